"""Loads at which vibration sets in and ends, and the distances between the results of two studies."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.vibration.classes import OccurrenceClass

Array = NDArray[np.float64]


def levels(classes: NDArray[np.int8]) -> Array:
    """Return 1 where a cell vibrates, -1 where it is quiet, nan elsewhere, by its `OccurrenceClass`."""
    kinds = [classes == OccurrenceClass.VIBRATING, classes == OccurrenceClass.QUIET]
    return np.select(kinds, [1.0, -1.0], np.nan)


class Onset(NamedTuple):
    """A load [N m], and whether the belt vibrates above it."""

    load: float
    rising: bool


def onsets(loads: Array, level: Array) -> list[Onset]:
    """Where a level changes its sign along the load, by a straight line between neighbours.

    Parameters
    ----------
    loads : (n,) array
        In any order [N m].
    level : (n,) array
        Positive where the belt vibrates, negative where it is quiet, nan where neither is known: such a place
        is passed over. Of -1 and 1 the straight line makes the load midway between both.
    """
    order = np.argsort(loads)
    known = order[np.isfinite(level[order])]
    x, y = loads[known], level[known]
    return [
        Onset(float(x[k] + (x[k + 1] - x[k]) * y[k] / (y[k] - y[k + 1])), bool(y[k + 1] > 0.0))
        for k in np.flatnonzero((y[:-1] > 0.0) != (y[1:] > 0.0))
    ]


def paired_errors(
    found: Sequence[Onset], true: Sequence[Onset], known: tuple[float, float]
) -> tuple[list[float], int, int]:
    """Pair the onsets of a line with the true ones of the same direction, at the least distance in all.

    Parameters
    ----------
    found, true : sequence of Onset
        Of one line.
    known : (float, float)
        Loads [N m] between which the truth is known: beyond, it is unknown whether there is an onset.

    Returns
    -------
    errors : list of float
        Distances of the pairs [N m].
    missed, additional : int
        True ones without a partner, and found ones between the known loads.
    """
    from scipy.optimize import linear_sum_assignment  # long to load, and maps need onsets alone

    errors: list[float] = []
    additional = 0
    for rising in (False, True):
        one, other = ([o.load for o in each if o.rising is rising] for each in (found, true))
        distance = np.abs(np.subtract.outer(one, other))
        rows, columns = linear_sum_assignment(distance)
        errors += distance[rows, columns].tolist()
        additional += sum(known[0] < load < known[1] for load in np.delete(one, rows))
    return errors, len(true) - len(errors), additional
