"""A chart made: all points measured, compared, written and drawn."""

import logging
import math
import multiprocessing
import os
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import closing
from dataclasses import dataclass
from multiprocessing.synchronize import Lock
from pathlib import Path

from cvt_hpc.chart.budget_drawing import draw_budget
from cvt_hpc.chart.checks import check_prospects
from cvt_hpc.chart.comparing import Comparison, compare
from cvt_hpc.chart.costs import predicted_cost
from cvt_hpc.chart.dataset import chart_dataset
from cvt_hpc.chart.measuring import Measurement, measure
from cvt_hpc.chart.plan import Chart, Point
from cvt_hpc.chart.scene_drawing import draw_scene
from cvt_hpc.chart.store import ChartFolder
from cvt_hpc.chart.table import write_table
from cvt_hpc.files import written_aside
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.netcdf import write_netcdf
from cvt_hpc.study.ranks.progress import Steps

_COMPILING = "cvt_hpc.kernels"  # the logger of messages about it


@dataclass(frozen=True)
class ChartReport:
    """Results of a chart.

    Attributes
    ----------
    comparisons : tuple of Comparison
        The results, scene by scene.
    table, dataset : Path
        The files that hold them.
    pictures : tuple of Path
        One for each scene, and that of the error budget.
    """

    comparisons: tuple[Comparison, ...]
    table: Path
    dataset: Path
    pictures: tuple[Path, ...]


def make_chart(
    chart: Chart,
    out: Path | None = None,
    *,
    fresh: bool = False,
    processes: int | None = None,
    tell: Callable[[str], None] = lambda line: None,
) -> ChartReport:
    """Measure the missing points, and write table, dataset and pictures.

    Parameters
    ----------
    chart : Chart
        The chart to measure.
    out : Path, optional
        Output folder; out/<job name> by default.
    fresh : bool
        Throw earlier results of the folder away.
    processes : int, optional
        How many runs that are not timed may go on together; as many as there are cores by default. Timed
        runs are always alone.
    tell : callable
        Given a line for each point that was measured, with the time to go.

    Raises
    ------
    InputError
        If the folder holds another job or is in use, the models do not record the requested quantities, or
        the system refuses.
    """
    check_prospects(chart)
    folder = ChartFolder(Path(out) if out is not None else Path("out") / chart.name, chart)
    with folder.claimed(chart, fresh=fresh):
        measurements = _fill(chart, folder, processes or len(os.sched_getaffinity(0)), tell)
        comparisons = compare(chart, measurements)
        dataset = chart_dataset(chart, comparisons, folder.points.makers)
        write_table(comparisons, dataset.attrs, folder.table)
        with written_aside(folder.dataset) as aside:
            write_netcdf(dataset, aside)
        pictures = [draw_scene(c, folder.picture(c.scene.name)) for c in comparisons]
        pictures += [draw_budget(c, folder.picture("budget")) for c in comparisons if c.choices]
    return ChartReport(comparisons, folder.table, folder.dataset, tuple(pictures))


def _fill(
    chart: Chart, folder: ChartFolder, processes: int, tell: Callable[[str], None]
) -> dict[str, Measurement]:
    """Measure the points that the folder does not hold yet, and return all by name."""
    loaded = {point.name: folder.load_point(point.name) for point in chart.points}
    folder.points.warn_of_others(folder.dataset)
    measurements = {name: found for name, found in loaded.items() if found is not None}
    missing = [point for point in chart.points if point.name not in measurements]
    missing.sort(key=lambda point: point.timed)  # the order in which they are done
    together = min(processes, sum(not point.timed for point in missing)) or 1
    costs = [predicted_cost(chart, point) / (1 if point.timed else together) for point in missing]
    with closing(Steps(costs, len(measurements), "point", tell)) as steps:
        for point, measurement in _measure_all(chart, missing, processes):
            folder.save_point(point.name, measurement)
            measurements[point.name] = measurement
            cost = f"{measurement.core_seconds:.3g} core-s"
            ended = f"failed: {measurement.reason}" if measurement.reason else cost
            steps.ended(f"{point.name}: {ended}", failed=bool(measurement.reason))
    return measurements


def _measure_all(chart: Chart, points: list[Point], processes: int) -> Iterator[tuple[Point, Measurement]]:
    """Yield each point as it is done: those without timing first, several together, then the others alone."""
    untimed = [point for point in points if not point.timed]
    if processes > 1 and len(untimed) > 1:
        yield from _measure_together(chart, untimed, processes)
    else:
        yield from ((point, _measure(chart, point)) for point in untimed)
    yield from ((point, _measure(chart, point)) for point in points if point.timed)


def _measure_together(
    chart: Chart, points: list[Point], processes: int
) -> Iterator[tuple[Point, Measurement]]:
    # spawned, not forked: a forked child inherits locks of the compiler's and the drawing library's threads
    context = multiprocessing.get_context("spawn")
    told = context.Lock(), logging.getLogger(_COMPILING).level
    pool = ProcessPoolExecutor(processes, context, _tell_compiling, told)
    try:
        pending = {pool.submit(_measure, chart, point): point for point in points}
        for future in as_completed(pending):
            yield pending[future], future.result()
    finally:
        pool.shutdown(cancel_futures=True)


def _tell_compiling(turn: Lock, level: int) -> None:
    """Let one of several processes, which all compile the same, report it as their parent would."""
    first = turn.acquire(block=False)
    logging.basicConfig(format="cvt-hpc: %(message)s")
    logging.getLogger(_COMPILING).setLevel(level if first else logging.ERROR)


def _measure(chart: Chart, point: Point) -> Measurement:
    scene = chart.scene(point.scene)
    limit = min(chart.time_limit, scene.time_limit) if point.timed else math.inf
    # threads of the linear algebra wait for each other in loops, which would count as a method's own time
    with one_thread():
        return measure(point, scene, chart.repeats, limit)
