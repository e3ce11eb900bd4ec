"""Whether a Hopf point is super- or subcritical, by runs from two starts on both sides of it.

On the unstable side every start vibrates. Where the limit cycle is born at the Hopf point and grows away
from it (supercritical), vibration ends there whatever the start. Where an unstable limit cycle bends back
over the stable side (subcritical), runs from near the steady state turn quiet at the Hopf point, those from
a large start only at the fold of limit cycles: in between both attractors exist, which is the hysteresis.
Runs on the unstable side do not count: a run that is quiet there is quiet by its amplitude alone.

One run where both attractors are found proves nothing: beside a Hopf point a vibration may fade more slowly
than a run shows. Two are required.
"""

from collections.abc import Callable
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cvt_hpc.vibration.classes import OccurrenceClass

QUIET, VIBRATING = OccurrenceClass.QUIET, OccurrenceClass.VIBRATING


class Kind(IntEnum):
    """The change of the steady state at a Hopf point."""

    SUPERCRITICAL = 0
    SUBCRITICAL = 1
    UNDECIDED = 2


class Criticality(NamedTuple):
    """The verdict on a Hopf point by runs."""

    kind: Kind  # the verdict
    # from the Hopf point, into the stable side, to where the vibration ends from the large start, in the
    # parameter's unit: of the hysteresis, or its upper bound by the runs' spacing; nan if undecided
    width: float
    # half of the spacing of the runs at that end, and the Hopf point's own error; inf where runs from the
    # large start vibrate as far as there are any
    error: float
    reason: str  # one line


def criticality(
    hopf: float,
    stable_above: bool,
    values: ArrayLike,
    small: ArrayLike,
    large: ArrayLike,
    *,
    agreement: float,
    bracket: float = 0.0,
    limits: tuple[float, float] = (-np.inf, np.inf),
    in_words: Callable[[float], str] = "{:.4g}".format,
) -> Criticality:
    """Decide whether a Hopf point is super- or subcritical.

    Parameters
    ----------
    hopf, stable_above : float, bool
        The parameter at the Hopf point, and whether the steady state is stable above it, or else below.
    values : array, shape (n,)
        Parameter values of the runs, distinct; in the unit of `hopf`, like all others below.
    small, large : arrays, shape (n,)
        `OccurrenceClass` of the runs from near the steady state and from the large start.
    agreement, bracket : float
        How far from the Hopf point the runs from the small start may turn quiet, and it may itself lie.
    limits : (float, float)
        Neighbouring Hopf points, beyond which other branches begin or the steady state is not stable.
    in_words : callable
        Turns a value of the parameter into words for `reason`.
    """
    values = np.asarray(values, dtype=float)
    sign = 1.0 if stable_above else -1.0
    inside = (values > limits[0]) & (values < limits[1])
    away = sign * (values[inside] - hopf)  # ascends into the stable side
    order = np.argsort(away)
    away = away[order]
    small, large = (np.asarray(classes)[inside][order] for classes in (small, large))
    turns = _turns(small)
    if not turns:
        return _undecided("no run from the small start turns from vibrating to quiet near it")
    first, last = min(turns, key=lambda turn: abs(away[turn[0]] + away[turn[1]]))
    turned, spread = _middle(away, first, last)
    if abs(turned) > agreement + spread:
        place = in_words(hopf + sign * turned)
        return _undecided(f"runs from the small start turn quiet at {place}, not there")
    ends = [turn for turn in _turns(large) if turn[1] > first]
    start, end = ends[0] if ends else (len(large) - 1, len(large))
    along = np.arange(len(away))
    both = (small == QUIET) & (large == VIBRATING) & (along > first) & (along < end)
    if (large[first:start] == QUIET).any() or not (ends or both.any()):
        return _undecided("runs from the large start do not vibrate up to it")
    coexist = both & (away > bracket)
    places = hopf + sign * away
    if coexist.sum() > 1 and not ends:
        reason = "both attractors as far as there are runs on that side"
        return Criticality(Kind.SUBCRITICAL, float(away[coexist][-1]) - bracket, np.inf, reason)
    if both.any() and coexist.sum() < 2:
        where = _range(places[coexist if coexist.any() else both], in_words)
        if coexist.any():
            return _undecided(f"both attractors {where} alone, closer runs would tell")
        return _undecided(f"both attractors {where}, not where the steady state is stable")
    width, spacing = _middle(away, start, end)
    if coexist.any():
        reason = f"both attractors {_range(places[coexist], in_words)}"
        return Criticality(Kind.SUBCRITICAL, width, spacing + bracket, reason)
    if end > last + 1:
        label = OccurrenceClass(int(large[last + 1])).label
        return _undecided(f"the run from the large start at {in_words(places[last + 1])} is {label}")
    reason = "vibration ends at one place from either start"
    return Criticality(Kind.SUPERCRITICAL, width, spacing + bracket, reason)


def _range(places: np.ndarray, in_words: Callable[[float], str]) -> str:
    """Name the places of runs."""
    low, high = in_words(places.min()), in_words(places.max())
    return f"at {low}" if low == high else f"from {low} to {high}"


def _turns(classes: np.ndarray) -> list[tuple[int, int]]:
    """Places of the last vibrating and the first quiet run of each turn, whatever is undecided in between."""
    said = np.flatnonzero(np.isin(classes, (QUIET, VIBRATING)))
    pairs = zip(said[:-1], said[1:], strict=True)
    return [(int(a), int(b)) for a, b in pairs if classes[a] == VIBRATING and classes[b] == QUIET]


def _middle(away: np.ndarray, first: int, last: int) -> tuple[float, float]:
    """Middle of two places, and half of their distance."""
    return float(0.5 * (away[first] + away[last])), float(0.5 * (away[last] - away[first]))


def _undecided(reason: str) -> Criticality:
    return Criticality(Kind.UNDECIDED, np.nan, np.nan, reason)
