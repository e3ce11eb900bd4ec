"""The records that a start of a sweep finds, and its plan; on rank 0 alone.

Rules decide which runs are done again, done alone, or given up. A process that dies, by a kill, for lack of
memory or in compiled code, leaves no record of its runs. They are done again, after all others, so that a run
that kills its process keeps no other from being done. A process that dies takes the other ranks along, so
most of these runs are innocent: after `_DEATHS` each is done alone, and where the process dies even then, by
one rank alone, at the very end. After `_DEATHS_ALONE` of these deaths the run is given up.

A trace runs some cells of its grid, and infers the classes of the cells between them. The grid is cut into
boxes that share their sides, at first as wide as the first spacing. The corners of all boxes are run. A box
in which, sides included, runs of different classes are known is cut in halves along each axis, the corners of
these are run as well, and so on down to neighbouring cells. Thus a boundary that shows in one box is followed
into the next, wherever it leads. In the end every box that is wider than that is of one class, as far as runs
know it, and this class is inferred for its inner cells. Along axes that are not traced nothing is inferred:
each of their values has boxes of its own.

A further run can only cut more boxes. Hence a trace runs in the end the least set of cells that
requires no other one: it does not depend on the order of the runs, on rounds, ranks or interruptions.

A trace can miss cells: of cells of one class that are connected, as neighbours along traced axes, all are
found if one of them is run. So only patches without a corner of the first boxes are missed, hence none that
contains as many cells as the first spacing along each traced axis, side by side.
"""

import logging
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import ExitStack
from functools import partial
from itertools import pairwise, product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.job import Job
from cvt_hpc.job.axes import SAMPLE
from cvt_hpc.storage.files import discard
from cvt_hpc.storage.provenance import new_session
from cvt_hpc.study.batches import Assignment, share_out
from cvt_hpc.study.description import Study
from cvt_hpc.study.folder import Part, StudyFolder, leave_out_missing
from cvt_hpc.study.forecast.cost_model import Fit
from cvt_hpc.study.intervals import look
from cvt_hpc.study.ranks.progress import Counter, Progress
from cvt_hpc.study.ranks.stopping import TimeLimit
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.record.log import RecordFormat, RecordLog, Session
from cvt_hpc.study.simulator import Simulator
from cvt_hpc.study.task import Task, asked_step, refined_steps, untried_factor
from cvt_hpc.variables import Status
from cvt_hpc.vibration.classes import OccurrenceClass, classify_runs

UNKNOWN = OccurrenceClass.NOT_RUN

Interval = tuple[int, int]  # first and last place on an axis
Box = tuple[Interval, ...]

_DEATHS = 3  # at a run, until it is done alone
_DEATHS_ALONE = 2  # while it was done alone, until it is given up

_logger = logging.getLogger(__name__)


class Plan(NamedTuple):
    """The findings of rank 0 that all ranks need."""

    assignments: list[Assignment]
    attempts: dict[int, int]  # of runs that began again
    steps: dict[int, float]  # [s], of runs that do not take the time step of the job
    costs: np.ndarray  # shape (runs,), as they are predicted
    fit: Fit
    total: int
    recorded: int
    failed: int
    session: Session
    limit: TimeLimit

    @property
    def order(self) -> list[int]:
        """The runs in the order in which they are begun."""
        return [index for assignment in self.assignments for index in assignment.runs]


def prepare(
    folder: StudyFolder,
    task: Task,
    part: Part | None,
    fresh: bool,
    retry: Collection[Status],
    ranks: int,
    held: ExitStack,
    refine: float | None = None,
) -> Plan:
    """Take the folder into possession and find the runs that are left to do; on rank 0 alone."""
    study = task.study
    inner = None if part is None else folder.part_lock(part)
    held.enter_context(folder.claimed(study, fresh=fresh, inner=inner))
    if part is None:
        for leftover in folder.half_histories():
            discard(leftover)
    records = folder.read_records(study)
    session = new_session(ranks)
    for warning in records.warnings + _other_versions(records, session):
        _logger.warning(warning)
    asked = asked_runs(task, records, part)
    if refine is None:
        refine = untried_factor(task.job, records, runs_to_repeat(records, asked, retry), retry)
    records = _enter_attempts(folder, records, asked, retry, session, refine)
    leave_out_missing(task.job, folder, records)
    done = records.status == Status.DONE
    recorded = int((records.recorded & asked).sum())
    steps = refined_steps(task.job, records, task.asked_steps() if task.asked_steps else {})
    costs = predicted_costs(task.job, task.simulator, steps)
    return Plan(
        assignments=plan_runs(task.job, task.simulator, records, asked, ranks, steps),
        attempts=_later_attempts(records),
        steps=steps,
        costs=costs,
        fit=task.fit(records, costs).inherited(),
        total=int(asked.sum()),
        recorded=recorded,
        failed=recorded - int((done & asked).sum()),
        session=session,
        limit=TimeLimit(),
    )


