"""The figures that jobs reproduce: how each is drawn and what the paper says of it.

Sliding in the plane of an arc, fig. 4 of Bullinger et al. 2005 and 4.1 of Lebrecht et al. 2004, is drawn
here.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cvt_hpc.analysis.curves import curve_figure, curve_panels_figure
from cvt_hpc.analysis.figures import WIDTH, draw, styled
from cvt_hpc.analysis.followed_drawing import element_figure
from cvt_hpc.analysis.paper_pictures import (
    blocks_figure,
    friction_figure,
    spectrum_figure,
    strand_bars_figure,
)
from cvt_hpc.analysis.profiles import inside, profile_figure, wrap_figure
from cvt_hpc.analysis.ramps import course_figure, ramp_figure
from cvt_hpc.analysis.telling_apart import entitle_runs, on_axes
from cvt_hpc.analysis.waterfall import waterfall_figure
from cvt_hpc.errors import unknown
from cvt_hpc.papers import (
    bullinger_along,
    bullinger_ratios,
    cepon,
    geier,
    lebrecht_belt,
    lebrecht_excitation,
    schindler,
)
from cvt_hpc.papers.verdicts import Finding, Kept, Statement, judged, opened
from cvt_hpc.storage.files import write_rows
from cvt_hpc.storage.provenance import origin_lines

INWARDS, OUTWARDS = "#0072b2", "#d55e00"
PARTS = {"radial_sliding": "#0072b2", "tangential_sliding": "#009e73"}
LINES = ("-", "--", ":")
ARROWS = 11  # along a wrap
ARROW: dict[str, Any] = {"angles": "xy", "scale_units": "xy", "scale": 1.0, "width": 0.009, "zorder": 3}
LONGEST = 0.33  # of the pulley's radius: the longest arrow of a kind
DEPTH = 0.25  # of the radius: how deep the way into the groove is drawn
PULLEYS = ("driving", "driven")
SLIDES = "sliding of the element"

SLIDING = ("radial_sliding", "sliding_speed")
COLUMNS = ("figure", "statement", "verdict", "measured", "why")


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
        """Stations at which arrows are drawn, about equally far apart."""
        return np.abs(self.wrap[:, None] - np.linspace(self.wrap[1], self.wrap[-2], ARROWS)).argmin(axis=0)

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


class PaperFigure(NamedTuple):
    """A figure of a paper."""

    source: str  # paper and number
    compose: Callable[[Kept], Figure]  # draws it of a study
    statements: Sequence[Statement]  # what the paper says of it


def _along(
    *quantities: str, region: str | None = None, columns: str | None = None
) -> Callable[[Kept], Figure]:
    """Quantities along the belt, of all histories."""
    return lambda kept: profile_figure(kept.histories, quantities, region, columns)


def _over(*quantities: str) -> Callable[[Kept], Figure]:
    """Quantities over the axis of the study."""
    return lambda kept: curve_figure(kept.results, quantities)


FIGURES = {
    f"bullinger_{number}": PaperFigure(f"Bullinger et al. 2005, fig. {int(number)}", compose, statements)
    for number, compose, statements in (
        ("04", lambda kept: sliding_figure(kept.histories), bullinger_along.FIGURE_4),
        ("05", lambda kept: strand_bars_figure(kept.results), bullinger_ratios.FIGURE_5),
        ("20", _along("push_force", "friction_force", "ring_friction"), bullinger_along.FIGURE_20),
        ("21", _along("mean_displacement", "sliding_angle"), bullinger_along.FIGURE_21),
        ("22", _along("push_force", "sliding_angle", columns="ratio"), bullinger_ratios.FIGURE_22),
        ("23", _along("normal_force", region="driving"), bullinger_ratios.FIGURE_23),
    )
}
FIGURES |= {
    f"lebrecht_{number.replace('.', '_')}": PaperFigure(
        f"Lebrecht et al. 2004, fig. {number}", compose, statements
    )
    for number, compose, statements in (
        ("3.1", lambda kept: course_figure(kept.histories[0], "driving_moment"), lebrecht_belt.FIGURE_3_1),
        ("3.2", lambda kept: waterfall_figure(kept.results), lebrecht_belt.FIGURE_3_2),
        ("3.6", lambda kept: strand_bars_figure(kept.results), lebrecht_belt.FIGURE_3_6),
        ("3.7", _over("eigenfrequency"), lebrecht_belt.FIGURE_3_7),
        ("3.9", lambda kept: ramp_figure(kept.histories), lebrecht_belt.FIGURE_3_9),
        ("3.10", lebrecht_belt.swings_figure, lebrecht_belt.FIGURE_3_10),
        ("3.11", lambda kept: spectrum_figure(kept.run()), lebrecht_belt.FIGURE_3_11),
        ("3.12", lambda kept: friction_figure(kept.results), lebrecht_excitation.FIGURE_3_12),
        ("3.13", lambda kept: ramp_figure(kept.histories), lebrecht_belt.FIGURE_3_13),
        ("3.14", lambda kept: ramp_figure(kept.histories), lebrecht_belt.FIGURE_3_14),
        ("4.1", lambda kept: spiral_figure(kept.histories[0], "driven"), lebrecht_excitation.FIGURE_4_1),
        (
            "4.2",
            lambda kept: element_figure(kept.histories[0], "driven", parts=SLIDING),
            lebrecht_excitation.FIGURE_4_2,
        ),
        ("4.4", lambda kept: blocks_figure(kept.histories), lebrecht_excitation.FIGURE_4_4),
    )
}
# several figures of these papers are of one job, by whose name they are found
FIGURES |= {
    job: PaperFigure(source, compose, statements)
    for job, source, compose, statements in (
        ("push_force", "Geier et al. 2007, fig. 4",
         _along("push_force", columns="load_share"), geier.FIGURE_4),
        ("spatial_push_force", "Geier et al. 2007, fig. 5", geier.push_parts_figure, geier.FIGURE_5),
        ("clamping", "Geier et al. 2007, figs 6, 7", _over(*geier.LOSSES), geier.FIGURES_6_7),
        ("belt_drive_friction", "Cepon and Boltezar 2011, fig. 3",
         cepon.friction_table_figure, cepon.FIGURE_3),
        ("belt_drive", "Cepon and Boltezar 2011, figs 7, 8",
         _over("speed_loss", "expected_speed_loss", "creep_speed_loss"), cepon.FIGURES_7_8),
        ("belt_drive_tension", "Cepon and Boltezar 2011, figs 9, 10",
         lambda kept: wrap_figure(kept.histories), cepon.FIGURES_9_10),
        ("belt_drive_spectra", "Cepon and Boltezar 2011, figs 11, 12",
         lambda kept: waterfall_figure(kept.results), cepon.FIGURES_11_12),
        ("belt_drive_roughness", "Cepon and Boltezar 2011, figs 11, 12",
         lambda kept: waterfall_figure(kept.results), cepon.ROUGH_FIGURES_11_12),
        ("serpentine", "Cepon and Boltezar 2011, figs 14 to 16",
         lambda kept: cepon.drive_figure(kept.histories[0]), cepon.FIGURES_14_16),
        ("misalignment", "Schindler et al. 2008, without a figure",
         lambda kept: curve_panels_figure(kept.results, schindler.SHOWN, "load"), schindler.MISALIGNMENT),
    )
}  # fmt: skip


def figure_of(folder: Path) -> tuple[Path, Path, list[Finding]]:
    """Draw the figure of a study and measure what its paper says of it.

    Parameters
    ----------
    folder : Path
        Output folder of one of the jobs of FIGURES.

    Returns
    -------
    picture, table : Path
        figure.png and statements.csv in the folder.
    findings : list of Finding
        In the paper's order.

    Raises
    ------
    InputError
        The folder is not that of such a job, or holds no results.
    """
    with opened(folder) as kept:
        name = str(kept.results.attrs.get("job_name", ""))
        if name not in FIGURES:
            raise unknown(f"{folder}: job {name}", "job of a paper's figure", name, list(FIGURES))
        figure = FIGURES[name]
        picture = draw(lambda: figure.compose(kept), folder / "figure.png")
        findings = [judged(statement, kept) for statement in figure.statements]
        origin = list(origin_lines(kept.results.attrs))
    rows = [(figure.source, one.text, one.verdict.value, one.numbers, one.why) for one in findings]
    return picture, write_rows(folder / "statements.csv", COLUMNS, rows, origin), findings


def finding_lines(findings: Sequence[Finding]) -> Iterator[str]:
    """Yield a line for each finding, and one that counts them."""
    for finding in findings:
        yield f"{finding.verdict.value}: {finding.text}"
        yield f"    {finding.numbers}" + (f"; {finding.why}" if finding.why else "")
    counts = Counter(finding.verdict.value for finding in findings)
    yield f"{len(findings)} statements: {', '.join(f'{n} {verdict}' for verdict, n in counts.items())}"
