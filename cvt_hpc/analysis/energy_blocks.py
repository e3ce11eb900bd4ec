"""Source of energy, switch and oscillator in watts, as fig. 4.4 of Lebrecht et al. 2004."""

import json
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from cvt_hpc.analysis.figures import WIDTH, styled
from cvt_hpc.analysis.telling_apart import entitle_runs, on_axes
from cvt_hpc.analysis.ticks import number

ROW = 1.9  # [inch]
SILENT = 1e-7  # [m]
SIGNED = "+.2g"
FEEDING, TAKING = "#d55e00", "#0072b2"
TAKEN = ("belt", "ring", "layer", "lag")


class Powers(NamedTuple):
    """What of a run the block diagram shows [W].

    Attributes
    ----------
    spiral : float
        Which friction takes from the mean radial motion through the arcs, into the sheaves and out again.
    outlet : float
        Which friction feeds into the vibration in the last quarter of the driven arc; negative: takes.
    elsewhere : float
        The same in all other parts of both arcs.
    stresses : float
        Which push and tension feed into the vibration, where gaps open and close.
    taken : float
        Which dampers of belt, layers and sheave and friction of the rings take from the vibration.
    """

    spiral: float
    outlet: float
    elsewhere: float
    stresses: float
    taken: float


def powers_of(history: xr.Dataset) -> Powers:
    """Powers of a run, by its history."""
    angle = json.loads(history.attrs["point"])["half_wedge_angle"]
    # f_P,n = f_ax cos d + (p_r / 2) sin d, of which p_r less 2 f_ax tan d is friction
    friction = 2.0 * (history["normal_force"] - history["contact_force"] / np.cos(angle)) / np.sin(angle)
    cell = float(np.diff(history["position"].values).mean())
    spiral = -cell * float((friction * history["radial_sliding"]).sum())
    fed = history["flank_fed"]
    outlet = float(fed.sel(pulley="driven").values[-1])
    taken = sum(float(history[f"{name}_taken"]) for name in TAKEN)
    return Powers(spiral, outlet, float(fed.sum()) - outlet, float(history["stress_fed"]), taken)


@styled
def blocks_figure(histories: Sequence[xr.Dataset]) -> Figure:
    """Draw a block diagram of each run below each other.

    Parameters
    ----------
    histories : sequence of Dataset
        Of the elastic belt, with what feeds the fluctuations.
    """
    _, labels = on_axes(histories)
    figure = Figure((WIDTH * 1.2, ROW * len(histories) + 0.7), layout="constrained")
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
    strands = ", ".join(f"{strand} {size:.2g} µm" for strand, size in sizes)
    if amplitude.max() < SILENT:
        strands = "silent"
    blocks = (
        (0.0, "source of energy", f"spiral motion of the belt:\nfriction takes {found.spiral:.0f} W"),
        (1.0, "switch", "curve of friction: less\nalong the motion"),
        (2.0, "oscillator", f"elements and belt:\n{strands}"),
    )
    for x, name, text in blocks:
        axes.add_patch(
            FancyBboxPatch((x, 0.0), 0.72, 0.62, "round,pad=0.02", facecolor="#f2f2f2", edgecolor="#333333")
        )
        axes.text(x + 0.36, 0.52, name, ha="center", va="top", fontweight="bold", fontsize=9)
        axes.text(x + 0.36, 0.24, text, ha="center", va="center", fontsize=8.5)
    _arrow(axes, (0.76, 0.31), (0.96, 0.31), "#333333")
    fed = found.outlet
    ends = ((1.76, 0.42), (1.96, 0.42)) if fed > 0.0 else ((1.96, 0.42), (1.76, 0.42))
    _arrow(axes, *ends, FEEDING if fed > 0.0 else TAKING)
    axes.text(1.86, 0.7, f"driven outlet {number(fed, SIGNED)} W", ha="center", va="bottom", fontsize=8.5)
    _arrow(axes, (2.36, -0.04), (1.36, -0.04), "#333333", "arc3,rad=-0.25")
    axes.text(1.86, -0.35, "its state sets the switch", ha="center", va="top", fontsize=8.5)
    _arrow(axes, (2.76, 0.31), (2.96, 0.31), TAKING)
    rest = (
        ("other flanks", found.elsewhere),
        ("push, tension", found.stresses),
        ("dampers, rings", -found.taken),
    )
    losses = "\n".join(f"{name} {number(power, SIGNED)} W" for name, power in rest)
    axes.text(2.99, 0.31, losses, va="center", fontsize=8.5)
    axes.set(xlim=(-0.05, 3.65), ylim=(-0.5, 0.85))
    axes.set_axis_off()


def _arrow(
    axes: Axes, start: tuple[float, float], end: tuple[float, float], colour: str, bend: str = "arc3"
) -> None:
    style = {"arrowstyle": "-|>", "mutation_scale": 14, "lw": 1.6, "color": colour, "connectionstyle": bend}
    axes.add_patch(FancyArrowPatch(start, end, **style))
