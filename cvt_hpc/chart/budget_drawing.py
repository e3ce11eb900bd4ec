"""The picture of an error budget: the effect of each choice."""

import math
from collections.abc import Sequence
from functools import partial
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cvt_hpc.analysis.error_axes import COLOURS, LEGEND, MARGIN, set_error_axis
from cvt_hpc.analysis.figures import WIDTH, draw
from cvt_hpc.chart.comparing import Comparison, Result
from cvt_hpc.chart.plan import Quantity
from cvt_hpc.chart.scene_drawing import error_label

_ROW_HEIGHT = 0.24  # [inch], of the budget


def draw_budget(comparison: Comparison, out: Path) -> Path:
    """Draw the error of each choice against the base; otherwise as `draw_scene`."""
    return draw(lambda: budget_figure(comparison), out)


def budget_figure(comparison: Comparison) -> Figure:
    """Compose the picture of `draw_budget`; to be called within STYLE."""
    quantities = [
        q for q in comparison.scene.quantities if q.name in comparison.shown and q.name != "occurrence"
    ]
    choices = _in_order(comparison.choices, quantities)
    figure = Figure((WIDTH, 1.3 + _ROW_HEIGHT * len(choices)), layout="constrained")
    figure.suptitle(f"{comparison.scene.title}: error budget, against {comparison.base}")
    panels = np.atleast_1d(figure.subplots(1, len(quantities), sharey=True))
    for axes, quantity in zip(panels, quantities, strict=True):
        _draw_budget_panel(axes, quantity, choices)
    panels[0].set_yticks(range(len(choices)), [choice.point.label for choice in choices])
    panels[0].set_ylim(len(choices) - 0.5, -0.5)
    figure.legend(handles=_legend(comparison, quantities), ncols=2, **LEGEND)
    return figure


def _legend(comparison: Comparison, quantities: Sequence[Quantity]) -> list[Line2D]:
    """Description of the budget that is drawn."""
    drawn = [choice for choice in comparison.choices if not choice.measurement.reason]
    dot = partial(Line2D, [], [], ls="", marker="o")
    handles = []
    if any(choice.point.refines for choice in drawn):
        handles.append(dot(color=COLOURS[1], label=f"error of {comparison.base}"))
    if not all(choice.point.refines for choice in drawn):
        handles.append(dot(color=COLOURS[0], mfc="white", label="what another choice changes"))
    if any(quantity.tolerance < math.inf for quantity in quantities):
        handles.append(Line2D([], [], ls="--", color="black", lw=0.9, label="tolerance"))
    if any(choice.errors.get("occurrence", 0.0) > 0.0 for choice in drawn):
        handles.append(Line2D([], [], ls="", marker="x", color="black", label="occurrence differs"))
    return handles


def _draw_budget_panel(axes: Axes, quantity: Quantity, choices: Sequence[Result]) -> None:
    axes.set_xscale("log")
    errors = [c.errors[quantity.name] for c in choices]
    positive = [e for e in errors if 0.0 < e < math.inf]
    floor = min(positive, default=1e-3) / MARGIN
    for row, (choice, error) in enumerate(zip(choices, errors, strict=True)):
        axes.axhline(row, color="#ececec", lw=0.6, zorder=0)
        if choice.measurement.reason or not math.isfinite(error):
            words = "failed" if choice.measurement.reason else "none"
            axes.text(0.04, row, words, va="center", fontsize=8, transform=axes.get_yaxis_transform())
            continue
        colour, fill = (COLOURS[1], COLOURS[1]) if choice.point.refines else (COLOURS[0], "white")
        axes.plot(max(error, floor), row, "o", color=colour, mfc=fill, ms=5.5)
        if choice.errors.get("occurrence", 0.0) > 0.0:
            axes.plot(max(error, floor), row, "x", color="black", ms=8)
    marks = [quantity.tolerance] if 0.0 < quantity.tolerance < math.inf else []
    set_error_axis(axes, [floor, *positive, *marks])
    if quantity.tolerance < math.inf:
        axes.axvline(quantity.tolerance, color="black", ls="--", lw=0.9)
    axes.tick_params(axis="y", length=0)
    axes.set_title(quantity.name.replace("_", " "), loc="left", pad=3)  # short: panels are narrow
    axes.set_xlabel(error_label(quantity))


def _in_order(choices: Sequence[Result], quantities: Sequence[Quantity]) -> list[Result]:
    """Errors of the base first, the largest on top, then all other choices as the job lists them."""

    def size(choice: Result) -> float:
        worst = [choice.errors[q.name] / min(q.tolerance, 1.0) for q in quantities]
        return max((value for value in worst if not math.isnan(value)), default=math.inf)

    errors = sorted((c for c in choices if c.point.refines), key=size, reverse=True)
    return [*errors, *(c for c in choices if not c.point.refines)]
