"""Expected cost of a chart, by the cost models of its models.

Requirements of a chart on its models, checked before anything is computed.
"""

import math
from collections.abc import Iterable, Iterator
from itertools import product

from cvt_hpc.chart.measuring import LONG, exact_displacement, lanes_of, most_lanes
from cvt_hpc.chart.plan import Chart, Point, Role, Scene
from cvt_hpc.chart.quantities import channels_needed
from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.job import Job
from cvt_hpc.job.summary import core_time_in_words
from cvt_hpc.models.contract import load_model
from cvt_hpc.tables import columns, short


def predicted_cost(chart: Chart, point: Point) -> float:
    """Core-seconds that a point takes, at most as many as its time limit allows.

    Little is known of methods that choose their step. Not known (nan) of a model without records; an exact
    solution takes next to nothing.

    Parameters
    ----------
    chart : Chart
        The chart.
    point : Point
        One of its points.
    """
    if point.series == "exact":
        return 0.0
    if not load_model(point.job.model).is_recorded:
        return math.nan
    scene = chart.scene(point.scene)
    batches = math.ceil(point.starts / lanes_of(point))
    first = _march_cost(point.job, point.until)
    if point.timed:
        first = min(first, chart.time_limit, scene.time_limit)
        first *= 1 + (chart.repeats if first < LONG else 0)
    led = _march_cost(scene.lead.job, scene.lead.until) if scene.lead else 0.0
    return batches * (first + led)


def _march_cost(job: Job, until: float) -> float:
    """Core-seconds of a batch up to a time [s]; inf: to its end."""
    whole = float(load_model(job.model).cost(job.parameters, job.stepper))
    return whole * min(until / job.parameters["duration"], 1.0)


def plan_lines(chart: Chart) -> Iterator[str]:
    """Yield the lines that describe the measurements of a chart, scene by scene, and their expected cost."""
    yield f"chart {chart.name} ({chart.source}): {len(chart.scenes)} scenes, {len(chart.points)} points"
    if chart.description:
        yield chart.description
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
        most = most_lanes(point.job)
        if point.lanes > most:
            where = f"{chart.source}: [chart.methods.{point.series}] lanes"
            raise mismatch(where, f"at most {most} with stepper {point.job.stepper}", f"{point.lanes}")


def _check_exact(point: Point, where: str) -> None:
    if not load_model(point.job.model).has_exact:
        found = f"{point.job.model}, which has none"
        raise mismatch(f"{where} reference", "a model with an exact solution", found)
    try:
        exact_displacement(point, 0)
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
