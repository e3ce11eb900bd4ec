"""Pictures over samples of uncertain parameters: probability, bands of the onset, and what it depends on."""

from collections.abc import Collection, Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis import figures, sensitivity
from cvt_hpc.analysis.arrangement import CHOSEN, At, Sides
from cvt_hpc.analysis.classes import axes_in_words, check_results
from cvt_hpc.analysis.courses import line_of_study
from cvt_hpc.analysis.curves import set_frame
from cvt_hpc.analysis.hysteresis_bands import within
from cvt_hpc.analysis.measured import File, Overlay, Side, side_of
from cvt_hpc.analysis.probability import CONTOURS, PROBABILITY, over_samples
from cvt_hpc.analysis.value_maps import value_map_figure
from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.job.axes import SAMPLE, SWAPPED

Array = NDArray[np.float64]
LINE, BAND = figures.COLOURS[0], "#9ecae1"
_DEEP = figures.COLOURS[1]
_BOUNDS = ("", "_low", "_high")  # a value and the ends of its 95 % bounds
LEAST, HEIGHT, FRAME = 1.3, 2.8, 1.3  # [inch]: a panel at least and else, and title and legend


class _Panel(NamedTuple):
    """A line and the band around it, arrays over x in units for people."""

    title: str
    low: Array
    middle: Array
    high: Array


@figures.styled
def probability_figure(
    dataset: xr.Dataset, at: At = None, source: str = "results", sides: Sides = CHOSEN, measured: File = None
) -> Figure:
    """Draw the probability of vibration: over two axes with contours, over one with its 95 % interval.

    Arguments as of all pictures of results (`figures.py`), with the axis `sample`; or their `probabilities`.
    Where no verdict on vibration is known, the probability of failure is drawn.
    """
    told = over_samples(dataset, at or {})
    name = PROBABILITY if np.isfinite(told[PROBABILITY]).any() else "failure_probability"
    arrangement = layout.arrange(told, at or {}, source, sides)
    if arrangement.y:
        return value_map_figure(told, [name], at, source, sides, measured=measured)
    over = Overlay(measured, told, source)
    shown = arrangement.dataset
    panel = _Panel("", *(shown[one].values for one in (f"{name}_low", name, f"{name}_high")))
    labels = "of the samples", "95 % interval"
    x = layout.ruler(shown[arrangement.x])
    figure, (axes,) = _draw_bands([panel], x, figures.in_words(shown[name]), labels, source, "")
    axes.set_ylim(-0.03, 1.03)
    over.draw(axes, side_of(shown, arrangement.x), Side("", np.array(axes.get_ylim())), shown)
    for share in CONTOURS:
        axes.axhline(share, color="#777777", ls="--" if share != CONTOURS[1] else "-", lw=0.8, zorder=0.5)
    head = f"P{figures.in_words(shown[name])[1:]}"
    fixed = [*arrangement.notes, line_of_study(dataset)]
    lines = [figures.headline(head, dataset.attrs), told.attrs["counted"], *fixed, over.note]
    set_frame(figure, figures.entries_of([axes]) | over.entries, lines)
    return figure


def _along(dataset: xr.Dataset, along: str, fixed: Collection[str]) -> tuple[str, str]:
    """Axis along which vibration sets in, by default the likeliest, and a line that names other ones."""
    likely, *others = sensitivity.onset_axes(dataset, fixed) or [""]
    chosen = along or not others
    return along or likely, "" if chosen else f"along another axis: --along {' or '.join(others)}"


