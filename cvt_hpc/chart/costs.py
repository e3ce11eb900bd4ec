"""Expected cost of a chart, by the cost models of its models."""

import math
from collections.abc import Iterator

from cvt_hpc.chart.measuring import LONG
from cvt_hpc.chart.plan import Chart, Point
from cvt_hpc.chart.timed_runs import lanes_of
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
