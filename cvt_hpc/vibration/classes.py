"""One class per run: the two flags of a record, and the undecided cases, as one category.

Two starts have a common verdict (`classify_starts`): where a vibration needs a large start, two attractors
exist. Two runs of one cell have one, too (`classify_pairs`): the same class, a contradiction, or another
difference. A contradiction is a cell that is quiet in one run and vibrating in the other. Near the amplitude
threshold a small error is enough for one, so contradictions whose larger amplitude lies within NEAR of the
threshold are separated from those beyond.

`onsets` gives the loads at which vibration sets in and ends.
"""

from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.variables import Status, Vibrates

Array = NDArray[np.float64]


class OccurrenceClass(IntEnum):
    """The class of a run in a map."""

    QUIET = 0
    VIBRATING = 1
    UNDECIDED = 2
    FAILED = 3
    NOT_RUN = 4
    # 5 is `StartClass.LARGE_START_ONLY`, a class of cells and not of runs
    SLIPPING = 6
    IRREGULAR = 7

    @property
    def label(self) -> str:
        """Name for people."""
        return self.name.lower().replace("_", " ")


# Verdicts that a longer run would not change: irregular motion is among them, undecided runs are not.
_OF_VERDICTS = {
    Vibrates.NO: OccurrenceClass.QUIET,
    Vibrates.YES: OccurrenceClass.VIBRATING,
    Vibrates.SLIPS: OccurrenceClass.SLIPPING,
    Vibrates.IRREGULAR: OccurrenceClass.IRREGULAR,
}
DECIDED = tuple(_OF_VERDICTS.values())


def classify_runs(status: NDArray, vibrates: NDArray) -> NDArray[np.int8]:
    """Class of each run, one of `OccurrenceClass`, by its `Status` and `Vibrates`.

    Whatever is not known to have ended well is never quiet nor vibrating: a status that this program does not
    know counts as failed, a missing one as not run, an unknown verdict as undecided.
    """
    classes = np.full(status.shape, OccurrenceClass.FAILED, np.int8)
    done = status == Status.DONE
    classes[done] = OccurrenceClass.UNDECIDED
    for verdict, kind in _OF_VERDICTS.items():
        classes[done & (vibrates == verdict)] = kind
    missing = np.isnan(status.astype(float))
    classes[(status == Status.NOT_RUN) | missing] = OccurrenceClass.NOT_RUN
    return classes


class StartClass(IntEnum):
    """The class of a cell whose runs began from a small and from a large disturbance.

    The values of `OccurrenceClass`, and one more.
    """

    QUIET = OccurrenceClass.QUIET
    VIBRATING = OccurrenceClass.VIBRATING
    UNDECIDED = OccurrenceClass.UNDECIDED
    FAILED = OccurrenceClass.FAILED
    NOT_RUN = OccurrenceClass.NOT_RUN
    LARGE_START_ONLY = 5
    SLIPPING = OccurrenceClass.SLIPPING
    IRREGULAR = OccurrenceClass.IRREGULAR

    @property
    def label(self) -> str:
        """Name for people."""
        if self is StartClass.LARGE_START_ONLY:
            return "vibrates from a large start only"
        return self.name.lower().replace("_", " ")


def classify_starts(small: NDArray, large: NDArray) -> NDArray[np.int8]:
    """Class of each cell, one of `StartClass`, by its runs from a small and from a large disturbance.

    Where a run failed the cell failed, whatever the other run gives, so that no failure is hidden. Else a
    cell that vibrates from the small start vibrates; a cell is quiet only if it is so from both. Of a cell
    that is quiet from the small start the other run decides, and where one run is undecided the cell is. A
    cell that slips or moves irregularly from the small start is of that class.
    """
    classes = np.where(small == OccurrenceClass.QUIET, large, small).astype(np.int8)
    # vibration or gross slip from the small start needs no second run, a doubtful motion cannot do without
    is_doubtful = np.isin(small, (OccurrenceClass.UNDECIDED, OccurrenceClass.IRREGULAR))
    classes[is_doubtful & (large == OccurrenceClass.NOT_RUN)] = StartClass.NOT_RUN
    classes[large == OccurrenceClass.FAILED] = StartClass.FAILED
    found = (small == OccurrenceClass.QUIET) & (large == OccurrenceClass.VIBRATING)
    classes[found] = StartClass.LARGE_START_ONLY
    return classes