def asked_runs(task: Task, records: Records, part: Part | None = None) -> np.ndarray:
    """Return whether a run belongs to this start, shape (runs,); a trace requires more later."""
    if part is not None:
        return part.holds(np.arange(task.study.size))
    if task.chosen is not None:
        return task.chosen()
    asked = needed_runs(task.study, records)
    asked[list(task.job.histories)] = True
    return asked


def next_round(
    folder: StudyFolder, task: Task, plan: Plan, ranks: int, counter: Counter, display: Progress
) -> Plan:
    """Return the plan of the runs that a trace requires after the runs of a round; on rank 0 alone.

    Raises
    ------
    RuntimeError
        If a run of that round is not on record: requesting it once more would never end.
    """
    records = folder.read_records(task.study)
    if lost := [index for index in plan.order if not records.recorded[index]]:
        raise RuntimeError(f"a round of the trace has ended without records of its runs {lost}")
    assignments = plan_runs(task.job, task.simulator, records, asked_runs(task, records), ranks, plan.steps)
    plan = plan._replace(assignments=assignments, fit=task.fit(records, plan.costs).inherited())
    counter.rewind()
    display.expect(plan.costs[plan.order])
    return plan


def _other_versions(records: Records, session: Session) -> list[str]:
    """Return a warning if the records were made by other code than that which is going on now."""
    keys = ("versions", "git_revision")
    if all(earlier[key] == session[key] for earlier in records.sessions for key in keys):
        return []
    return [
        "earlier runs of this folder were made with other versions than these (results.nc names them in its "
        "attributes `versions` and `git_revision`); --fresh repeats them"
    ]


def plan_runs(
    job: Job,
    simulator: Simulator,
    records: Records,
    asked: np.ndarray,
    ranks: int,
    steps: Mapping[int, float] | None = None,
) -> list[Assignment]:
    """Return the runs to be done, as assignments in the order in which to start them.

    Parameters
    ----------
    job, simulator, ranks
        The job that is run, what does the runs, and the number of processes that compute.
    records : Records
        The runs on record; no run in it is to be given up.
    asked : numpy.ndarray of bool, shape (runs,)
        Which runs are to be on record in the end.
    steps : mapping, optional
        Time steps [s] of the runs that do not take that of the job, by run index: only runs of one step can
        advance together.
    """
    costs = predicted_costs(job, simulator, steps or {})
    pending = asked & ~records.recorded
    suspect = pending & (records.died >= _DEATHS)
    groups = []
    for struck in (False, True):
        chosen = pending & ~suspect & ((records.died > 0) == struck)
        for together in _by_step(np.flatnonzero(chosen).tolist(), steps or {}):
            groups += simulator.lane_groups(job, together)
    batches = share_out(groups, costs, ranks, partial(simulator.turns, job))
    batches.sort(key=lambda batch: bool(records.died[batch[0]]))
    suspects = sorted(np.flatnonzero(suspect).tolist(), key=lambda i: (-costs[i], i))
    kept = {*job.histories}
    lethal = tuple(index for index in suspects if records.died_alone[index])
    return [
        *(Assignment(batch, joins=not (records.died[batch[0]] or kept & {*batch})) for batch in batches),
        *(Assignment((index,), alone=True) for index in suspects if index not in lethal),
        *([Assignment(lethal, alone=True)] if lethal else []),
    ]


def predicted_costs(job: Job, simulator: Simulator, steps: Mapping[int, float]) -> np.ndarray:
    """Return the predicted duration of each run, in any unit.

    The runs that do not take the time step of the job but that of `steps` [s] take as much longer.
    """
    costs = np.array(simulator.run_costs(job), float)
    for index, step in steps.items():
        costs[index] *= asked_step(job, index) / step
    return costs


def _by_step(runs: list[int], steps: Mapping[int, float]) -> Iterable[list[int]]:
    if not steps:
        return [runs]
    groups: dict[float | None, list[int]] = {}
    for index in runs:
        groups.setdefault(steps.get(index), []).append(index)
    return groups.values()


def given_up(records: Records, asked: np.ndarray) -> dict[int, str]:
    """Return the runs, among those marked in `asked`, that are not tried again, with the reason."""
    lost = np.flatnonzero(asked & ~records.recorded & (records.died_alone >= _DEATHS_ALONE))
    told = "its process died {} times, the last {} while it did this run alone"
    return {k: told.format(records.died[k], records.died_alone[k]) for k in lost.tolist()}


