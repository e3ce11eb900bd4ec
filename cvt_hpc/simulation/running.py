"""Runs from their start to their records."""

import time
from collections.abc import Callable, Collection, Sequence
from typing import Any

from cvt_hpc.job import Job
from cvt_hpc.models.contract import Model
from cvt_hpc.simulation.marching import Interrupted, march_runs
from cvt_hpc.simulation.record import record_of_solution, recorded_model


def run_point(job: Job, point: dict[str, Any], interrupt: Callable[[], str | None]) -> dict[str, Any]:
    """Do one run.

    Parameters
    ----------
    job : Job
        For its model and stepper.
    point : dict
        Flat parameters of the run [SI].
    interrupt : callable
        Called every few tens of milliseconds; a text ends the run.

    Returns
    -------
    dict
        Value of each of `record_variables`. A run that fails has its reason, and no numbers but its cost.

    Raises
    ------
    Interrupted
        With the text of `interrupt`.
    """
    return run_points(job, [point], interrupt)[0]


def run_points(
    job: Job, points: Sequence[dict[str, Any]], interrupt: Callable[[], str | None]
) -> list[dict[str, Any]]:
    """Do several runs that advance together, in the lanes of the processor's registers.

    Parameters
    ----------
    job : Job
        For its model and stepper.
    points : sequence of dict
        Flat parameters of the runs [SI], as `lane_groups` puts them together.
    interrupt : callable
        As `run_point` takes it.

    Returns
    -------
    list of dict
        Records in the order of the points, each bitwise equal to `run_point` of its point alone.

    Raises
    ------
    Interrupted
        With the text of `interrupt`.
    """
    return [record for _, record in do(job, points, interrupt)]


def do(
    job: Job,
    points: Sequence[dict[str, Any]],
    interrupt: Callable[[], str | None],
    kept: Collection[int] = (),
) -> list[tuple[Any, dict[str, Any]]]:
    """Do a batch of runs as `run_points`; beside each record the input of `histories`, if kept."""
    model = recorded_model(job)
    if job.stepper is None:
        return [_solve(job, model, point, interrupt) for point in points]
    return march_runs(job, points, interrupt, kept)


def _solve(
    job: Job, model: Model, point: dict[str, Any], interrupt: Callable[[], str | None]
) -> tuple[Any, dict[str, Any]]:
    """A run of a model without a transient: its record follows from the parameters at once."""
    if stop := interrupt():
        raise Interrupted(stop)
    started = time.process_time()
    solution = model.solve(point)
    return solution, record_of_solution(job, solution, time.process_time() - started)
