"""Quantities of a study over one of its axes: what runs give as marks, what stands beside them as lines.

`curve_panels_figure` draws a panel for each quantity, with a curve for each value of another axis.
"""

from collections.abc import Iterator, Mapping, Sequence
from itertools import chain

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis import figures
from cvt_hpc.analysis.arrangement import At, Sides
from cvt_hpc.analysis.cells import STYLES
from cvt_hpc.analysis.classes import WITHOUT_RESULT, check_results, occurrence_classes
from cvt_hpc.analysis.courses import line_of_study
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.variables import Status

_MOST_QUANTITIES, COLUMNS = 12, 3
_PANEL_HEIGHT = 1.9  # [inch] of a panel
FRAME = 1.0  # [inch]: what title and labels take
INK = "#333333"  # of styles in the legend, which colours do not tell

HEIGHT = 3.8  # [inch]
MOST_PANELS = 3  # side by side
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_PREFIXES = {-6: "µ", -3: "m", 3: "k", 6: "M"}  # of powers of ten
_PREFIXED = ("m", "m s-1", "s", "N", "N m", "N m-1", "W", "Hz")
BESIDE = ("-", "--", ":", "-.")
MARKS = tuple(mark for mark in figures.MARKERS if mark not in {STYLES[kind].mark for kind in WITHOUT_RESULT})


@figures.styled
def curve_figure(
    dataset: xr.Dataset, quantities: Sequence[str], at: At = None, source: str = "results"
) -> Figure:
    """Draw quantities over an axis.

    Arguments as of all pictures of results (`figures.py`). The axis that runs along x in a map does so here;
    there is a panel for each value of the one that runs along y, MOST_PANELS at most. Quantities are numeric
    variables of one unit. The first is drawn by marks, the others by lines beside it; one with further
    dimensions, such as `strand`, gives a curve for each of their labels.
    """
    check_results(dataset, source)
    check_quantities(dataset, quantities, source)
    arrangement = layout.arrange(dataset, at or {}, source)
    panels, notes = panels_of(arrangement, source)
    figure = Figure((figures.WIDTH, HEIGHT), layout="constrained")
    all_axes = figure.subplots(1, len(panels), sharex=True, sharey=True, squeeze=False)[0]
    x = layout.ruler(arrangement.dataset[arrangement.x])
    factor, unit = scale(arrangement.dataset, quantities)
    for axes, (title, shown) in zip(all_axes, panels, strict=True):
        each = (_curves(shown[name], factor, arrangement.x, len(quantities) > 1) for name in quantities)
        _draw_curves(axes, x.centres, list(chain(*each)), shown["status"].values == Status.DONE)
        _mark_above(axes, x.centres, occurrence_classes(shown).values)
        axes.set_title(title, loc="left", pad=6)
        axes.set(xlabel=x.label, xlim=_with_margins(x))
        x.lay_out(axes.xaxis)
        axes.grid(linewidth=0.4, alpha=0.5)
    label = _common_words(dataset, quantities)
    all_axes[0].set_ylabel(f"{label} [{unit}]" if unit else label)
    lines = [figures.headline(f"{label[0].upper()}{label[1:]}", dataset.attrs), *notes]
    set_frame(figure, figures.entries_of(all_axes), [*lines, line_of_study(dataset)])
    return figure


def set_frame(figure: Figure, legend: Mapping[str, figures.Handle], lines: Sequence[str]) -> None:
    """Title and legend of a figure of curves, which grows by the legend; `legend` has handles by label."""
    rows = len(legend) // figures.legend_columns(list(legend))
    figure.set_figheight(figure.get_figheight() + 0.2 * rows)
    figures.legend_below(figure, legend)
    figures.entitle(figure, lines)


def check_quantities(
    dataset: xr.Dataset, quantities: Sequence[str], source: str, *, of_one_unit: bool = True
) -> None:
    """Raise InputError unless results hold these quantities, as numbers, and of one unit if so asked."""
    numeric = [str(name) for name, array in dataset.data_vars.items() if array.dtype.kind in "iuf"]
    for name in quantities:
        if name not in numeric:
            raise unknown(f"{source}: {name}", "numeric variable of the results", name, numeric)
        units = [dataset[key].attrs.get("units", "") for key in (quantities[0], name)]
        if of_one_unit and units[0] != units[1]:
            raise mismatch(f"{source}: {name}", f"the unit of {quantities[0]}, {units[0]}", str(units[1]))
    figures.check_known(dataset, quantities, source)


