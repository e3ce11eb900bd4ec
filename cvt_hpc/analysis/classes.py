"""One class per run of a dataset, and what a map shows of the runs that vibrate."""

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.errors import few_of, mismatch
from cvt_hpc.storage.netcdf import flag_attributes
from cvt_hpc.vibration.classes import OccurrenceClass, StartClass, classify_runs

WITHOUT_RESULT = {  # in words, beside curves and spectra
    OccurrenceClass.SLIPPING: "slips or lifts off",
    OccurrenceClass.FAILED: "failed",
    OccurrenceClass.NOT_RUN: "not run",
}
ALONG = ("load", "load_share", "driving_speed")  # axes along which a vibration is said to set in
_MOST_NAMED = 6  # variables


def check_results(dataset: xr.Dataset, source: str) -> None:
    """Raise InputError unless a dataset holds results of a study; `source` says where it is from."""
    for name in ("status", "vibrates"):
        if name not in dataset:
            found = few_of(list(map(str, dataset.data_vars)), _MOST_NAMED) or "no variables"
            raise mismatch(source, f"results of a study, with the variable {name}", found)
        if dataset[name].dtype.kind not in "biuf":
            raise mismatch(f"{source}: {name}", "flags as numbers", "others")
    if beyond := set(dataset["vibrates"].dims) - set(dataset["status"].dims):
        found = f"{min(map(str, beyond))} beside them"
        raise mismatch(f"{source}: vibrates", "the dimensions of status", found)
    for name in map(str, dataset["status"].dims):
        if "amplitude" in dataset and name not in dataset["amplitude"].dims:
            raise mismatch(f"{source}: amplitude", "the dimensions of status", f"none along {name}")
        values = dataset[name].values.tolist() if name in dataset.coords else []
        if len({value for value in values if value == value}) < len(values):  # nan is no value
            raise mismatch(f"{source}: {name}", "values that differ from each other", "some twice, or none")
    if not dataset["status"].size:
        raise mismatch(source, "results of a study of one run at least", "none")


def axes_in_words(dataset: xr.Dataset) -> str:
    """Names of the axes of results."""
    return ", ".join(map(str, dataset["status"].dims)) or "a single run"


def occurrence_classes(dataset: xr.Dataset) -> xr.DataArray:
    """Class of each run, values of `OccurrenceClass` over the dimensions of `status`.

    They follow from the flags `status` and `vibrates`, or are given as `occurrence_class`, of several runs
    for a cell. Of a chunked dataset nothing is computed yet.
    """
    if "occurrence_class" in dataset:
        return dataset["occurrence_class"]
    flags = dataset["status"], dataset["vibrates"]
    classes = xr.apply_ufunc(classify_runs, *flags, dask="parallelized", output_dtypes=[np.int8])
    attributes = {"long_name": "vibration occurrence", **flag_attributes(OccurrenceClass)}
    return classes.rename("occurrence_class").assign_attrs(attributes)


def map_classes(dataset: xr.Dataset) -> xr.DataArray:
    """Class of each cell of a map: that of its run, or the `inferred_class` of a trace where none was run."""
    classes = occurrence_classes(dataset)
    if "inferred_class" not in dataset:
        return classes
    return classes.where(classes != OccurrenceClass.NOT_RUN, dataset["inferred_class"])


def count_classes(classes: NDArray[np.int8]) -> str:
    """Number of runs, or of cells, of each class that occurs, in words."""
    counts = {c: int(np.count_nonzero(classes == c)) for c in StartClass}
    return ", ".join(f"{count} {kind.label}" for kind, count in counts.items() if count)


def at_strongest_strand(dataset: xr.Dataset, name: str) -> xr.DataArray:
    """A variable at the strand with the largest amplitude, over the dimensions of `status`.

    It has the dimensions of `amplitude`, which may be more (`strand`); nan where the dataset has no such
    variable. Of a chunked dataset nothing is computed yet.
    """
    status = dataset["status"]
    if name not in dataset or "amplitude" not in dataset:
        return xr.full_like(status, np.nan, dtype=float)
    extra = [d for d in dataset["amplitude"].dims if d not in status.dims]
    return xr.apply_ufunc(
        _at_largest,
        dataset["amplitude"],
        dataset[name],
        input_core_dims=[extra, extra],
        kwargs={"extra": len(extra)},
        dask="parallelized",
        dask_gufunc_kwargs={"allow_rechunk": True},
        output_dtypes=[float],
    ).transpose(*status.dims)


def _at_largest(amplitude: NDArray[np.float64], values: NDArray[np.float64], extra: int) -> NDArray:
    """Values where the amplitude is largest, over the last `extra` dimensions of both."""
    shape = amplitude.shape[: amplitude.ndim - extra]
    flat = np.where(np.isnan(amplitude), -np.inf, amplitude).reshape(*shape, -1)
    strongest = np.argmax(flat, axis=-1)[..., np.newaxis]
    return np.take_along_axis(values.reshape(*shape, -1), strongest, axis=-1)[..., 0].astype(float)
