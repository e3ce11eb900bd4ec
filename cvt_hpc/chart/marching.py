"""Runs marched and timed: the one place that knows how the runs of several starts are carried out."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

from cvt_hpc.models import MODELS
from cvt_hpc.variables import Status

_FIRST_SLICE = 20  # samples; doubled while a slice takes less than _SLICE, so that a time limit can be kept
_SLICE = 0.2  # [s]


@dataclass(frozen=True)
class Marched:
    """Runs from several starts.

    Attributes
    ----------
    runs : tuple of Transient
        One of the model for each start.
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


def warm_up(model: str, stepper: str, parameters: dict[str, Any]) -> None:
    """Compile or load all that a run needs, which is no cost of the run."""
    _transient(model)(parameters, stepper).advance(1)


def march(
    model: str, stepper: str, starts: Sequence[dict[str, Any]], until: float, time_limit: float = math.inf
) -> Marched:
    """Do the runs of a point, one after another.

    Parameters
    ----------
    model, stepper : str
        Their names.
    starts : sequence of dict
        Flat parameters of each run [SI].
    until : float
        How far they are marched [s]; inf: to their ends.
    time_limit : float
        Core-seconds after which a run is given up and counts as failed [s]; without one nothing but the run
        is in its time.
    """
    runs = [_transient(model)(parameters, stepper) for parameters in starts]
    failures = []
    seconds = 0.0
    for run in runs:
        samples = run.samples if math.isinf(until) else min(run.samples, round(until / run.interval))
        first = samples if math.isinf(time_limit) else _FIRST_SLICE
        started = time.process_time()
        failures.append(_advance(run, samples, first, started + time_limit))
        seconds += time.process_time() - started
    return Marched(tuple(runs), tuple(failures), seconds, sum(run.time for run in runs))


def _advance(run: Any, samples: int, piece: int, deadline: float) -> tuple[Status, str] | None:
    now = time.process_time()
    while run.done < samples:
        if now > deadline:
            return Status.TIMED_OUT, "takes longer than the chart's time_limit"
        if failure := run.advance(min(piece, samples - run.done)):
            return failure
        before, now = now, time.process_time()
        piece = 2 * piece if now - before < _SLICE else piece
    return None


def _transient(model: str) -> Any:
    return import_module(MODELS[model] + ".transient").Transient
