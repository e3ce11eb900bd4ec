"""Studies whose runs begin with a small and with a large disturbance, as one map: where the start decides."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.arrangement import arrange, value_text
from cvt_hpc.analysis.classes import map_classes, occurrence_classes
from cvt_hpc.vibration.hysteresis import StartClass, classify_starts

AXIS = "disturbance"


def has_starts(dataset: xr.Dataset, at: Mapping[str, Any]) -> bool:
    """Whether a map is to join runs from several disturbances: that axis is free, and not alone."""
    dims = dataset["status"].dims
    return AXIS in dims and AXIS not in at and dataset.sizes[AXIS] > 1 and len(set(dims) - set(at)) > 1


def join_starts(dataset: xr.Dataset) -> xr.Dataset:
    """Results over the other axes: the runs from the smallest disturbance, and the classes of both.

    Parameters
    ----------
    dataset : Dataset
        Results of a study with the axis `disturbance` [m].

    Returns
    -------
    Dataset
        With `occurrence_class`, values of `StartClass`, `inferred_class` where the study is a trace, and
        both disturbances in words in the attribute `starts`.
    """
    ordered = dataset.sortby(AXIS)
    small, large = (ordered.isel({AXIS: place}, drop=True) for place in (0, -1))
    joined = {"occurrence_class": _joined(occurrence_classes(small), occurrence_classes(large))}
    if "inferred_class" in dataset:
        joined["inferred_class"] = _joined(map_classes(small), map_classes(large))
    words = " and ".join(value_text(ordered[AXIS], place) for place in (0, -1))
    return small.assign(joined).assign_attrs(starts=words)


def start_line(dataset: xr.Dataset, at: Mapping[str, Any], source: str) -> str:
    """How many cells of a map vibrate from the large start only, in words; as `map_figure` takes results."""
    drawn = arrange(join_starts(dataset), at, source).dataset
    classes = map_classes(drawn)
    found = int(np.count_nonzero(classes == StartClass.LARGE_START_ONLY))
    return f"{found} of {classes.size} cells: vibration from the large start only ({drawn.attrs['starts']})"


def _joined(small: xr.DataArray, large: xr.DataArray) -> xr.DataArray:
    return small.copy(data=classify_starts(small.values, large.transpose(*small.dims).values))
