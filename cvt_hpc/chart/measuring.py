"""One point measured: runs from all its starts, their results, and their cost."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.chart.plan import Point, Scene, start_parameters
from cvt_hpc.chart.quantities import History, observe, strand_of
from cvt_hpc.chart.timed_runs import Marched, lanes_of, march, most_lanes, warm_up
from cvt_hpc.models.contract import Failure, Run, load_model
from cvt_hpc.variables import Status

LONG = 2.0  # [s] of processor time: beyond, a run is timed once, because noise averages out within it


@dataclass(frozen=True)
class Measurement:
    """Result of a point.

    Attributes
    ----------
    reason : str
        Why it failed; "" where it did not.
    values : dict
        By quantity an array with the starts along the first axis; empty where it failed.
    cost : float
        Core-seconds for each simulated second of a run, the shortest of all repeats; of a run that failed or
        was given up until then. Of a point that is not timed by one pass, in as many lanes as it has starts.
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
        The job to run.
    scene : Scene
        The scene with the judged quantities.
    repeats : int
        How often a quick run is timed.
    time_limit : float
        Core-seconds after which a run is given up [s].
    """
    if scene.exact and point.series == "exact":
        return _exact(point, scene)
    job, lanes = point.job, lanes_of(point)
    # costs are those of full lanes: further starts, if needed, count for the time alone
    runs = math.ceil(point.starts / lanes) * lanes if point.timed else point.starts
    points = [point.parameters(k) for k in range(runs)]
    warm_up(job, points[:lanes])
    led = _led(point, scene, runs)
    for run in led:
        if run.failure is not None:
            return Measurement(f"{_explained(run, run.failure)}, before the method takes over")
    marched = march(job, points, lanes, point.until, time_limit, led)
    reason, values = _outcome(point, scene, marched)
    cost = marched.cost
    if point.timed and not reason:
        again = repeats if marched.core_seconds < LONG * runs / lanes else 0
        costs = [march(job, points, lanes, point.until, led=led).cost for _ in range(again)]
        cost = min([marched.cost, *costs])
    counters = _mean_counters(marched)
    return Measurement(reason, values, cost, marched.core_seconds, marched.simulated, counters)


def _led(point: Point, scene: Scene, runs: int) -> tuple[Any, ...]:
    """Runs that a point's take over from; none where they start by themselves."""
    if scene.lead is None:
        return ()
    job, until = scene.lead.job, scene.lead.until
    return march(job, [start_parameters(job, k) for k in range(runs)], most_lanes(job), until).runs


def exact_displacement(point: Point, start: int) -> tuple[Any, NDArray[np.float64]]:
    """Return a run of a point that was not marched, and its exact displacement, (time, probe) [m].

    Raises
    ------
    InputError
        If the model has no closed form for these parameters.
    """
    parameters = point.parameters(start)
    model = load_model(point.job.model)
    (run,) = model.batch([parameters], point.job.stepper).runs
    return run, model.exact(parameters, (1 + np.arange(run.samples)) * run.interval)


def _exact(point: Point, scene: Scene) -> Measurement:
    """The model's exact solution in the place of a run."""
    observed = []
    for start in range(point.starts):
        run, displacement = exact_displacement(point, start)
        columns, strands = _columns(run)
        history = History(displacement[:, columns], strands, run.channel, run.parameters)
        observed.append(observe(history, scene.quantities, whole=True))
    return Measurement("", _stacked(observed))


def _outcome(point: Point, scene: Scene, marched: Marched) -> tuple[str, dict[str, NDArray[np.float64]]]:
    """Why a point failed, or else its values."""
    whole = math.isinf(point.until) and scene.lead is None
    observed = []
    for k, run in enumerate(marched.runs[: point.starts]):
        failure = marched.failures[k]
        if failure is None and whole:
            failure = _doubt(point.job.model, run)
        if failure is not None:
            count = f" (start {k + 1} of {point.starts})" if point.starts > 1 else ""
            return _explained(run, failure, count), {}
        observed.append(observe(_history(run), scene.quantities, whole))
    return "", _stacked(observed)


def _explained(run: Any, failure: tuple[Status, str], count: str = "") -> str:
    status, why = failure
    how = "ended early" if status is Status.DONE else status.name.lower()
    return f"{how}{count} at {run.time * 1e3:.4g} ms: {why}"


def _history(run: Any) -> History:
    columns, strands = _columns(run)
    return History(np.array(run.displacement)[:, columns], strands, run.channel, run.parameters)


def _columns(run: Any) -> tuple[list[int], tuple[str, ...]]:
    strands = enumerate(strand_of(probe.label) for probe in run.probes)
    judged = {column: strand for column, strand in strands if strand is not None}
    return list(judged), tuple(judged.values())


def _doubt(name: str, run: Run) -> Failure | None:
    """Why a run that has reached its end is not to be trusted, of models that judge their runs."""
    model = load_model(name)
    return run.numerical_doubt(model.judge(run)) if model.is_recorded else None


def _stacked(observed: list[dict[str, NDArray[np.float64]]]) -> dict[str, NDArray[np.float64]]:
    return {name: np.array([values[name] for values in observed]) for name in observed[0]}


def _mean_counters(marched: Marched) -> dict[str, float]:
    each = [run.counters() for run in marched.runs]
    return {name: float(np.mean([counters[name] for counters in each])) for name in each[0]}
