"""How the values of an axis are spread, evenly or by their logarithms, and borders between them."""

import numpy as np
from numpy.typing import NDArray

EVEN, EQUAL = 1.5, 1.01  # of steps: largest over smallest, below which they are taken for even
LEAST_SPAN = 4.0  # last over first value of a logarithmic axis


def is_logarithmic(values: NDArray[np.float64]) -> bool:
    """Whether sorted numbers are of one sign and evenly spread by their logarithms alone."""
    if values.size < 3 or values[0] * values[-1] <= 0.0:
        return False
    sizes = np.sort(np.abs(values))
    if sizes[-1] < LEAST_SPAN * sizes[0]:
        return False
    steps, ratios = np.diff(sizes), np.diff(np.log(sizes))
    most = EVEN if values.size > 3 else EQUAL  # of three values a middle that is a little off says nothing
    return bool(ratios.max() < most * ratios.min() and steps.max() > EVEN * steps.min())


def on_decades(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Places of numbers of one sign on a logarithmic axis; negative ones are mirrored."""
    return np.sign(values) * np.log10(np.abs(values))


def are_few(centres: NDArray[np.float64], few: int) -> bool:
    """Whether grid points can have labelled ticks: few, and about evenly spread."""
    if centres.size < 2:
        return True
    return centres.size <= few and bool(np.diff(centres).min() > 0.5 * np.ptp(centres) / (centres.size - 1))


def edges_of(centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Borders of the cells around points, halfway between; the outer cells are symmetric."""
    if centres.size == 1:
        half = 0.05 * abs(centres[0]) or 0.5
        return np.array([centres[0] - half, centres[0] + half])
    middles = (centres[1:] + centres[:-1]) / 2
    return np.concatenate(([2 * centres[0] - middles[0]], middles, [2 * centres[-1] - middles[-1]]))
