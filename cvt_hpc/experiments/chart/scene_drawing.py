"""The picture of a scene: error against cost.

The text under the panels names the chosen method, and points that are not drawn, with the reason. The picture
of an error budget shows the effect of each choice.
"""

import math
import re
from collections.abc import Sequence
from functools import partial
from textwrap import wrap

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import LogFormatter

from cvt_hpc.analysis import figures
from cvt_hpc.experiments.chart.comparing import Comparison, Result
from cvt_hpc.experiments.chart.plan import Quantity
from cvt_hpc.experiments.chart.quantities import KINDS

_LINE_LENGTH = 104  # [letters]
_LARGEST_ERROR = 10.0  # relative: errors beyond are named, and not drawn
_DETAILS = re.compile(r" \([^()]*\)$")

GREY = "#a8a8a8"
_COLUMNS = 2
_PANEL_HEIGHT = 2.55  # [inch]
_LINE_HEIGHT = 0.16  # [inch], of the text under the panels

_ROW_HEIGHT = 0.24  # [inch], of the budget


def scene_figure(comparison: Comparison) -> Figure:
    """Compose the picture of a scene: error against cost, a panel for each quantity; within STYLE."""
    quantities = [q for q in comparison.scene.quantities if q.name != "occurrence"]
    columns = min(_COLUMNS, len(quantities))
    rows = math.ceil(len(quantities) / columns)
    series = _series(comparison.methods)
    lines = notes(comparison)
    legend_rows = math.ceil((len(series) + 4) / 3)
    text_height = _LINE_HEIGHT * (len(lines) + 0.5)
    height = 0.5 + _PANEL_HEIGHT * rows + 0.19 * legend_rows + text_height
    figure = Figure((figures.WIDTH, height), layout="constrained")
    figure.suptitle(
        figures.balanced(comparison.scene.title, 64) + "\nerror against cost, lower left is better"
    )
    ratios = [_PANEL_HEIGHT] * rows + [text_height]
    grid = figure.add_gridspec(rows + 1, columns, height_ratios=ratios)
    first: Axes | None = None
    for k, quantity in enumerate(quantities):
        axes = figure.add_subplot(grid[divmod(k, columns)], sharey=first)
        first = first or axes
        _draw_panel(axes, quantity, comparison, series)
        if k % columns == 0:
            axes.set_ylabel("core-seconds per\nsimulated second")
        else:
            axes.tick_params(labelleft=False)
    below = figure.add_subplot(grid[rows, :])
    below.set_axis_off()
    below.text(0.0, 1.0, "\n".join(lines), va="top", fontsize=7.5, transform=below.transAxes)
    figure.legend(handles=_legend(comparison, series), ncols=2, **figures.LEGEND)
    return figure


def _draw_panel(
    axes: Axes, quantity: Quantity, comparison: Comparison, series: dict[str, list[Result]]
) -> None:
    own = comparison.reference.errors[quantity.name]
    axes.set(xscale="log", yscale="log")
    axes.yaxis.set_major_formatter(LogFormatter(labelOnlyBase=False))
    axes.yaxis.set_minor_formatter(LogFormatter(labelOnlyBase=False))
    floor = _floor(quantity, comparison)
    for name, results in series.items():
        k = comparison.series.index(name)
        drawn = [r for r in results if _is_drawn(r, quantity.name)]
        x = [max(r.errors[quantity.name], floor) for r in drawn]
        y = [r.measurement.cost for r in drawn]
        axes.plot(x, y, **figures.line_style(k), label=results[0].point.label)
        for result, error, cost in zip(drawn, x, y, strict=True):
            _mark_point(axes, result, quantity.name, error, cost, k)
    _limit(axes, quantity, own, floor)
    axes.set_title(_heading(quantity), loc="left", pad=3)
    axes.set_xlabel(_error_label(quantity))
    axes.grid(which="major", color="#e4e4e4", lw=0.6)
    axes.set_axisbelow(True)


def _mark_point(axes: Axes, result: Result, name: str, error: float, cost: float, k: int) -> None:
    if name in result.below:
        hollow = {**figures.line_style(k), "ls": "", "mfc": "white", "mec": GREY}
        axes.plot(error, cost, **hollow, gid="below")
    if result.errors.get("occurrence", 0.0) > 0.0:
        axes.plot(error, cost, marker="x", ms=7, color="black", ls="", gid="occurrence")
    if result.chosen:
        axes.plot(error, cost, marker="o", ms=11, mfc="none", mec="black", ls="", gid="chosen")


