"""Pictures over samples of uncertain parameters: probability over an axis or two, and bands of the onset."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis import figures
from cvt_hpc.analysis.classes import check_results
from cvt_hpc.analysis.curves import set_frame
from cvt_hpc.analysis.hysteresis_bands import ALONG
from cvt_hpc.analysis.probability import CONTOURS, PROBABILITY, over_samples
from cvt_hpc.analysis.sensitivity import QUANTILES, onset_scatter
from cvt_hpc.analysis.value_maps import value_map_figure
from cvt_hpc.errors import mismatch
from cvt_hpc.job.axes import SAMPLE, SWAPPED

LINE, BAND = figures.COLOURS[0], "#9ecae1"
LEAST, HEIGHT, FRAME = 1.3, 2.8, 1.3  # [inch]: a panel at least and else, and title and legend


class _Panel(NamedTuple):
    """A line and the band around it, arrays over x in units for people."""

    title: str
    low: NDArray[np.float64]
    middle: NDArray[np.float64]
    high: NDArray[np.float64]


@figures.styled
def probability_figure(
    dataset: xr.Dataset, at: layout.At = None, source: str = "results", sides: layout.Sides = layout.CHOSEN
) -> Figure:
    """Draw the probability of vibration: over two axes with contours, over one with its 95 % interval.

    Parameters
    ----------
    dataset, at, source
        As of all pictures of results (`figures.py`), with the axis `sample`; or their `probabilities`. Where
        no verdict on vibration is known, the probability of failure is drawn.
    sides : Sides
        Which axis runs along x, along y, and over the panels.
    """
    told = over_samples(dataset, at or {})
    name = PROBABILITY if np.isfinite(told[PROBABILITY]).any() else "failure_probability"
    arrangement = layout.arrange(told, at or {}, source, sides)
    if arrangement.y:
        return value_map_figure(told, [name], at, source, sides)
    shown = arrangement.dataset
    panel = _Panel("", *(shown[one].values for one in (f"{name}_low", name, f"{name}_high")))
    labels = "of the samples", "95 % interval"
    x = layout.ruler(shown[arrangement.x])
    figure, (axes,) = _draw_bands([panel], x, figures.in_words(shown[name]), labels, source, "")
    axes.set_ylim(-0.03, 1.03)
    for share in CONTOURS:
        axes.axhline(share, color="#777777", ls="--" if share != CONTOURS[1] else "-", lw=0.8, zorder=0.5)
    head = f"P{figures.in_words(shown[name])[1:]}"
    _entitle(figure, axes, [figures.headline(head, dataset.attrs), told.attrs["counted"], *arrangement.notes])
    return figure


@figures.styled
def onset_bands_figure(
    dataset: xr.Dataset,
    at: layout.At = None,
    source: str = "results",
    sides: layout.Sides = layout.CHOSEN,
    along: str = "",
) -> Figure:
    """Draw the onset of vibration along an axis over another one: its median and 5 to 95 % of the samples.

    Parameters
    ----------
    dataset, at, source
        As of all pictures of results (`figures.py`), with the axis `sample`.
    sides : Sides
        Which axis runs along x, and over the panels.
    along : str
        Axis along which vibration sets in; by default the load or the axis in its place, else the last one.

    Raises
    ------
    InputError
        As of all pictures; the results have no samples, or no axis beside `along`.
    """
    check_results(dataset, source)
    told = over_samples(dataset, at or {})
    numeric = [name for name in map(str, told["status"].dims) if told[name].dtype.kind in "iuf"]
    known = [name for name in (*ALONG, *reversed(numeric)) if name in numeric and name not in (at or {})]
    along = along or next(iter(known), "")
    if "counted" not in told.attrs or along not in known or told["status"].ndim < 2:
        found = ", ".join(map(str, dataset["status"].dims)) or "a single run"
        expected = f"results over samples and two further axes, of them {along or 'one'} of numbers"
        raise mismatch(source, expected, found)
    quantiles = onset_scatter(dataset, along)["onset"]
    axes_left = xr.Dataset({"status": told["status"].isel({along: 0}, drop=True), "onset": quantiles})
    arrangement = layout.arrange(axes_left, at or {}, source, layout.Sides(sides.x, sides.panel))
    arrangement = layout.first_panel(arrangement)
    shown, over = arrangement.dataset, arrangement.y
    factor, unit = figures.coordinate_unit(quantiles.attrs)
    panels = []
    for place in range(shown.sizes[over]) if over else (0,):
        part = shown["onset"].isel({over: place}) if over else shown["onset"]
        title = f"{figures.in_words(shown[over])}: {layout.value_text(shown[over], place)}" if over else ""
        values = factor * part.transpose("quantile", ...).values
        low, _, high = np.clip(values, *_ends(factor * told[along].values))
        panels.append(_Panel(title, low, np.where(np.isinf(values[1]), np.nan, values[1]), high))
    label = f"onset in {figures.axis_label(told[along], unit)}"
    first, _, last = QUANTILES
    labels = "median", f"{first} to {last} of the samples"
    then = "fix an axis, as by `--at AXIS=VALUE`"
    figure, all_axes = _draw_bands(panels, layout.ruler(shown[arrangement.x]), label, labels, source, then)
    size = dataset.sizes[SAMPLE] * (2 if SWAPPED in dataset.dims else 1)
    samples = f"{size} samples; the band ends where the axis does"
    head = figures.headline("Onset of vibration", dataset.attrs)
    _entitle(figure, all_axes[0], [head, samples, *arrangement.notes])
    return figure


def _ends(values: NDArray[np.float64]) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _draw_bands(
    panels: Sequence[_Panel],
    x: layout.Ruler,
    label: str,
    labels: tuple[str, str],
    source: str,
    then: str,
) -> tuple[Figure, list[Any]]:
    """Draw a line and a band in each panel, and return the figure and its panels."""
    grid = figures.on_a_page(len(panels), (1, 2), (LEAST, HEIGHT), FRAME, source, then)
    rows = -(-len(panels) // grid.columns)
    figure = Figure((figures.WIDTH, rows * grid.height + FRAME), layout="constrained")
    all_axes = list(figure.subplots(rows, grid.columns, sharex=True, sharey=True, squeeze=False).flat)
    for axes in all_axes[len(panels) :]:
        axes.set_axis_off()
    for axes, panel in zip(all_axes, panels, strict=False):
        axes.fill_between(x.centres, panel.low, panel.high, color=BAND, lw=0, label=labels[1])
        axes.plot(x.centres, panel.middle, color=LINE, marker="o", ms=3.5, lw=1.5, label=labels[0])
        axes.set_title(panel.title, loc="left", pad=3)
        x.lay_out(axes.xaxis)
        axes.grid(lw=0.4, alpha=0.5)
    for axes in all_axes[: len(panels)][-grid.columns :]:
        axes.set_xlabel(x.label)
        axes.tick_params(labelbottom=True)
    figure.supylabel(label, fontsize=figures.STYLE["axes.labelsize"])
    return figure, all_axes[: len(panels)]


def _entitle(figure: Figure, axes: Any, lines: Sequence[str]) -> None:
    handles, labels = axes.get_legend_handles_labels()
    set_frame(figure, dict(zip(labels, handles, strict=True)), lines)
