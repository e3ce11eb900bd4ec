"""One point measured: runs from all its starts, what they give, and what they cost."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.chart.marching import Marched, march, warm_up
from cvt_hpc.chart.plan import Chart, Point, Scene
from cvt_hpc.chart.quantities import History, channels_needed, observe, strand_of
from cvt_hpc.errors import mismatch
from cvt_hpc.models import MODELS
from cvt_hpc.vibration.assessment import assess

_LONG = 2.0  # [s] of processor time: beyond, a run is timed once, because noise averages out within it


@dataclass(frozen=True)
class Measurement:
    """What a point gave.

    Attributes
    ----------
    reason : str
        Why it failed; "" where it did not.
    values : dict
        By quantity an array with the starts along the first axis; empty where it failed.
    cost : float
        Core-seconds for each simulated second of a run, the shortest of all repeats; nan where it is of no
        interest.
    core_seconds : float
        Processor time that the first pass took [s].
    simulated : float
        Simulated time of all starts [s].
    counters : dict
        Work by its name, mean over the starts.
    """

    reason: str
    values: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    cost: float = math.nan
    core_seconds: float = 0.0
    simulated: float = 0.0
    counters: dict[str, float] = field(default_factory=dict)


def measure(point: Point, scene: Scene, repeats: int, time_limit: float) -> Measurement:
    """Measure a point.

    Parameters
    ----------
    point : Point
        What to run.
    scene : Scene
        What is judged.
    repeats : int
        How often a quick run is timed.
    time_limit : float
        Core-seconds after which a run is given up [s].
    """
    starts = [point.parameters(k) for k in range(point.starts)]
    if scene.exact and point.series == "exact":
        return _exact(point, scene, starts)
    model, stepper = point.job.model, point.job.stepper
    warm_up(model, stepper, starts[0])
    marched = march(model, stepper, starts, point.until, time_limit)
    reason, values = _outcome(point, scene, marched, starts)
    cost = math.nan
    if point.timed and not reason:
        again = repeats if marched.core_seconds < _LONG * len(starts) else 0
        costs = [march(model, stepper, starts, point.until).cost for _ in range(again)]
        cost = min([marched.cost, *costs])
    return Measurement(reason, values, cost, marched.core_seconds, marched.simulated, _mean_counters(marched))


def check_channels(chart: Chart) -> None:
    """Make sure that each scene's model records what is to be judged, before anything is computed.

    Raises
    ------
    InputError
        If a channel is missing, or a model has no exact solution where one is asked for.
    """
    for scene in chart.scenes:
        point = next(point for point in chart.points if point.scene == scene.name)
        where = f"{chart.source}: [chart.scenes.{scene.name}]"
        run = import_module(MODELS[point.job.model] + ".transient").Transient(
            point.parameters(0), point.job.stepper
        )
        if scene.exact and not _has_exact(point.job.model):
            raise mismatch(
                f"{where} reference", f"a model with an exact solution for {scene.name}", point.job.model
            )
        for channel in channels_needed(scene.quantities):
            if scene.exact or not _has_channel(run, channel):
                found = "an exact solution, which has none" if scene.exact else point.job.model
                raise mismatch(f"{where} quantities", f"a model that records the channel {channel}", found)


def _outcome(
    point: Point, scene: Scene, marched: Marched, starts: list[dict[str, Any]]
) -> tuple[str, dict[str, NDArray[np.float64]]]:
    """Why a point failed, or else its values."""
    whole = math.isinf(point.until)
    observed = []
    for k, run in enumerate(marched.runs):
        failure = marched.failures[k]
        if failure is None and whole:
            failure = _doubt(point.job.model, run, starts[k])
        if failure is not None:
            status, why = failure
            count = f" (start {k + 1} of {len(starts)})" if len(starts) > 1 else ""
            return f"{status.name.lower()}{count} at {run.time * 1e3:.4g} ms: {why}", {}
        observed.append(observe(_history(run, starts[k]), scene.quantities, whole))
    return "", {name: np.array([values[name] for values in observed]) for name in observed[0]}


def _history(run: Any, parameters: Mapping[str, Any]) -> History:
    columns, strands = _columns(run)
    return History(np.array(run.displacement)[:, columns], strands, run.channel, parameters)


def _columns(run: Any) -> tuple[list[int], tuple[str, ...]]:
    strands = [strand_of(probe.label) for probe in run.probes]
    columns = [k for k, strand in enumerate(strands) if strand is not None]
    return columns, tuple(strands[k] for k in columns)


def _doubt(model: str, run: Any, parameters: dict[str, Any]) -> Any:
    """Whether the model itself does not trust a run that has reached its end."""
    history = _history(run, parameters)
    found = assess(history.displacement, history.rate, history.strands, parameters)
    strongest = np.array(_columns(run)[0])[found.strongest_probe]
    return run.numerical_doubt(import_module(MODELS[model] + ".record").evaluate(run, strongest))


def _exact(point: Point, scene: Scene, starts: list[dict[str, Any]]) -> Measurement:
    """The model's exact solution in the place of a run."""
    solution = import_module(MODELS[point.job.model] + ".exact").exact
    observed = []
    for parameters in starts:
        run = import_module(MODELS[point.job.model] + ".transient").Transient(parameters, point.job.stepper)
        columns, strands = _columns(run)
        displacement = solution(parameters, (1 + np.arange(run.samples)) * run.interval)[:, columns]
        history = History(displacement, strands, run.channel, parameters)
        observed.append(observe(history, scene.quantities, whole=True))
    return Measurement("", {name: np.array([values[name] for values in observed]) for name in observed[0]})


def _has_exact(model: str) -> bool:
    try:
        return hasattr(import_module(MODELS[model] + ".exact"), "exact")
    except ModuleNotFoundError:
        return False


def _has_channel(run: Any, name: str) -> bool:
    try:
        run.channel(name)
    except (KeyError, ValueError):
        return False
    return True


def _mean_counters(marched: Marched) -> dict[str, float]:
    each = [run.counters() for run in marched.runs]
    return {name: float(np.mean([counters[name] for counters in each])) for name in each[0]}