def _limit(axes: Axes, quantity: Quantity, own: float, floor: float) -> None:
    """Draw the limits of the error's axis, the tolerance, and the reference's own error."""
    drawn = [x for line in axes.lines for x in np.atleast_1d(line.get_xdata())]
    marks = [x for x in (own, quantity.tolerance) if 0.0 < x < math.inf]
    low = figures.set_error_axis(axes, [*drawn, *marks])
    if 0.0 < own < math.inf:
        axes.axvspan(
            low, own, facecolor="#f3f3f3", edgecolor="#d0d0d0", hatch="////", lw=0, zorder=0, gid="reference"
        )
    if quantity.tolerance < math.inf:
        axes.axvline(quantity.tolerance, color="black", ls="--", lw=0.9, gid="tolerance")


def _series(results: Sequence[Result]) -> dict[str, list[Result]]:
    """Return the methods by name, in the job's order, each along its setting."""
    series: dict[str, list[Result]] = {}
    for result in results:
        series.setdefault(result.point.series, []).append(result)
    return {name: sorted(found, key=lambda r: r.point.setting) for name, found in series.items()}


def _legend(comparison: Comparison, series: dict[str, list[Result]]) -> list[Line2D | Patch]:
    handles: list[Line2D | Patch] = [
        Line2D([], [], **figures.line_style(comparison.series.index(name)), label=results[0].point.label)
        for name, results in series.items()
        if any(not result.measurement.reason for result in results)
    ]
    if not comparison.scene.exact:
        grey = {"facecolor": "#f3f3f3", "edgecolor": "#d0d0d0", "hatch": "////"}
        handles.append(Patch(**grey, label="below the reference's error"))
    handles.append(Line2D([], [], color="black", ls="--", lw=0.9, label="tolerance"))
    handles.append(
        Line2D(
            [], [], ls="", marker="o", ms=9, mfc="none", mec="black", label="cheapest within all tolerances"
        )
    )
    if any(result.errors.get("occurrence", 0.0) > 0.0 for result in comparison.methods):
        handles.append(Line2D([], [], ls="", marker="x", color="black", label="occurrence differs"))
    return handles


def _is_drawn(result: Result, name: str) -> bool:
    return not result.measurement.reason and result.errors[name] <= _LARGEST_ERROR


def _floor(quantity: Quantity, comparison: Comparison) -> float:
    """Return the place of an error of 0: a little left of the smallest one."""
    errors = [r.errors[quantity.name] for r in comparison.methods if _is_drawn(r, quantity.name)]
    return min((e for e in errors if e > 0.0), default=1e-3) / figures.MARGIN


def _heading(quantity: Quantity) -> str:
    title = KINDS[quantity.name].title
    if quantity.name == "trajectory":
        return f"{title}, {1e3 * quantity.since:g}-{1e3 * quantity.until:g} ms"
    return title


def _error_label(quantity: Quantity) -> str:
    """Return the label at the axis of a quantity's errors."""
    if quantity.scale == 0.0:
        return "relative error"
    factor, unit = (
        (1e6, "µm") if KINDS[quantity.name].unit == "m" else figures.display_unit(KINDS[quantity.name].unit)
    )
    return f"error / {factor * quantity.scale:g} {unit}"


def notes(comparison: Comparison) -> list[str]:
    """Return the text under the panels: the chosen method, and reasons for points that are not drawn."""
    point = comparison.reference.point
    known = f"{point.label} at {point.setting_in_words}; its own error from a coarser one"
    lines = [f"reference: {'exact solution' if comparison.scene.exact else known}"]
    lines.append(f"cheapest within all tolerances: {comparison.verdict}")
    for why, methods in _omitted(comparison).items():
        each = "; ".join(f"{label} ({', '.join(settings)})" for label, settings in methods.items())
        lines.append(f"omitted: {why}: {each}")
    return [
        part
        for line in lines
        for part in wrap(figures.with_units(line), _LINE_LENGTH, subsequent_indent="    ")
    ]


def _omitted(comparison: Comparison) -> dict[str, dict[str, list[str]]]:
    """Return the points that are not drawn in all panels: reason -> method -> settings."""
    omitted: dict[str, dict[str, list[str]]] = {}
    for result in comparison.methods:
        for why in _reasons(result):
            methods = omitted.setdefault(why, {})
            methods.setdefault(result.point.label, []).append(result.point.setting_in_words)
    return omitted


