"""Progress of a study, read from its folder alone; works while a sweep is running and after.

A `RunReport` says how a sweep ended, for people and for the exit status.
"""

import time
from contextlib import suppress
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from cvt_hpc.errors import InputError
from cvt_hpc.job import Job, rebuild_job
from cvt_hpc.job.values import Point
from cvt_hpc.study.description import Study
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.planning import needed_runs
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.simulator import default_simulator
from cvt_hpc.variables import Status, Vibrates

# exit statuses; 2 is bad input, raised as InputError
DONE, SOME_FAILED, STALLED, STOPPED = 0, 1, 98, 99


@dataclass(frozen=True)
class StudyStatus:
    """Progress of a study.

    Attributes
    ----------
    name : str
        Of the job.
    total, done, failed, left : int
        Number of runs: all that are needed, with results, ended without results, not yet recorded. While runs
        of a trace are left, it may require more.
    running : bool
        Whether a sweep is at work in the folder now.
    rate : float or None
        Runs recorded per second [1/s] in the latest session; None before its first record.
    time_to_go : float or None
        Time [s] that the runs left take at the pace of that session, by their predicted costs; None before
        its first record.
    warnings : tuple of str
        One line for each record file that is not sound.
    unneeded : int
        Number of runs of the grid that a trace or an adaptive study does not need, as far as is known.
    undecided, slipping, irregular : int
        Number of runs with results that were too short to be decided, under more load than friction carries,
        and of irregular motion.
    finished : float or None
        When the last run was recorded [s since 1970], if none is left and no sweep is at work.
    time_at_work : float
        For how long [s] sweeps have been at work, each until its last record.
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
    unneeded: int = 0
    undecided: int = 0
    slipping: int = 0
    irregular: int = 0
    finished: float | None = None
    time_at_work: float = 0.0


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
    running = folder.is_in_use()
    return status_of(folder, folder.read_records(study), running)


def status_of(folder: StudyFolder, records: Records, running: bool) -> StudyStatus:
    """Return how far a study is by its records; `running`: a sweep was at work before they were read."""
    study = records.study
    recorded = int(records.recorded.sum())
    done = int((records.status == Status.DONE).sum())
    needed = needed_runs(study, records)
    left = needed & ~records.recorded
    latest, elapsed = _latest_session(records, running)
    costs = _predicted_costs(study, folder)
    spent = costs[latest].sum()
    return StudyStatus(
        name=study.name,
        total=int(needed.sum()),
        done=done,
        failed=recorded - done,
        left=int(left.sum()),
        running=running,
        rate=latest.sum() / elapsed if elapsed else None,
        time_to_go=float(costs[left].sum() * elapsed / spent) if elapsed else None,
        warnings=tuple(records.warnings),
        unneeded=int((~needed).sum()),
        **_count_special(records),
        finished=None if left.any() or running else float(np.nanmax(records.written)),
        time_at_work=_time_at_work(records),
    )


def expected_cost(job: Job, out: Path) -> tuple[float, int]:
    """Return the core-seconds of a run, mean over the job, and the number of records used for it.

    Records of this job in the output folder give the speed of the machine.
    """
    from cvt_hpc.simulation import estimate_cost

    factor, runs = _machine_factor(out, job)
    return factor * estimate_cost(job), runs


def _machine_factor(out: Path, job: Job) -> tuple[float, int]:
    """Return processor time over predicted cost of recorded runs of a job, and their number; or 1 by none."""
    records = find_records(out, job)
    if records is None or "core_seconds" not in records.study.record_names:
        return 1.0, 0
    done = np.flatnonzero(records.status == Status.DONE)
    done = done[records.read(done, "vibrates") != Vibrates.SLIPS]  # they end early
    if not done.size:
        return 1.0, 0
    predicted = default_simulator().run_costs(job)[done].sum()
    return float(records.read(done, "core_seconds").sum() / predicted), done.size


def find_records(out: Path, job: Job) -> Records | None:
    """Return the records in an output folder, None unless it is that of this job."""
    folder = StudyFolder(out)
    try:
        study = folder.load()
    except InputError:
        return None
    return folder.read_records(study) if study.fingerprint == job.fingerprint() else None


def _latest_session(records: Records, running: bool) -> tuple[np.ndarray, float]:
    """Return which runs the latest start has recorded, and in what time [s]: until now or its last."""
    if not records.sessions:
        return np.zeros(records.study.size, bool), 0.0
    started = records.sessions[-1]["started"]
    chosen = records.written >= started  # NaN, of a run without a record, is not
    if not chosen.any():
        return chosen, 0.0
    return chosen, max((time.time() if running else np.nanmax(records.written)) - started, 0.0)


def _time_at_work(records: Records) -> float:
    """Return for how long [s] sweeps have been at work, each until its last record before the next start."""
    starts = [session["started"] for session in records.sessions]
    worked = 0.0
    for first, following in pairwise([*starts, np.inf]):
        written = records.written[(records.written >= first) & (records.written < following)]
        worked += written.max() - first if written.size else 0.0
    return float(worked)


def _predicted_costs(study: Study, folder: StudyFolder) -> np.ndarray:
    """Return the predicted duration of each run, in some unit; all alike where there is no such model."""
    with suppress(InputError):  # of another version
        job = rebuild_job(study.job, str(folder.job_file), {})
        if job.shape == study.shape:
            return default_simulator().run_costs(job)
    return np.ones(study.size)


@dataclass(frozen=True)
class FailedRun:
    """A run that ended without results.

    Attributes
    ----------
    index : int
        Its place in the grid, in C order, or among the samples.
    at : dict
        Values of the axes there, by name [SI].
    place : str
        The same for people, in the units of the job.
    status : str
        How it failed, e.g. "failed_numerics".
    reason : str
        Why.
    """

    index: int
    at: Point
    place: str
    status: str
    reason: str


@dataclass(frozen=True)
class RunReport:
    """Report of how a sweep, or a part of one, ended; the same on all ranks.

    Attributes
    ----------
    out : Path
        The output folder.
    results : Path or None
        The dataset in it; None where another part is at work, and will gather it.
    total, done, remaining : int
        Number of runs, of the part where one was requested: all, with results, not yet run. While runs of a
        trace remain, it may require more.
    failed : tuple of FailedRun
        The runs that ended without results.
    stopped : str or None
        Why the sweep ended early: the name of a signal, or "time limit". A signal may come when all runs are
        done: then what was to follow must not begin.
    gained : int
        Number of runs recorded since this start.
    unneeded : int
        Number of runs of the grid that a trace or an adaptive study does not need.
    undecided, slipping, irregular : int
        Number of runs with results that were too short to be decided, under more load than friction carries,
        and of irregular motion.
    """

    out: Path
    results: Path | None
    total: int
    done: int
    failed: tuple[FailedRun, ...]
    remaining: int
    stopped: str | None
    gained: int
    unneeded: int = 0
    undecided: int = 0
    slipping: int = 0
    irregular: int = 0

    @property
    def exit_status(self) -> int:
        """Return 0 if all runs are done, 1 if some failed, 99 if some remain: the same command continues.

        98 if some remain and none has ended since the start: the same command may get no further.
        """
        if self.remaining:
            return STOPPED if self.gained else STALLED
        return SOME_FAILED if self.failed else DONE

    @property
    def status_of_more(self) -> int | None:
        """Return the exit status if what was to follow must not begin, None if it may."""
        if self.remaining:
            return self.exit_status
        return STOPPED if self.stopped else None


def build_report(
    folder: StudyFolder, records: Records, asked: np.ndarray, gathered: bool, gained: int, stopped: str | None
) -> RunReport:
    """Return the report of a sweep of the runs marked in `asked`, shape (runs,)."""
    study, status, recorded = records.study, records.status, asked & records.recorded
    without_results = np.flatnonzero(recorded & (status != Status.DONE)).tolist()
    reasons = records.read(np.array(without_results, int), "reason")
    failed = []
    for index, reason in zip(without_results, reasons, strict=True):
        told = Status(status[index]).name.lower(), reason.decode(errors="replace")
        failed.append(FailedRun(index, study.place(index), study.place_in_words(index), *told))
    return RunReport(
        out=folder.path,
        results=folder.results if gathered else None,
        total=int(asked.sum()),
        done=int((recorded & (status == Status.DONE)).sum()),
        failed=tuple(failed),
        remaining=int((asked & ~records.recorded).sum()),
        stopped=stopped,
        gained=gained,
        unneeded=int((~asked).sum()) if study.in_rounds else 0,
        **_count_special(records, asked),
    )


def _count_special(records: Records, asked: np.ndarray | None = None) -> dict[str, int]:
    """Return how many runs with results are no plain yes or no, among those marked in `asked`, or all."""
    is_done = records.status == Status.DONE
    done = np.flatnonzero(is_done if asked is None else is_done & asked)
    verdicts = records.read(done, "vibrates")
    kinds = (Vibrates.UNDECIDED, Vibrates.SLIPS, Vibrates.IRREGULAR)
    counts = (int((verdicts == verdict).sum()) for verdict in kinds)
    return dict(zip(("undecided", "slipping", "irregular"), counts, strict=True))