@figures.styled
def onset_bands_figure(
    dataset: xr.Dataset,
    at: At = None,
    source: str = "results",
    sides: Sides = CHOSEN,
    along: str = "",
    measured: File = None,
) -> Figure:
    """Draw the onset of vibration along an axis over another one: its median and 5 to 95 % of the samples.

    Arguments as of all pictures of results (`figures.py`), with the axis `sample` and another one beside that
    along which vibration sets in: by default as of `onset_axes`.
    """
    check_results(dataset, source)
    told = over_samples(dataset, at or {})
    along, other = _along(dataset, along, at or {})
    known = [name for name in map(str, told["status"].dims) if name not in (at or {})]
    if "counted" not in told.attrs or along not in known or told["status"].ndim < 2:
        which = f"{along} with numbers" if along else "one of numbers"
        expected = f"results over samples, {which}, and a further axis, such as friction_gradient"
        raise mismatch(source, expected, axes_in_words(dataset))
    overlay = Overlay(measured, told, source)
    quantiles = sensitivity.onset_scatter(dataset, along)["onset"]
    axes_left = xr.Dataset({"status": told["status"].isel({along: 0}, drop=True), "onset": quantiles})
    arrangement = layout.arrange(axes_left, at or {}, source, Sides(sides.x, sides.panel))
    arrangement = layout.first_panel(arrangement)
    shown, over = arrangement.dataset, arrangement.y
    factor, unit = figures.coordinate_unit(quantiles.attrs)
    panels = []
    for place in range(shown.sizes[over]) if over else (0,):
        part = shown["onset"].isel({over: place}) if over else shown["onset"]
        title = layout.place_text(shown[over], place, ": ") if over else ""
        values = factor * part.transpose("quantile", ...).values
        low, _, high = np.clip(values, *_ends(factor * told[along].values))
        panels.append(_Panel(title, low, np.where(np.isinf(values[1]), np.nan, values[1]), high))
    label = f"onset in {figures.axis_label(told[along], unit)}"
    least, _, most = sensitivity.QUANTILES
    labels = "median", f"{least} to {most} of the samples"
    then = "fix an axis, as by `--at AXIS=VALUE`"
    ruler = layout.ruler(shown[arrangement.x])
    figure, all_axes = _draw_bands(panels, ruler, label, labels, source, then)
    if measured is not None:  # what was measured may lie far from the bands
        reached = factor * told[along].values[np.isfinite(told[along].values)]
        all_axes[0].set_ylim(*_ends(np.array([*all_axes[0].get_ylim(), *reached])))
    x, y = side_of(shown, arrangement.x), Side(along, np.array(all_axes[0].get_ylim()), factor)
    for place, axes in enumerate(all_axes):
        overlay.draw(axes, x, y, shown.isel({over: place} if over else {}))
    size = dataset.sizes[SAMPLE] * (2 if SWAPPED in dataset.dims else 1)
    samples = f"{size} samples, onsets {within(told[along])}; the band ends where the axis does"
    head = figures.headline("Onset of vibration", dataset.attrs)
    lines = [head, samples, other, *arrangement.notes, overlay.note]
    set_frame(figure, figures.entries_of(all_axes[:1]) | overlay.entries, lines)
    return figure


