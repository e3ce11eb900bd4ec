"""The results of a chart as a table: for people, and as a small file that can be kept."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from math import nan
from pathlib import Path
from textwrap import shorten
from typing import Any

from cvt_hpc.chart.comparing import Comparison, Result
from cvt_hpc.chart.plan import Role
from cvt_hpc.chart.quantities import KINDS
from cvt_hpc.files import write_rows
from cvt_hpc.provenance import origin_lines
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
    """Further remarks on a point."""
    if result.measurement.reason:
        return shorten(f"failed: {result.measurement.reason}", _LONGEST_NOTE, placeholder=" ...")
    if result.point.role is Role.CHOICE:
        return "is an error of it" if result.point.refines else ""
    return "<- chosen" if result.chosen else ""
