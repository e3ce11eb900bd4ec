"""One point measured: runs from all its starts, their results, and their cost.

Runs are marched and timed, alone or in lanes. Before that `check_prospects` holds models against what a chart
requires of them, and `predicted_cost` gives its expected cost, by the cost models of its models.
"""

import math
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.experiments.chart.plan import Chart, Point, Role, Scene, start_parameters
from cvt_hpc.experiments.chart.quantities import History, channels_needed, observe, strand_of
from cvt_hpc.job import Job
from cvt_hpc.job.summary import core_time_in_words
from cvt_hpc.models.contract import Failure, Run, load_model
from cvt_hpc.simulation import marching
from cvt_hpc.tables import columns, short
from cvt_hpc.variables import Status
from cvt_hpc.variator.band import band

_TOO_LONG = (Status.TIMED_OUT, "takes longer than the chart's time_limit")

LONG = 2.0  # [s] of processor time: beyond, a run is timed once, because noise averages out within it


@dataclass(frozen=True)
class Marched:
    """Runs from several starts."""

    runs: tuple[Run, ...]  # of the model, in the order of the points
    failures: tuple[Failure | None, ...]  # the failure of each
    core_seconds: float  # processor time of all of them [s], without compiling
    simulated: float  # their simulated time together [s]

    @property
    def cost(self) -> float:
        """Return core-seconds for each simulated second of a run."""
        return self.core_seconds / self.simulated if self.simulated > 0.0 else math.nan


def warm_up(job: Job, points: Sequence[dict[str, Any]]) -> None:
    """Compile or load all that a group of runs needs; this does not count as their cost."""
    load_model(job.model).batch(points, job.stepper).advance(1)


def _most_lanes(job: Job) -> int:
    """Return how many runs of a job can advance together, in the lanes of the processor's registers."""
    return load_model(job.model).lanes(job.parameters, job.stepper)


def _lanes_of(point: Point) -> int:
    """Return how many runs of a point advance together: as many as it asks for, or as can."""
    return point.lanes or min(_most_lanes(point.job), point.starts)


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
    job, points : Job, sequence of dict
        With the model and stepper of the runs; flat parameters of each [SI], of one group as batches allow.
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
    """Return a function that ends a march after so much processor time; None without a limit."""
    if math.isinf(seconds):
        return None
    end = time.process_time() + seconds
    return lambda: _TOO_LONG[1] if time.process_time() > end else None


@dataclass(frozen=True)
class Measurement:
    """Result of a point."""

    reason: str  # why it failed; "" where it did not
    # by quantity an array with the starts along the first axis; empty where it failed
    values: dict[str, NDArray[np.float64]] = field(default_factory=dict)
    # core-seconds for each simulated second of a run, the shortest of all repeats; of a run that failed or
    # was given up until then. Of a point that is not timed by one pass, in as many lanes as it has starts.
    cost: float = math.nan
    core_seconds: float = 0.0  # processor time that the first pass took [s]
    simulated: float = 0.0  # simulated time of all starts [s]
    counters: dict[str, float] = field(default_factory=dict)  # work by its name, mean over the starts


def measure(point: Point, scene: Scene, repeats: int, time_limit: float) -> Measurement:
    """Measure a point; a quick run is timed `repeats` times, a run beyond the core-seconds given up."""
    if scene.exact and point.series == "exact":
        return _exact(point, scene)
    job, lanes = point.job, _lanes_of(point)
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
    """Return the runs from which those of a point take over; none where they start by themselves."""
    if scene.lead is None:
        return ()
    job, until = scene.lead.job, scene.lead.until
    return march(job, [start_parameters(job, k) for k in range(runs)], _most_lanes(job), until).runs


def _exact_displacement(point: Point, start: int) -> tuple[Any, NDArray[np.float64]]:
    """Return a run of a point that was not marched, and its exact displacement, (time, probe) [m]."""
    parameters = point.parameters(start)
    model = load_model(point.job.model)
    (run,) = model.batch([parameters], point.job.stepper).runs
    return run, model.exact(parameters, (1 + np.arange(run.samples)) * run.interval)


def _exact(point: Point, scene: Scene) -> Measurement:
    """Measure the model's exact solution in the place of a run."""
    observed = []
    for start in range(point.starts):
        run, displacement = _exact_displacement(point, start)
        columns, strands = _columns(run)
        history = History(displacement[:, columns], strands, run.channel, run.parameters)
        observed.append(observe(history, scene.quantities, whole=True))
    return Measurement("", _stacked(observed))


def _outcome(point: Point, scene: Scene, marched: Marched) -> tuple[str, dict[str, NDArray[np.float64]]]:
    """Return the reason why a point failed, or else its values."""
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
    p, whole = run.parameters, run.done == run.samples
    parameters = {**p, "band_low": band(run)[0]} if whole else p
    return History(np.array(run.displacement)[:, columns], strands, run.channel, parameters)


