"""All runs of a job, on all ranks: compute the plan, record, gather.

All ranks compute, and each claims its next batch from one counter.
"""

import logging
import math
import os
import threading
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from cvt_hpc.errors import mismatch
from cvt_hpc.job import Job
from cvt_hpc.job.values import Document
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.storage.files import StorageError, naming_refusals, open_missing_streams, probed
from cvt_hpc.storage.locks import BusyError
from cvt_hpc.storage.provenance import program_identity
from cvt_hpc.study.batches import Assignment, Batch
from cvt_hpc.study.description import Study, describe
from cvt_hpc.study.folder import Part, StudyFolder, leave_out_missing, read_part
from cvt_hpc.study.forecast.cost_model import CostModel
from cvt_hpc.study.forecast.resources import refuse_too_large
from cvt_hpc.study.gather import LossError, gather_records
from cvt_hpc.study.planning import Plan, asked_runs, next_round, prepare
from cvt_hpc.study.ranks import stopping
from cvt_hpc.study.ranks.launch import RankDied, Ranks, Team, assembled_team, end_all, noticing_deaths
from cvt_hpc.study.ranks.progress import Counter, Progress
from cvt_hpc.study.record.log import RecordFormat, RecordLog
from cvt_hpc.study.simulator import Simulator, default_simulator
from cvt_hpc.study.status import STOPPED, RunReport, build_report
from cvt_hpc.study.task import Task, check_refinement
from cvt_hpc.variables import Status

_logger = logging.getLogger(__name__)


def run(
    job: Job,
    out: str | Path | None = None,
    *,
    part: str | None = None,
    fresh: bool = False,
    simulator: Simulator | None = None,
    progress: bool = True,
    time_limit: float | None = None,
    run_limit: float = math.inf,
    retry: Collection[Status] = (),
    refine: float | None = None,
    chosen: Callable[[], np.ndarray] | None = None,
    asked_steps: Callable[[], Mapping[int, float]] | None = None,
    comm: Ranks = "all",
    raises: bool = True,
) -> RunReport:
    """Do all runs of a job that are not yet recorded, and gather the dataset.

    Serial, or on all ranks when started under mpirun or srun. A run that raises is recorded as failed, and
    the sweep continues; so do the other ranks when one dies, where MPI lets them. SIGINT, SIGHUP, SIGTERM,
    SIGUSR1, SIGUSR2 and SIGXCPU end the sweep early and orderly: the runs at work are broken off, the dataset
    is gathered, the signal's exception is raised on all ranks, and the same call does these runs later.

    Only the main thread can call it, since signals reach no other one. Meanwhile other threads can read
    datasets that `open_results` has opened, and values of those that xarray has opened before.

    Parameters
    ----------
    job : Job
        The job to run.
    out : str or Path, optional
        Output folder; "out/<job name>" by default.
    part : str, optional
        Only the runs of one part of the study: "3/16" for the third of sixteen. Different parts may be at
        work in a folder at the same time; the part that ends last gathers the dataset.
    fresh : bool
        Remove the results of earlier runs in the folder instead of continuing from them.
    simulator : Simulator, optional
        Does the runs; `cvt_hpc.simulation` by default.
    progress : bool
        Whether rank 0 shows on stderr how far the sweep is.
    time_limit : float, optional
        Time [s] in which the sweep is to end; some of it is reserved for gathering the dataset. Within a
        Slurm job, that until its end by default. Runs that are not expected to end in time are not started.
        That of rank 0 counts: ranks that read their clocks have different ones.
    run_limit : float, optional
        Time [s] that a run may take; runs that take longer are recorded as timed out.
    retry : collection of Status, optional
        Recorded runs that ended so are done again, from the beginning; their earlier records do not count any
        more.
    refine : float, optional
        Factor by which the time step of runs that are done again for failed numerics is shortened, against
        that of the job; a run that fails there is refined by itself from there on. By default the first
        factor that these runs have not tried (`untried_factor`); 1: the step of the job again. Kept on
        record: a retry that was stopped continues with it.
    chosen : callable, optional
        Returns on rank 0 the requested runs, shape (runs,), always the same ones; by default those of the
        job's design.
    asked_steps : callable, optional
        Returns on rank 0 the time step [s] of runs that do not take the job's step, by run index, always
        the same one of a run.
    comm : MPI.Intracomm, "all" or None
        The ranks that compute together, and that all have to call this with the same arguments: those of a
        communicator, all that were started together, or this process alone, whatever others do. Ranks of a
        pool, or rank 0 alone, take None, or COMM_SELF.
    raises : bool
        Whether signals are raised again once the sweep has been stopped; if not, the report tells.

    Returns
    -------
    RunReport
        How the sweep ended, or its part.

    Raises
    ------
    InputError
        If the folder holds another job, is in use or cannot be written to, if ranks are not connected, or if
        there is no such part, or it is to start over: the other parts would lose their runs; or if steps
        cannot be shortened so; or if memory, disk or time do not suffice for so many runs. On all ranks if
        one of them has an error, or another job, other options or another version than rank 0; in a thread;
        or if not all ranks call this within CVT_HPC_RANK_WAIT, an environment variable (5 min by default).
    KeyboardInterrupt
        After SIGINT.
    SystemExit
        With the exit status 99, or 98 if no run has ended, after other signals.
    """
    open_missing_streams()
    if (thread := threading.current_thread()) is not threading.main_thread():
        found, then = f"the thread {thread.name}", "start a process for each sweep"
        raise mismatch("run", "the main thread of the process", found, then)
    started = time.monotonic()
    simulator = simulator or default_simulator()
    folder = _folder(job, out)
    options: Document = {"out": str(folder.path), "part": part, "fresh": fresh, "run_limit": run_limit}
    options |= {"retry": [int(status) for status in retry], "refine": refine}

    first = True

    def accept() -> tuple[Study, Part | None]:
        if refine is not None:
            check_refinement(job, refine, retry)
        return _accept(job, part, fresh, simulator)

    def plan_of(accepted: tuple[Study, Part | None]) -> Document:
        study, _ = accepted
        layout = str(study.record_dtype)
        return {"job": study.job, "records": layout, "options": options, "program": program_identity()}

    def sweep(team: Team) -> tuple[RunReport, str | None]:
        nonlocal first
        begins, first = first, False  # the survivors of a death continue from the records

        def find_plan() -> Plan:
            again = retry if begins else ()
            if begins and chosen is None:
                refuse_too_large(job, simulator, folder.path)
            asked = None if time_limit is None else time_limit - (time.monotonic() - started)
            limit, began = stopping.find_time_limit(asked, study.size), time.monotonic()
            with stopping.planning_within(limit.seconds, study.size):
                plan = prepare(folder, task, share, fresh and begins, again, team.size, held, refine)
            return plan._replace(limit=limit._replace(seconds=limit.seconds - (time.monotonic() - began)))

        with ExitStack() as held:
            plan = team.on_root(find_plan)
            if begins and team.size > 1:
                _refuse_other_folders(team, folder)
            with open_counter(team) as counter:
                visible, costs = progress and team.rank == 0, plan.costs[plan.order]
                display = Progress(counter, plan.total, plan.recorded, plan.failed, visible, costs)
                stop = stopping.Stop(counter, signals, plan.limit, display.show)
                stopped = None
                with closing(display):
                    while plan.assignments:
                        trouble = _compute(task, folder, plan, team.rank, counter, stop)
                        team.wait_for_all(stop.look)
                        stopped = _settle(team, trouble, stop.reason)
                        if stopped or not study.in_rounds:
                            break
                        more = partial(next_round, folder, task, plan, team.size, counter, display)
                        plan = team.on_root(more)
            report = team.on_root(lambda: _conclude(folder, task, share, plan, stopped, held, signals))
        noted = next(filter(None, team.collect(signals.noted)), None)
        return replace(report, stopped=report.stopped or noted), noted

    with assembled_team(folder.crash_log, comm) as team:
        study, share = team.agreed(accept, plan_of)
        task = Task(job, study, simulator, run_limit, chosen, asked_steps)
        with stopping.SignalWatch() as signals:
            report, noted = stopping.outlive(team, sweep)
    status = report.status_of_more or STOPPED
    if signals.noted and noted is None:  # too late for the other ranks to learn of it: they would go on
        if team.size > 1:
            end_all(status, f"stopped by {signals.noted}")
        report = replace(report, stopped=signals.noted)
    if raises and (name := noted or signals.noted):
        stopping.raise_again(name, status)
    return report


