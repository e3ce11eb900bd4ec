"""Sliding in the plane of an arc: fig. 4 of Bullinger et al. 2005, fig. 4.1 of Lebrecht et al. 2004."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cvt_hpc.analysis.figures import WIDTH, styled
from cvt_hpc.analysis.profiles import inside
from cvt_hpc.analysis.telling_apart import entitle_runs, on_axes

INWARDS, OUTWARDS = "#0072b2", "#d55e00"
PARTS = {"radial_sliding": "#0072b2", "tangential_sliding": "#009e73"}
LINES = ("-", "--", ":")
ARROWS = 11  # along a wrap
ARROW: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.009, "zorder": 3}
LONGEST = 0.33  # of the pulley's radius: the longest arrow of a kind
DEPTH = 0.25  # of the radius: how deep the way into the groove is drawn
PULLEYS = ("driving", "driven")
SLIDES = "sliding of the element"


class _Arc:
    """The arc of a pulley in the plane, the other pulley below: turned so that its middle is on top."""

    def __init__(self, history: xr.Dataset, pulley: str) -> None:
        self._here, self._history = inside(history, pulley), history
        self.wrap = history["wrap_angle"].values[self._here]
        # the belt runs clockwise around
        around = 0.5 * np.pi + 0.5 * self.wrap[-1] - self.wrap
        self.outward = np.array([np.cos(around), np.sin(around)])
        self.forward = np.array([np.sin(around), -np.cos(around)])
        self.radius = float(np.ptp(history["position"].values[self._here][:-1]) / self.wrap[-2])

    def of(self, name: str) -> np.ndarray:
        """A quantity at its stations, (n,)."""
        values: np.ndarray = self._history[name].values[self._here]
        return values

    @property
    def arrows(self) -> np.ndarray:
        """Stations at which arrows are drawn."""
        return np.linspace(1, self.wrap.size - 2, ARROWS).round().astype(int)

    def draw(self, axes: Axes, offset: np.ndarray | float = 0.0, **style: object) -> np.ndarray:
        """Draw a line around, off the circle by an offset [m], and return its points (2, n) [mm]."""
        points: np.ndarray = 1e3 * (self.radius + offset) * self.outward
        axes.plot(*points, **style)  # type: ignore[arg-type]  # of a line
        return points

    def frame(self, axes: Axes) -> None:
        """Name the ends, and leave out all scales."""
        for k, name in ((0, "inlet"), (-1, "outlet")):
            place = 1e3 * self.radius * self.outward[:, k] * 1.13 - [0.0, 60.0 * self.radius]
            axes.text(*place, name, ha="center", va="top", fontsize=9)
        axes.set_aspect("equal")
        axes.set_axis_off()
        axes.margins(0.12)


@styled
def sliding_figure(histories: Sequence[xr.Dataset]) -> Figure:
    """Draw how elements slide on both pulleys, with friction against it, and both parts over the wraps.

    Parameters
    ----------
    histories : sequence of Dataset
        With speeds and forces by `position`; arrows are those of the first one.

    Returns
    -------
    Figure
        Arrows of sliding have a scale of their own on each pulley, those of friction show its direction.
    """
    _, labels = on_axes(histories)
    figure = Figure((WIDTH * 1.2, 5.6), layout="constrained")
    panels = figure.subplots(2, 2, height_ratios=[1.25, 1.0])
    reach = 1e3 * max(_Arc(histories[0], pulley).radius for pulley in PULLEYS)
    for column, pulley in enumerate(PULLEYS):
        _draw_vectors(panels[0, column], _Arc(histories[0], pulley))
        panels[0, column].set_title(f"{pulley} pulley", pad=2)
        below = panels[1, column]
        for k, history in enumerate(histories):
            arc = _Arc(history, pulley)
            told = ", ".join(labels[k].values())
            for name, colour in PARTS.items():
                label = f"{name.split('_')[0]}, {told}"
                style = {"color": colour, "ls": LINES[k % len(LINES)], "lw": 1.3, "label": label}
                below.plot(np.degrees(arc.wrap), 1e3 * arc.of(name), **style)
        below.axhline(0.0, color="#333333", lw=0.7, zorder=1)
        below.grid(lw=0.4, alpha=0.5)
        below.set_xlabel("wrap angle [°]")
    panels[1, 0].set_ylabel("sliding on the sheaves [mm/s]")
    for axes in panels[0]:
        axes.set(xlim=(-1.6 * reach, 1.6 * reach), ylim=(-0.55 * reach, 1.5 * reach))
    entries = [axes.get_legend_handles_labels() for axes in panels[:, 0]]
    handles, texts = ([part for entry in entries for part in entry[k]] for k in (0, 1))
    figure.legend(handles, texts, loc="outside lower center", frameon=False, ncols=2)
    arrows = f"arrows: {', '.join(labels[0].values())}"
    entitle_runs(figure, histories, "Sliding, and friction against it", arrows, width=84)
    return figure


def _draw_vectors(axes: Axes, arc: _Arc) -> None:
    """Arrows of sliding, and of friction on the element."""
    points = arc.draw(axes, color="#333333", lw=1.2)
    radial, tangential = arc.of("radial_sliding"), arc.of("tangential_sliding")
    sliding = radial * arc.outward + tangential * arc.forward
    size = np.hypot(*sliding)
    friction = -sliding / np.maximum(size, 1e-12)  # its direction
    at = arc.arrows
    longest = float(size[at].max())
    for vector, colour, name in (
        (sliding, OUTWARDS, SLIDES),
        (0.5 * friction, "#333333", "direction of friction on the element"),
    ):
        vector = vector[:, at] * (1e3 * LONGEST * arc.radius / (longest if name == SLIDES else 1.0))
        axes.quiver(*points[:, at], *vector, color=colour, label=name, **ARROW)
        axes.update_datalim((points[:, at] + vector).T)
    arc.frame(axes)


@styled
def spiral_figure(history: xr.Dataset, pulley: str) -> Figure:
    """Draw the way of the elements into the groove of a pulley and out again.

    Parameters
    ----------
    history : Dataset
        With `mean_displacement` [m] and `radial_sliding` [m/s] by `position`.
    pulley : str
        "driving" or "driven".

    Returns
    -------
    Figure
        Left the arc, with the way into the groove drawn larger than it is; right both over the wrap.
    """
    arc = _Arc(history, pulley)
    way, speed = arc.of("mean_displacement"), arc.of("radial_sliding")
    depth = way - way[0]
    larger = DEPTH * arc.radius / max(float(-depth.min()), 1e-9)
    figure = Figure((WIDTH * 1.2, 3.9), layout="constrained")
    columns = figure.subplot_mosaic([["plane", "way"], ["plane", "speed"]], width_ratios=[1.25, 1.0])
    plane = columns["plane"]
    arc.draw(plane, color="#8a8a8a", lw=1.0, ls="--", label="radius at the inlet")
    points = arc.draw(plane, larger * depth, color="#333333", lw=1.4, label="way of the elements")
    innermost = int(np.argmin(way))
    plane.plot(*points[:, innermost], "o", color="#333333", ms=6, label="innermost point")
    at = arc.arrows
    vectors = speed[at] * arc.outward[:, at] * (1e3 * LONGEST * arc.radius / np.abs(speed).max())
    for sign, colour, name in ((-1.0, INWARDS, "moves inwards"), (1.0, OUTWARDS, "moves outwards")):
        which = sign * speed[at] > 0.0
        plane.quiver(*points[:, at[which]], *vectors[:, which], color=colour, label=name, **ARROW)
    plane.update_datalim((points[:, at] + vectors).T)
    arc.frame(plane)
    plane.legend(loc="lower center", frameon=False, fontsize=9)
    right = ((columns["way"], 1e3 * depth, "way [mm]"), (columns["speed"], 1e3 * speed, "speed [mm/s]"))
    for axes, values, name in right:
        axes.plot(np.degrees(arc.wrap), values, color="#333333", lw=1.3)
        axes.axhline(0.0, color="#333333", lw=0.7)
        axes.axvline(np.degrees(arc.wrap[innermost]), color="#8a8a8a", lw=0.9, ls=":")
        axes.set_ylabel(f"radial {name}")
        axes.grid(lw=0.4, alpha=0.5)
    columns["speed"].set_xlabel("wrap angle [°]")
    depth = f"left, the way into the groove is drawn {larger:.2g} times as deep as it is"
    entitle_runs(figure, [history], f"Elements in the {pulley} arc", depth, width=84)
    return figure
