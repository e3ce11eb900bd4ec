"""One class per run: the two flags of a record, and the undecided cases, as one category."""

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.variables import Status, Vibrates


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
    """Class of each run.

    Whatever is not known to have ended well is never quiet nor vibrating: a status that this program does
    not know counts as failed, a missing one as not run, an unknown verdict as undecided.

    Parameters
    ----------
    status, vibrates : arrays of one shape
        Values of `Status` and of `Vibrates`.

    Returns
    -------
    array of int8
        Values of `OccurrenceClass`.
    """
    classes = np.full(status.shape, OccurrenceClass.FAILED, np.int8)
    done = status == Status.DONE
    classes[done] = OccurrenceClass.UNDECIDED
    for verdict, kind in _OF_VERDICTS.items():
        classes[done & (vibrates == verdict)] = kind
    missing = np.isnan(status.astype(float))
    classes[(status == Status.NOT_RUN) | missing] = OccurrenceClass.NOT_RUN
    return classes
