"""Certainty of a map: probabilities over the samples of uncertain parameters, with intervals.

A run that ended without a verdict, or moves irregularly, counts on neither side: the probability is that of
the others. Its interval reaches from where no such run had the property to where all of them had it.

The intervals hold the probability in 95 of 100 studies or more if samples are independent, also where an
adaptive study stops by what it finds (`study/intervals.py`). Points of a scrambled Sobol sequence are not
independent. Each is distributed like a sample, so that the probability has no bias, but in an adaptive study
that has stopped. They cover a distribution more evenly: with one uncertain parameter each of n equal parts
has one of n samples. So the intervals are rather too wide; of several parameters no theorem says so for a
given n. All cells have the samples in common: their errors are alike, and contours shift as a whole.
"""

from collections.abc import Collection

import numpy as np
import xarray as xr

from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, map_classes
from cvt_hpc.analysis.sensitivity import EVENTS, QUANTILES, check_samples, independent, indices_of, stated
from cvt_hpc.analysis.sobol import WITHOUT
from cvt_hpc.job.axes import SAMPLE, SWAPPED
from cvt_hpc.study.intervals import VERDICTS, interval, look, looks_of
from cvt_hpc.variables import Status, Vibrates

CONTOURS = (0.1, 0.5, 0.9)
ISOLINES = "isolines"  # attribute of a variable: values of lines on its map
PROBABILITY = "vibration_probability"


def has_samples(dataset: xr.Dataset, fixed: Collection[str] = ()) -> bool:
    """Whether results have samples of uncertain parameters, and none of their axes is fixed."""
    dims = {*dataset["status"].dims}
    return SAMPLE in dims and not {SAMPLE, SWAPPED} & {*fixed} and bool(dims - {SAMPLE, SWAPPED})


def over_samples(dataset: xr.Dataset, fixed: Collection[str] = ()) -> xr.Dataset:
    """Return the `probabilities` of results with samples, unless one is fixed; other datasets as they are."""
    return probabilities(dataset) if has_samples(dataset, fixed) else dataset


def probabilities(dataset: xr.Dataset, source: str = "results") -> xr.Dataset:
    """Return the probabilities of vibration, slip and failure, and quantiles of amplitude and frequency.

    Parameters
    ----------
    dataset, source
        Results of a study with the axis `sample`, else InputError, which names the source.

    Returns
    -------
    Dataset
        Over the other axes `vibration_probability`, `slip_probability` and `failure_probability`, each with
        the ends of its 95 % interval, `_low` and `_high`; `samples`, how many have ended, and
        `undecided_samples`, how many of them count neither as vibration nor against it. Over `quantile`, too,
        `amplitude_quantiles` [m] and `frequency_quantiles` [Hz] of the samples that vibrate, at the strongest
        strand. With runs for Sobol indices those of vibration over `parameter`, as of `indices_of`.
    """
    check_samples(dataset, source)
    whole, dataset = dataset, independent(dataset)
    classes = map_classes(dataset).compute().drop_attrs(deep=False)
    design = stated(dataset, "design")
    looks = looks_of(design, dataset.sizes[SAMPLE])
    if len(looks) > 1:  # further samples, of other studies in the folder, are none that a cell has stopped at
        counted = look(classes.transpose(..., SAMPLE).values, design).counted
        rest = [dim for dim in classes.dims if dim != SAMPLE]
        place = xr.DataArray(np.arange(classes.sizes[SAMPLE]), dims=SAMPLE)
        classes = classes.where(place < xr.DataArray(counted, dims=rest), OccurrenceClass.NOT_RUN)
    ended = classes != OccurrenceClass.NOT_RUN
    count = ended.sum(SAMPLE)
    found = xr.Dataset(attrs=dataset.attrs)
    for event, (kind, may_hide) in EVENTS.items():
        yes = classes == kind
        hidden = (ended & ~classes.isin(VERDICTS)).sum(SAMPLE) if may_hide else xr.zeros_like(count)
        name = f"{event}_probability"
        found[name] = (yes.sum(SAMPLE) / (count - hidden).where(count > hidden)).assign_attrs(
            units="1", long_name=f"probability of {event}", valid_range=[0.0, 1.0], isolines=list(CONTOURS)
        )
        found[name].attrs[WITHOUT] = "no sample has a verdict"
        hits = yes.sum(SAMPLE)
        low, _ = interval(hits.values, count.values, len(looks))
        _, high = interval((hits + hidden).values, count.values, len(looks))
        for end, values in (("low", low), ("high", high)):
            comment = f"{end} end of the 95 % interval of {name}"
            found[f"{name}_{end}"] = count.dims, values, {"units": "1", "comment": comment}
        if event == "vibration":
            told = {"units": "1", "comment": "samples that count neither as vibration nor against it"}
            found["undecided_samples"] = hidden.astype(int).assign_attrs(told)
    found["samples"] = count.assign_attrs(units="1", comment="samples that have ended")
    vibrates = classes == OccurrenceClass.VIBRATING
    for name, unit in (("amplitude", "m"), ("frequency", "Hz")):
        if name in dataset:
            values = at_strongest_strand(dataset, name).compute().where(vibrates)
            told = {"units": unit, "long_name": name, "comment": "quantiles of the samples that vibrate"}
            told[WITHOUT] = "no sample vibrates"
            found[f"{name}_quantiles"] = _quantiles(values).assign_attrs(told)
    if SWAPPED in whole["status"].dims:
        found = found.merge(indices_of(whole, "vibration"))
    # a cell of many runs has no verdict of its own
    found["status"] = xr.where(count > 0, int(Status.DONE), int(Status.NOT_RUN)).astype(np.int8)
    found["vibrates"] = xr.full_like(found["status"], int(Vibrates.UNDECIDED))
    kept = {name: axis for name, axis in dataset.coords.items() if SAMPLE not in axis.dims}
    cells, least, most = count.size, int(count.min()), int(count.max())
    each = f"{most} samples" if len(looks) == 1 or least == most else f"{least} to {most} samples"
    widest = float((found[f"{PROBABILITY}_high"] - found[f"{PROBABILITY}_low"]).max())
    told_as = f"{cells} cell{'s' * (cells != 1)} of {each}; 95 % intervals up to {widest:.2g} wide"
    return found.assign_coords(kept).assign_attrs(counted=told_as)


def _quantiles(values: xr.DataArray) -> xr.DataArray:
    """Quantiles over the samples: the least value that so many do not exceed; nan where none has a value."""
    ordered = np.sort(values.transpose(SAMPLE, ...).values, axis=0)  # nan last
    count = (~np.isnan(ordered)).sum(axis=0)
    places = [np.maximum(np.ceil(share * count).astype(int) - 1, 0) for share in QUANTILES.values()]
    found = np.take_along_axis(ordered, np.stack(places), axis=0)
    rest = [dim for dim in values.dims if dim != SAMPLE]
    coordinates = {name: axis for name, axis in values.coords.items() if SAMPLE not in axis.dims}
    return xr.DataArray(found, {**coordinates, "quantile": [*QUANTILES]}, ["quantile", *rest])
