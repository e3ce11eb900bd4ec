"""Quantities of a study over one of its axes, a panel for each, with a curve for each value of another."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cvt_hpc.analysis import curves
from cvt_hpc.analysis.arrangement import At, Sides, arrange, places, ruler
from cvt_hpc.analysis.classes import check_results, occurrence_classes
from cvt_hpc.analysis.error_axes import COLOURS
from cvt_hpc.analysis.figures import WIDTH, headline, in_words, styled
from cvt_hpc.errors import mismatch
from cvt_hpc.variables import Status

MOST_PANELS, COLUMNS = 12, 3
HEIGHT = 1.9  # [inch] of a panel
FRAME = 1.0  # [inch]: what title and labels take
INK = "#333333"  # of styles in the legend, which colours do not tell


def curves_figure(
    dataset: xr.Dataset,
    quantities: Sequence[str],
    at: At = None,
    source: str = "results",
    lines: str | None = None,
) -> Figure:
    """Draw as `curve_figure`, or with `lines` as `curve_panels_figure`, A+B in one panel."""
    if lines is None:
        return curves.curve_figure(dataset, quantities, at, source)
    return curve_panels_figure(dataset, [name.split("+") for name in quantities], lines, at, source)


@styled
def curve_panels_figure(
    dataset: xr.Dataset, groups: Sequence[Sequence[str]], lines: str, at: At = None, source: str = "results"
) -> Figure:
    """Draw quantities over an axis, by another axis.

    Parameters
    ----------
    dataset, at, source
        As of all pictures of results (`figures.py`). Of the axes that `lines` leaves, the one that runs along
        x in a map does so here.
    groups : sequence of sequences of str
        Numeric variables: those of a group are of one unit and share a panel, the first drawn by marks, the
        others by lines beside it. Of quantities with further dimensions, such as `pulley`, there is a panel
        for each of their labels.
    lines : str
        The axis that has a colour for each of its values.

    Raises
    ------
    InputError
        As of all pictures; there is no such quantity or axis, quantities of a group differ in unit or
        dimensions, or there would be more curves than colours, or more than MOST_PANELS panels.
    """
    check_results(dataset, source)
    for group in groups:
        curves.check_quantities(dataset, group, source)
    arrangement = arrange(dataset, at or {}, source, Sides(y=lines))
    each, notes = curves.panels_of(arrangement, source, len(COLOURS))
    shown, along = arrangement.dataset, {arrangement.x, lines, arrangement.panel}
    panels = [(group, place) for group in groups for place in _places(shown, group, along, source)]
    if len(panels) > MOST_PANELS:
        then = "name fewer quantities: one of both pulleys has a panel for each"
        raise mismatch(f"{source}: panels", f"at most {MOST_PANELS}", f"{len(panels)}", then)
    columns = min(len(panels), COLUMNS)
    rows = -(-len(panels) // columns)
    width = WIDTH * (1.0 + 0.25 * (columns - 1) / (COLUMNS - 1))
    figure = Figure((width, HEIGHT * rows + FRAME), layout="constrained")
    all_axes = figure.subplots(rows, columns, sharex=True, squeeze=False).ravel()
    for unused in all_axes[len(panels) :]:
        unused.set_visible(False)
    x = ruler(shown[arrangement.x])
    legend: dict[str, Any] = {
        title: Line2D([], [], color=colour, marker=mark, ms=5, lw=0.7)
        for (title, _), colour, mark in zip(each, COLOURS, curves.MARKS, strict=False)
    }
    for axes, (group, place) in zip(all_axes, panels, strict=False):
        factor, unit = curves.scale(shown, group)
        labels = [curves.place_in_words(shown[dim], k) for dim, k in place.items()]
        title = " ".join([curves.common_words(shown, group), *labels])
        axes.set_title(f"{title} [{unit}]" if unit else title, loc="left", pad=6)
        for k, (_, results) in enumerate(each):
            values = [factor * results[name].isel(place).values for name in group]
            _draw(axes, x.centres, values, results["status"].values == Status.DONE, k)
            curves.mark_above(axes, x.centres, occurrence_classes(results).values)
        for name, style in zip(group[1:], curves.BESIDE, strict=False):
            legend[in_words(shown[name])] = Line2D([], [], color=INK, ls=style, lw=1.2)
        handles, told = axes.get_legend_handles_labels()
        legend |= dict(zip(told, handles, strict=True))
        axes.set_xlim(curves.with_margins(x))
        x.lay_out(axes.xaxis)
        axes.grid(linewidth=0.4, alpha=0.5)
    for axes in all_axes[len(panels) - columns : len(panels)]:
        axes.set_xlabel(x.label)
        axes.tick_params(labelbottom=True)
    title = f"Over {in_words(shown[arrangement.x])}, by {in_words(shown[lines])}"
    curves.set_frame(figure, legend, [headline(title, dataset.attrs), *notes])
    return figure


def _places(
    dataset: xr.Dataset, group: Sequence[str], along: set[str | None], source: str
) -> list[dict[str, int]]:
    """Indices along the further dimensions of a group's quantities, of each panel."""
    first, *others = (tuple(dim for dim in dataset[name].dims if dim not in along) for name in group)
    for name, dims in zip(group[1:], others, strict=True):
        if dims != first:
            expected = f"the dimensions of {group[0]}: {', '.join(map(str, first)) or 'none'}"
            raise mismatch(f"{source}: {name}", expected, ", ".join(map(str, dims)) or "none")
    return places(dataset, list(map(str, first)))


def _draw(axes: Axes, x: np.ndarray, values: Sequence[np.ndarray], is_done: np.ndarray, k: int) -> None:
    """The k-th curve of a panel: marks of the first quantity, lines of the others, in one colour."""
    colour, mark = COLOURS[k], curves.MARKS[k % len(curves.MARKS)]
    first, *others = (np.where(is_done, value, np.nan) for value in values)
    axes.plot(x, first, color=colour, marker=mark, ms=4, lw=0.7, zorder=2.5)
    for value, style in zip(others, curves.BESIDE, strict=False):
        axes.plot(x, value, color=colour, ls=style, lw=1.2, zorder=1.5)
