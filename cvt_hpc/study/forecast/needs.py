"""What a sweep needs of memory and disk, and which one is refused before it begins."""

from __future__ import annotations

import os
import shutil
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from cvt_hpc.errors import mismatch
from cvt_hpc.study.description import record_layout, record_type, runs_along
from cvt_hpc.study.record.frames import HEAD, PLACE
from cvt_hpc.study.simulator import Simulator

if TYPE_CHECKING:
    from cvt_hpc.job import Job

# [byte] of rank 0 for each run, for the plan and the index of the records: 207 were measured with 10^6 runs
# on one rank, and about as much again is assumed for sending the plan.
MEMORY_PER_RUN = 400


class Needs(NamedTuple):
    """What a sweep needs: memory of rank 0 [byte], and disk for the records of all runs [byte]."""

    memory: int
    disk: int


def needs(job: Job, simulator: Simulator) -> Needs:
    """Return what a sweep of all runs of a job needs, without marks, dataset and histories."""
    record = HEAD.size + PLACE.size + record_type(*record_layout(job, simulator)).itemsize
    size = runs_along(job, [axis.name for axis in job.axes])
    return Needs(MEMORY_PER_RUN * size, record * size)


def refuse_too_large(job: Job, simulator: Simulator, out: Path) -> Needs:
    """Return what a sweep of all runs of a job needs.

    Parameters
    ----------
    job : Job
        A validated job.
    simulator : Simulator
        What does the runs.
    out : Path
        The output folder; what it holds need not be written any more.

    Raises
    ------
    InputError
        If this machine has less memory, or less disk is free. Of a trace it is not known how many cells it
        runs, and disk is no reason.
    """
    needed, size = needs(job, simulator), runs_along(job, [axis.name for axis in job.axes])
    where = f"{job.source}: {size} runs"
    memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    if needed.memory > memory:
        found = f"{in_gigabytes(memory)} in this machine"
        raise mismatch(where, f"{in_gigabytes(needed.memory)} of memory for their plan", found)
    if "first_spacing" not in job.design:
        free = _free(out) + _held(out)
        if needed.disk > free:
            expected = f"{in_gigabytes(needed.disk)} on the disk for their records"
            raise mismatch(where, expected, f"{in_gigabytes(free)} at {out}")
    return needed


def in_gigabytes(size: float) -> str:
    """Return a size [byte] in words."""
    return f"{size / 1e9:.3g} GB"


def _free(out: Path) -> int:
    """Return the space [byte] on the disk where a folder is, or will be made."""
    try:
        return shutil.disk_usage(next(p for p in (out, *out.absolute().parents) if p.is_dir())).free
    except OSError:  # the start itself says so, in its own words
        return 1 << 62


def _held(out: Path) -> int:
    """Return the size [byte] of the records in an output folder."""
    try:
        return sum(path.stat().st_size for path in (out / "records").iterdir())
    except OSError:
        return 0
