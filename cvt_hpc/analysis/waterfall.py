"""Spectra of the strands over an axis of a study, as figs 11 and 12 of Cepon and Boltezar 2011."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.patheffects import Normal, withStroke
from numpy.typing import NDArray

from cvt_hpc.analysis.arrangement import CHOSEN, Ruler, Sides, along_x, arrange, ruler
from cvt_hpc.analysis.cells import colours_of
from cvt_hpc.analysis.classes import WITHOUT_RESULT, check_results, occurrence_classes
from cvt_hpc.analysis.eigenfrequencies import along_axis
from cvt_hpc.analysis.figures import WIDTH, styled
from cvt_hpc.errors import few_of, mismatch, one_line

HEIGHT = 4.0  # [inch]
COLOURS = colours_of("inferno_r", 0.0, 0.95)
DEEPEST = 1e-2  # of the largest amplitude: what is smaller has the lightest colour
LABELLED = 0.94  # of the panel's height, up to which there is room for a number
UNKNOWN = "#d0d4d8"  # of runs without a spectrum
LINE, ORDER = "#123a6b", "#4d4d4d"
ORDERS = (1.0, 2.0, 4.0, 8.0, 16.0)  # of the driving pulley, in a Campbell diagram


def campbell_figure(
    dataset: xr.Dataset,
    at: Mapping[str, Any] | None = None,
    source: str = "results",
    orders: Sequence[float] = ORDERS,
) -> Figure:
    """Draw a Campbell diagram: `waterfall_figure` over the driving speed, with orders of that speed."""
    check_results(dataset, source)
    if "driving_speed" not in dataset["status"].dims:
        found = ", ".join(map(str, dataset["status"].dims)) or "a single run"
        then = "`cvt-hpc plot waterfall` draws spectra over any axis"
        raise mismatch(source, "results over the axis driving_speed", found, then)
    return waterfall_figure(dataset, at, source, Sides("driving_speed"), orders)


@styled
def waterfall_figure(
    dataset: xr.Dataset,
    at: Mapping[str, Any] | None = None,
    source: str = "results",
    sides: Sides = CHOSEN,
    orders: Sequence[float] = (),
) -> Figure:
    """Draw spectra of all strands over an axis, with the eigenfrequencies where they are known.

    Arguments as of all pictures of results (`figures.py`), with `status`, `vibrates` and `spectrum` [m] over
    the job's axes, `strand` and `frequency_bin` [Hz]. `eigenfrequency` [Hz] over the axes, `strand` and
    `half_waves` is drawn as lines; where it is missing it follows from the strands' mean forces. Over the
    driving speed `orders` are drawn, multiples of the turns of the driving pulley. Of the axes that are not
    fixed the one that runs along x in a map, or that of `sides`, does so here, and the rest are fixed at
    their first value.
    """
    check_results(dataset, source)
    if "spectrum" not in dataset or "frequency_bin" not in dataset["spectrum"].dims:
        found = few_of(list(map(str, dataset.data_vars)), 6)
        then = "runs of elastic_belt, pushbelt or belt_drive record it, up to band_high in [vibration]"
        raise mismatch(source, "results with the variable spectrum", found, then)
    arrangement = arrange(dataset, at or {}, source, sides)
    shown, notes = along_x(arrangement)
    x = ruler(shown[arrangement.x])
    amplitude = 1e6 * shown["spectrum"].transpose("strand", "frequency_bin", arrangement.x).values
    largest = np.nanmax(amplitude, initial=0.0) or 1.0
    norm = LogNorm(DEEPEST * largest, largest)
    known = along_axis(shown, arrangement.x)
    figure = Figure((WIDTH, HEIGHT), layout="constrained")
    strands = [str(name) for name in shown["strand"].values]
    panels = figure.subplots(1, len(strands), sharex=True, sharey=True, squeeze=False)[0]
    y = ruler(shown["frequency_bin"])
    for axes, strand, values in zip(panels, strands, amplitude, strict=True):
        _draw_spectra(axes, x, y, values, norm)
        if known is not None:
            of_strand = known.sel(strand=strand)
            draw_eigenfrequencies(axes, x.centres, of_strand.values, known["half_waves"].values)
        if arrangement.x == "driving_speed":
            draw_orders(axes, x.centres, shown["driving_speed"].values / (2.0 * np.pi), orders, y.edges[-1])
        axes.set_xlim(x.edges[[0, -1]])
        axes.set_title(f"strand {strand}", loc="left", pad=3)
        axes.set_xlabel(x.label)
        x.lay_out(axes.xaxis)
    panels[0].set_ylabel("frequency [Hz]")
    panels[0].set_ylim(0.0, y.edges[-1])
    bar = figure.colorbar(ScalarMappable(norm, COLOURS), ax=panels, pad=0.02, extend="min")
    bar.set_label("amplitude [µm]")
    job = one_line(dataset.attrs.get("job_name", ""))
    subject = "Campbell diagram" if orders else "Spectra of the strands"
    lines = [f"{subject}: {job}".rstrip(": "), *notes]
    if arrangement.x == "driving_speed" and orders:
        lines.append("dotted: orders of the driving pulley's turns")
    if known is not None:
        lines.append("dashed: eigenfrequencies, with their half waves along the strand")
    if np.isnan(amplitude).any():
        unknown = occurrence_classes(shown).values[np.isnan(amplitude).any(axis=(0, 1))]
        words = [text for kind, text in WITHOUT_RESULT.items() if (unknown == kind).any()]
        lines.append("grey: no spectrum" + (f" ({', '.join(words)})" if words else ""))
    figure.suptitle("\n".join(fill(line, 72) for line in lines))
    return figure


def _draw_spectra(axes: Axes, x: Ruler, y: Ruler, values: NDArray[np.float64], norm: LogNorm) -> None:
    """Cells of one strand, of amplitudes (frequency, x) [um]."""
    axes.set_facecolor(UNKNOWN)
    cells = np.ma.masked_invalid(np.maximum(values, norm.vmin))  # zero has no logarithm
    axes.pcolormesh(x.edges, y.edges, cells, norm=norm, cmap=COLOURS, rasterized=True)


def draw_orders(
    axes: Axes,
    x: NDArray[np.float64],
    turns: NDArray[np.float64],
    orders: Sequence[float],
    highest: float,
) -> None:
    """Draw multiples of the turns (n,) [Hz] at places (n,), each with its order where it leaves the panel."""
    outline = [withStroke(linewidth=2.2, foreground="white"), Normal()]
    for order in orders:
        line = order * turns
        inside = np.flatnonzero(line < 0.96 * highest)
        if inside.size == 0:
            continue
        axes.plot(x, line, color=ORDER, ls=":", lw=1.2, path_effects=outline)
        last = inside[np.argmax(line[inside])]
        place, at_end = (x[last], line[last]), line[last] < 0.9 * highest
        style = {"color": ORDER, "fontsize": 8, "path_effects": outline, "ha": "right", "va": "bottom"}
        offset = (-1, 1) if at_end else (-6, -4)
        axes.annotate(f"{order:g}×", place, offset, textcoords="offset points", **style)


def draw_eigenfrequencies(
    axes: Axes, x: NDArray[np.float64], lines: NDArray[np.float64], numbers: NDArray[np.int64]
) -> None:
    """Dashes (half waves, n) at places (n,) that let the ridges show through, each with its half waves."""
    outline = [withStroke(linewidth=2.2, foreground="white"), Normal()]
    for number, line in zip(numbers, lines, strict=True):
        known = np.flatnonzero(np.isfinite(line) & (line < axes.dataLim.ymax))
        if known.size == 0:
            continue
        axes.plot(x, line, color=LINE, ls=(0, (3, 5)), lw=1.1, path_effects=outline)
        if line[known[0]] > LABELLED * axes.dataLim.ymax:
            continue  # the number would lie above the panel
        axes.annotate(
            str(number),
            (x[known[0]], line[known[0]]),
            (2, 5),
            textcoords="offset points",
            color=LINE,
            fontsize=9,
            path_effects=outline,
        )
