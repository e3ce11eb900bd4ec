"""The real command line in processes of its own, serial or under a real mpirun."""

import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

PATIENCE = 120.0  # [s] until a process that should end counts as hanging; kernels may have to be compiled
_LAUNCHERS = ("SLURM_", "PMI", "OMPI_", "MPI_")


def environment(**changes: str) -> dict[str, str]:
    """This environment without traces of a launcher, and with what Open MPI wants in a container."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(_LAUNCHERS)}
    return {
        **kept,
        "OMPI_ALLOW_RUN_AS_ROOT": "1",
        "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
        "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        **changes,
    }


def mpirun(ranks: int) -> list[str]:
    """The launcher for some ranks."""
    if importlib.util.find_spec("mpi4py") is None:
        pytest.skip("mpi4py is not installed")
    found = shutil.which("mpirun", path=str(Path(sys.executable).parent)) or shutil.which("mpirun")
    if found is None:
        pytest.skip("no mpirun beside the Python interpreter nor on the path")
    return [found, "-n", str(ranks)]


def call(*arguments, cwd: Path, ranks: int = 0, **changes: str) -> subprocess.CompletedProcess:
    """Run `cvt-hpc` to its end; ranks 0: without a launcher."""
    process = subprocess.Popen(
        [*(mpirun(ranks) if ranks else []), sys.executable, "-m", "cvt_hpc", *map(str, arguments)],
        cwd=cwd,
        env=environment(**changes),
        text=True,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        start_new_session=True,
    )
    try:
        out, err = process.communicate(timeout=PATIENCE)
    except subprocess.TimeoutExpired:
        _kill(process)
        pytest.fail(f"{arguments} hangs; its stderr: {process.communicate()[1]}")
    return subprocess.CompletedProcess(process.args, process.returncode, out, err)


def _kill(process: subprocess.Popen) -> None:
    """Kill -9 a launcher and all that it has started, wherever it has put them."""
    root = psutil.Process(process.pid)
    family = [*root.children(recursive=True), root]
    for member in family:
        try:
            member.kill()
        except psutil.NoSuchProcess:
            continue
    psutil.wait_procs(family, timeout=PATIENCE)
