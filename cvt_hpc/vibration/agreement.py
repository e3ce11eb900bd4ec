"""The common verdict on two runs of one cell: the same class, a contradiction, or another difference.

A contradiction is a cell that is quiet in one run and vibrating in the other. Near the amplitude threshold a
small error is enough for one, so contradictions whose larger amplitude lies within NEAR of the threshold are
separated from those beyond.
"""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.vibration.classes import OccurrenceClass

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
    """Class of each cell by its two runs.

    Parameters
    ----------
    a, b : arrays of one shape
        Values of `OccurrenceClass` of either run.
    near : array of bool, same shape
        Whether the larger amplitude of the two lies near the threshold; see `is_near`.

    Returns
    -------
    array of int8
        The value of `OccurrenceClass` where both agree, and NOT_RUN where either was not run; else one of
        `PairClass`.
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
