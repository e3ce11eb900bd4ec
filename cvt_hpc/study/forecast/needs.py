"""Memory and disk that a sweep needs, and the refusal of sweeps that need too much."""

import math
import os
import shutil
from pathlib import Path
from typing import NamedTuple

from cvt_hpc.errors import mismatch
from cvt_hpc.job import Job
from cvt_hpc.study.description import record_layout, record_type
from cvt_hpc.study.record.log import HEAD, PLACE
from cvt_hpc.study.simulator import Simulator

# [byte] of rank 0 for each run, for the plan and the index of the records: 207 were measured with 10^6 runs
# on one rank, and about as much again is assumed for sending the plan.
MEMORY_PER_RUN = 400
# [byte] of results.nc for each quantity and coordinate, beside its values: 4700 at most were measured
NAMES_AND_CHUNKS = 5000
_PREFIXES = ((1e12, "T"), (1e9, "G"), (1e6, "M"), (1e3, "k"))


class Disk(NamedTuple):
    """Space on the disk [byte], of `results` at most; `histories` NaN where it is not known."""

    records: float
    results: float
    histories: float


class Needs(NamedTuple):
    """Needs of a sweep.

    Attributes
    ----------
    memory : int
        Of rank 0, for the plan [byte].
    disk : Disk
        Space on the disk.
    profiles : int
        Memory of a rank, and disk at most, for a kept history's values along the belt at each sample [byte].
    """

    memory: int
    disk: Disk
    profiles: int = 0


def needs(job: Job, simulator: Simulator) -> Needs:
    """Return the needs of a sweep of all runs of a job, without the marks of its batches."""
    variables, coordinates = record_layout(job, simulator)
    record = record_type(variables, coordinates).itemsize
    size = job.size
    named = len(variables) + len(coordinates) + len(job.axes) + len(job.rules)
    disk = Disk((HEAD.size + PLACE.size + record) * size, most_of_results(size * record, named), math.nan)
    disk = disk if job.histories else disk._replace(histories=0.0)
    return Needs(MEMORY_PER_RUN * size, disk, simulator.profile_bytes(job))


def most_of_results(values: int, named: int) -> int:
    """Return the most that results.nc takes [byte], by its values [byte] and number of quantities."""
    return values + NAMES_AND_CHUNKS * named


def refuse_too_large(job: Job, simulator: Simulator, out: Path) -> Needs:
    """Return the needs of a sweep of all runs of a job.

    Parameters
    ----------
    job : Job
        A validated job.
    simulator : Simulator
        Does the runs.
    out : Path
        The output folder; its present content need not be written any more.

    Raises
    ------
    InputError
        If this machine has less memory, or less disk is free. Of a trace it is not known how many cells it
        runs, and disk is no reason.
    """
    needed, where = needs(job, simulator), f"{job.source}: {job.size} runs"
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed.memory > memory:
        found = f"{size_in_words(memory)} in this machine"
        raise mismatch(where, f"{size_in_words(needed.memory)} of memory for their plan", found)
    if needed.profiles > memory:
        found = f"{size_in_words(memory)} in this machine"
        raise mismatch(where, f"{size_in_words(needed.profiles)} of memory for profiles over time", found)
    if "first_spacing" not in job.design:
        free = _free(out) + _held(out)
        profiles = needed.profiles * len(job.histories)
        if (disk := needed.disk.records + needed.disk.results + profiles) > free:
            expected = f"{size_in_words(disk)} on the disk for their records and results.nc"
            expected += ", and for profiles over time" if profiles else ""
            raise mismatch(where, expected, f"{size_in_words(free)} at {out}")
    return needed


def size_in_words(size: float) -> str:
    """Return a size [byte] in words, to three digits."""
    factor, prefix = next((pair for pair in _PREFIXES if size >= 0.9995 * pair[0]), _PREFIXES[-1])
    return f"{size / factor:.3g} {prefix}B"


def _free(out: Path) -> int:
    """Return the space [byte] on the disk where a folder is, or will be made."""
    try:
        return shutil.disk_usage(next(p for p in (out, *out.absolute().parents) if p.is_dir())).free
    except OSError:  # the start itself names it, in its own words
        return 1 << 62


def _held(out: Path) -> int:
    """Return the size [byte] of the records in an output folder."""
    try:
        return sum(path.stat().st_size for path in (out / "records").iterdir())
    except OSError:
        return 0
