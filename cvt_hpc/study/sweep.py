"""All runs of a job, on all ranks: plan, resume, compute, record, gather."""

from __future__ import annotations

import logging
import time
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cvt_hpc.files import StorageError, discard
from cvt_hpc.study.batches import Batch
from cvt_hpc.study.description import Study, describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.gather import write_results
from cvt_hpc.study.launch import Team, assembled_team
from cvt_hpc.study.lock import locked
from cvt_hpc.study.progress import Progress
from cvt_hpc.study.provenance import new_session
from cvt_hpc.study.record import RecordFormat, RecordLog
from cvt_hpc.study.records import Records
from cvt_hpc.study.recovery import read_records
from cvt_hpc.study.report import RunReport, build_report
from cvt_hpc.study.schedule import Counter, claimed_batches, open_counter
from cvt_hpc.study.simulator import Simulator, default_simulator
from cvt_hpc.study.stopping import ELSEWHERE, SignalWatch, Stop
from cvt_hpc.study.task import Task
from cvt_hpc.variables import Status

if TYPE_CHECKING:
    from cvt_hpc.job import Job

_logger = logging.getLogger(__name__)


class _Plan(NamedTuple):
    """What rank 0 finds out and all ranks need."""

    batches: list[Batch]
    recorded: int
    failed: int
    session: dict[str, Any]


def run(
    job: Job,
    out: str | Path | None = None,
    *,
    fresh: bool = False,
    simulator: Simulator | None = None,
    progress: bool = True,
    time_limit: float | None = None,
) -> RunReport:
    """Do all runs of a job that are not yet recorded, and gather the dataset.

    Serial, or on all ranks when started under mpirun or srun. A run that raises is recorded as failed, and
    the sweep goes on. SIGINT, SIGTERM and SIGUSR1 end the sweep early and orderly: the runs at work are
    broken off, and the same call does them later.

    Parameters
    ----------
    job : Job
        What to run.
    out : str or Path, optional
        Output folder; "out/<job name>" by default.
    fresh : bool
        Throw away what earlier runs have left in the folder, instead of going on from there.
    simulator : Simulator, optional
        What does the runs; `cvt_hpc.simulation` by default.
    progress : bool
        Whether rank 0 shows on stderr how far the sweep is.
    time_limit : float, optional
        Time [s] after which no more runs are started.

    Returns
    -------
    RunReport
        How the sweep ended.

    Raises
    ------
    InputError
        If the folder holds another job, is in use or cannot be written to, or if ranks are not connected.
    """
    deadline = float("inf") if time_limit is None else time.monotonic() + time_limit
    simulator = simulator or default_simulator()
    study = describe(job, simulator)
    task = Task(job, study, simulator)
    folder = StudyFolder(out if out is not None else Path("out") / job.name)
    with SignalWatch() as signals, assembled_team(folder.crash_log) as team, ExitStack() as held:
        plan = team.on_root(lambda: _prepare(folder, task, fresh, team.size, held))
        with open_counter(team) as counter:
            display = Progress(counter, study.size, plan.recorded, plan.failed, progress and team.rank == 0)
            stop = Stop(counter, signals, deadline, display.show)
            trouble = _compute(task, folder, plan, team.rank, counter, stop)
            team.wait_for_all(stop.interrupt)
            display.close()
        stopped = _settle(team, trouble, stop.reason)
        return team.on_root(lambda: _conclude(folder, study, stopped))


def _prepare(folder: StudyFolder, task: Task, fresh: bool, ranks: int, held: ExitStack) -> _Plan:
    """Take the folder into possession and find what is left to do; on rank 0 alone."""
    study = task.study
    folder.check_free_for(study, fresh)
    folder.create()
    held.enter_context(locked(folder.lock_file))
    folder.check_free_for(study, fresh)  # again: another process may have been there before the lock
    for leftover in folder.leftovers():
        discard(leftover)
    if fresh:
        folder.clear()
    folder.save(study)
    records = read_records(folder.records, study)
    session = new_session(ranks)
    for warning in records.warnings + _other_versions(records, session):
        _logger.warning(warning)
    recorded = records.recorded
    done = int((records.status == Status.DONE).sum())
    batches = task.plan(np.flatnonzero(~recorded), ranks)
    return _Plan(batches, int(recorded.sum()), int(recorded.sum()) - done, session)


def _other_versions(records: Records, session: dict[str, Any]) -> list[str]:
    """Return a warning if the records were made by other code than that which is going on now."""
    keys = ("versions", "git_revision")
    if all(earlier[key] == session[key] for earlier in records.sessions for key in keys):
        return []
    return [
        "earlier runs of this folder were made with other versions than these (results.nc names them in its "
        "attributes `versions` and `git_revision`); --fresh repeats them"
    ]


def _compute(
    task: Task, folder: StudyFolder, plan: _Plan, rank: int, counter: Counter, stop: Stop
) -> str | None:
    """Do and record the runs that this rank claims; return why it could not go on, if so."""
    layout = RecordFormat(task.study.fingerprint, task.study.record_dtype)
    try:
        with RecordLog(folder.records, layout, plan.session, rank) as log:
            for batch in claimed_batches(plan.batches, counter, stop.may_claim):
                for records in task.do(batch, stop.interrupt):
                    log.append(records)
                    failed = sum(bool(row["status"] != Status.DONE) for _, row in records)
                    counter.report(len(records), failed)
    except StorageError as error:
        stop.tell_all()
        return str(error)
    return None


def _settle(team: Team, trouble: str | None, reason: str | None) -> str | None:
    """Agree on why the sweep stopped early, None if it did not.

    Raises
    ------
    StorageError
        On all ranks, if one of them could not store its results.
    """
    ends = team.collect((trouble, reason))
    for found, _ in ends:
        if found:
            raise StorageError(found)
    return next((why for _, why in ends if why and why != ELSEWHERE), None)


def _conclude(folder: StudyFolder, study: Study, stopped: str | None) -> RunReport:
    """Gather the dataset and report; on rank 0 alone."""
    records = read_records(folder.records, study)
    write_results(folder, study, records)
    return build_report(folder, study, records, stopped)
