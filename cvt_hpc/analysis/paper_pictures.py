"""Pictures of single figures of papers.

- Source of energy, switch and oscillator in watts, as fig. 4.4 of Lebrecht et al. 2004
- Spectra of the strands of one run, as their fig. 3.11
- Curves of friction over sliding speed, and where motion is fed: their fig. 3.12
- Tension and push force of the strands over an axis of a study, as fig. 5 of Bullinger et al. 2005
"""

import json
from collections.abc import Sequence
from itertools import cycle
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from cvt_hpc.analysis import figures
from cvt_hpc.analysis.arrangement import CHOSEN, At, Sides, arrange, check_sides, ruler
from cvt_hpc.analysis.classes import check_results
from cvt_hpc.analysis.curves import panels_of
from cvt_hpc.analysis.followed_drawing import lengths_of
from cvt_hpc.analysis.telling_apart import entitle_runs, on_axes
from cvt_hpc.errors import mismatch
from cvt_hpc.job import stored_job
from cvt_hpc.job.values import Table
from cvt_hpc.physics.friction import friction_coefficients, given_law
from cvt_hpc.variables import Status, Vibrates

POINTS = 400
MARKS = {
    Vibrates.YES: ({"marker": "o", "ms": 4.5}, "fed"),
    Vibrates.UNDECIDED: ({"marker": "o", "ms": 4.5, "fillstyle": "none"}, "undecided"),
}

HEIGHT = 3.8  # [inch]
_SHADES = {"t1": "#8a8a8a", "t2": "#c9c9c9"}
PUSH = "#d55e00"
_BAR = 0.36  # of the distance of two runs
NEEDED = ("mean_ring_tension", "mean_push_force")

_OF_STRANDS = {"t1": "#0072b2", "t2": "#d55e00"}
_LINES_OF_STRANDS = {"t1": "-", "t2": "--"}

ROW = 1.9  # [inch]
_SILENT = 1e-7  # [m]
_SIGNED = "+.2g"
_FEEDING, _TAKING = "#d55e00", "#0072b2"
TAKEN = ("belt", "ring", "layer", "lag")


class Powers(NamedTuple):
    """Powers of a run that the block diagram shows [W]."""

    spiral: float  # taken by friction from the mean radial motion through the arcs, into the sheaves and out
    outlet: float  # fed by friction into the vibration in the last quarter of the driven arc; negative: taken
    elsewhere: float  # the same in all other parts of both arcs
    stresses: float  # fed by push and tension into the vibration, where gaps open and close
    taken: float  # from the vibration by dampers of belt, layers and sheave and friction of the rings


def powers_of(history: xr.Dataset) -> Powers:
    """Powers of a run, by its history."""
    angle = json.loads(history.attrs["point"])["half_wedge_angle"]
    # f_P,n = f_ax cos d + (p_r / 2) sin d, of which p_r less 2 f_ax tan d is friction
    friction = 2.0 * (history["normal_force"] - history["contact_force"] / np.cos(angle)) / np.sin(angle)
    spiral = -float(np.nansum(lengths_of(history) * (friction * history["radial_sliding"]).values))
    fed = history["flank_fed"]
    outlet = float(fed.sel(pulley="driven").values[-1])
    taken = sum(float(history[f"{name}_taken"]) for name in TAKEN)
    return Powers(spiral, outlet, float(fed.sum()) - outlet, float(history["stress_fed"]), taken)


@figures.styled
def blocks_figure(histories: Sequence[xr.Dataset]) -> Figure:
    """Draw block diagrams of runs of the elastic belt, with what feeds the fluctuations, below each other."""
    _, labels = on_axes(histories)
    figure = Figure((figures.WIDTH * 1.2, ROW * len(histories) + 0.7), layout="constrained")
    rows = figure.subplots(len(histories), 1, squeeze=False)[:, 0]
    for axes, history, label in zip(rows, histories, labels, strict=True):
        _draw_blocks(axes, history)
        axes.set_title(", ".join(label.values()), loc="left", pad=2)
    entitle_runs(figure, histories, "Source, switch, oscillator", width=84)
    return figure


