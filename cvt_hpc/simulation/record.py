"""The record of a run: its content, and how it is made of a run that has ended."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np

from cvt_hpc.job import Job
from cvt_hpc.models.contract import Model, Run, load_model
from cvt_hpc.variables import LONGEST_REASON, Coordinate, Status, Variable, Vibrates, shortened

_VERDICT = (
    Variable("status", "", "how the run ended", dtype="i1", flags=Status),
    Variable(
        "vibrates",
        "",
        "whether the belt vibrates; has a meaning where status is done",
        dtype="i1",
        flags=Vibrates,
    ),
    Variable("reason", "", "why the run failed, or was found to vibrate or not", dtype=f"S{LONGEST_REASON}"),
)
_COST = (
    Variable(
        "core_seconds",
        "s",
        "processor time, all tries; of runs that advance together, their time divided by their number",
        volatile=True,
        words="processor time",
    ),
)
_MARCH = (
    Variable(
        "simulated_seconds",
        "s",
        "more than asked where a run was prolonged, less where it failed or slipped through",
        words="simulated time",
    ),
    Variable("time_step", "s", "time step of the run that counts"),
    Variable("refinements", "1", "times that the run was done again at half the step", dtype="i1"),
    Variable("steps", "1", "time steps taken, all tries", dtype="i8"),
    Variable("contact_solves", "1", "linear solves of the contact problem, all tries", dtype="i8"),
)
COMMON = (*_VERDICT, *_COST, *_MARCH)  # of all models; those without a march have none of its


def recorded_model(job: Job) -> Model:
    """Return the model of a job; InputError where its runs are not judged and recorded."""
    model = load_model(job.model)
    model.check_recorded(job.source)
    return model


def record_variables(job: Job) -> tuple[Variable, ...]:
    """Quantities of a run's record, `status` first.

    Those along a dimension that the job's record does not have are left out.

    Parameters
    ----------
    job : Job
        A validated job.
    """
    march = () if job.stepper is None else _MARCH
    model, dims = recorded_model(job), record_coordinates(job).keys()
    own = (variable for variable in model.variables if dims >= {*variable.dims})
    return (*_VERDICT, *own, *_COST, *march)


def declared_record(model: str, source: str) -> tuple[list[Variable], dict[str, Coordinate]]:
    """Return all quantities that a model declares of a run, with default settings or others, and dimensions.

    Parameters
    ----------
    model : str
        A model whose runs are recorded.
    source : str
        Who asks, for the error.

    Raises
    ------
    InputError
        If there is no such model, or its runs are not recorded.
    """
    from cvt_hpc.job import build_job

    job = build_job({"name": model, "model": model}, source)
    variables = {v.name: v for v in (*record_variables(job), *recorded_model(job).variables)}
    return list(variables.values()), record_coordinates(job)


def record_coordinates(job: Job) -> dict[str, Coordinate]:
    """Dimensions of a run's record beside the grid's.

    Parameters
    ----------
    job : Job
        A validated job.
    """
    return recorded_model(job).coordinates(job.parameters)


def record_of(
    job: Job, run: Run, marched: float, judge: Callable[[Any], dict[str, Any] | None] | None = None
) -> dict[str, Any]:
    """The record of a transient that has ended.

    Parameters
    ----------
    job : Job
        For its model.
    run : object
        A run as the model's batch has them.
    marched : float
        Processor time that it has taken [s].
    judge : callable, optional
        Gives the values of a run that has reached its end, by default as the model judges its runs; None,
        and the record's status is not_run, where it does not answer.
    """
    started = time.process_time()
    record, failure = _blank(job), run.failure
    has_result = failure is None or failure[0] is Status.DONE
    if has_result and (values := (judge or load_model(job.model).judge)(run)) is not None:
        record |= values
        if failure is None:
            failure = run.numerical_doubt(record)
    if failure is not None and failure[0] is not Status.DONE:
        status, why = failure
        record = _blank(job) | {"status": status, "reason": shortened(f"at {run.time * 1e3:.4g} ms: {why}")}
    return record | {
        "core_seconds": marched + time.process_time() - started,
        "simulated_seconds": run.time,
        "time_step": run.step,
        "steps": run.steps,
        "contact_solves": run.contact_solves,
    }


def record_without_run(job: Job, values: dict[str, Any]) -> dict[str, Any]:
    """The record of a run that needed no transient.

    Parameters
    ----------
    job : Job
        For its model.
    values : dict
        The known values.
    """
    return _blank(job) | values | {"core_seconds": 0.0, "simulated_seconds": 0.0}


def record_of_solution(job: Job, solution: Any, solving: float) -> dict[str, Any]:
    """The record of the result of a model without a transient.

    Parameters
    ----------
    job : Job
        For its model.
    solution : object
        As the model's `solve` returns it.
    solving : float
        Processor time that it has taken [s].
    """
    started = time.process_time()
    record = _blank(job) | load_model(job.model).judge(solution)
    return record | {"core_seconds": solving + time.process_time() - started}


def _blank(job: Job) -> dict[str, Any]:
    """An empty record."""
    sizes = {name: len(c.values) for name, c in record_coordinates(job).items()}
    return {
        v.name: v.blank
        if v.dtype.startswith("S")
        else np.full(tuple(sizes[dim] for dim in v.dims), v.blank, v.dtype)
        for v in record_variables(job)
    }