def check_start(
    job: Job, out: str | Path | None = None, *, part: str | None = None, fresh: bool = False
) -> None:
    """Raise the InputError that `run` would raise before it computes anything; touches nothing."""
    folder = _folder(job, out)
    study, _ = _accept(job, part, fresh, default_simulator())
    refuse_too_large(job, default_simulator(), folder.path)
    folder.check_free_for(study, fresh)


def _folder(job: Job, out: str | Path | None) -> StudyFolder:
    return StudyFolder(out if out is not None else Path("out") / job.name)


def _accept(job: Job, part: str | None, fresh: bool, simulator: Simulator) -> tuple[Study, Part | None]:
    """Return the runs to be done, if all settings agree."""
    share = None if part is None else read_part(part)
    if share is not None and fresh:
        raise mismatch("fresh", "a run of the whole study", f"part {share}, and the others would lose theirs")
    study = describe(job, simulator)
    if share is not None and study.in_rounds:
        raise mismatch("part", "a whole study, since it chooses by the runs of all parts", f"part {share}")
    return study, share


def _refuse_other_folders(team: Team, folder: StudyFolder) -> None:
    """Raise InputError on all ranks if one sees another folder than rank 0, which would miss its records."""
    with ExitStack() as kept, noticing_deaths():

        def leave_file() -> Path:
            with naming_refusals(folder.records, "a folder that can be written to"):
                return kept.enter_context(probed(folder.records))

        def find(file: Path) -> None:
            if not os.path.exists(file):
                then = "give all ranks one that all of them see, by --out"
                raise mismatch(str(folder.path), "the folder that rank 0 writes to", "another one", then)

        file = team.on_root(leave_file)
        team.agreed(lambda: find(file), lambda _: {})