def _draw_blocks(axes: Axes, history: xr.Dataset) -> None:
    """The diagram of one run."""
    found = powers_of(history)
    amplitude = history["amplitude"].values
    sizes = zip(history["strand"].values, 1e6 * amplitude, strict=True)
    moving = ", ".join(f"{strand} {size:.2g} µm" for strand, size in sizes)
    strands = moving if amplitude.max() >= _SILENT else "silent"
    blocks = (
        (0.0, "source of energy", f"spiral motion of the belt:\nfriction takes {found.spiral:.0f} W"),
        (1.0, "switch", "curve of friction: less\nalong the motion"),
        (2.0, "oscillator", f"elements and belt:\n{strands}"),
    )
    for x, name, text in blocks:
        look = {"facecolor": "#f2f2f2", "edgecolor": "#333333"}
        axes.add_patch(FancyBboxPatch((x, 0.0), 0.72, 0.62, "round,pad=0.02", **look))
        axes.text(x + 0.36, 0.52, name, ha="center", va="top", fontweight="bold", fontsize=9)
        axes.text(x + 0.36, 0.24, text, ha="center", va="center", fontsize=8.5)
    _arrow(axes, (0.76, 0.31), (0.96, 0.31), "#333333")
    fed = found.outlet
    ends = ((1.76, 0.42), (1.96, 0.42)) if fed > 0.0 else ((1.96, 0.42), (1.76, 0.42))
    _arrow(axes, *ends, _FEEDING if fed > 0.0 else _TAKING)
    outlet = f"driven outlet {figures.number(fed, _SIGNED)} W"
    axes.text(1.86, 0.7, outlet, ha="center", va="bottom", fontsize=8.5)
    _arrow(axes, (2.36, -0.04), (1.36, -0.04), "#333333", "arc3,rad=-0.25")
    axes.text(1.86, -0.35, "its state sets the switch", ha="center", va="top", fontsize=8.5)
    _arrow(axes, (2.76, 0.31), (2.96, 0.31), _TAKING)
    rest = {"other flanks": found.elsewhere, "push, tension": found.stresses, "dampers, rings": -found.taken}
    losses = "\n".join(f"{name} {figures.number(power, _SIGNED)} W" for name, power in rest.items())
    axes.text(2.99, 0.31, losses, va="center", fontsize=8.5)
    axes.set(xlim=(-0.05, 3.65), ylim=(-0.5, 0.85))
    axes.set_axis_off()


def _arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str, bend: str = "arc3"
) -> None:
    style = {"arrowstyle": "-|>", "mutation_scale": 14, "lw": 1.6, "color": colour, "connectionstyle": bend}
    axes.add_patch(FancyArrowPatch(start, end, **style))


@figures.styled
def spectrum_figure(run: xr.Dataset) -> Figure:
    """Draw the amplitude of each strand over frequency, with the mode of its peaks.

    The run has `spectrum` [m] over `strand` and `frequency_bin` [Hz]; `peak_frequency` [Hz], `peak_amplitude`
    [m] and `peak_mode` over `strand` and `peak` (`[record] modal_peaks`).
    """
    figure = Figure((figures.WIDTH, 3.6), layout="constrained")
    axes = figure.subplots()
    lines = run["frequency_bin"].values
    for strand in map(str, run["strand"].values):
        of = run.sel(strand=strand)
        amplitude = 1e6 * of["spectrum"].values
        style = {"color": _OF_STRANDS[strand], "ls": _LINES_OF_STRANDS[strand], "lw": 1.3}
        axes.plot(lines, amplitude, label=f"strand {strand}", **style)
        largest = np.nanmax(of["peak_amplitude"].values, initial=0.0)
        for peak in range(of.sizes["peak"]):
            mode, size = int(of["peak_mode"][peak]), float(of["peak_amplitude"][peak])
            if mode and size > 0.05 * largest:
                at = float(of["peak_frequency"][peak])
                place = at, float(np.interp(at, lines, amplitude))
                words = {"textcoords": "offset points", "color": _OF_STRANDS[strand], "fontsize": 9}
                axes.annotate(f"mode {mode}", place, (5 if strand == "t2" else -38, 3), **words)
    axes.axvspan(500.0, 700.0, color="#ececec", lw=0, zorder=0, label="500 to 700 Hz")
    axes.set(xlabel="frequency [Hz]", ylabel="amplitude [µm]", xlim=(0.0, lines[-1]))
    axes.set_ylim(bottom=0.0)
    axes.grid(lw=0.4, alpha=0.5)
    figures.legend_below(figure, figures.entries_of([axes]), 3)
    figures.entitle(figure, [figures.headline("Spectra of the strands", run.attrs)], 76)
    return figure


