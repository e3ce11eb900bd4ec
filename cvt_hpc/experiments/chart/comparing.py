"""Measurements against their reference: errors, their meaning, and the cheapest sufficient method."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.experiments.chart.measuring import Measurement
from cvt_hpc.experiments.chart.plan import Chart, Point, Quantity, Role, Scene

Array = NDArray[np.float64]

_OF_ONE_STRAND = ("frequency", "growth_rate")  # judged on the strand that vibrates most in the reference


@dataclass(frozen=True)
class Result:
    """A point with its errors."""

    point: Point
    measurement: Measurement
    # by quantity; nan where it was not measured or has no meaning, inf where the run lacks what the reference
    # has (a frequency, an onset). That of a reference is its own estimated error.
    errors: dict[str, float]
    # pooled value by quantity [SI], that of the stronger strand where there are two; none of a trajectory
    values: dict[str, float]
    # quantities whose error is below the reference's own: the true error is only known to be below that
    below: frozenset[str] = frozenset()
    chosen: bool = False  # whether this is the cheapest point of its scene that meets all tolerances


@dataclass(frozen=True)
class Comparison:
    """All results of a scene."""

    scene: Scene  # which one
    reference: Result  # its errors are its own
    # methods, choices: against the reference, and against the base of the error budget
    methods: tuple[Result, ...]
    choices: tuple[Result, ...]
    # all methods of the chart by name, so that each has the same colour in all pictures
    series: tuple[str, ...]
    base: str  # the point that choices are compared with; "" where there are none
    shown: tuple[str, ...]  # quantities by which choices are judged
    verdict: str  # the chosen method and the criterion, or the reason why none was chosen

    @property
    def results(self) -> tuple[Result, ...]:
        """Return all results: of the reference, of the methods, of the choices."""
        return (self.reference, *self.methods, *self.choices)


def compare(chart: Chart, measurements: Mapping[str, Measurement]) -> tuple[Comparison, ...]:
    """Return the results of all scenes, from measurements by the name of the point."""
    return tuple(_compare_scene(chart, scene, measurements) for scene in chart.scenes)


def _compare_scene(chart: Chart, scene: Scene, measurements: Mapping[str, Measurement]) -> Comparison:
    (point,) = chart.points_of(scene.name, Role.REFERENCE)
    reference = measurements[point.name]
    own = _own_errors(chart, scene, reference, measurements)
    judged = Result(point, reference, own, _pooled_values(scene, reference, reference))
    methods = [
        _judge(point, measurements[point.name], reference, scene, own)
        for point in chart.points_of(scene.name, Role.METHOD)
    ]
    methods, verdict = choose(scene, own, methods)
    for known in chart.points_of(scene.name, Role.REFERENCE, Role.COARSER):
        if reason := measurements[known.name].reason:
            setting = known.setting_in_words
            verdict = f"none can be chosen: the reference failed at {setting}: {reason}"
    choices: tuple[Result, ...] = ()
    series = tuple(dict.fromkeys(p.series for p in chart.points if p.role is Role.METHOD))
    label = ""
    for base in chart.points_of(scene.name, Role.BASE):
        label, against = base.label, measurements[base.name]
        choices = tuple(
            _judge(point, measurements[point.name], against, scene, {})
            for point in chart.points_of(scene.name, Role.CHOICE)
        )
    return Comparison(scene, judged, tuple(methods), choices, series, label, chart.budgeted, verdict)


def _judge(
    point: Point, measurement: Measurement, reference: Measurement, scene: Scene, own: Mapping[str, float]
) -> Result:
    errors = {q.name: error(q, measurement, reference) for q in scene.quantities}
    # quantities that the reference knows exactly, as a rule whether it vibrates, are below nothing
    below = frozenset(name for name, value in errors.items() if 0.0 < own.get(name, 0.0) >= value)
    return Result(point, measurement, errors, _pooled_values(scene, measurement, reference), below)


def _own_errors(
    chart: Chart, scene: Scene, reference: Measurement, measurements: Mapping[str, Measurement]
) -> dict[str, float]:
    """Return errors of the reference: its distance from the coarser one, and the scatter over starts.

    For an error in proportion to the step, or to the step and to cells that are coarser by the same factor,
    the distance is that of the steps, so many times the error; no higher order is assumed, and none for a
    tolerance. The scatter is the standard error of the difference, start by start: nothing where the two stay
    together, and in a chaotic scene the uncertainty of so few starts.
    """
    if scene.exact:
        return {quantity.name: 0.0 for quantity in scene.quantities}
    (point,) = chart.points_of(scene.name, Role.REFERENCE)
    (coarser,) = chart.points_of(scene.name, Role.COARSER)
    other = measurements[coarser.name]
    share = 1.0 if point.key == "tolerance" else 1.0 / (coarser.setting / point.setting - 1.0)
    return {
        q.name: math.hypot(share * error(q, other, reference), scatter(q, other, reference))
        for q in scene.quantities
    }


def error(quantity: Quantity, measurement: Measurement, reference: Measurement) -> float:
    """Return the error of a quantity, relative to its scale or to the reference.

    It is nan where either does not have it; inf where the reference has a value and the measurement none.
    """
    name = quantity.name
    if name not in measurement.values or name not in reference.values:
        return math.nan
    found = measurement.values[name]
    true = reference.values[name][: len(found)]  # of a choice the first starts may be enough
    if name == "occurrence":
        return float(np.mean(found != true))
    if name == "trajectory":
        spread = true - true.mean(axis=1, keepdims=True)
        return _ratio(_rms(found - true), quantity.scale or _rms(spread))
    found, true = (pool(name, _strand(name, array, reference)) for array in (found, true))
    if not np.isfinite(true).all():
        return math.nan
    if not np.isfinite(found).all():
        return math.inf
    return _ratio(np.linalg.norm(found - true), quantity.scale or np.linalg.norm(true))


def scatter(quantity: Quantity, measurement: Measurement, reference: Measurement) -> float:
    """Return the standard error of `error` from the scatter over the starts; 0 for a single start."""
    name = quantity.name
    if name in ("trajectory", "occurrence") or name not in measurement.values:
        return 0.0
    found, true = (_strand(name, m.values[name], reference) for m in (measurement, reference))
    starts = len(true)
    if starts < 2 or not (np.isfinite(found).all() and np.isfinite(true).all()):
        return 0.0
    deviation = np.std(found - true, axis=0, ddof=1) / math.sqrt(starts)
    return _ratio(np.linalg.norm(deviation), quantity.scale or np.linalg.norm(pool(name, true)))


def pool(name: str, values: Array) -> Array:
    """Return one row for all starts: the rms of amplitudes, the mean of everything else."""
    return np.sqrt(np.mean(values**2, axis=0)) if name == "amplitude" else values.mean(axis=0)


def choose(scene: Scene, own: Mapping[str, float], results: list[Result]) -> tuple[list[Result], str]:
    """Mark the cheapest of the methods' points that meets every tolerance, and describe the choice in words.

    `own` is the error of the reference by quantity: a tolerance below it cannot be judged.
    """
    asked = {q.name: q.tolerance for q in scene.quantities if math.isfinite(q.tolerance)}
    if not asked:
        return results, "none, because no tolerance is asked"
    blunt = [name for name, tolerance in asked.items() if not own[name] <= tolerance]
    if blunt:
        words = ", ".join(f"{name} ({own[name]:.2g} > {asked[name]:.2g})" for name in blunt)
        return results, f"none can be chosen: the reference's own error exceeds the tolerance of {words}"
    good = [r for r in results if all(r.errors[name] <= tolerance for name, tolerance in asked.items())]
    if not good:
        return results, "none meets all tolerances"
    best = min(good, key=lambda result: result.measurement.cost)
    marked = [replace(result, chosen=True) if result is best else result for result in results]
    return (
        marked,
        f"{best.point.label} at {best.point.setting_in_words}, {best.measurement.cost:.3g} core-s/s",
    )


def _strand(name: str, values: Array, reference: Measurement) -> Array:
    """Return the values (starts, strand) of the judged strand, or of all strands where all are judged."""
    if name not in _OF_ONE_STRAND or values.shape[1] == 1:
        return values
    strongest = int(np.argmax(pool("amplitude", reference.values["amplitude"])))
    return values[:, strongest : strongest + 1]


def _pooled_values(scene: Scene, measurement: Measurement, reference: Measurement) -> dict[str, float]:
    found = {}
    for quantity in scene.quantities:
        name = quantity.name
        if name != "trajectory" and name in measurement.values:
            found[name] = float(np.max(pool(name, _strand(name, measurement.values[name], reference))))
    return found


def _rms(values: Array) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _ratio(difference: float | np.floating, size: float | np.floating) -> float:
    if size > 0.0:
        return float(difference / size)
    return 0.0 if difference == 0.0 else math.inf
