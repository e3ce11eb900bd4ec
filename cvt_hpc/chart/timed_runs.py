"""Runs marched and timed, alone or in lanes."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from cvt_hpc.chart.plan import Point
from cvt_hpc.job import Job
from cvt_hpc.models.contract import Failure, Run, load_model
from cvt_hpc.simulation import marching
from cvt_hpc.variables import Status

_TOO_LONG = (Status.TIMED_OUT, "takes longer than the chart's time_limit")


@dataclass(frozen=True)
class Marched:
    """Runs from several starts.

    Attributes
    ----------
    runs : tuple of Transient
        Of the model, in the order of the points.
    failures : tuple of (Status, str) or None
        The failure of each.
    core_seconds : float
        Processor time of all of them [s], without compiling.
    simulated : float
        Their simulated time together [s].
    """

    runs: tuple[Run, ...]
    failures: tuple[Failure | None, ...]
    core_seconds: float
    simulated: float

    @property
    def cost(self) -> float:
        """Core-seconds for each simulated second of a run."""
        return self.core_seconds / self.simulated if self.simulated > 0.0 else math.nan


def warm_up(job: Job, points: Sequence[dict[str, Any]]) -> None:
    """Compile or load all that a group of runs needs; this does not count as their cost."""
    load_model(job.model).batch(points, job.stepper).advance(1)


def most_lanes(job: Job) -> int:
    """Return how many runs of a job can advance together, in the lanes of the processor's registers."""
    return load_model(job.model).lanes(job.parameters, job.stepper)


def lanes_of(point: Point) -> int:
    """Return how many runs of a point advance together: as many as it asks for, or as can."""
    return point.lanes or min(most_lanes(point.job), point.starts)


def march(
    job: Job,
    points: Sequence[dict[str, Any]],
    lanes: int,
    until: float,
    time_limit: float = math.inf,
    led: Sequence[Any] = (),
) -> Marched:
    """Do several runs, in groups that advance together.

    Parameters
    ----------
    job : Job
        With their model and stepper.
    points : sequence of dict
        Flat parameters of each run [SI]; those of a group may differ as the model's batches allow.
    lanes : int
        Runs of a group.
    until : float
        How far they are marched [s]; inf: to their ends.
    time_limit : float
        Core-seconds after which a group is given up and counts as failed [s]; without one nothing but the
        runs is in their time.
    led : sequence of Transient
        Runs from which the runs take over, one for each; none: they start by themselves.
    """
    runs: list[Run] = []
    failures: list[Failure | None] = []
    seconds = simulated = 0.0
    for first in range(0, len(points), lanes):
        model = load_model(job.model)
        model.forget()
        batch = model.batch(points[first : first + lanes], job.stepper)
        if led:
            batch.take_over(led[first : first + lanes])
        begun = batch.done
        samples = batch.samples if math.isinf(until) else round(until / batch.interval)
        needed, stopped = marching.march(batch, samples, _stop_after(time_limit))
        seconds += needed
        runs += batch.runs
        simulated += sum(run.time - begun * batch.interval for run in batch.runs)
        failures += [run.failure or (_TOO_LONG if stopped else None) for run in batch.runs]
    return Marched(tuple(runs), tuple(failures), seconds, simulated)


def _stop_after(seconds: float) -> Callable[[], str | None] | None:
    """A function that ends a march after so much processor time; None where there is no limit."""
    if math.isinf(seconds):
        return None
    end = time.process_time() + seconds
    return lambda: _TOO_LONG[1] if time.process_time() > end else None
