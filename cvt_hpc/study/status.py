"""How far a study is, read from its folder alone; works while a sweep is running and after."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.lock import is_locked
from cvt_hpc.study.records import Records
from cvt_hpc.study.recovery import read_records
from cvt_hpc.variables import Status


@dataclass(frozen=True)
class StudyStatus:
    """How far a study is.

    Attributes
    ----------
    name : str
        Of the job.
    total, done, failed, left : int
        Number of runs: all, with results, ended without results, not yet recorded.
    running : bool
        Whether a sweep is at work in the folder now.
    rate : float or None
        Runs recorded per second [1/s] in the latest session; None before its first record.
    time_to_go : float or None
        Time [s] that the runs left take at this rate; None where there is no rate.
    warnings : tuple of str
        One line for each record file that is not sound.
    """

    name: str
    total: int
    done: int
    failed: int
    left: int
    running: bool
    rate: float | None
    time_to_go: float | None
    warnings: tuple[str, ...]


def read_status(out: str | Path) -> StudyStatus:
    """Return how far the study in an output folder is.

    Parameters
    ----------
    out : str or Path
        The output folder of a run.

    Raises
    ------
    InputError
        If the folder is not that of a run.
    """
    folder = StudyFolder(out)
    study = folder.load()
    running = is_locked(folder.lock_file)
    records = read_records(folder.records, study)
    recorded = int(records.recorded.sum())
    done = int((records.status == Status.DONE).sum())
    left = study.size - recorded
    rate = _session_rate(records, running)
    return StudyStatus(
        name=study.name,
        total=study.size,
        done=done,
        failed=recorded - done,
        left=left,
        running=running,
        rate=rate,
        time_to_go=left / rate if rate else None,
        warnings=tuple(records.warnings),
    )


def _session_rate(records: Records, running: bool) -> float | None:
    """Return the runs per second [1/s] since the latest start, until now or until the last record."""
    if not records.sessions:
        return None
    started = records.sessions[-1]["started"]
    count = int(np.sum(records.written >= started))  # NaN, of a run without a record, is not
    elapsed = (time.time() if running else np.nanmax(records.written)) - started
    return count / elapsed if count and elapsed > 0 else None
