"""Runs marched and timed, alone or in lanes: the one place that knows how several runs are carried out."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from types import ModuleType
from typing import Any

from cvt_hpc.models import MODELS
from cvt_hpc.variables import Status

_FIRST_SLICE = 1  # sample; doubled while a slice takes less than _SLICE, so that a time limit can be kept
_SLICE = 0.2  # [s]
_TOO_LONG = (Status.TIMED_OUT, "takes longer than the chart's time_limit")


@dataclass(frozen=True)
class Marched:
    """Runs from several starts.

    Attributes
    ----------
    runs : tuple of Transient
        Of the model, in the order of the points.
    failures : tuple of (Status, str) or None
        What has gone wrong with each.
    core_seconds : float
        Processor time of all of them [s], without compiling.
    simulated : float
        What they have simulated together [s].
    """

    runs: tuple[Any, ...]
    failures: tuple[tuple[Status, str] | None, ...]
    core_seconds: float
    simulated: float

    @property
    def cost(self) -> float:
        """Core-seconds for each simulated second of a run."""
        return self.core_seconds / self.simulated if self.simulated > 0.0 else math.nan


def warm_up(model: str, stepper: str, points: Sequence[dict[str, Any]]) -> None:
    """Compile or load all that a group of runs needs, which is no cost of theirs."""
    _module(model).batch(points, stepper).advance(1)


def most_lanes(model: str, stepper: str, parameters: dict[str, Any]) -> int:
    """Return how many runs of a model can advance together, in the lanes of the processor's registers."""
    module = _module(model)
    return module.lanes(parameters, stepper) if hasattr(module, "lanes") else 1


def march(
    model: str,
    stepper: str,
    points: Sequence[dict[str, Any]],
    lanes: int,
    until: float,
    time_limit: float = math.inf,
    led: Sequence[Any] = (),
) -> Marched:
    """Do several runs, in groups that advance together.

    Parameters
    ----------
    model, stepper : str
        Their names.
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
        What the runs take over from, one for each; none: they start by themselves.
    """
    runs: list[Any] = []
    failures: list[tuple[Status, str] | None] = []
    seconds = simulated = 0.0
    for first in range(0, len(points), lanes):
        batch = _module(model).batch(points[first : first + lanes], stepper)
        if led:
            batch.take_over(led[first : first + lanes])
        begun = batch.done
        samples = batch.samples if math.isinf(until) else min(batch.samples, round(until / batch.interval))
        piece = samples if math.isinf(time_limit) else _FIRST_SLICE
        started = time.process_time()
        in_time = _advance(batch, samples, piece, started + time_limit)
        seconds += time.process_time() - started
        runs += batch.runs
        simulated += sum(run.time - begun * batch.interval for run in batch.runs)
        failures += [run.failure or (None if in_time else _TOO_LONG) for run in batch.runs]
    return Marched(tuple(runs), tuple(failures), seconds, simulated)


def lead(model: str, stepper: str, points: Sequence[dict[str, Any]], until: float) -> tuple[Any, ...]:
    """Return runs that have been brought to a time, from where others can take over.

    Parameters
    ----------
    model, stepper, points
        As for `march`.
    until : float
        The time [s].
    """
    lanes = most_lanes(model, stepper, points[0])
    return march(model, stepper, points, lanes, until).runs


def _advance(batch: Any, samples: int, piece: int, deadline: float) -> bool:
    """March a batch, and return whether it came to its end in time."""
    now = time.process_time()
    while batch.running and batch.done < samples:
        if now > deadline:
            return False
        batch.advance(min(piece, samples - batch.done))
        before, now = now, time.process_time()
        piece = 2 * piece if now - before < _SLICE else piece
    return True


def _module(model: str) -> ModuleType:
    return import_module(MODELS[model] + ".transient")
