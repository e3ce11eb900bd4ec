"""Names of lines over spectra, in the margins where the lines leave the panel, clear of ridges."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import Normal, withStroke
from numpy.typing import NDArray

LINE, LETTER, TITLE = 9.5, 5.6, 3.0  # [point]: height of a name, width of a letter, distance of a title
OUTLINE = [withStroke(linewidth=2.2, foreground="white"), Normal()]


class Named(NamedTuple):
    """A line with its name.

    Attributes
    ----------
    name, colour : str
    x, y : array, shape (point,)
        In data coordinates; nan where it is not known.
    """

    name: str
    colour: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]


def name_lines(axes: Axes, lines: Sequence[Named], size: tuple[float, float]) -> float:
    """Write the names of lines beside a panel whose limits are set; return how high its title has to stand.

    Parameters
    ----------
    axes : Axes
        The panel; its lower limit along y is below all lines.
    lines : sequence of Named
        What leaves the panel at its upper side is named there, other lines where they end.
    size : (float, float)
        About the width and height of the panel [inch].

    Returns
    -------
    float
        Distance of the title [point].
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
    gaps = LINE / (72.0 * size[1]) * top, (LETTER * letters + 3.0) / (72.0 * size[0]) * (end - left)
    places = _apart(right, gaps[0], (0.0, top - 0.5 * gaps[0]))
    for (_, line), place in zip(sorted(right, key=_place), places, strict=True):
        _write(axes, line, (1.0, place), axes.get_yaxis_transform(), (3, 0), ha="left", va="center")
    for (_, line), place in zip(sorted(above, key=_place), _apart(above, gaps[1], (left, end)), strict=True):
        _write(axes, line, (place, 1.0), axes.get_xaxis_transform(), (0, 1), ha="center", va="bottom")
    return TITLE + LINE if above else TITLE


def _place(placed: tuple[float, Named]) -> float:
    return placed[0]


def _apart(
    placed: Sequence[tuple[float, Named]], gap: float, limits: tuple[float, float]
) -> NDArray[np.float64]:
    """Places in ascending order, moved until they lie a gap apart, and within limits as far as they can."""
    at = np.sort([place for place, _ in placed])
    steps = gap * np.arange(at.size)
    at = np.maximum.accumulate(at - steps) + steps
    highest = limits[1] - steps[::-1]
    return np.minimum(at, highest)


def _write(
    axes: Axes, line: Named, place: tuple[float, float], within: Any, off: tuple[float, float], **how: Any
) -> None:
    how |= {"textcoords": "offset points", "color": line.colour, "fontsize": 8, "annotation_clip": False}
    axes.annotate(line.name, place, off, xycoords=within, **how)
