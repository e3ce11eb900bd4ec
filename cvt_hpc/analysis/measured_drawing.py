"""Measurements over the panels of all pictures whose sides are axes of a study, or frequencies."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.patheffects import Normal, withStroke
from numpy.typing import NDArray

from cvt_hpc.analysis.figures import legend_columns
from cvt_hpc.analysis.measured import (
    ALIKE,
    FREQUENCY,
    PEAK,
    WINDOW,
    Measured,
    Row,
    Side,
    fixed_values,
    read_measured,
)
from cvt_hpc.variables import shortened

INK = "#0033dd"  # of nothing that is computed; in grey, dark within a white outline
DASHES, DOTS = (0, (6, 1.5, 1.5, 1.5)), (0, (1, 1.5))
LONGEST_NAME = 60  # letters of the file's name in a title
LEGEND = 0.4  # [inch]: height of a legend of its own
_OUTLINE = [withStroke(linewidth=4.2, foreground="white"), Normal()]
_ABOVE = 2.6  # lines and marks of what was computed
_LOOK: dict[str, Any] = {"color": INK, "lw": 2.0, "ms": 7.0}
_MARKS = {"x": {True: ">", False: "<"}, "y": {True: "^", False: "v"}}  # of an onset, as the axis goes

Extent = NDArray[np.float64]  # places of two ends on a side


class Overlay:
    """What was measured, drawn over panels one by one, and its entries of the legend.

    Parameters
    ----------
    path : str, Path or None
        The measured file; without one nothing is drawn.
    dataset : Dataset
        Results or history, whole, as `read_measured` takes it.
    source : str
        Where it is from, for the errors.

    Attributes
    ----------
    height : float
        Height that a legend of its own takes [inch].
    note : str
        Line of the title, which names the file.
    """

    def __init__(self, path: str | Path | None, dataset: xr.Dataset, source: str = "results") -> None:
        none = Measured("", "", "", ())
        self._measured = none if path is None else read_measured(path, dataset, source)
        self._entries: dict[str, Any] = {}
        self.height = 0.0 if path is None else LEGEND
        self.note = "" if path is None else f"measured: {shortened(self._measured.name, LONGEST_NAME)}"

    @property
    def handles(self) -> list[Any]:
        """Entries of the legend, of what was drawn."""
        return list(self._entries.values())

    def draw(self, axes: Axes, x: Side, y: Side, shown: xr.Dataset) -> None:
        """Draw what was measured over a panel whose limits are set.

        Parameters
        ----------
        axes : Axes
            The panel.
        x, y : Side
            Its sides.
        shown : Dataset
            What it shows: coordinates without a dimension say at which values.
        """
        fixed = fixed_values(shown) if self._measured.rows else {}
        for row in self._measured.rows:
            if all(self._holds(row, name, value) for name, value in fixed.items()):
                self._draw_row(axes, row, (x, y))

    def _holds(self, row: Row, name: str, value: float) -> bool:
        """Whether a row tells of this value of an axis."""
        if name != self._measured.along:
            return row.at.get(name, value) == value
        if self._measured.kind == WINDOW:
            return row.span[0] <= value <= row.span[1]
        return math.isclose(value, row.span[0], rel_tol=ALIKE) if math.isnan(row.cell) else row.cell == value

    def _extent(self, row: Row, side: Side) -> Extent | None:
        """Where a row lies on a side; None beyond its ends."""
        if side.name == self._measured.along:
            return side.span(*row.span)
        if side.name == FREQUENCY and row.frequency:
            return side.span(*row.frequency)
        if side.name in row.at:
            cell = int(np.argmax(side.values == row.at[side.name]))
            return side.edges[cell : cell + 2]
        return side.edges[[0, -1]]

    def _box(self, row: Row, sides: tuple[Side, Side]) -> list[Extent]:
        """Where a row lies on both sides; empty where that is beyond an end."""
        box = [extent for side in sides if (extent := self._extent(row, side)) is not None]
        return box if len(box) == len(sides) else []

    def _draw_row(self, axes: Axes, row: Row, sides: tuple[Side, Side]) -> None:
        _, kind, along, _ = self._measured
        on = next((which for which, side in zip("xy", sides, strict=True) if side.name == along), "")
        if kind == WINDOW and on and np.isfinite(row.swept).all():
            swept = row._replace(span=row.swept, frequency=None)
            self._outline(axes, self._box(swept, sides), "measured range", DOTS)
        box = self._box(row, sides)
        if not box:
            return
        if kind == WINDOW:
            self._outline(axes, box if row.span[0] < row.span[1] else [], "measured noise", DASHES)
        elif kind == PEAK:  # at the lower end of a side that tells nothing of it
            whole = [np.array_equal(one, side.edges[[0, -1]]) for one, side in zip(box, sides, strict=True)]
            x, y = (
                one[:1] if rest else one[:1] / 2 + one[1:] / 2 for one, rest in zip(box, whole, strict=True)
            )
            self._line(axes, x, y, "measured peak", marker="P", ls="")
        elif on:
            x, y = (np.array([low, 0.5 * (low + high), high]) for low, high in box)
            label = f"measured onset, {'rising' if row.rising else 'falling'}"
            self._line(axes, x, y, label, marker=_MARKS[on][row.rising], ls=DASHES)

    def _line(self, axes: Axes, x: Extent, y: Extent, label: str, **look: Any) -> None:
        """Draw a line with a mark in its middle, or the mark alone, without a change of the limits."""
        how = {"path_effects": _OUTLINE, "markevery": [x.size // 2], "zorder": _ABOVE, "clip_on": x.size > 1}
        axes.add_artist(Line2D(x, y, **_LOOK, **look, **how))
        self._entries.setdefault(label, Line2D([], [], **_LOOK, **look, label=label))

    def _outline(self, axes: Axes, box: Sequence[Extent], label: str, style: Any) -> None:
        if box:
            (left, right), (low, high) = box
            look = {"fill": False, "ec": INK, "lw": 2.0, "ls": style}
            shape = (left, low), right - left, high - low
            axes.add_artist(Rectangle(*shape, **look, zorder=_ABOVE, path_effects=_OUTLINE))
            self._entries.setdefault(label, Rectangle((0.0, 0.0), 1.0, 1.0, **look, label=label))


def put_legend(figure: Figure, *overlays: Overlay) -> None:
    """Put a legend of what was measured below a picture that has none of its own."""
    entries = {handle.get_label(): handle for over in overlays for handle in over.handles}
    if entries:
        place = {"ncols": legend_columns(list(entries)), "loc": "outside lower center", "frameon": False}
        figure.legend(handles=list(entries.values()), **place)
