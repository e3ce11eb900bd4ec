"""Ticks at the values of an axis: numbers as short as they may be, and only those for which there is room."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axis import Axis, XAxis
from matplotlib.ticker import FuncFormatter, Locator
from numpy.typing import NDArray

ROUNDED = 0.005  # of the distance of two values: by so much a number on an axis may be off
MOST_DECIMALS = 12
LETTER, LINE, GAP = 5.6, 11.0, 5.0  # [point]: width and height of a tick's letters, and space between two
TEXTS = 55  # letters of texts side by side along x; more stand upright


def number(value: float, layout: str = ".6g") -> str:
    """A number in at most six digits, or in another layout, with a true minus."""
    return format(value, layout).replace("-", "−")


def short_numbers(values: NDArray[np.float64], *, is_log: bool = False) -> tuple[str, ...]:
    """Numbers with as few decimals as tell them apart: 954.93 and 1909.86 as 955 and 1910.

    Each is off by at most ROUNDED of the smallest distance, or of itself on a logarithmic axis.
    """
    steps = np.abs(values) if is_log or values.size < 2 else np.abs(np.diff(values)).min()
    allowed = np.broadcast_to(ROUNDED * steps, values.shape)
    texts = []
    for value, off in zip(values.tolist(), allowed, strict=True):
        tried = (round(value, decimals) for decimals in range(MOST_DECIMALS))
        texts.append(number(next((one for one in tried if abs(one - value) <= off), value)))
    return tuple(texts)


class Places(Locator):
    """Given places on an axis in ascending order, or every second, third, ... where labels would touch."""

    def __init__(self, places: NDArray[np.float64], labels: Sequence[str], letters: float = LETTER) -> None:
        self.places, self.labels, self.letters = np.asarray(places), labels, letters

    def __call__(self) -> NDArray[np.float64]:
        """Return the places that have room at the axis' present length."""
        return self.tick_values(*self.axis.get_view_interval())

    def tick_values(self, vmin: float, vmax: float) -> NDArray[np.float64]:
        """Return the places that have room between two limits of the axis."""
        box, along_x = self.axis.axes.bbox, isinstance(self.axis, XAxis)
        length = 72.0 * (box.width if along_x else box.height) / self.axis.axes.figure.dpi
        scale = length / (abs(vmax - vmin) or 1.0)
        sizes = np.array([self.letters * len(label) if along_x else 0.0 for label in self.labels])
        for stride in range(1, self.places.size):
            kept = slice(None, None, stride)  # alike everywhere, so that an eye can fill the gaps
            needed = 0.5 * (sizes[kept][1:] + sizes[kept][:-1]) + (GAP if sizes.any() else LINE)
            if (scale * np.diff(self.places[kept]) >= needed).all():
                return self.places[kept]
        return self.places[:1]


def put_ticks(axis: Axis, places: NDArray[np.float64], labels: Sequence[str]) -> None:
    """Put labelled ticks at places of an axis; texts that are too long for a line stand upright along x."""
    is_upright = isinstance(axis, XAxis) and sum(map(len, labels)) > TEXTS
    is_upright &= not all(label[:1] in "−0123456789" for label in labels)
    axis.set_major_locator(Places(places, labels, 0.0 if is_upright else LETTER))
    if is_upright:
        axis.set_tick_params(rotation=90)

    def label_at(place: float, _: int | None = None) -> str:
        return labels[int(np.argmin(np.abs(places - place)))] if len(labels) else ""

    axis.set_major_formatter(FuncFormatter(label_at))
