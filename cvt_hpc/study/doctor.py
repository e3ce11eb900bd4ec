"""Whether this machine can do sweeps: packages, cores, memory, kernels' cache, disk, MPI and Slurm."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from subprocess import PIPE, STDOUT
from typing import NamedTuple

from cvt_hpc.storage.files import try_to_write
from cvt_hpc.storage.provenance import versions
from cvt_hpc.study.forecast.resources import size_in_words

LEAST_DISK = 1e9  # [byte]: records and results.nc of a million runs take about as much
PATIENCE = 60.0  # [s] for a program that is tried out
_RANKS = 2
# One rank answers for all: lines of two may come mixed
_COUNT_RANKS = (
    "from mpi4py import MPI; count = MPI.COMM_WORLD.allreduce(1); "
    "MPI.COMM_WORLD.rank or print(f'{count} {MPI.Get_library_version().split()[0]}')"
)


class Finding(NamedTuple):
    """One thing that was looked at."""

    fine: bool  # whether sweeps work with it
    what: str  # the object of the check
    found: str  # its finding
    advice: str = ""  # the next action, or the consequence; "" where there is none


def examine(folder: Path) -> Iterator[Finding]:
    """Yield the findings about this machine, with `folder` as the place where studies are to lie."""
    found = versions()
    yield Finding(True, "versions", ", ".join(f"{name} {version}" for name, version in found.items()))
    yield _cores()
    yield _cache()
    yield _disk(folder)
    yield _mpi("mpi4py" in found)
    yield _slurm()


def _cores() -> Finding:
    usable, present = len(os.sched_getaffinity(0)), os.cpu_count() or 1
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    found = f"{usable} of {present} cores may be used, {size_in_words(memory)} of memory"
    return Finding(True, "machine", found)


def _cache() -> Finding:
    from cvt_hpc.kernels.store import folder as cache_folder

    if (place := cache_folder()) is None:
        advice = "set NUMBA_CACHE_DIR to a folder of your own, or each start compiles again"
        return Finding(False, "machine code", "is not kept", advice)
    size = sum(path.stat().st_size for path in place.rglob("*") if path.is_file())
    advice = "" if size else "the first run of a model compiles for a minute or two"
    return Finding(True, "machine code", f"{size_in_words(size)} in {place}", advice)


def _disk(folder: Path) -> Finding:
    try:
        try_to_write(folder)
    except OSError as error:
        advice = "start in another folder, or give one by --out"
        return Finding(False, "disk", f"nothing can be written to {folder}: {error}", advice)
    free = shutil.disk_usage(folder).free
    advice = "" if free > LEAST_DISK else "`cvt-hpc check JOB` says what a study takes"
    return Finding(free > LEAST_DISK, "disk", f"{size_in_words(free)} free at {folder.absolute()}", advice)


def _mpi(installed: bool) -> Finding:
    """Start two ranks, and see whether they see each other."""
    serial = "without MPI `cvt-hpc run` uses one core"
    if not installed:
        return Finding(True, "MPI", "mpi4py is not installed", f'{serial}; pip install "cvt_hpc[mpich]"')
    beside = Path(sys.executable).with_name("mpirun")
    launcher = str(beside) if beside.exists() else shutil.which("mpirun")
    if launcher is None:
        return Finding(False, "MPI", "mpi4py without an mpirun", "add that of its MPI library to PATH")
    _, lines = _said([launcher, "-n", str(_RANKS), sys.executable, "-c", _COUNT_RANKS])
    if len(lines) == 1 and lines[0].startswith(f"{_RANKS} "):
        usable = len(os.sched_getaffinity(0))
        fills = f"mpirun -n {usable} fills this machine" if usable > 1 else ""
        return Finding(True, "MPI", f"{_RANKS} ranks by {launcher} ({lines[0].split()[1]})", fills)
    advice = f"`{launcher}` does not fit the MPI library of mpi4py; {serial}"
    found = f"{_RANKS} ranks did not find each other: {lines[-1:] or 'no answer'}"
    return Finding(False, "MPI", found, advice)


def _slurm() -> Finding:
    if shutil.which("sbatch") is None:
        advice = "needed on a cluster alone: `cvt-hpc examples slurm` copies batch files"
        return Finding(True, "Slurm", "none here", advice)
    status, lines = _said(["srun", "--mpi=list"])
    if status != 0:
        found = f"sbatch is there, but srun fails: {lines[-1] if lines else 'no answer'}"
        advice = "`sinfo` has to list partitions first: ask who runs the cluster, or log in to a node of it"
        return Finding(False, "Slurm", found, advice)
    return Finding(True, "Slurm", f"sbatch is there; srun knows {' '.join(lines) or 'no --mpi kind'}")


def _said(command: list[str]) -> tuple[int | None, list[str]]:
    """Exit status of a program and the lines that it prints, errors included; None where it does not end."""
    try:
        done = subprocess.run(command, stdout=PIPE, stderr=STDOUT, text=True, timeout=PATIENCE, check=False)
    except (OSError, subprocess.SubprocessError):
        return None, []
    return done.returncode, [line.strip() for line in done.stdout.splitlines() if line.strip()]