@figures.styled
def sensitivity_figure(
    dataset: xr.Dataset, at: At = None, source: str = "results", along: str = ""
) -> Figure:
    """Draw which uncertain parameters the onset of vibration depends on, a bar for each.

    Side by side: its median in the lowest and the highest quarter of the samples, by the parameter; its
    scatter as it is, and with half that of the parameter; Sobol indices, where the job has the runs.

    Arguments as of all pictures of results (`figures.py`), with the axis `sample` and the job that states the
    distributions. Further axes are fixed where the scatter of the onset is widest. Vibration sets in `along`
    an axis, by default as of `onset_axes`.
    """
    check_results(dataset, source)
    dims = list(map(str, dataset["status"].dims))
    for name, value in (at or {}).items():
        where = f"{source}: at {name}"
        if name not in dims:
            raise unknown(where, "axis of the results", name, dims)
        dataset = dataset.isel({name: [layout.index_of(dataset[name], value, where)]})
    along, other = _along(dataset, along, at or {})
    found = sensitivity.onset_scatter(dataset, along, source)
    if "band" not in found:
        raise mismatch(source, "results with the job that states the distributions", "others")
    row = sensitivity.widest_row(found)
    place = ", ".join(layout.place_text(found[name], k, " = ") for name, k in row.items())
    head = figures.headline(f"What the onset in {figures.in_words(dataset[along])} depends on", dataset.attrs)
    lines = [head, place.replace("_", " "), other]
    here = found.isel(row)
    if not np.any(here["onset"] < np.inf):
        lines.append("hardly any sample vibrates along the axis: extend it, or take more samples")
    swing = np.abs(here["quarter_onset"].diff("quarter").values[0])
    here = here.isel(parameter=np.argsort(np.where(np.isfinite(swing), swing, -1.0)))
    factor, unit = figures.coordinate_unit(here[sensitivity.ONSET].attrs)
    ends = _ends(dataset[along].values[np.isfinite(dataset[along].values)])
    if here["band"].item() < sensitivity.COARSE * (step := here["step"].item()):
        lines.append(f"known no better than the step of {factor * step:.3g} {unit}: take a finer axis")
    middle = factor * np.clip(here[sensitivity.ONSET].values[1], *ends)
    medians = factor * np.clip(here["quarter_onset"].fillna(middle / factor).values, *ends)
    places, names = np.arange(float(here.sizes["parameter"])), here["parameter"].values
    heads = [f"median onset [{unit}]", f"5 to 95 % [{unit}]"]
    heads += ["Sobol index"] * (SWAPPED in dims)
    figure = Figure((figures.WIDTH, FRAME + 0.45 * places.size + 0.3), layout="constrained")
    all_axes = figure.subplots(1, len(heads), sharey=True)
    for median, colour, quarter in zip(medians, (LINE, _DEEP), sensitivity.QUARTERS, strict=True):
        label = f"{quarter} of the parameter"
        all_axes[0].barh(places, median - middle, left=middle, color=colour, label=label)
    halved = factor * np.stack([here[f"halved_band{end}"].values for end in _BOUNDS])
    _draw_bars(all_axes[1], places, halved, "half its scatter", BAND)
    if np.isfinite(band := factor * here["band"].item()):
        all_axes[1].axvline(band, color="k", ls="--", lw=1.0, label="scatter as it is")
    if SWAPPED in dims:
        shares = sensitivity.indices_of(dataset, sensitivity.ONSET, along, source)
        shares = shares.isel(row).sel(parameter=names)
        for key, shift, colour in (("first_order", 0.18, "#756bb1"), ("total_order", -0.18, "#bcbddc")):
            values = np.stack([shares[f"{key}{end}"].values for end in _BOUNDS])
            _draw_bars(all_axes[2], places + shift, values, key.replace("_", " "), colour, 0.34)
    all_axes[0].set_yticks(places, [",\n".join(sensitivity.members(dataset, str(name))) for name in names])
    for axes, head in zip(all_axes, heads, strict=True):
        axes.set_xlabel(head)
        axes.grid(axis="x", lw=0.4, alpha=0.5)
    set_frame(figure, figures.entries_of(all_axes), lines)
    return figure


def _draw_bars(
    axes: Axes, places: Array, values: Array, label: str, colour: str, height: float = 0.8
) -> None:
    """Draw bars of values and their bounds, shape (3, places); none where one is not known or infinite."""
    known = np.isfinite(values[0])
    with np.errstate(invalid="ignore"):
        errors = np.abs(values[1:] - values[0])
    errors = np.where(np.isfinite(errors) & known, errors, 0.0)
    bars = {"xerr": errors, "error_kw": {"lw": 1.0, "capsize": 2.5}}
    axes.barh(places, np.where(known, values[0], 0.0), height, color=colour, label=label, **bars)
    for place in places[np.isinf(values[0])]:
        axes.text(0.0, place, " beyond the axis", va="center", fontsize="small")


def _ends(values: Array) -> tuple[float, float]:
    return float(values.min()), float(values.max())


def _draw_bands(
    panels: Sequence[_Panel], x: layout.Ruler, label: str, labels: tuple[str, str], source: str, then: str
) -> tuple[Figure, list[Axes]]:
    """Draw a line and a band in each panel, and return the figure and its panels."""
    page = len(panels), (1, 2), (LEAST, HEIGHT), FRAME, source, then
    figure, grid, _ = figures.panels_on_a_page(*page, sharex=True, sharey=True)
    all_axes = list(grid.flat[: len(panels)])
    for axes, panel in zip(all_axes, panels, strict=True):
        axes.fill_between(x.centres, panel.low, panel.high, color=BAND, lw=0, label=labels[1])
        axes.plot(x.centres, panel.middle, color=LINE, marker="o", ms=3.5, lw=1.5, label=labels[0])
        axes.set_title(panel.title, loc="left", pad=3)
        x.lay_out(axes.xaxis)
        axes.grid(lw=0.4, alpha=0.5)
    figures.label_x(grid, len(panels), x.label)
    figure.supylabel(label)
    return figure, all_axes