def panels_of(
    arrangement: layout.Arrangement, source: str, most: int = MOST_PANELS
) -> tuple[list[tuple[str, xr.Dataset]], list[str]]:
    """Title and results over x of each value along y, `most` at most, and what is fixed, in words."""
    arrangement = layout.first_panel(arrangement)
    dataset, notes = arrangement.dataset, list(arrangement.notes)
    if arrangement.y is None:
        return [("", dataset)], notes
    y = dataset[arrangement.y]
    if y.size > most:
        expected = f"at most {most} values, or one that --at fixes"
        raise mismatch(f"{source}: {arrangement.y}", expected, f"{y.size}")
    return [(layout.place_text(y, k), dataset.isel({arrangement.y: k})) for k in range(y.size)], notes


def _curves(
    array: xr.DataArray, factor: float, x: str, is_named: bool
) -> Iterator[tuple[str, str, np.ndarray]]:
    """Name of the quantity, label of the curve, with it or without, and values over x by a factor."""
    extra = [str(dim) for dim in array.dims if dim != x]
    words = [figures.in_words(array)] if is_named or not extra else []
    for at in layout.places(array, extra):
        labels = [place_in_words(array[dim], k) for dim, k in at.items()]
        yield str(array.name), " ".join([*words, *labels]), factor * array.isel(at).values


def place_in_words(coordinate: xr.DataArray, index: int) -> str:
    """A place along a further dimension: a name speaks for itself, a number has the dimension's."""
    value = coordinate.values[index]
    return str(value) if coordinate.dtype.kind not in "iuf" else f"{figures.in_words(coordinate)} {value:g}"


def scale(dataset: xr.Dataset, quantities: Sequence[str]) -> tuple[float, str]:
    """Factor that gives numbers of up to three digits before the point, and the unit with it, for a label."""
    unit = str(dataset[quantities[0]].attrs.get("units", "")).replace("rad s-1", "rad/s")
    unit = "" if unit == "1" else unit
    largest = max(float(np.abs(dataset[name]).max()) for name in quantities)
    if not (np.isfinite(largest) and largest > 0.0) or 0.1 <= largest < 1e4:
        return 1.0, unit
    power = 3 * int(np.floor(np.log10(largest) / 3.0))
    if power in _PREFIXES and unit in _PREFIXED:
        return 10.0**-power, _PREFIXES[power] + unit
    return 10.0**-power, f"10{str(power).translate(_RAISED)} {unit}".strip()


def _with_margins(x: layout.Ruler) -> tuple[float, float]:
    """Limits around all values of the axis, also those where nothing is known."""
    margin = 0.05 * np.ptp(x.centres) or 0.5 * np.ptp(x.edges)
    return x.centres.min() - margin, x.centres.max() + margin


