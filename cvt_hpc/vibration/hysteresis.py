"""The common verdict on two starts: where a vibration needs a large start, two attractors exist."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.vibration.classes import OccurrenceClass


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
    """Class of each cell by its runs from two starts.

    Where a run failed the cell failed, whatever the other run gives, so that no failure is hidden. Else the
    vibrates from the small start vibrates; a cell is quiet only if it is so from both. Of a cell that is
    quiet from the small start the other run decides, and where one run is undecided the cell is.
    A cell that slips or moves irregularly from the small start is of that class.

    Parameters
    ----------
    small, large : arrays of one shape
        Values of `OccurrenceClass` of the runs from the smaller and from the larger disturbance.

    Returns
    -------
    array of int8
        Values of `StartClass`.
    """
    classes = np.where(small == OccurrenceClass.QUIET, large, small).astype(np.int8)
    # vibration or gross slip from the small start needs no second run, a doubtful motion cannot do without
    is_doubtful = np.isin(small, (OccurrenceClass.UNDECIDED, OccurrenceClass.IRREGULAR))
    classes[is_doubtful & (large == OccurrenceClass.NOT_RUN)] = StartClass.NOT_RUN
    classes[large == OccurrenceClass.FAILED] = StartClass.FAILED
    found = (small == OccurrenceClass.QUIET) & (large == OccurrenceClass.VIBRATING)
    classes[found] = StartClass.LARGE_START_ONLY
    return classes
