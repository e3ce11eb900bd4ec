"""A chart made: all points measured, compared, written and drawn.

The output folder keeps the origin of a chart and the points measured so far. Its results are a dataset, with
all that is needed to repeat it, and a table: for people, and as a small file that can be kept.
"""

import json
import logging
import math
import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from contextlib import closing
from dataclasses import fields
from functools import partial
from math import nan
from multiprocessing.synchronize import Lock
from pathlib import Path
from textwrap import shorten
from typing import Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.figures import draw
from cvt_hpc.experiments.chart.comparing import Comparison, Result, compare
from cvt_hpc.experiments.chart.measuring import Measurement, check_prospects, measure, predicted_cost
from cvt_hpc.experiments.chart.plan import Chart, Point, Role
from cvt_hpc.experiments.chart.quantities import KINDS
from cvt_hpc.experiments.chart.scene_drawing import budget_figure, scene_figure
from cvt_hpc.experiments.outcome import Outcome, Tell
from cvt_hpc.experiments.parts import PartsFolder
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.storage.archives import Arrays
from cvt_hpc.storage.files import write_rows
from cvt_hpc.storage.netcdf import VOLATILE, attributes, global_attributes, store
from cvt_hpc.storage.output_folder import Kind
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.study.ranks.progress import Steps
from cvt_hpc.tables import columns, number, short

_FIRST: dict[str, Callable[[Result], str]] = {  # columns that all charts have
    "scene": lambda r: r.point.scene,
    "role": lambda r: "refinement" if r.point.refines else r.point.role.value,
    "method": lambda r: r.point.label,
    "stepper": lambda r: "" if r.point.series == "exact" else r.point.job.stepper or "",
    "setting": lambda r: r.point.key,
    "value": lambda r: number(r.point.setting),
    "chosen": lambda r: "yes" if r.chosen else "",
    "outcome": lambda r: r.measurement.reason or "done",
    "core_s_per_s": lambda r: number(r.measurement.cost, 3),
    "starts": lambda r: str(r.point.starts),
}
_LONGEST_NOTE = 90  # letters; the whole reason is in the file

_PLAIN = tuple(f.name for f in fields(Measurement) if f.name != "values")

CHOSEN = "cheapest point of its scene that meets all tolerances"
_REFINES = "whether a choice is nearer to the truth than the base"
_Variable = tuple[str, np.ndarray, dict[str, Any]]

_COMPILING = "cvt_hpc.kernels"  # the logger of messages about it


class ChartFolder(PartsFolder[Chart]):
    """The output folder of a chart. Its parts are points by name."""

    kind = Kind("chart", "chart.json", ".chart.lock", "cvt_hpc chart 2", ("points",))

    def is_picture(self, name: str, job: dict[str, Any]) -> bool:
        """Return whether a file of this name is a picture of a chart."""
        return name in {f"{scene}.png" for scene in (*job["scenes"], "budget")}


def make(chart: Chart, out: Path, *, fresh: bool, tell: Tell) -> Outcome:
    """Measure the points that are missing, and write table, dataset and pictures; see `experiment_kinds`.

    Points that are not timed are measured together by as many processes as there are cores, others alone.

    Raises
    ------
    InputError
        If the folder holds another job or is in use, the models do not record the requested quantities, or
        the system refuses.
    """
    check_prospects(chart)
    folder = ChartFolder(out, chart)
    with folder.claimed(chart, fresh=fresh):
        measurements = _fill(chart, folder, len(os.sched_getaffinity(0)), tell)
        comparisons = compare(chart, measurements)
        dataset = _chart_dataset(chart, comparisons, folder.parts.makers)
        write_table(comparisons, dataset.attrs, folder.table)
        store(dataset, folder.dataset)
        pictures = [draw(partial(scene_figure, c), out / f"{c.scene.name}.png") for c in comparisons]
        pictures += [draw(partial(budget_figure, c), out / "budget.png") for c in comparisons if c.choices]
    lines = [line for comparison in comparisons for line in (*table_lines(comparison), "")]
    files = [("table", folder.table), ("dataset", folder.dataset), *(("picture", path) for path in pictures)]
    return Outcome(lines, files)


