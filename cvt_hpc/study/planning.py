"""The records that a start of a sweep finds, and its plan; on rank 0 alone."""

import logging
from collections.abc import Collection
from contextlib import ExitStack
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.files import discard
from cvt_hpc.provenance import new_session
from cvt_hpc.study.attempts import (
    enter_attempts,
    later_attempts,
    plan_runs,
    predicted_costs,
    runs_to_repeat,
)
from cvt_hpc.study.batches import Assignment
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.forecast.cost_model import Fit
from cvt_hpc.study.histories import leave_out_missing
from cvt_hpc.study.part import Part
from cvt_hpc.study.ranks.counter import Counter
from cvt_hpc.study.ranks.progress import Progress
from cvt_hpc.study.ranks.time_limit import TimeLimit
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.task import Task
from cvt_hpc.study.time_steps import refined_steps, untried_factor
from cvt_hpc.study.tracing import needed_runs
from cvt_hpc.variables import Status

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
    session: dict[str, Any]
    limit: TimeLimit


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
    records = enter_attempts(folder, study, records, asked, retry, session, refine)
    leave_out_missing(task.job, folder, records)
    done = records.status == Status.DONE
    recorded = int((records.recorded & asked).sum())
    steps = refined_steps(task.job, records, task.asked_steps() if task.asked_steps else {})
    costs = predicted_costs(task.job, task.simulator, steps)
    return Plan(
        assignments=plan_runs(task.job, task.simulator, records, asked, ranks, steps),
        attempts=later_attempts(records),
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
    lost = [
        index for assignment in plan.assignments for index in assignment.runs if not records.recorded[index]
    ]
    if lost:
        raise RuntimeError(f"a round of the trace has ended without records of its runs {lost}")
    asked, costs = asked_runs(task, records), plan.costs
    assignments = plan_runs(task.job, task.simulator, records, asked, ranks, plan.steps)
    counter.rewind()
    display.expect(costs[[index for assignment in assignments for index in assignment.runs]])
    fit = task.fit(records, costs)
    return plan._replace(assignments=assignments, fit=fit.inherited())


def _other_versions(records: Records, session: dict[str, Any]) -> list[str]:
    """Return a warning if the records were made by other code than that which is going on now."""
    keys = ("versions", "git_revision")
    if all(earlier[key] == session[key] for earlier in records.sessions for key in keys):
        return []
    return [
        "earlier runs of this folder were made with other versions than these (results.nc names them in its "
        "attributes `versions` and `git_revision`); --fresh repeats them"
    ]