def _reasons(result: Result) -> list[str]:
    """Return reasons for a point that is not drawn, in general words; the table has the details."""
    if reason := result.measurement.reason:
        return [f"failed, {_DETAILS.sub('', reason.partition(': ')[2])}"]
    errors = {name.replace("_", " "): error for name, error in result.errors.items()}
    reasons = [f"no {name}" for name, error in errors.items() if math.isinf(error)]
    if any(_LARGEST_ERROR < error < math.inf for error in errors.values()):
        reasons.append(f"error of more than {_LARGEST_ERROR:.0%}")
    return reasons


def budget_figure(comparison: Comparison) -> Figure:
    """Compose the picture of the error of each choice against the base; to be called within STYLE."""
    quantities = [
        q for q in comparison.scene.quantities if q.name in comparison.shown and q.name != "occurrence"
    ]
    choices = _in_order(comparison.choices, quantities)
    figure = Figure((figures.WIDTH, 1.3 + _ROW_HEIGHT * len(choices)), layout="constrained")
    figure.suptitle(f"{comparison.scene.title}: error budget, against {comparison.base}")
    panels = np.atleast_1d(figure.subplots(1, len(quantities), sharey=True))
    for axes, quantity in zip(panels, quantities, strict=True):
        _draw_budget_panel(axes, quantity, choices)
    panels[0].set_yticks(range(len(choices)), [choice.point.label for choice in choices])
    panels[0].set_ylim(len(choices) - 0.5, -0.5)
    figure.legend(handles=_budget_legend(comparison, quantities), ncols=2, **figures.LEGEND)
    return figure


def _budget_legend(comparison: Comparison, quantities: Sequence[Quantity]) -> list[Line2D]:
    """Return the entries of the budget's legend."""
    drawn = [choice for choice in comparison.choices if not choice.measurement.reason]
    dot = partial(Line2D, [], [], ls="", marker="o")
    handles = []
    if any(choice.point.refines for choice in drawn):
        handles.append(dot(color=figures.COLOURS[1], label=f"error of {comparison.base}"))
    if not all(choice.point.refines for choice in drawn):
        handles.append(dot(color=figures.COLOURS[0], mfc="white", label="what another choice changes"))
    if any(quantity.tolerance < math.inf for quantity in quantities):
        handles.append(Line2D([], [], ls="--", color="black", lw=0.9, label="tolerance"))
    if any(choice.errors.get("occurrence", 0.0) > 0.0 for choice in drawn):
        handles.append(Line2D([], [], ls="", marker="x", color="black", label="occurrence differs"))
    return handles


def _draw_budget_panel(axes: Axes, quantity: Quantity, choices: Sequence[Result]) -> None:
    axes.set_xscale("log")
    errors = [c.errors[quantity.name] for c in choices]
    positive = [e for e in errors if 0.0 < e < math.inf]
    floor = min(positive, default=1e-3) / figures.MARGIN
    for row, (choice, error) in enumerate(zip(choices, errors, strict=True)):
        axes.axhline(row, color="#ececec", lw=0.6, zorder=0)
        if choice.measurement.reason or not math.isfinite(error):
            words = "failed" if choice.measurement.reason else "none"
            axes.text(0.04, row, words, va="center", fontsize=8, transform=axes.get_yaxis_transform())
            continue
        colour, fill = (
            (figures.COLOURS[1], figures.COLOURS[1])
            if choice.point.refines
            else (figures.COLOURS[0], "white")
        )
        axes.plot(max(error, floor), row, "o", color=colour, mfc=fill, ms=5.5)
        if choice.errors.get("occurrence", 0.0) > 0.0:
            axes.plot(max(error, floor), row, "x", color="black", ms=8)
    marks = [quantity.tolerance] if 0.0 < quantity.tolerance < math.inf else []
    figures.set_error_axis(axes, [floor, *positive, *marks])
    if quantity.tolerance < math.inf:
        axes.axvline(quantity.tolerance, color="black", ls="--", lw=0.9)
    axes.tick_params(axis="y", length=0)
    axes.set_title(quantity.name.replace("_", " "), loc="left", pad=3)  # short: panels are narrow
    axes.set_xlabel(_error_label(quantity))


def _in_order(choices: Sequence[Result], quantities: Sequence[Quantity]) -> list[Result]:
    """Return errors of the base, the largest first, then all other choices as the job lists them."""

    def size(choice: Result) -> float:
        worst = [choice.errors[q.name] / min(q.tolerance, 1.0) for q in quantities]
        return max((value for value in worst if not math.isnan(value)), default=math.inf)

    errors = sorted((c for c in choices if c.point.refines), key=size, reverse=True)
    return [*errors, *(c for c in choices if not c.point.refines)]
