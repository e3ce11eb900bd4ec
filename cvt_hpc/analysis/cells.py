"""The cells of a map: a run's class shows in lightness, in hatching, and in the mark on its grid point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, ListedColormap, LogNorm, Normalize, to_hex, to_rgba
from matplotlib.figure import Figure, FigureBase
from matplotlib.image import PcolorImage
from matplotlib.legend_handler import HandlerTuple
from matplotlib.lines import Line2D
from matplotlib.patches import Patch, PathPatch
from matplotlib.path import Path
from numpy.typing import ArrayLike, NDArray

from cvt_hpc.analysis import figures
from cvt_hpc.analysis.arrangement import Ruler
from cvt_hpc.analysis.classes import OccurrenceClass
from cvt_hpc.errors import mismatch, show
from cvt_hpc.vibration.classes import PairClass, StartClass

Array = NDArray[np.float64]
# [um] All maps have one scale of amplitudes, so that they compare: from less than the threshold of vibration
# to the largest of pushbelts; equal ratios, as in dB, are equally far apart.
_AMPLITUDES = 2.0, 200.0
AMPLITUDE_TICKS = 2, 5, 10, 20, 50, 100, 200
FIT = "fit"  # instead of a value: colours end where the amplitudes of a map do
End = float | str | None
# share of values on a scale, where the others reach so far beyond; of so many
MOST, FAR, MANY = 0.98, 1.5, 20
_MOST_BORDERS = 20_000  # sides between cells of different class: more would hide the cells
Mask = NDArray[np.bool_]
CellClass = OccurrenceClass | StartClass | PairClass


@dataclass(frozen=True)
class ClassStyle:
    """Look of a class: fill and hatching of its cells, mark on the grid points with its relative size."""

    fill: str
    ink: str
    rim: str
    hatch: str
    mark: str
    mark_size: float

    def marks(self, size: float) -> dict[str, Any]:
        """Return how marks are drawn that are not joined, for the size of a dot [point]."""
        look = {"marker": self.mark, "ms": size * self.mark_size, "color": self.ink, "mec": self.rim}
        return {"ls": "", **look}


# Lightness falls from not run (white) over quiet to undecided; vibrating cells follow below. Failed ones are
# white under the densest hatching, which no other class comes near in any print.
STYLES: dict[CellClass, ClassStyle] = {
    OccurrenceClass.QUIET: ClassStyle("#e9eef2", "#7c8a96", "#7c8a96", "", "o", 0.5),
    OccurrenceClass.VIBRATING: ClassStyle("#e8703a", "#ffffff", "#000000", "", "o", 1.0),
    OccurrenceClass.UNDECIDED: ClassStyle("#bccde0", "#23405f", "#23405f", "///", "$?$", 2.0),
    OccurrenceClass.FAILED: ClassStyle("#ffffff", "#a01010", "#ffffff", "xxxx", "X", 2.2),
    OccurrenceClass.NOT_RUN: ClassStyle("#ffffff", "#8a8a8a", "#8a8a8a", "", "_", 1.4),
    OccurrenceClass.SLIPPING: ClassStyle("#c9d8a6", "#4a5a14", "#ffffff", "...", ">", 1.3),
    OccurrenceClass.IRREGULAR: ClassStyle("#f3dca3", "#7a4b00", "#ffffff", "|||", "*", 1.8),
}
LEGEND_COLUMNS = 5
LEADING = ClassStyle("#e8703a", "#ffffff", "#000000", "", "D", 1.2)  # vibrating, its harmonics lead

# Of maps from two starts: lighter than any vibration, and hatched the other way than what is undecided.
OF_STARTS: dict[CellClass, ClassStyle] = {
    StartClass.LARGE_START_ONLY: ClassStyle("#d8c5ea", "#5b2a86", "#ffffff", "\\\\\\", "D", 1.0)
}

# Of comparisons: contradictions are blue, which nobody takes for the orange of vibration, dark beyond the
# threshold and light near it; the mark points up where B alone vibrates.
OF_PAIRS: dict[CellClass, ClassStyle] = {
    PairClass.FAILED_IN_ONE: ClassStyle("#ffffff", "#a01010", "#a01010", "++", "+", 1.4),
    PairClass.OTHERWISE: ClassStyle("#f6f0c4", "#6b6420", "#6b6420", "...", "d", 1.0),
    PairClass.A_ONLY_NEAR: ClassStyle("#7fb0dc", "#123a6b", "#ffffff", "", "v", 1.4),
    PairClass.B_ONLY_NEAR: ClassStyle("#7fb0dc", "#123a6b", "#ffffff", "", "^", 1.4),
    PairClass.A_ONLY: ClassStyle("#123a6b", "#ffffff", "#000000", "", "v", 1.8),
    PairClass.B_ONLY: ClassStyle("#123a6b", "#ffffff", "#000000", "", "^", 1.8),
}
ALL_STYLES = STYLES | OF_STARTS | OF_PAIRS

# Inferred cells: level lines, no mark. Of vibrating ones the amplitude is not known: a colour of no scale.
LINES: dict[str, Any] = {"facecolor": "none", "edgecolor": "#8a8a8a", "linewidth": 0, "hatch": "---"}
INFERRED_VIBRATION = "#d795ab"


def colours_of(name: str, start: float, stop: float) -> Colormap:
    """Part of a colour map of the plotting library, in steps that an eye finds again on the colour bar."""
    return ListedColormap(matplotlib.colormaps[name](np.linspace(start, stop, 24)), name)


# Both fall in lightness all the way and begin darker than undecided cells.
AMPLITUDE_COLOURS = colours_of("inferno_r", 0.27, 0.92)
FREQUENCY_COLOURS = colours_of("viridis_r", 0.30, 1.0)


@dataclass(frozen=True)
class Scale:
    """Quantity that colours the vibrating cells, with its colour scale; ticks where they are given."""

    colours: Colormap
    norm: Normalize
    label: str
    ticks: Sequence[int] = ()


def norm_over(values: Array, lowest: float | None = None, highest: float | None = None) -> Normalize:
    """Scale over the finite values, from `lowest` and to `highest` if given.

    Else a few values far above or below the others do not flatten these: the scale ends at the MOST share.
    """
    known = values[np.isfinite(values)]
    if known.size == 0:
        return Normalize(0.0, 1.0) if highest is None else Normalize(lowest or 0.0, highest)
    low, high = known.min() if lowest is None else lowest, known.max() if highest is None else highest
    if known.size >= MANY:
        least, most = np.quantile(known, (1.0 - MOST, MOST))
        base = least if lowest is None else lowest
        if highest is None and most > base and high > base + FAR * (most - base):
            high = most
        if lowest is None and least < high and low < high - FAR * (high - least):
            low = least
    return Normalize(low, high) if high > low else Normalize(low - 0.5, high + 0.5)


def amplitude_scale(values: Array, vmax: End = None) -> Scale:
    """Scale of amplitudes [um]: logarithmic over _AMPLITUDES; or linear from 0 to `vmax` [m], or to FIT."""
    if isinstance(vmax, str) and vmax != FIT:
        raise mismatch("vmax", f'a number or "{FIT}"', show(vmax))
    if vmax is None:
        return Scale(AMPLITUDE_COLOURS, LogNorm(*_AMPLITUDES), "amplitude [µm]", AMPLITUDE_TICKS)
    norm = norm_over(values, 0.0, None if isinstance(vmax, str) else 1e6 * vmax)
    return Scale(AMPLITUDE_COLOURS, norm, "amplitude [µm]")


def colour_bar(figure: Figure, scale: Scale, values: Array, **options: Any) -> Colorbar:
    """Draw the colour bar of a scale; it has a point where values lie beyond its end."""
    above, below = np.nanmax(values) > scale.norm.vmax, np.nanmin(values) < scale.norm.vmin
    extend = {(True, True): "both", (True, False): "max", (False, True): "min"}.get((above, below), "neither")
    mappable = ScalarMappable(scale.norm, scale.colours)
    bar = figure.colorbar(mappable, extend=extend, label=scale.label, **options)
    if scale.ticks:
        bar.set_ticks(scale.ticks, labels=list(map(str, scale.ticks)))
        bar.minorticks_off()
    return bar


def draw_cells(
    axes: Axes, x: Ruler, y: Ruler, classes: NDArray[np.int8], inferred: Mask, values: Array, scale: Scale
) -> None:
    """Draw the cells (row, column) of one panel, and borders between the classes.

    `classes` are the `OccurrenceClass` of each run, or `StartClass` or `PairClass` of each cell; where they
    are `inferred` they are not those of a run. `values` colour the vibrating cells by the scale; where they
    are nan these keep the colour of their class.
    """
    fills = np.zeros((*classes.shape, 4))
    hatched = {}
    for kind, style in ALL_STYLES.items():
        inside = classes == kind
        fills[inside] = fills_of(kind, values[inside], scale)
        if kind is OccurrenceClass.VIBRATING:
            fills[inside & inferred] = to_rgba(INFERRED_VIBRATION)
        if style.hatch and inside.any():
            hatched[style.hatch] = inside, {**LINES, "edgecolor": style.ink, "hatch": style.hatch}
    if inferred.any():
        hatched[LINES["hatch"]] = inferred, LINES
    # Cells and marks are pixels even in a vector format: thousands of shapes would make megabytes of it.
    shades = (255 * fills).round().astype(np.uint8)
    # the axes have the same place with and without it
    axes.add_image(PcolorImage(axes, x.edges, y.edges, shades, rasterized=True, in_layout=False))
    for inside, lines in hatched.values():  # as an artist: the limits are set below, and long to find
        axes.add_artist(PathPatch(area_of(x, y, inside), rasterized=True, **lines))
    if len(borders := _borders(x, y, classes)) <= _MOST_BORDERS:
        lines_between = LineCollection(borders, colors="#202020", linewidths=1.0)
        axes.add_collection(lines_between, autolim=False)
    axes.set(xlim=x.edges[[0, -1]], ylim=y.edges[[0, -1]])


def draw_grid(axes: Axes, x: Ruler, y: Ruler) -> None:
    """Draw thin lines between all cells; arguments as for `draw_cells`."""
    upright = _segments(x.edges, x.edges, y.edges[0], y.edges[-1])
    level = _segments(x.edges[0], x.edges[-1], y.edges, y.edges)
    lines = {"colors": "white", "linewidths": 0.3, "zorder": 0.5}  # below borders and hatching
    axes.add_collection(LineCollection([*upright, *level], rasterized=True, **lines), autolim=False)


def draw_marks(axes: Axes, x: Ruler, y: Ruler, classes: NDArray[np.int8], marked: Mask, size: float) -> None:
    """Mark grid points by class; arguments as for `draw_cells`, which ones, and the size of a dot [point]."""
    for kind, style in ALL_STYLES.items():
        rows, columns = np.nonzero((classes == kind) & marked)
        look = {**style.marks(size), "mew": 0.2 * size, "zorder": 2.2}  # above lines of onset
        axes.plot(x.centres[columns], y.centres[rows], **look, rasterized=True)


def write_value(
    axes: Axes,
    place: tuple[float, float],
    text: str,
    fill: Array,
    *,
    above: float = 0.0,
    size: float = 8.5,
    outlined: bool = False,
) -> None:
    """Write a number at a place in data coordinates [or above it, point] on a cell of a colour (rgba).

    An outline in that colour keeps it apart from hatching.
    """
    effects = figures.outlined(2.5, to_hex(fill)) if outlined else None
    ink = "#ffffff" if fill[:3] @ (0.299, 0.587, 0.114) < 0.45 else "#000000"  # by the lightness of the fill
    look = {"ha": "center", "va": "bottom" if above else "center", "fontsize": size, "color": ink}
    axes.annotate(text, place, (0, above), textcoords="offset points", path_effects=effects, **look)


def class_legend(
    figure: FigureBase,
    styles: Mapping[CellClass, ClassStyle],
    columns: int,
    *,
    with_inferred: bool = False,
    further: Sequence[Artist] = (),
) -> None:
    """Legend of some classes below the panels: fill, hatching, mark; of inferred cells; and of lines."""
    entries: dict[str, Any] = {}
    for kind, style in styles.items():
        outline = style.ink if style.hatch else "#606060"
        cell = Patch(facecolor=style.fill, edgecolor=outline, hatch=style.hatch, linewidth=0.8)
        entries[kind.label] = cell, Line2D([], [], **style.marks(4.0))
    if with_inferred:
        for label, fill in (("inferred", "none"), ("inferred, vibrating", INFERRED_VIBRATION)):
            entries[label] = Patch(**{**LINES, "facecolor": fill, "linewidth": 0.8})
    entries |= {handle.get_label(): handle for handle in further}
    rows = -(-len(entries) // columns)
    place = {"loc": "outside lower center", "ncols": -(-len(entries) // rows)}  # rows of like length
    look = {"frameon": False, "handlelength": 2.2, "handleheight": 1.5, "columnspacing": 1.3}
    handlers = {tuple: HandlerTuple(ndivide=1, pad=0)}
    figure.legend(entries.values(), entries.keys(), handler_map=handlers, **place, **look)


def area_of(x: Ruler, y: Ruler, inside: Mask) -> Path:
    """The outline of some cells: a rectangle around those that follow each other in a row."""
    turns = np.diff(np.pad(inside, ((0, 0), (1, 1))).astype(np.int8))
    (rows, first), (_, end) = np.nonzero(turns == 1), np.nonzero(turns == -1)
    left, right, low, high = x.edges[first], x.edges[end], y.edges[rows], y.edges[rows + 1]
    corners = [(left, low), (right, low), (right, high), (left, high), (left, low)]
    vertices = np.moveaxis(np.array(corners), -1, 0).reshape(-1, 2)
    codes = [Path.MOVETO, Path.LINETO, Path.LINETO, Path.LINETO, Path.CLOSEPOLY]
    return Path(vertices, np.tile(np.array(codes, Path.code_type), rows.size))


def fills_of(kind: CellClass, values: Array, scale: Scale) -> Array:
    """Colours (cell, rgba) of cells of one class."""
    fills = np.tile(to_rgba(ALL_STYLES[kind].fill), (len(values), 1))
    if kind is OccurrenceClass.VIBRATING:
        known = np.isfinite(values)
        fills[known] = scale.colours(scale.norm(values[known]))
    return fills


def _borders(x: Ruler, y: Ruler, classes: NDArray[np.int8]) -> Array:
    """Sides between cells of different classes, shape (side, end, coordinate)."""
    rows, columns = np.nonzero(classes[:, 1:] != classes[:, :-1])
    upright = _segments(x.edges[columns + 1], x.edges[columns + 1], y.edges[rows], y.edges[rows + 1])
    rows, columns = np.nonzero(classes[1:] != classes[:-1])
    level = _segments(x.edges[columns], x.edges[columns + 1], y.edges[rows + 1], y.edges[rows + 1])
    return np.concatenate((upright, level))


def _segments(x0: ArrayLike, x1: ArrayLike, y0: ArrayLike, y1: ArrayLike) -> Array:
    """Lines from (x0, y0) to (x1, y1), numbers or arrays, as shape (line, end, coordinate)."""
    return np.moveaxis(np.stack(np.broadcast_arrays(x0, y0, x1, y1)), 0, -1).reshape(-1, 2, 2)
