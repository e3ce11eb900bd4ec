"""Maps of quantities over a study's grid, such as efficiency and thrust over ratio and torque ratio."""

import warnings
from collections.abc import Sequence
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis import cells, figures
from cvt_hpc.analysis.arrangement import Ruler
from cvt_hpc.analysis.classes import WITHOUT_RESULT, check_results, count_classes, occurrence_classes
from cvt_hpc.analysis.courses import line_of_study
from cvt_hpc.analysis.curves import check_quantities
from cvt_hpc.analysis.measured import File, Overlay, side_of
from cvt_hpc.analysis.probability import ISOLINES, PROBABILITY, over_samples
from cvt_hpc.analysis.scatter import is_sampled
from cvt_hpc.analysis.sobol import WITHOUT
from cvt_hpc.errors import mismatch, one_line
from cvt_hpc.vibration.classes import OccurrenceClass

Array = NDArray[np.float64]
COLOURS = cells.colours_of("viridis_r", 0.05, 0.85)
_OTHER_SIGN = 0.05  # of the largest size: values of the other sign from here on have colours of their own
TWO_SIGNS = cells.colours_of("PuOr", 0.08, 0.92)
MOST_PANELS = 8  # of an axis that nobody chose
BESIDE, LETTERS = 3, 14.0  # panels side by side at most; letters of a title to an inch
ROW, FRAME = 0.25, 0.9  # [inch], of a row of cells, and of title and labels
HIGHEST, LEAST = 3.6, 0.8  # [inch], of a panel's cells
AROUND = 1.5  # [inch]: labels beside a panel's cells
_ISOLINE_INK = "#b3003b"  # over the colours of a map, light and dark
_ISOLINE_STYLES = ("--", "-", "-.")
_NEGATIVE = "---"  # lines over cells below zero that hold no numbers
UNSURE, INK = "xx", "#5a5a5a"  # lines over cells that are hardly known, and the colour of both
WIDE = 0.5  # of a probability or an index: with a wider interval next to nothing is known
_HATCH = cells.STYLES[OccurrenceClass.SLIPPING].hatch
EQUAL = 1e-6  # of a quantity: what differs less is the same
_NARROWEST, LOWEST = 24.0, 11.0  # [point]: cells into which numbers are written
OTHERS = tuple(WITHOUT_RESULT)  # which runs are marked


class Panel(NamedTuple):
    """A quantity over a grid (row, column)."""

    title: str
    unit: str
    factor: float  # from SI to the unit
    values: Array  # in the unit
    kinds: NDArray[np.int8]  # how the runs ended
    unsure: NDArray[np.bool_]  # where the interval of a value is WIDE
    alike: Array  # values of all panels that share the scale of colours, or its range
    isolines: tuple[float, ...]  # values of lines, in the unit
    at: dict[str, int]  # index along the axis of panels


