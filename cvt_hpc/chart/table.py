"""The results of a chart as a table: for people, and as a small file that can be kept."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from textwrap import shorten
from typing import Any

from cvt_hpc.chart.comparing import Comparison, Result
from cvt_hpc.chart.plan import Role
from cvt_hpc.chart.quantities import KINDS
from cvt_hpc.provenance import origin_lines
from cvt_hpc.tables import columns, number, short

_HEAD = (
    "scene",
    "role",
    "method",
    "stepper",
    "setting",
    "value",
    "chosen",
    "outcome",
    "core_s_per_s",
    "starts",
)

_LONGEST_NOTE = 90  # letters; the whole reason is in the file


def write_table(comparisons: Sequence[Comparison], made: Mapping[str, Any], path: Path) -> None:
    """Write all results as comma-separated values, a row for each point, below their origin."""
    rows = [result for comparison in comparisons for result in _results(comparison)]
    names = [name for name in KINDS if any(name in row.errors for row in rows)]
    counters = list(dict.fromkeys(name for row in rows for name in row.measurement.counters))
    with path.open("w", encoding="utf-8", newline="") as file:
        file.writelines(origin_lines(made))
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([*_HEAD, *_quantity_heads(names), "below_reference", *counters])
        for row in rows:
            writer.writerow([*_head(row), *_quantities(row, names), *_tail(row, counters)])


def table_lines(comparison: Comparison) -> Iterator[str]:
    """Yield the lines that show the results of a scene to people."""
    names = [quantity.name for quantity in comparison.scene.quantities]
    heads = ["method", "", "core-s/s", *(f"{name.replace('_', ' ')} error" for name in names), ""]
    own = [short(comparison.reference.errors[name]) for name in names]
    label, setting = comparison.reference.point.label, comparison.reference.point.setting_in_words
    rows = [heads, [f"reference: {label}", setting, "-", *own, comparison.reference.measurement.reason]]
    rows += [_line(result, names) for result in comparison.methods]
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


def _results(comparison: Comparison) -> tuple[Result, ...]:
    return (comparison.reference, *comparison.methods, *comparison.choices)


def _quantity_heads(names: Sequence[str]) -> Iterator[str]:
    for name in names:
        if name not in ("trajectory", "occurrence"):
            yield f"{name} [{KINDS[name].unit}]"
        yield f"{name}_error"


def _head(result: Result) -> list[str]:
    point, measurement = result.point, result.measurement
    return [
        point.scene,
        "refinement" if point.refines else point.role.value,
        point.label,
        "" if point.series == "exact" else point.job.stepper or "",
        point.key,
        number(point.setting),
        "yes" if result.chosen else "",
        measurement.reason or "done",
        number(measurement.cost, 3),
        str(point.starts),
    ]


def _quantities(result: Result, names: Sequence[str]) -> Iterator[str]:
    for name in names:
        if name not in ("trajectory", "occurrence"):
            yield number(result.values.get(name, math.nan), 6)
        yield number(result.errors.get(name, math.nan), 3)


def _tail(result: Result, counters: Sequence[str]) -> list[str]:
    counts = result.measurement.counters
    return [" ".join(sorted(result.below)), *(number(counts.get(name, math.nan), 8) for name in counters)]


def _line(result: Result, names: Sequence[str]) -> list[str]:
    point = result.point
    return [point.label, point.setting_in_words, _cost(result), *_errors(result, names), _note(result)]


def _cost(result: Result) -> str:
    return short(result.measurement.cost) or "-"


def _errors(result: Result, names: Sequence[str]) -> list[str]:
    return [short(result.errors[name]) + ("*" if name in result.below else "") for name in names]


def _note(result: Result) -> str:
    """Further remarks on a point."""
    if result.measurement.reason:
        return shorten(f"failed: {result.measurement.reason}", _LONGEST_NOTE, placeholder=" ...")
    if result.point.role is Role.CHOICE:
        return "is an error of it" if result.point.refines else ""
    return "<- chosen" if result.chosen else ""
