"""Spectra of the strands over an axis of a study, as figs 11 and 12 of Cepon and Boltezar 2011.

Names of lines stand in the margins where the lines leave the panel, clear of ridges.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap, LogNorm
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis import cells, figures
from cvt_hpc.analysis.classes import WITHOUT_RESULT, axes_in_words, check_results, occurrence_classes
from cvt_hpc.analysis.courses import line_of_study
from cvt_hpc.analysis.eigenfrequencies import along_axis
from cvt_hpc.analysis.figures import Panels
from cvt_hpc.analysis.measured import FREQUENCY, File, Overlay, Side, put_legend, side_of
from cvt_hpc.errors import few_of, mismatch

Array = NDArray[np.float64]

_NAME_HEIGHT, LETTER = 9.5, 5.6  # [point]: of a name, and width of one of its letters
_TITLE = 3.0  # [point]: distance of a title
OUTLINE = figures.outlined(2.2)

LEAST, HEIGHT, FRAME = 1.3, 2.8, 1.2  # [inch]: a row of panels, and title and labels
# white ground, on which weak ridges are seen
COLOURS = ListedColormap(["white", *cells.colours_of("magma_r", 0.04, 0.97).colors], "spectra")
_SHALLOWEST, DEEPEST = 1e-2, 1e-4  # of the end of the colours: between them lies their beginning
_LIGHT = 0.9  # share of all amplitudes that may have the lightest colour
UNKNOWN = "#d0d4d8"  # of runs without a spectrum
LINE, ORDER = "#123a6b", "#4d4d4d"
ORDERS = (1.0, 2.0, 4.0, 8.0, 16.0)  # of the driving pulley, in a Campbell diagram


class Named(NamedTuple):
    """A line with its name, over points (n,) in data coordinates; nan where it is not known."""

    name: str
    colour: str
    x: Array
    y: Array


def name_lines(axes: Axes, lines: Sequence[Named], size: tuple[float, float]) -> float:
    """Write the names of lines beside a panel whose limits are set; return the distance of its title [point].

    What leaves the panel at its upper side is named there, other lines where they end; none lies below its
    lower limit. Where lines are crowded the first of them have names. `size` is about the width and height
    of the panel [inch].
    """
    right: list[tuple[float, Named]] = []
    above: list[tuple[float, Named]] = []
    (left, end), top = sorted(axes.get_xlim()), max(axes.get_ylim())
    for line in lines:
        order = np.argsort(line.x)
        x, y = line.x[order], line.y[order]
        known = np.isfinite(y) & (np.nan_to_num(y, nan=np.inf) <= top)
        if not known.any():
            continue
        last = int(np.flatnonzero(known)[-1])
        if last + 1 < y.size and np.isfinite(y[last + 1]):
            share = (top - y[last]) / (y[last + 1] - y[last])
            above.append((float(x[last] + share * (x[last + 1] - x[last])), line))
        elif last + 1 == y.size:
            right.append((float(y[last]), line))
        else:
            paper = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6}
            _write(axes, line, (x[last], y[last]), "data", (3, 0), ha="left", va="center", bbox=paper)
    letters = max((len(line.name) for _, line in above), default=1)
    gaps = _NAME_HEIGHT / (72.0 * size[1]) * top, (LETTER * letters + 3.0) / (72.0 * size[0]) * (end - left)
    right = [(min(place, top - 0.5 * gaps[0]), line) for place, line in right]  # clear of the title
    off = 3.0  # [point]: names of another colour have a column of their own
    for colour in dict.fromkeys(line.colour for _, line in right):
        named = list(_clear([one for one in right if one[1].colour == colour], gaps[0]))
        for place, line in named:
            _write(axes, line, (1.0, place), axes.get_yaxis_transform(), (off, 0), ha="left", va="center")
        off += LETTER * max(len(line.name) for _, line in named) + 2.0
    for place, line in _clear(above, gaps[1]):
        _write(axes, line, (place, 1.0), axes.get_xaxis_transform(), (0, 1), ha="center", va="bottom")
    return _TITLE + _NAME_HEIGHT if above else _TITLE


def _clear(placed: Sequence[tuple[float, Named]], gap: float) -> Iterator[tuple[float, Named]]:
    """Yield the places whose names have room beside those before them: a name elsewhere would mislead."""
    taken: list[float] = []
    for place, line in placed:
        if all(abs(place - other) >= gap for other in taken):
            taken.append(place)
            yield place, line


def _write(
    axes: Axes, line: Named, place: tuple[float, float], within: Any, off: tuple[float, float], **how: Any
) -> None:
    how |= {"textcoords": "offset points", "color": line.colour, "fontsize": 8, "annotation_clip": False}
    axes.annotate(line.name, place, off, xycoords=within, **how)


def campbell_figure(
    dataset: xr.Dataset,
    at: layout.At = None,
    source: str = "results",
    orders: Sequence[float] = ORDERS,
    sides: layout.Sides = layout.CHOSEN,
    vmax: float | None = None,
    measured: File = None,
) -> Figure:
    """Draw a Campbell diagram: `waterfall_figure` over the driving speed, with orders of that speed."""
    check_results(dataset, source)
    if "driving_speed" not in dataset["status"].dims:
        then = "`cvt-hpc plot waterfall` draws spectra over any axis"
        raise mismatch(source, "results over the axis driving_speed", axes_in_words(dataset), then)
    sides = layout.Sides("driving_speed", panel=sides.panel)
    return waterfall_figure(dataset, at, source, sides, orders, vmax, measured)


@figures.styled
def waterfall_figure(
    dataset: xr.Dataset,
    at: layout.At = None,
    source: str = "results",
    sides: layout.Sides = layout.CHOSEN,
    orders: Sequence[float] = (),
    vmax: float | None = None,
    measured: File = None,
) -> Figure:
    """Draw spectra of all strands over an axis, with the eigenfrequencies where they are known.

    Arguments as of all pictures of results (`figures.py`), with `status`, `vibrates` and `spectrum` [m] over
    the job's axes, `strand` and `frequency_bin` [Hz]. `eigenfrequency` [Hz] over the axes, `strand` and
    `half_waves` is drawn as lines; where it is missing it follows from the strands' mean forces. Over the
    driving speed `orders` are drawn, multiples of the turns of the driving pulley. Of the axes that are not
    fixed the one that runs along x in a map does so here; that of `sides.panel` has a row of panels for each
    value, and the rest are fixed at their first value. The colours end as `spectra_norm` says, unless at
    `vmax`.
    """
    check_results(dataset, source)
    if "spectrum" not in dataset or "frequency_bin" not in dataset["spectrum"].dims:
        found = few_of(list(map(str, dataset.data_vars)), 6)
        then = "runs of a belt that marches in time record it, up to band_high in [vibration]"
        raise mismatch(source, "results with the variable spectrum", found, then)
    overlay = Overlay(measured, dataset, source)
    arrangement = layout.arrange(dataset, at or {}, source, sides)
    figures.check_known(arrangement.dataset, ["spectrum"], source)
    rows, notes = _rows(arrangement, sides.panel)
    x, y = layout.ruler(arrangement.dataset[arrangement.x]), layout.ruler(dataset["frequency_bin"])
    over = ("strand", "frequency_bin", arrangement.x)
    amplitude = [1e6 * shown["spectrum"].transpose(*over).values for _, shown in rows]
    norm = spectra_norm([of for row in amplitude for of in row], None if vmax is None else 1e6 * vmax)
    known = [along_axis(shown, arrangement.x) for _, shown in rows]
    strands = [str(name) for name in dataset["strand"].values]
    then = f"fix an axis, as by `--at {sides.panel}=VALUE`, or choose another one by `--panel AXIS`"
    page = len(rows), (1, 2), (LEAST, HEIGHT), FRAME + overlay.height, source, then
    figure, panels, height = figures.panels_on_a_page(*page, each=len(strands), sharex=True, sharey=True)
    size = 0.8 * figures.WIDTH / panels.shape[1], height - 0.3
    each, pad, along = iter(panels.flat), 0.0, side_of(arrangement.dataset, arrangement.x)
    for (title, shown), of_row, modes in zip(rows, amplitude, known, strict=True):
        for strand, values in zip(strands, of_row, strict=True):
            axes, lines = next(each), []
            axes.set_facecolor(UNKNOWN)
            draw_spectra(axes, x.edges, y.edges, values, norm)
            axes.set(xlim=x.edges[[0, -1]], ylim=(0.0, y.edges[-1]))
            if modes is not None:
                of_strand = modes.sel(strand=strand).values
                lines += draw_eigenfrequencies(axes, x.centres, of_strand, modes["half_waves"].values)
            if arrangement.x == "driving_speed":
                lines += draw_orders(axes, x.centres, shown["driving_speed"].values / (2.0 * np.pi), orders)
            overlay.draw(axes, along, Side(FREQUENCY, y.edges[[0, -1]]), shown)
            pad = max(pad, name_lines(axes, lines, size))
            axes.set_title(", ".join(filter(None, (f"strand {strand}", title))), loc="left", pad=pad)
            x.lay_out(axes.xaxis)
    figures.label_x(panels, len(rows) * len(strands), x.label)
    for axes in panels[:, 0]:
        axes.set_ylabel("frequency [Hz]")
    spectra_bar(figure, norm, amplitude, panels, 20 * len(panels))
    subject = "Campbell diagram" if orders else "Spectra of the strands"
    told = []
    if arrangement.x == "driving_speed" and orders:
        told.append(orders_in_words(orders))
    if any(modes is not None for modes in known):
        told.append("dashed: eigenfrequencies, with their half waves along the strand")
    told += _without_spectrum(rows, amplitude)
    fixed = [", ".join(notes), line_of_study(dataset)]
    figures.entitle(figure, [figures.headline(subject, dataset.attrs), *fixed, *told, overlay.note])
    put_legend(figure, overlay)
    return figure


def _rows(
    arrangement: layout.Arrangement, panel: str | None
) -> tuple[list[tuple[str, xr.Dataset]], list[str]]:
    """Title and results over x of each row of panels, and what is fixed, in words."""
    if panel is None:
        shown, notes = layout.along_x(arrangement)
        return [("", shown)], notes
    axis, rows = arrangement.dataset[panel], []
    for k in range(axis.size):
        one = replace(arrangement, dataset=arrangement.dataset.isel({panel: k}), panel=None)
        shown, notes = layout.along_x(one)
        rows.append((layout.place_text(axis, k), shown))
    return rows, notes


def _without_spectrum(rows: Sequence[tuple[str, xr.Dataset]], amplitude: Sequence[Array]) -> list[str]:
    """State what became of the runs without a spectrum; an empty line where all have one."""
    of_rows = zip((occurrence_classes(shown).values for _, shown in rows), amplitude, strict=True)
    unknown = np.concatenate([kinds[np.isnan(values).any(axis=(0, 1))] for kinds, values in of_rows])
    words = [text for kind, text in WITHOUT_RESULT.items() if (unknown == kind).any()]
    return ["grey: no spectrum" + (f" ({', '.join(words)})" if words else "")] if unknown.size else []


def spectra_norm(spectra: Sequence[Array], highest: float | None = None) -> LogNorm:
    """Logarithmic scale of amplitudes, which neither one run nor one harmonic flattens.

    It ends at `highest`, or as `cells.norm_over` ends over the largest amplitude of each run, and begins
    where LIGHT of all amplitudes (line, run) lie below, within two to four decades from its end. nan stands
    where a run has no spectrum.
    """
    strongest = np.concatenate([np.nan_to_num(each, nan=-1.0).max(axis=0) for each in spectra])
    top = float(cells.norm_over(strongest[strongest > 0.0], 0.0, highest).vmax or 1.0)
    known = np.concatenate([each[np.isfinite(each)] for each in spectra])
    low = np.quantile(known, _LIGHT) if known.size else 0.0
    return LogNorm(float(np.clip(low, DEEPEST * top, _SHALLOWEST * top)), top)


def draw_spectra(axes: Axes, x: Array, y: Array, amplitude: Array, norm: LogNorm) -> None:
    """Draw amplitudes (line, run) in colours, at places or between borders along both sides."""
    cut = np.ma.masked_invalid(np.maximum(amplitude, norm.vmin))  # zero has no logarithm
    axes.pcolormesh(x, y, cut, norm=norm, cmap=COLOURS, rasterized=True)


def spectra_bar(
    figure: Figure, norm: LogNorm, spectra: Sequence[Array], panels: Panels, aspect: int, unit: str = "µm"
) -> None:
    """Draw the colour bar of spectra beside their panels."""
    values = np.concatenate([each.ravel() for each in spectra])
    scale = cells.Scale(COLOURS, norm, f"amplitude [{unit}]")
    cells.colour_bar(figure, scale, values, ax=list(panels.flat), aspect=aspect, pad=0.02)


def draw_orders(axes: Axes, x: Array, turns: Array, orders: Sequence[float]) -> list[Named]:
    """Draw multiples of the turns (n,) [Hz] at places (n,) as dots, and return them with their orders."""
    lines = [Named(f"{order:g}×", ORDER, x, order * turns) for order in orders]
    for line in lines:
        axes.plot(x, line.y, color=ORDER, ls=":", lw=1.2, path_effects=OUTLINE)
    return lines


def orders_in_words(orders: Sequence[float]) -> str:
    """State which orders are drawn: where they are crowded not all have names."""
    return f"dotted: orders {', '.join(f'{order:g}' for order in orders)} of the driving pulley's turns"


def draw_eigenfrequencies(axes: Axes, x: Array, lines: Array, numbers: NDArray[np.int64]) -> list[Named]:
    """Draw dashes (half waves, n) at places (n,), which let ridges show; return them with their numbers."""
    each = (Named(str(number), LINE, x, line) for number, line in zip(numbers, lines, strict=True))
    found = [line for line in each if np.any(line.y < axes.get_ylim()[1])]
    for line in found:
        axes.plot(x, line.y, color=LINE, ls=(0, (3, 5)), lw=1.1, path_effects=OUTLINE)
    return found