def runs_to_repeat(records: Records, asked: np.ndarray, statuses: Collection[Status]) -> np.ndarray:
    """Return the indices of recorded runs, of those `asked`, that a retry of some statuses begins again.

    None while runs are left of a sweep in which an earlier retry began: the same command, given again
    after an early end, continues instead of beginning anew.
    """
    if (records.attempts[asked] > 1).any() and not records.recorded[asked].all():
        return np.zeros(0, np.int64)
    return np.flatnonzero(asked & records.recorded & np.isin(records.status, list(statuses)))


def _enter_attempts(
    folder: StudyFolder,
    records: Records,
    asked: np.ndarray,
    retry: Collection[Status],
    session: Session,
    refine: float,
) -> Records:
    """Record which runs are given up and which begin again, and return the records as they are then.

    Only of runs marked in `asked`, shape (runs,): others may be at work just now. The factor `refine`, by
    which the retries shorten their time step, is kept with them, so that a continuation does the same.
    """
    lost, again = given_up(records, asked), runs_to_repeat(records, asked, retry)
    if not lost and not len(again):
        return records
    records.attempts[again] += 1
    study = records.study
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    with RecordLog(folder.records, layout, {**session, "refine": refine}, 0, _later_attempts(records)) as log:
        if lost:
            log.append([(index, study.pack_failure(reason)) for index, reason in lost.items()])
        if len(again):
            log.begin_again(again)
    return folder.read_records(study)


def _later_attempts(records: Records) -> dict[int, int]:
    """Return the attempts that are not the first, by run index."""
    return {int(index): int(records.attempts[index]) for index in np.flatnonzero(records.attempts > 1)}


def needed_runs(study: Study, records: Records) -> NDArray[np.bool_]:
    """Return the runs that a study needs by the records, shape (runs,): of a grid or of samples all.

    Of an adaptive one the samples that each cell wants. Runs on record count as needed; those needed now are
    among those needed later on.
    """
    if not study.in_rounds:
        return np.ones(study.size, bool)
    classes = _run_classes(study, records)
    if not study.is_traced:
        of_samples = study.dims.index(SAMPLE)
        wanted = look(np.moveaxis(classes, of_samples, -1), study.design).wanted
        chosen = np.arange(study.shape[of_samples]) < wanted[..., np.newaxis]
        return np.moveaxis(chosen, -1, of_samples).ravel() | records.recorded
    needed = np.zeros(study.shape, bool)
    for box in _leaf_boxes(classes, _first_intervals(study)):
        needed[np.ix_(*box)] = True
    return needed.ravel() | records.recorded


def inferred_classes(study: Study, records: Records) -> NDArray[np.int8]:
    """Return the class of each cell, shape of the grid: its own, or that of the runs around it.

    NOT_RUN where these do not agree, or are not all known yet.
    """
    classes = _run_classes(study, records)
    inferred = classes.copy()
    for box in _leaf_boxes(classes, _first_intervals(study)):
        corners = classes[np.ix_(*box)]
        if (corners == corners.flat[0]).all():
            inside = inferred[_cells(box)]
            inside[inside == UNKNOWN] = corners.flat[0]
    return inferred


def _run_classes(study: Study, records: Records) -> NDArray[np.int8]:
    """Return the class of each run, shape of the grid; NOT_RUN where there is no record."""
    return classify_runs(records.status, records.read(np.arange(study.size), "vibrates")).reshape(study.shape)


def _first_intervals(study: Study) -> list[list[Interval]]:
    """Return for each axis the intervals that the first boxes are made of."""
    spacings = study.design["first_spacing"]
    return [_intervals(len(axis.values), spacings.get(axis.name)) for axis in study.axes]


def _leaf_boxes(classes: NDArray[np.int8], intervals: list[list[Interval]]) -> Iterator[Box]:
    """Yield the boxes that are not cut: neighbours, and those within which all known runs are of one class.

    Parameters
    ----------
    classes : array of int8, shape of the grid
        `OccurrenceClass` of each run; NOT_RUN where it is not known.
    intervals : list of list of (int, int)
        For each axis, the places of which the first boxes are made.
    """
    for box in product(*intervals):
        cells = classes[_cells(box)]
        known = cells[cells != UNKNOWN]
        if max((last - first for first, last in box), default=0) <= 1 or (known == known[:1]).all():
            yield box
        else:
            yield from _leaf_boxes(classes, [_halves(*interval) for interval in box])


def _cells(box: Box) -> tuple[slice, ...]:
    return tuple(slice(first, last + 1) for first, last in box)


def _intervals(length: int, spacing: int | None) -> list[Interval]:
    """Cut an axis into intervals that share their ends; without a spacing into single places."""
    if spacing is None or length == 1:
        return [(place, place) for place in range(length)]
    return list(pairwise([*range(0, length - 1, spacing), length - 1]))


def _halves(first: int, last: int) -> list[Interval]:
    middle = (first + last) // 2
    return [(first, middle), (middle, last)] if last - first > 1 else [(first, last)]
