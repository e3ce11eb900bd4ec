"""Error over cost in pictures: lines and markers of the methods or models compared, axes of errors."""

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.ticker import NullFormatter

# Okabe and Ito's colours, told apart by those who do not see all; with the lines enough for 21 methods.
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#333333")
LINES = ("-", "--", ":")
MARKERS = ("o", "s", "^", "D", "v", "P", "<", ">")
LEGEND = {"loc": "outside lower center", "frameon": False, "fontsize": 8, "columnspacing": 1.0}
MARGIN = 1.6  # factor by which axes reach beyond the points
_LEAST_SPAN = 100.0  # of an error's axis, so that two powers of ten stand at it


def line_style(k: int) -> dict[str, Any]:
    """Line and marker of the k-th method."""
    return {
        "color": COLOURS[k % len(COLOURS)],
        "ls": LINES[k // len(COLOURS) % len(LINES)],
        "marker": MARKERS[k % len(MARKERS)],
        "lw": 1.3,
        "ms": 4.5,
    }


def set_error_axis(axes: Axes, values: Sequence[float]) -> float:
    """Make room for the values, and return the lower limit."""
    low, high = min(values, default=1e-3) / MARGIN, max(values, default=1.0) * MARGIN
    wanting = max(_LEAST_SPAN * low / high, 1.0) ** 0.5
    axes.set_xlim(low / wanting, high * wanting)
    axes.xaxis.set_minor_formatter(NullFormatter())
    return low / wanting