@figures.styled
def strand_bars_figure(
    dataset: xr.Dataset, at: At = None, source: str = "results", sides: Sides = CHOSEN
) -> Figure:
    """Draw for each run what each strand carries: ring tension above zero, push force below.

    Arguments as of all pictures of results (`figures.py`), with `mean_ring_tension` and `mean_push_force` [N]
    over the job's axes and `strand`. The axis along x of a map, or that of `sides`, does so here; there is a
    panel for each value of the one that runs along y of a map, or of `sides.panel`. Too many are refused.
    """
    check_results(dataset, source)
    for name in NEEDED:
        if name not in dataset:
            raise mismatch(source, f"results with {', '.join(NEEDED)}", f"no {name}")
    check_sides(sides, list(map(str, dataset["status"].dims)), at or {}, source)
    # panels here are what `panels_of` makes of the rows of a map
    arrangement = arrange(dataset, at or {}, source, Sides(sides.x, sides.panel))
    figures.check_known(arrangement.dataset, NEEDED, source)
    panels, notes = panels_of(arrangement, source)
    figure = Figure((figures.WIDTH, HEIGHT), layout="constrained")
    row = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    x = ruler(arrangement.dataset[arrangement.x])
    along = arrangement.dataset[arrangement.x]
    ticks = list(x.tick_labels)
    if len(ticks) != along.size:
        ticks = list(figures.short_numbers(figures.coordinate_unit(along.attrs)[0] * along.values))
    for axes, (title, shown) in zip(row, panels, strict=True):
        _draw_bars(axes, shown.transpose(arrangement.x, ...))
        axes.set_title(title, loc="left", pad=4)
        figures.put_ticks(axes.xaxis, np.arange(float(len(ticks))), ticks)
        axes.set_xlabel(x.label)
    row[0].set_ylabel("push force | ring tension [kN]")
    figures.legend_below(figure, figures.entries_of(row[:1]), 4)
    figures.entitle(figure, [figures.headline("Forces in the strands", dataset.attrs), *notes], 76)
    return figure


def _draw_bars(axes: Axes, shown: xr.Dataset) -> None:
    """A pair of bars for each run, one for each strand."""
    places = np.arange(shown["status"].size)
    done = shown["status"].values == Status.DONE
    for k, strand in enumerate(str(name) for name in shown["strand"].values):
        left = places + (k - 0.5) * (_BAR + 0.04)
        of = shown.sel(strand=strand)
        tension, push = (1e-3 * np.where(done, of[name].values, np.nan) for name in NEEDED)
        label = {"label": f"tension {strand}"}
        axes.bar(left, tension, _BAR, color=_SHADES[strand], edgecolor="#333333", lw=0.6, **label)
        hatch = {"hatch": "" if k else "///", "label": f"push {strand}"}
        axes.bar(left, -push, _BAR, color=PUSH, alpha=0.75, edgecolor="#333333", lw=0.6, **hatch)
    axes.axhline(0.0, color="#333333", linewidth=0.8)
    axes.grid(axis="y", linewidth=0.4, alpha=0.5)


def curves_of(dataset: xr.Dataset, speeds: np.ndarray) -> dict[float, np.ndarray]:
    """Coefficients of friction, regularised, at speeds (n,) [m/s] by the gradient [s/m] of each law.

    The study is one of the energy criterion over `friction_gradient` and `radial_speed`.
    """
    job: Any = stored_job(json.loads(dataset.attrs["job"]), "dataset")
    found = {}
    for gradient in dataset["friction_gradient"].values:
        found[float(gradient)] = regularised(job.point_at({"friction_gradient": float(gradient)}), speeds)
    return found


def regularised(point: Table, speeds: np.ndarray) -> np.ndarray:
    """Coefficients of friction (n,) of a run's parameters [SI] at sliding speeds (n,) [m/s], unloaded."""
    coefficients = friction_coefficients(given_law(point), speeds, np.zeros(speeds.size))
    return np.asarray(coefficients * np.tanh(speeds / point["friction_speed"]))


@figures.styled
def friction_figure(dataset: xr.Dataset) -> Figure:
    """Draw the `curves_of` a study, with marks where the criterion says that radial motion is fed."""
    sliding = dataset["radial_speed"].values
    along = np.linspace(0.0, sliding.max(), POINTS)
    figure = Figure((figures.WIDTH, 3.8), layout="constrained")
    axes = figure.subplots()
    looks = zip(cycle(figures.COLOURS), cycle(figures.LINES), strict=False)
    for (gradient, curve), (colour, line) in zip(curves_of(dataset, along).items(), looks, strict=False):
        label = f"{figures.number(gradient, 'g')} s/m"
        axes.plot(1e3 * along, curve, color=colour, ls=line, lw=1.4, label=label)
        verdicts = dataset["vibrates"].sel(friction_gradient=gradient).values
        for verdict, (style, _) in MARKS.items():
            at = sliding[verdicts == verdict]
            axes.plot(1e3 * at, np.interp(at, along, curve), ls="", color=colour, **style)
    for style, label in MARKS.values():
        axes.plot([], [], ls="", color="#333333", label=f"radial motion {label}", **style)
    axes.set(xlabel="sliding speed [mm/s]", ylabel="coefficient of friction", xlim=(0.0, 1e3 * along[-1]))
    axes.set_ylim(bottom=0.0)
    axes.grid(lw=0.4, alpha=0.5)
    figures.legend_below(figure, figures.entries_of([axes]), 3)
    marks = "marks: by the energy criterion, of radial sliding at that speed"
    figures.entitle(figure, [figures.headline("Curves of friction", dataset.attrs), marks], 76)
    return figure