def _fill(
    chart: Chart, folder: ChartFolder, processes: int, tell: Callable[[str], None]
) -> dict[str, Measurement]:
    """Measure the points that the folder does not hold yet, and return all by name."""
    loaded = {point.name: folder.parts.load(point.name, _restored) for point in chart.points}
    folder.parts.warn_of_others(folder.dataset)
    measurements = {name: found for name, found in loaded.items() if found is not None}
    missing = [point for point in chart.points if point.name not in measurements]
    missing.sort(key=lambda point: point.timed)  # the order in which they are done
    together = min(processes, sum(not point.timed for point in missing)) or 1
    costs = [predicted_cost(chart, point) / (1 if point.timed else together) for point in missing]
    with closing(Steps(costs, len(measurements), "point", tell)) as steps:
        for point, measurement in _measure_all(chart, missing, processes):
            plain = {key: getattr(measurement, key) for key in _PLAIN}
            folder.parts.save(point.name, plain, measurement.values)
            measurements[point.name] = measurement
            cost = f"{measurement.core_seconds:.3g} core-s"
            ended = f"failed: {measurement.reason}" if measurement.reason else cost
            steps.ended(f"{point.name}: {ended}", failed=bool(measurement.reason))
    return measurements


def _restored(plain: Any, values: Arrays) -> Measurement:
    return Measurement(values=values, **plain)


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


def _chart_dataset(
    chart: Chart, comparisons: Sequence[Comparison], makers: Sequence[dict[str, Any]]
) -> xr.Dataset:
    """Return errors, values, cost and work of each point, and how it ended, along the dimension `point`."""
    rows = [result for comparison in comparisons for result in comparison.results]
    variables: dict[str, Any] = _descriptions(rows) | _costs(rows)
    for name in KINDS:
        if not any(name in row.errors for row in rows):
            continue
        words = name.replace("_", " ")
        errors = [row.errors.get(name, np.nan) for row in rows]
        variables[f"{name}_error"] = _along(errors, "1", f"{words} error", "of a reference its own")
        below = np.array([name in row.below for row in rows], "i1")
        text = "whether the error is below the reference's own"
        variables[f"{name}_below_reference"] = _flag(below, f"{words} below the reference", text)
        if name not in ("trajectory", "occurrence"):
            values = [row.values.get(name, np.nan) for row in rows]
            variables[name] = _along(values, KINDS[name].unit, words, "pooled over the starts")
    points = ("point", np.array([row.point.name for row in rows], dtype=object), attributes("point"))
    return xr.Dataset(variables, {"point": points}, _attributes(chart, comparisons, makers))


def _descriptions(rows: Sequence[Result]) -> dict[str, Any]:
    texts = {
        "scene": ("", lambda r: r.point.scene),
        "role": ("what the point was measured for", lambda r: r.point.role.value),
        "method": ("method or choice", lambda r: r.point.label),
        "stepper": ("", lambda r: r.point.job.stepper),
        "reason": ("why the point failed", lambda r: r.measurement.reason),
    }
    variables: dict[str, Any] = {
        name: ("point", np.array([read(row) for row in rows], dtype=object), attributes(name, comment=text))
        for name, (text, read) in texts.items()
    }
    for key, unit in (("step", "s"), ("tolerance", "1")):
        settings = [row.point.setting if row.point.key == key else np.nan for row in rows]
        variables[key] = _along(settings, unit, key, "of the method")
    variables["chosen"] = _flag([r.chosen for r in rows], "chosen", CHOSEN)
    variables["failed"] = _flag([bool(r.measurement.reason) for r in rows], "failed", "see reason")
    variables["refines"] = _flag([r.point.refines for r in rows], "refines", _REFINES)
    return variables


def _costs(rows: Sequence[Result]) -> dict[str, Any]:
    found = [row.measurement for row in rows]
    least, first = f"of methods the least of all repeats; {VOLATILE}", f"of the first pass; {VOLATILE}"
    variables = {
        "core_seconds_per_simulated_second": _along([m.cost for m in found], "1", "cost of a run", least),
        "core_seconds": _along([m.core_seconds for m in found], "s", "processor time", first),
        "simulated_seconds": _along([m.simulated for m in found], "s", "simulated time", "of a run"),
        "starts": _along([row.point.starts for row in rows], "1", "starts", "number of pooled runs"),
    }
    for name in dict.fromkeys(name for row in rows for name in row.measurement.counters):
        counts = [row.measurement.counters.get(name, np.nan) for row in rows]
        variables[f"work_{name}"] = _along(counts, "1", name.replace("_", " "), "mean over the starts")
    return variables