def _columns(run: Any) -> tuple[list[int], tuple[str, ...]]:
    strands = enumerate(strand_of(probe.label) for probe in run.probes)
    judged = {column: strand for column, strand in strands if strand is not None}
    return list(judged), tuple(judged.values())


def _doubt(name: str, run: Run) -> Failure | None:
    """Return the reason not to trust a run at its end, if its model judges runs."""
    model = load_model(name)
    return run.numerical_doubt(model.judge(run)) if model.is_recorded else None


def _stacked(observed: list[dict[str, NDArray[np.float64]]]) -> dict[str, NDArray[np.float64]]:
    return {name: np.array([values[name] for values in observed]) for name in observed[0]}


def _mean_counters(marched: Marched) -> dict[str, float]:
    each = [run.counters() for run in marched.runs]
    return {name: float(np.mean([counters[name] for counters in each])) for name in each[0]}


def predicted_cost(chart: Chart, point: Point) -> float:
    """Return the core-seconds that a point takes, within its time limit.

    Little is known of methods that choose their step. Not known (nan) of a model without records; an exact
    solution takes next to nothing.
    """
    if point.series == "exact":
        return 0.0
    if not load_model(point.job.model).is_recorded:
        return math.nan
    scene = chart.scene(point.scene)
    batches = math.ceil(point.starts / _lanes_of(point))
    first = _march_cost(point.job, point.until)
    if point.timed:
        first = min(first, chart.time_limit, scene.time_limit)
        first *= 1 + (chart.repeats if first < LONG else 0)
    led = _march_cost(scene.lead.job, scene.lead.until) if scene.lead else 0.0
    return batches * (first + led)


def _march_cost(job: Job, until: float) -> float:
    """Return the core-seconds of a batch up to a time [s]; inf: to its end."""
    whole = float(load_model(job.model).cost(job.parameters, job.stepper))
    return whole * min(until / job.parameters["duration"], 1.0)


def plan_lines(chart: Chart, out: Path) -> Iterator[str]:
    """Yield the lines that describe the measurements of a chart, scene by scene, and their expected cost."""
    check_prospects(chart)
    yield f"chart {chart.job.name} ({chart.source}): {len(chart.scenes)} scenes, {len(chart.points)} points"
    if chart.job.description:
        yield chart.job.description
    rows, total, unknown = [], 0.0, 0
    for scene in chart.scenes:
        points = [point for point in chart.points if point.scene == scene.name]
        costs = [predicted_cost(chart, point) for point in points]
        known = [cost for cost in costs if not math.isnan(cost)]
        unknown += len(costs) - len(known)
        total += sum(known)
        methods = ", ".join(dict.fromkeys(point.series for point in points if point.timed))
        cells = str(len(points)), str(sum(point.starts for point in points))
        rows.append([scene.name, *cells, short(sum(known)) if any(known) else "not known", methods])
    yield from columns([["scene", "points", "runs", "core-s", "methods"], *rows])
    beside = f"; not known of {unknown} points" if unknown else ""
    yield f"estimated cost: {core_time_in_words(total)}, by methods that choose their step roughly{beside}"


def check_prospects(chart: Chart) -> None:
    """Check that the models record the judged quantities, have the exact solution if used, and the lanes.

    Raises
    ------
    InputError
        If one does not.
    """
    for scene in chart.scenes:
        where = f"{chart.source}: [chart.scenes.{scene.name}]"
        (point,) = chart.points_of(scene.name, Role.REFERENCE)
        if scene.exact:
            _check_exact(point, where)
        models = dict.fromkeys(p.job.model for p in chart.points if p.scene == scene.name)
        _check_channels(models, scene, where)
        if scene.lead is not None:
            _check_lead(point, where)
    for point in chart.points:
        most = _most_lanes(point.job)
        if point.lanes > most:
            where = f"{chart.source}: [chart.methods.{point.series}] lanes"
            raise mismatch(where, f"at most {most} with stepper {point.job.stepper}", f"{point.lanes}")


def _check_exact(point: Point, where: str) -> None:
    if not load_model(point.job.model).has_exact:
        found = f"{point.job.model}, which has none"
        raise mismatch(f"{where} reference", "a model with an exact solution", found)
    try:
        _exact_displacement(point, 0)
    except InputError as error:
        raise InputError(f"{where} reference: {error}") from error


def _check_lead(point: Point, where: str) -> None:
    if not load_model(point.job.model).takes_over:
        raise mismatch(f"{where} lead", "a model whose runs can take over from others", point.job.model)


def _check_channels(models: Iterable[str], scene: Scene, where: str) -> None:
    needed = channels_needed(scene.quantities)
    if scene.exact and needed:
        raise mismatch(f"{where} quantities", "those that an exact solution has", f"channel {needed[0]}")
    for channel, model in product(needed, models):
        if channel not in load_model(model).channels:
            raise mismatch(f"{where} quantities", f"a model that records {channel}", model)