NEAR = 0.2  # of the amplitude threshold
WITHOUT_RESULTS = (OccurrenceClass.FAILED, OccurrenceClass.NOT_RUN)


class PairClass(IntEnum):
    """Class of a cell whose two runs, A and B, have different classes.

    All values are negative, so that they stand beside the values of `OccurrenceClass`, which mean that both
    runs are of that class; NOT_RUN means that either one has not run.
    """

    A_ONLY = -1
    B_ONLY = -2
    A_ONLY_NEAR = -3
    B_ONLY_NEAR = -4
    OTHERWISE = -5
    FAILED_IN_ONE = -6

    @property
    def label(self) -> str:
        """Name for people."""
        return _LABELS[self]


_LABELS = {
    PairClass.A_ONLY: "vibrates in A only",
    PairClass.B_ONLY: "vibrates in B only",
    PairClass.A_ONLY_NEAR: "in A only, near the threshold",
    PairClass.B_ONLY_NEAR: "in B only, near the threshold",
    PairClass.OTHERWISE: "other classes",
    PairClass.FAILED_IN_ONE: "failed in one",
}
NEAR_CONTRADICTIONS = (PairClass.A_ONLY_NEAR, PairClass.B_ONLY_NEAR)
CONTRADICTIONS = (PairClass.A_ONLY, PairClass.B_ONLY, *NEAR_CONTRADICTIONS)


def classify_pairs(a: NDArray, b: NDArray, near: NDArray[np.bool_]) -> NDArray[np.int8]:
    """Class of each cell by the `OccurrenceClass` of its two runs.

    It is their class where both agree, and NOT_RUN where either was not run; else one of `PairClass`, by
    whether the larger amplitude of the two lies near the threshold (`is_near`).
    """
    pairs = np.where(a == b, a, PairClass.OTHERWISE).astype(np.int8)
    pairs[(a == OccurrenceClass.FAILED) != (b == OccurrenceClass.FAILED)] = PairClass.FAILED_IN_ONE
    pairs[(a == OccurrenceClass.NOT_RUN) | (b == OccurrenceClass.NOT_RUN)] = OccurrenceClass.NOT_RUN
    for vibrating, quiet, far, close in (
        (a, b, PairClass.A_ONLY, PairClass.A_ONLY_NEAR),
        (b, a, PairClass.B_ONLY, PairClass.B_ONLY_NEAR),
    ):
        contrary = (vibrating == OccurrenceClass.VIBRATING) & (quiet == OccurrenceClass.QUIET)
        pairs[contrary] = np.where(near[contrary], close, far)
    return pairs


def is_near(a: NDArray, b: NDArray) -> NDArray[np.bool_]:
    """Whether the larger of two amplitudes, each over its threshold [1], lies within NEAR of 1."""
    return np.abs(np.fmax(a, b) - 1.0) <= NEAR


def levels(classes: NDArray[np.int8]) -> Array:
    """Return 1 where a cell vibrates, -1 where it is quiet, nan elsewhere, by its `OccurrenceClass`."""
    kinds = [classes == OccurrenceClass.VIBRATING, classes == OccurrenceClass.QUIET]
    return np.select(kinds, [1.0, -1.0], np.nan)


class Onset(NamedTuple):
    """A load [N m], and whether the belt vibrates above it."""

    load: float
    rising: bool


def onsets(loads: Array, level: Array) -> list[Onset]:
    """Find where a level changes its sign along the load, by a straight line between neighbours.

    Loads [N m] are in any order. The level is positive where the belt vibrates, negative where it is quiet,
    nan where neither is known: such a place is passed over. Of -1 and 1 the straight line makes the load
    midway between both.
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

    Returns the distances of the pairs [N m], the number of true ones without a partner, and that of onsets
    found in addition between the loads [N m] where the truth is known: beyond, it is unknown whether there is
    one.
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