def _along(values: Sequence[float], units: str, long_name: str, comment: str) -> _Variable:
    return "point", np.array(values, float), attributes(long_name, units, comment)


def _flag(values: Sequence[bool] | np.ndarray, long_name: str, comment: str) -> _Variable:
    flags = {"flag_values": np.array([0, 1], "i1"), "flag_meanings": "no yes"}
    return "point", np.array(values, "i1"), attributes(long_name, comment=comment) | flags


def _attributes(
    chart: Chart, comparisons: Sequence[Comparison], makers: Sequence[dict[str, Any]]
) -> dict[str, str]:
    return {
        **global_attributes(chart.job, chart.resolved(), "speed against accuracy", makers=makers),
        "job_fingerprint": chart.fingerprint(),
        "verdicts": json.dumps({c.scene.name: c.verdict for c in comparisons}),
        "machine": json.dumps([*{str(m["machine"]): m["machine"] for m in makers}.values()]),
    }


def write_table(comparisons: Sequence[Comparison], made: Mapping[str, Any], path: Path) -> None:
    """Write all results as comma-separated values, a row for each point, below their origin."""
    results = [result for comparison in comparisons for result in comparison.results]
    columns = {head: [read(result) for result in results] for head, read in _FIRST.items()}
    for name in (name for name in KINDS if any(name in result.errors for result in results)):
        if name not in ("trajectory", "occurrence"):
            head = f"{name} [{KINDS[name].unit}]"
            columns[head] = [number(result.values.get(name, nan), 6) for result in results]
        columns[f"{name}_error"] = [number(result.errors.get(name, nan), 3) for result in results]
    columns["below_reference"] = [" ".join(sorted(result.below)) for result in results]
    for name in dict.fromkeys(name for result in results for name in result.measurement.counters):
        columns[name] = [number(result.measurement.counters.get(name, nan), 8) for result in results]
    write_rows(path, list(columns), zip(*columns.values(), strict=True), origin_lines(made))


def table_lines(comparison: Comparison) -> Iterator[str]:
    """Yield the lines that show the results of a scene to people."""
    names = [quantity.name for quantity in comparison.scene.quantities]
    heads = ["method", "", "core-s/s", *(f"{name.replace('_', ' ')} error" for name in names), ""]
    own = [short(comparison.reference.errors[name]) for name in names]
    label, setting = comparison.reference.point.label, comparison.reference.point.setting_in_words
    rows = [heads, [f"reference: {label}", setting, "-", *own, comparison.reference.measurement.reason]]
    rows += [
        [r.point.label, r.point.setting_in_words, _cost(r), *_errors(r, names), _note(r)]
        for r in comparison.methods
    ]
    yield comparison.scene.title
    yield from columns(rows)
    if any(result.below for result in comparison.methods):
        yield "  *: no larger than the reference's own error"
    yield f"  chosen: {comparison.verdict}"
    if comparison.choices:
        shown = comparison.shown
        words = [name.replace("_", " ") for name in shown]
        rows = [[f"error budget, against {comparison.base}", "core-s/s", *words, ""]]
        rows += [[r.point.label, _cost(r), *_errors(r, shown), _note(r)] for r in comparison.choices]
        yield from columns(rows)


def _cost(result: Result) -> str:
    return short(result.measurement.cost) or "-"


def _errors(result: Result, names: Sequence[str]) -> list[str]:
    return [short(result.errors[name]) + ("*" if name in result.below else "") for name in names]


def _note(result: Result) -> str:
    """Return further remarks on a point."""
    if result.measurement.reason:
        return shorten(f"failed: {result.measurement.reason}", _LONGEST_NOTE, placeholder=" ...")
    if result.point.role is Role.CHOICE:
        return "is an error of it" if result.point.refines else ""
    return "<- chosen" if result.chosen else ""