@figures.styled
def value_map_figure(
    dataset: xr.Dataset,
    quantities: Sequence[str],
    at: layout.At = None,
    source: str = "results",
    sides: layout.Sides = layout.CHOSEN,
    vmax: float | None = None,
    measured: File = None,
) -> Figure:
    """Draw quantities over two axes of a study: panels for each, its further dimensions and a third axis.

    Arguments as of all pictures of results (`figures.py`); `vmax` is of a single quantity. x, y and the axis
    of panels are those of `map_figure`; where there would be more than MOST_PANELS panels and nobody chose
    it, that axis is fixed at its first value. Quantities are numeric variables. Results with samples of
    uncertain parameters are drawn as their `probabilities`.
    """
    check_results(dataset, source)
    if is_sampled(dataset):
        raise mismatch(source, "results over a grid", "samples")
    dataset = over_samples(dataset, at or {})
    over = Overlay(measured, dataset, source)
    check_quantities(dataset, quantities, source, of_one_unit=False)
    if vmax is not None and len(quantities) > 1:
        raise mismatch(f"{source}: vmax", "one quantity", ", ".join(quantities))
    arrangement = layout.arrange(dataset, at or {}, source, sides)
    panels = _panels(arrangement, quantities)
    if len(panels) > MOST_PANELS and not sides.panel:
        arrangement = layout.first_panel(arrangement)
        panels = _panels(arrangement, quantities)
    shown = arrangement.dataset
    x = layout.ruler(shown[arrangement.x])
    y = layout.ruler(shown[arrangement.y]) if arrangement.y else layout.ONE_ROW
    size, (columns, height) = _on_paper(len(panels), y.centres.size, source, arrangement)
    sides_of_panel = side_of(shown, arrangement.x), side_of(shown, arrangement.y)
    figure = Figure(size, layout="constrained")
    all_axes = figure.subplots(-(-len(panels) // columns), columns, squeeze=False)
    room = 72 * np.array([size[0] / columns - AROUND, height - FRAME])  # [point]
    for axes, panel in zip(all_axes.flat, panels, strict=False):
        _draw_panel(figure, axes, (x, y), panel, vmax, room)
        over.draw(axes, *sides_of_panel, shown.coords.to_dataset().isel(panel.at))
        axes.set_title(fill(panel.title, int(LETTERS * size[0] / columns)), loc="left", pad=3)
    for axes in all_axes.flat[len(panels) :]:
        axes.set_axis_off()
    for axes in all_axes[:, 0]:
        axes.set_ylabel(y.label)
    figures.label_x(all_axes, len(panels), x.label)
    kinds = occurrence_classes(shown)
    counted = dataset.attrs.get("counted") or _counted(kinds)
    if PROBABILITY not in quantities:  # the width told is that of its intervals
        counted = counted.partition(";")[0]
    job = one_line(dataset.attrs.get("job_name", ""))
    lines = [f"{job}: {counted}".removeprefix(": "), ", ".join(arrangement.notes), line_of_study(dataset)]
    figures.entitle(figure, [*lines, over.note], int(72 * size[0] / figures.WIDTH))
    marked: dict[cells.CellClass, cells.ClassStyle] = {
        kind: cells.STYLES[kind] for kind in OTHERS if (kinds == kind).any()
    }
    hatches = {patch.get_hatch() for axes in all_axes.flat for patch in axes.patches}
    without = (dataset[name].attrs.get(WITHOUT) for name in quantities)
    undecided = cells.STYLES[OccurrenceClass.UNDECIDED]
    told = {
        _NEGATIVE: ("below zero", "none", INK),
        UNSURE: (f"interval wider than {WIDE:g}", "none", INK),
        undecided.hatch: (next(filter(None, without), "undecided"), undecided.fill, undecided.ink),
    }
    further: list[Artist] = [
        Patch(facecolor=fill, edgecolor=ink, hatch=hatch, linewidth=0.8, label=label)
        for hatch, (label, fill, ink) in told.items()
        if hatch in hatches
    ]
    isolines = {panel.isolines for panel in panels if min(panel.values.shape) > 1} - {()}
    for style, value in zip(_ISOLINE_STYLES, min(isolines, default=()), strict=False):
        look = {"color": _ISOLINE_INK, "lw": 1.6, "ls": style}
        further.append(Line2D([], [], label=f"probability {value:g}", **look))
    further += over.handles
    if marked or further:
        labels = [kind.label for kind in marked] + [str(one.get_label()) for one in further]
        cells.class_legend(figure, marked, figures.legend_columns(labels), further=further)
    return figure


def _on_paper(
    count: int, rows: int, source: str, arrangement: layout.Arrangement
) -> tuple[tuple[float, float], figures.Grid]:
    """Size of the picture [inch] and its panels: on a page on its side, else on one upright.

    The panels of an axis of three values stand side by side.
    """
    wanted = min(ROW * rows + 0.3, HIGHEST) + FRAME
    if count == 1:
        return (figures.WIDTH, wanted + FRAME), figures.Grid(1, wanted)
    sizes, then = (LEAST + FRAME, wanted), "show fewer quantities, or fix an axis by `--at`"
    if panel := arrangement.panel:
        then = f"fix an axis, as by `--at {panel}=VALUE`, or choose another one by `--panel AXIS`"
    is_row = arrangement.dataset.sizes.get(panel) == BESIDE
    width, least = 1.6 * figures.WIDTH, sizes[0] if is_row else wanted
    grid = figures.fitting(count, (BESIDE if is_row else 2,), (least, wanted), figures.NARROW - FRAME)
    if grid is None:
        width, grid = figures.NARROW, figures.on_a_page(count, (2, BESIDE), sizes, FRAME, source, then)
    return (width, grid.height * -(-count // grid.columns) + FRAME), grid


def _counted(kinds: xr.DataArray) -> str:
    """State how many runs there are, and how many of the marked classes."""
    others = kinds.values[np.isin(kinds, OTHERS)]
    return f"{kinds.size} runs" + (f", of them {count_classes(others)}" if others.size else "")


def _of_grid(array: xr.DataArray, arrangement: layout.Arrangement) -> np.ndarray:
    """Values (row, column) of a variable over x, or over y and x."""
    return np.atleast_2d(array.transpose(*[name for name in (arrangement.y, arrangement.x) if name]).values)


def _panels(arrangement: layout.Arrangement, quantities: Sequence[str]) -> list[Panel]:
    """Panels of all quantities, by the axis of panels and by labels of further dimensions."""
    dataset = arrangement.dataset
    kinds, found = occurrence_classes(dataset), []
    # between texts there is nothing that a line could cross
    are_numbers = all(dataset[name].dtype.kind in "iuf" for name in (arrangement.x, arrangement.y) if name)
    over = [arrangement.panel] if arrangement.panel else []
    for name in quantities:
        array = dataset[name]
        factor, unit = figures.value_unit(array)
        labelled = [str(dim) for dim in array.dims if dim not in (arrangement.x, arrangement.y, *over)]
        alike = factor * np.asarray(array.attrs.get("valid_range", array.values))
        wide = xr.zeros_like(array, bool)
        if f"{name}_low" in dataset:
            wide = dataset[f"{name}_high"] - dataset[f"{name}_low"] > WIDE
        isolines = tuple(factor * np.asarray(array.attrs.get(ISOLINES, ()) if are_numbers else (), float))
        for labels in layout.places(array, labelled):
            told = [str(array[dim].values[k]).replace("_", " ") for dim, k in labels.items()]
            for at in layout.places(dataset, over):
                here = [layout.place_text(dataset[dim], k) for dim, k in at.items()]
                title = ", ".join([figures.axis_label(array, unit), *told, *here])
                values = factor * _of_grid(array.isel(labels | at), arrangement)
                ended = _of_grid(kinds.isel(at), arrangement).astype(np.int8)
                unsure = _of_grid(wide.isel(labels | at), arrangement)
                found.append(Panel(title, unit, factor, values, ended, unsure, alike, isolines, at))
    return found


def _draw_panel(
    figure: Figure, axes: Axes, rulers: tuple[Ruler, Ruler], panel: Panel, vmax: float | None, room: Array
) -> None:
    """Cells coloured by a quantity, with numbers where there is room [point], and marks of other runs."""
    (x, y), kinds, values = rulers, panel.kinds, panel.values
    norm = _norm(panel.alike, None if vmax is None else panel.factor * vmax)
    ends = sorted((-float(norm.vmin), float(norm.vmax)))
    both = ends[0] > _OTHER_SIGN * ends[1]
    if both:  # white is none
        norm = Normalize(-ends[1], ends[1])
    scale = cells.Scale(TWO_SIGNS if both else COLOURS, norm, panel.unit)
    is_known = np.isfinite(values) & ~np.isin(kinds, (OccurrenceClass.FAILED, OccurrenceClass.NOT_RUN))
    # what has a value is coloured by it, as vibrating cells of other maps by their amplitude
    drawn = np.where(is_known, OccurrenceClass.VIBRATING, kinds).astype(np.int8)
    cells.draw_cells(axes, x, y, drawn, np.zeros(kinds.shape, bool), values, scale)
    cells.draw_grid(axes, x, y)
    width, height = room * [np.diff(one.edges).min() / np.ptp(one.edges) for one in (x, y)]
    if width >= _NARROWEST and height >= LOWEST:
        for row, column in np.argwhere(is_known):
            place, value = (x.centres[column], y.centres[row]), values[row, column]
            fill_colour = np.asarray(scale.colours(scale.norm(value)))
            digits = ".0f" if 1e3 <= abs(value) < 1e5 else ".3g" if abs(value) >= 0.1 else ".2g"
            is_lined = kinds[row, column] == OccurrenceClass.SLIPPING or panel.unsure[row, column]
            is_lined |= bool(panel.isolines)
            digits = ".2g" if panel.isolines else digits
            cells.write_value(axes, place, f"{value:{digits}}", fill_colour, size=7.5, outlined=is_lined)
    elif both:  # in grey the colours of both signs are alike
        _hatch(axes, x, y, is_known & (values < 0.0), _NEGATIVE, INK)
    cells.draw_marks(axes, x, y, kinds, np.isin(kinds, OTHERS) & ~is_known, 3.5)
    _hatch(axes, x, y, is_known & (kinds == OccurrenceClass.SLIPPING), _HATCH, "#ffffff")
    _hatch(axes, x, y, is_known & panel.unsure, UNSURE, INK)
    if panel.isolines and min(values.shape) > 1:
        _draw_isolines(axes, x, y, np.where(is_known, values, np.nan), panel.isolines)
    x.lay_out(axes.xaxis)
    y.lay_out(axes.yaxis)
    if is_known.any():
        cells.colour_bar(figure, scale, values, ax=axes, pad=0.02)


def _draw_isolines(axes: Axes, x: Ruler, y: Ruler, values: Array, isolines: Sequence[float]) -> None:
    """Draw lines of equal values between the grid points, each in a style of its own."""
    look: dict[str, Any] = {"colors": _ISOLINE_INK, "linewidths": 1.6, "zorder": 2.4}
    look["linestyles"] = _ISOLINE_STYLES
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "No contour levels")
        lines = axes.contour(x.centres, y.centres, values, isolines, **look)
    lines.set_path_effects(figures.outlined(3.0))


def _hatch(axes: Axes, x: Ruler, y: Ruler, inside: NDArray[np.bool_], hatch: str, ink: str) -> None:
    """Hatch some cells over their colours."""
    lines = {"facecolor": "none", "edgecolor": ink, "linewidth": 0, "hatch": hatch, "rasterized": True}
    if inside.any():
        axes.add_patch(PathPatch(cells.area_of(x, y, inside), **lines))


def _norm(values: Array, vmax: float | None) -> Normalize:
    """Scale over the finite values; a quantity that does not vary has one colour."""
    known = values[np.isfinite(values)]
    if vmax is None and known.size and np.ptp(known) < EQUAL * np.abs(known).max():
        return Normalize(*(known.mean() + 0.1 * np.abs(known).max() * np.array([-1.0, 1.1])))
    return cells.norm_over(values, None, vmax)
