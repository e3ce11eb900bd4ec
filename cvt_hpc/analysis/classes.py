"""One class per run of a study: the two flags of a record, and what they leave open, as one category."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.errors import mismatch
from cvt_hpc.variables import Status, Vibrates


class OccurrenceClass(IntEnum):
    """What a map says of a run."""

    QUIET = 0
    VIBRATING = 1
    UNDECIDED = 2
    FAILED = 3
    NOT_RUN = 4

    @property
    def label(self) -> str:
        """Name for people."""
        return self.name.lower().replace("_", " ")


def occurrence_classes(dataset: xr.Dataset) -> xr.DataArray:
    """Class of each run.

    Whatever is not known to have ended well is never quiet nor vibrating: a status that this program does
    not know counts as failed, a missing one as not run, an unknown verdict as undecided.

    Parameters
    ----------
    dataset : Dataset
        With the flag variables `status` and `vibrates`, same dimensions.

    Returns
    -------
    DataArray of int8
        Values of `OccurrenceClass`, dimensions of `status`.

    Raises
    ------
    InputError
        The dataset has no `status` or no `vibrates`.
    """
    for name in ("status", "vibrates"):
        if name not in dataset:
            found = ", ".join(map(str, dataset.data_vars)) or "no variables"
            raise mismatch("the dataset", f"results of a study, with the variable {name}", found)
    status = dataset["status"]
    vibrates = dataset["vibrates"].transpose(*status.dims).values
    classes = np.full(status.shape, OccurrenceClass.FAILED, np.int8)
    done = status.values == Status.DONE
    classes[done] = OccurrenceClass.UNDECIDED
    classes[done & (vibrates == Vibrates.NO)] = OccurrenceClass.QUIET
    classes[done & (vibrates == Vibrates.YES)] = OccurrenceClass.VIBRATING
    missing = np.isnan(status.values.astype(float))
    classes[(status.values == Status.NOT_RUN) | missing] = OccurrenceClass.NOT_RUN
    attributes = {
        "long_name": "vibration occurrence",
        "flag_values": np.array(list(OccurrenceClass), np.int8),
        "flag_meanings": " ".join(c.name.lower() for c in OccurrenceClass),
    }
    return xr.DataArray(classes, status.coords, status.dims, "occurrence_class", attributes)


def count_classes(classes: NDArray[np.int8]) -> dict[OccurrenceClass, int]:
    """Number of runs of each class."""
    return {c: int(np.count_nonzero(classes == c)) for c in OccurrenceClass}


def at_strongest_strand(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """A variable at the strand with the largest amplitude.

    Parameters
    ----------
    dataset : Dataset
        With `status`, `amplitude` and the variable; these may have a dimension (`strand`) beyond those of
        `status`.
    name : str
        "amplitude", "frequency" or another variable with the dimensions of `amplitude`.

    Returns
    -------
    DataArray
        Dimensions of `status`; nan where the dataset has no such variable.
    """
    status = dataset["status"]
    if name not in dataset or "amplitude" not in dataset:
        return xr.full_like(status, np.nan, dtype=float)
    extra = [d for d in dataset["amplitude"].dims if d not in status.dims]
    amplitude = dataset["amplitude"].transpose(*status.dims, *extra).values.reshape(*status.shape, -1)
    values = dataset[name].transpose(*status.dims, *extra).values.reshape(*status.shape, -1)
    strongest = np.argmax(np.where(np.isnan(amplitude), -np.inf, amplitude), axis=-1)[..., np.newaxis]
    return status.copy(data=np.take_along_axis(values, strongest, axis=-1)[..., 0].astype(float))
