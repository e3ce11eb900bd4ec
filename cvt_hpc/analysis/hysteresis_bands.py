"""Onset and end of vibration over a map: lines, and bands where ramps up and down differ."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis import figures
from cvt_hpc.analysis.arrangement import CHOSEN, At, Sides
from cvt_hpc.analysis.cells import OF_STARTS, STYLES
from cvt_hpc.analysis.classes import OccurrenceClass, check_results
from cvt_hpc.analysis.measured import File, Overlay, Side, side_of
from cvt_hpc.errors import mismatch
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.classes import StartClass, levels, onsets
from cvt_hpc.vibration.ramped import QUANTITIES

INK = "#00695c"  # beside orange, grey and purple cells, and as dark as these are light
BAND = OF_STARTS[StartClass.LARGE_START_ONLY]
UP, DOWN = "up", "down"
LINES = {UP: ("-", ">"), DOWN: ("--", "<")}
LEAST, FRAME = 0.9, 1.8  # [inch]: a panel at least, and title, labels and legend
OUTLINE = figures.outlined(4.0)


def onset_line(along: layout.Ruler, across: layout.Ruler, classes: NDArray[np.int8]) -> NDArray[np.float64]:
    """The lowest onset of each row, as a line from border to border of the rows: places (point, 2) on both.

    Vibration sets in along the columns; classes (row, column) are `OccurrenceClass` or `StartClass` of the
    cells. nan stands in rows without an onset.
    """
    borders = np.stack([across.edges[:-1], across.edges[1:]], 1)
    return np.stack([np.repeat(lowest_onsets(along.centres, classes), 2), borders.ravel()], 1)


def lowest_onsets(places: NDArray[np.float64], classes: NDArray[np.int8]) -> NDArray[np.float64]:
    """The lowest onset of each row of classes (row, place), in the unit of the places; nan where none is."""
    rising = ([one.load for one in onsets(places, levels(row)) if one.rising] for row in classes)
    return np.array([min(loads, default=np.nan) for loads in rising])


def within(axis: xr.DataArray) -> str:
    """Return how far a border between two values of an axis may be off: half their distance, as "± 5 N m"."""
    factor, unit = figures.coordinate_unit(axis.attrs)
    values = np.sort(factor * axis.values.astype(float))
    steps = np.diff(values[np.isfinite(values)])
    if not steps.size or steps.max() > layout.EQUAL * steps.min():
        return "± half a step"
    return f"± {figures.number(0.5 * steps.mean(), '.3g')} {unit}".rstrip()


def of_each_start(classes: NDArray[np.int8], along: xr.DataArray) -> list[tuple[str, str, NDArray[np.int8]]]:
    """Name and style of the onset lines of a map along an axis, and the classes that each of them separates.

    A map with cells that vibrate from a large start only has two lines.
    """
    only, known = classes == StartClass.LARGE_START_ONLY, within(along)
    small = np.where(only, OccurrenceClass.QUIET, classes)
    if not only.any():
        return [(f"onset of vibration {known}", "-", small)]
    large = np.where(only, OccurrenceClass.VIBRATING, classes)
    starts = ("small", "-", small), ("large", "--", large)
    return [(f"onset from a {size} start {known}", line, kinds) for size, line, kinds in starts]


def draw_onsets(
    axes: Axes,
    x: layout.Ruler,
    y: layout.Ruler,
    classes: NDArray[np.int8],
    along: xr.DataArray,
    along_y: bool,
) -> list[Line2D]:
    """Draw the onset line of a panel, and that of the large starts beside it; return handles of a legend.

    Arguments as of `cells.draw_cells`, the axis along which vibration sets in, and whether that is y.
    """
    handles = []
    for label, style, kinds in of_each_start(classes, along):
        points = onset_line(y, x, kinds.T)[:, ::-1] if along_y else onset_line(x, y, kinds)
        if np.isfinite(points).all(axis=1).any():
            look = {"color": INK, "ls": style, "lw": 2.2, "label": label}
            axes.add_collection(LineCollection([points], **look, zorder=2.1, path_effects=OUTLINE))
            handles.append(Line2D([], [], **look))
    return handles


def vibration_ranges(dataset: xr.Dataset, source: str = "results") -> xr.DataArray:
    """Return between which values runs vibrate along ramps, up and down.

    Parameters
    ----------
    dataset, source
        As of all pictures of results (`figures.py`): results of ramps of load or speed, up and down along one
        axis of the study, such as `load_start`, else InputError: `onset_load`, `end_load` and `ramp_load`
        [N m], or the same of the speed [rad/s].

    Returns
    -------
    DataArray
        Over the other axes, `ramp` ("up", "down") and `limit` ("lower", "upper"), in the unit of what is
        ramped; nan where a run does not vibrate. A vibration from a ramp's start on, or to its end, reaches
        to the middle of the ramp's first or last part.
    """
    check_results(dataset, source)
    expected = "results of ramps of load or speed, up and down along one axis such as load_start"
    known = (name for name in QUANTITIES if f"onset_{name}" in dataset and f"ramp_{name}" in dataset)
    name = next((name for name in known if np.isfinite(dataset[f"ramp_{name}"]).any()), None)
    if name is None:
        then = "`cvt-hpc examples speed_ramp` copies a job of ramps"
        raise mismatch(source, expected, "no onset along a ramp", then)
    course = dataset[f"ramp_{name}"]
    rise = course.diff("ramp_share").mean("ramp_share")
    dims = [str(dim) for dim in dataset["status"].dims]
    turning = [dim for dim in dims if bool(((rise.max(dim) > 0) & (rise.min(dim) < 0)).all())]
    if not turning:
        raise mismatch(source, expected, "ramps in one direction")
    vibrates = (dataset["status"] == Status.DONE) & (dataset["vibrates"] == Vibrates.YES)
    onset, end = dataset[f"onset_{name}"], dataset[f"end_{name}"]
    lowest, highest = course.min("ramp_share"), course.max("ramp_share")
    found = []
    for is_rising, first, last in ((rise > 0.0, onset, end), (rise < 0.0, end, onset)):
        ends = (first.fillna(lowest), last.fillna(highest))
        lower, upper = (one.where(vibrates & is_rising) for one in ends)
        found.append(xr.concat((lower.min(turning[0]), upper.max(turning[0])), "limit"))
    ranges = xr.concat(found, "ramp").assign_coords(ramp=[UP, DOWN], limit=["lower", "upper"])
    units = {"units": QUANTITIES[name].cf_units, "long_name": name}
    return ranges.rename("driving_speed" if name == "speed" else name).assign_attrs(units)


def _draw_bands(axes: Axes, y: layout.Ruler, ranges: NDArray[np.float64]) -> list[Artist]:
    """Draw the limits of vibration along both ramps and hatch what lies between; return handles of a legend.

    `ranges` (ramp, limit, row) are places along x, as `vibration_ranges` has them.
    """
    bands = []
    borders = np.stack([y.edges[:-1], y.edges[1:]], 1)
    for between in np.moveaxis(ranges, 0, -1):  # (row, ramp) of each limit
        for (a, b), (low, high) in zip(between, borders, strict=True):
            if np.isfinite([a, b]).all():
                bands.append([(a, low), (b, low), (b, high), (a, high)])
    handles: list[Artist] = []
    look: dict[str, Any] = {"facecolor": "none", "edgecolor": BAND.ink, "hatch": BAND.hatch, "linewidth": 0}
    if bands:
        axes.add_collection(PolyCollection(bands, **look, zorder=2.5))
        handles.append(Patch(**look, label="hysteresis: depends on ramp direction"))
    for (name, (style, mark)), limits in zip(LINES.items(), ranges, strict=True):
        line = {"color": INK, "ls": style, "marker": mark, "ms": 5, "lw": 1.8}
        for values in limits:
            axes.plot(np.repeat(values, 2), borders.ravel(), color=INK, ls=style, lw=1.8, zorder=3)
            axes.plot(values, y.centres, color=INK, marker=mark, ls="", ms=5, zorder=3.1)
        if np.isfinite(limits).any():
            handles.append(Line2D([], [], **line, label=f"vibration begins and ends, ramp {name}"))
    return handles


@figures.styled
def hysteresis_figure(
    dataset: xr.Dataset, at: At = None, source: str = "results", sides: Sides = CHOSEN, measured: File = None
) -> Figure:
    """Draw between which loads or speeds runs vibrate along ramps up and down, and where the two differ.

    Arguments as of all pictures of results (`figures.py`), with what `vibration_ranges` takes: the first axis
    that is left, or that of `sides`, runs along y, the next one, or that of `sides`, over the panels.
    """
    ranges = vibration_ranges(dataset, source)
    axes_left = ranges.isel(ramp=0, limit=0, drop=True)
    ramped = axes_left.to_dataset(name="status").assign_coords({ranges.name: ((), np.nan, ranges.attrs)})
    over = Overlay(measured, ramped.assign_attrs(dataset.attrs), source)
    layout.check_sides(sides, list(map(str, axes_left.dims)), at or {}, source)
    notes: tuple[str, ...] = ()
    y_name = panel = None
    if axes_left.dims:
        along = Sides(sides.y, sides.panel)
        shown = layout.first_panel(layout.arrange(xr.Dataset({"status": axes_left}), at or {}, source, along))
        names = [name for name in (shown.x, shown.y) if name]
        # what runs along x of a map runs along y here, because x is what is ramped
        y_name, panel = names[0], names[1] if len(names) > 1 else None
        notes = shown.notes
        ranges = ranges.sel({name: shown.dataset[name] for name in axes_left.dims})
    count = ranges.sizes[panel] if panel else 1
    factor, unit = figures.coordinate_unit(ranges.attrs)
    y = layout.ruler(ranges[y_name]) if y_name else layout.ONE_ROW
    wanted = float(np.clip(0.35 * y.centres.size, 0.6, 2.2)) + 0.35
    then = f"fix an axis, as by `--at {panel}=VALUE`, or choose another one by `--panel AXIS`"
    page = count, (1, 2), (LEAST, wanted), FRAME, source, then
    figure, panels, _ = figures.panels_on_a_page(*page, sharex=True)
    legend: dict[str, figures.Handle] = {}
    both = STYLES[OccurrenceClass.VIBRATING].fill
    for k, axes in enumerate(panels.flat[:count]):
        part = ranges.isel({panel: k}) if panel else ranges
        values = part.transpose("ramp", "limit", *([y_name] if y_name else [])).values
        values = factor * values.reshape(2, 2, -1)
        start, stop = values[:, 0].max(axis=0), values[:, 1].min(axis=0)
        lasting = np.isfinite(start) & np.isfinite(stop)
        if lasting.any():
            widths, heights = (stop - start)[lasting], np.diff(y.edges)[lasting]
            look = {"left": start[lasting], "color": both, "alpha": 0.55, "lw": 0}
            legend["vibrates either way"] = axes.barh(y.centres[lasting], widths, heights, **look)
        for handle in _draw_bands(axes, y, values):
            legend.setdefault(handle.get_label(), handle)
        axes.set_ylim(*y.edges[[0, -1]])
        if count == 1:
            axes.set_ylabel(y.label)
        y.lay_out(axes.yaxis)
        axes.grid(axis="x", lw=0.4, alpha=0.5)
        if panel:
            axes.set_title(layout.place_text(ranges[panel], k, ": "), loc="left", pad=3)
    x, places = Side(str(ranges.name), np.array(panels[0, 0].get_xlim()), factor), ranges.coords.to_dataset()
    for k, axes in enumerate(panels.flat[:count]):
        over.draw(axes, x, side_of(places, y_name), places.isel({panel: k} if panel else {}))
    figures.label_x(panels, count, figures.axis_label(ranges, unit))
    if count > 1:
        figure.supylabel(y.label)
    head = figures.headline("Vibration along ramps up and down", dataset.attrs)
    figures.entitle(figure, [head, *notes, over.note])
    figures.legend_below(figure, legend | over.entries)
    return figure