def _compute(
    task: Task, folder: StudyFolder, plan: Plan, rank: int, counter: Counter, stop: stopping.Stop
) -> str | None:
    """Do and record the runs that this rank claims; return the reason if it could not continue."""
    layout = RecordFormat(task.study.fingerprint, task.study.record_dtype)
    model = CostModel(plan.costs, plan.fit, task.turns)
    task = replace(task, steps=plan.steps)
    try:
        # Every core has a rank of its own: threads of linear algebra would only wait for each other.
        log = RecordLog(folder.records, layout, plan.session, rank, plan.attempts)
        with one_thread(), log:
            fits = lambda batch: stop.fits(model.upper(batch))  # noqa: E731
            claims = Claims(plan.assignments, counter, stop.may_claim, fits)
            counted = 0  # runs at work that are reported already: they have done their first transients

            def join(runs: Batch, seconds: float) -> Batch:
                nonlocal counted

                def may_join(others: Batch) -> bool:
                    # beyond a limit of time a batch leaves nothing: none grows before a time is measured
                    needed, left = model.upper((*runs, *others)), stop.seconds_left
                    fits = left == math.inf or 0.0 < needed < seconds + left
                    return fits and task.simulator.may_join(task.job, runs, others)

                try:
                    counter.report(len(runs) - counted, 0)
                    counted = len(runs)
                    return () if stop.interrupt() is not None else claims.joining(may_join)
                except RankDied:  # the batch at work goes on; the next claim tells
                    return ()

            for runs, alone, joins in claims:
                begin = partial(log.begin, alone=alone)
                for result in task.do(runs, stop.interrupt, begin, join if joins else None):
                    folder.keep_histories(result.histories)
                    log.append(result.records)
                    counter.report(len(result.records) - counted, result.failed)
                    counted = 0
                    if result.failed < len(result.records):  # failed ones all ended before their time
                        model.learn(result.batch, result.seconds)
                if counted:  # they have been broken off
                    counter.report(-counted, 0)
                    counted = 0
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
    return next((why for _, why in ends if why and why != stopping.ELSEWHERE), None)


def _conclude(
    folder: StudyFolder,
    task: Task,
    part: Part | None,
    plan: Plan,
    stopped: str | None,
    held: ExitStack,
    signals: stopping.SignalWatch,
) -> RunReport:
    """Gather the dataset, unless other parts are at work, and report; on rank 0 alone."""
    if part is not None:
        held.close()  # before the look around: of parts that end together the last one sees nobody
    gathers = part is None or not folder.is_in_use()
    records = None
    if gathers:
        try:
            records = gather_records(folder, task.study, lambda: signals.noted)
        except BusyError as error:
            if not signals.noted:
                raise
            stopped = stopped or signals.noted
            _logger.warning("%s; not gathered", error)
        except LossError as error:
            records = folder.read_records(task.study)
            if records.recorded.all():
                raise
            _logger.warning("%s", error)  # runs that were damaged are yet to be done again
    gathers = records is not None
    if records is None:
        records = folder.read_records(task.study)
    leave_out_missing(task.job, folder, records)
    asked = asked_runs(task, records, part)
    gained = int(records.recorded[asked].sum()) - plan.recorded
    return build_report(folder, records, asked, gathers, gained, stopped)


def open_counter(team: Team) -> Counter:
    """Return the counter of a team, at zero."""
    if team.communicator is None:
        return Counter()
    from cvt_hpc.study.ranks.shared_counter import SharedCounter

    return SharedCounter(team.communicator)


@dataclass
class Claims:
    """The work of this rank: iterating yields one batch at a time."""

    plan: Sequence[Assignment]  # all batches to be done, in the order in which they start, alike on all ranks
    counter: Counter  # where positions in `plan` are claimed
    may_claim: Callable[[], bool]  # called before each batch; if it returns False, there are no more
    # Whether there is time for a batch. One that does not fit is passed over, and no rank does it in this
    # session; shorter ones stand later in the plan.
    fits: Callable[[Batch], bool]

    def __post_init__(self) -> None:
        self._held: Assignment | None = None  # claimed, and not begun

    def __iter__(self) -> Iterator[Assignment]:
        while self.may_claim() and (claimed := self._claim()) is not None:
            for place, part in enumerate(claimed.parts()):
                if place > 0 and not self.may_claim():
                    return
                if self.fits(part.runs):
                    yield part

    def joining(self, may_join: Callable[[Batch], bool]) -> Batch:
        """Claim a batch that joins the one at work; no runs if there is none, or it is to be the next one."""
        claimed = self._claim()
        if claimed is not None and claimed.joins and may_join(claimed.runs):
            return claimed.runs
        self._held = claimed
        return ()

    def _claim(self) -> Assignment | None:
        held, self._held = self._held, None
        if held is not None:
            return held
        position = self.counter.claim()
        return self.plan[position] if position < len(self.plan) else None