def _draw_curves(
    axes: Axes, x: np.ndarray, curves: Sequence[tuple[str, str, np.ndarray]], is_done: np.ndarray
) -> None:
    """Marks of the first quantity, hollow where they come again, and lines of the others."""
    first, marks = curves[0][0], 0
    for k, (name, label, values) in enumerate(curves):
        colour = figures.COLOURS[k % len(figures.COLOURS)]
        if name == first:
            known = np.where(is_done, values, np.nan)
            mark, fill = MARKS[marks % len(MARKS)], ("full", "none")[marks // len(MARKS) % 2]
            axes.plot(x, known, ls="", marker=mark, fillstyle=fill, ms=5, color=colour, label=label)
            marks += 1
        else:
            style = {"ls": BESIDE[(k - marks) % len(BESIDE)], "lw": 1.4, "zorder": 1.5}
            axes.plot(x, values, color=colour, label=label, **style)


def _mark_above(axes: Axes, x: np.ndarray, classes: np.ndarray) -> None:
    """Marks on the upper edge, which no curve has, for runs without a value, by what became of them."""
    for kind, label in WITHOUT_RESULT.items():
        if (inside := classes == kind).any():
            style, place = STYLES[kind], axes.get_xaxis_transform()
            marks = {"marker": style.mark, "color": style.ink, "ms": 7, "clip_on": False, "zorder": 5}
            axes.plot(x[inside], np.ones(inside.sum()), ls="", transform=place, label=label, **marks)


def _common_words(dataset: xr.Dataset, quantities: Sequence[str]) -> str:
    """Words that the names of all quantities end with, else the name of the first."""
    words = [figures.in_words(dataset[name]).split() for name in quantities]
    common: list[str] = []
    for column in zip(*(reversed(each) for each in words), strict=False):
        if len(set(column)) > 1:
            break
        common.insert(0, column[0])
    return " ".join(common or words[0])


def curves_figure(
    dataset: xr.Dataset,
    quantities: Sequence[str],
    at: At = None,
    source: str = "results",
    lines: str | None = None,
) -> Figure:
    """Draw as `curve_figure`, or with `lines` as `curve_panels_figure`, A+B in one panel."""
    if lines is None:
        return curve_figure(dataset, quantities, at, source)
    return curve_panels_figure(dataset, [name.split("+") for name in quantities], lines, at, source)


@figures.styled
def curve_panels_figure(
    dataset: xr.Dataset, groups: Sequence[Sequence[str]], lines: str, at: At = None, source: str = "results"
) -> Figure:
    """Draw quantities over an axis, by another axis.

    Arguments as of all pictures of results (`figures.py`). The axis `lines` has a colour for each of its
    values; of the axes that it leaves, the one that runs along x in a map does so here. Variables of a group
    are numeric, of one unit and of the same dimensions, and share a panel, the first drawn by marks, the
    others by lines beside it. Of quantities with further dimensions, such as `pulley`, there is a panel for
    each of their labels, _MOST_QUANTITIES at most.
    """
    check_results(dataset, source)
    for group in groups:
        check_quantities(dataset, group, source)
    arrangement = layout.arrange(dataset, at or {}, source, Sides(y=lines))
    each, notes = panels_of(arrangement, source, len(figures.COLOURS))
    shown, along = arrangement.dataset, {arrangement.x, lines, arrangement.panel}
    panels = [(group, place) for group in groups for place in _places(shown, group, along, source)]
    if len(panels) > _MOST_QUANTITIES:
        then = "name fewer quantities: one of both pulleys has a panel for each"
        raise mismatch(f"{source}: panels", f"at most {_MOST_QUANTITIES}", f"{len(panels)}", then)
    columns = min(len(panels), COLUMNS)
    rows = -(-len(panels) // columns)
    width = figures.WIDTH * (1.0 + 0.25 * (columns - 1) / (COLUMNS - 1))
    figure = Figure((width, _PANEL_HEIGHT * rows + FRAME), layout="constrained")
    all_axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
    for unused in all_axes.flat[len(panels) :]:
        unused.set_visible(False)
    x = layout.ruler(shown[arrangement.x])
    legend: dict[str, figures.Handle] = {}
    for (title, _), colour, mark in zip(each, figures.COLOURS, MARKS, strict=False):
        legend[title] = Line2D([], [], color=colour, marker=mark, ms=5, lw=0.7)
    for axes, (group, place) in zip(all_axes.flat, panels, strict=False):
        factor, unit = scale(shown, group)
        labels = [place_in_words(shown[dim], k) for dim, k in place.items()]
        title = " ".join([_common_words(shown, group), *labels])
        axes.set_title(f"{title} [{unit}]" if unit else title, loc="left", pad=6)
        for k, (_, results) in enumerate(each):
            values = [factor * results[name].isel(place).values for name in group]
            _draw(axes, x.centres, values, results["status"].values == Status.DONE, k)
            _mark_above(axes, x.centres, occurrence_classes(results).values)
        for name, style in zip(group[1:], BESIDE, strict=False):
            legend[figures.in_words(shown[name])] = Line2D([], [], color=INK, ls=style, lw=1.2)
        legend |= figures.entries_of([axes])
        axes.set_xlim(_with_margins(x))
        x.lay_out(axes.xaxis)
        axes.grid(linewidth=0.4, alpha=0.5)
    figures.label_x(all_axes, len(panels), x.label)
    title = f"Over {figures.in_words(shown[arrangement.x])}, by {figures.in_words(shown[lines])}"
    set_frame(figure, legend, [figures.headline(title, dataset.attrs), *notes, line_of_study(dataset)])
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
    return layout.places(dataset, list(map(str, first)))


def _draw(axes: Axes, x: np.ndarray, values: Sequence[np.ndarray], is_done: np.ndarray, k: int) -> None:
    """The k-th curve of a panel: marks of the first quantity, lines of the others, in one colour."""
    colour, mark = figures.COLOURS[k], MARKS[k % len(MARKS)]
    first, *others = (np.where(is_done, value, np.nan) for value in values)
    axes.plot(x, first, color=colour, marker=mark, ms=4, lw=0.7, zorder=2.5)
    for value, style in zip(others, BESIDE, strict=False):
        axes.plot(x, value, color=colour, ls=style, lw=1.2, zorder=1.5)
