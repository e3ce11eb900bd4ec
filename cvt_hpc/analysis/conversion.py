"""Datasets in other units than SI, for tables and pictures of one's own, and back."""

from __future__ import annotations

from collections.abc import Mapping

import xarray as xr

from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.job.shown import JOB_UNITS
from cvt_hpc.job.units import UnitError, from_si

_SI_UNITS = "si_units"  # attribute of what was converted: the unit that it had before


def in_units(dataset: xr.Dataset, units: Mapping[str, str]) -> xr.Dataset:
    """Convert variables and coordinates.

    Parameters
    ----------
    dataset : Dataset
        Of this program: with the attribute `units` where there is one.
    units : mapping
        By the name of a variable or coordinate a unit of its dimension, as pint reads it.

    Returns
    -------
    Dataset
        Values and the attribute `units` are converted. Of a chunked dataset nothing is computed yet.

    Raises
    ------
    InputError
        There is no such variable, it has no unit, or the unit is of another dimension.
    """
    for name, unit in units.items():
        if name not in dataset.variables:
            raise unknown("results", "variable", name, map(str, dataset.variables))
        attributes = dataset[name].attrs
        if "units" not in attributes:
            raise mismatch(f"results: {name}", "a variable with a unit", "a flag or a text")
        given = str(attributes["units"])
        try:
            factor = from_si(1.0, given, unit)
        except UnitError:
            raise mismatch(f"results: {name}", f"a unit of the dimension of {given}", unit) from None
        told = {"units": unit, JOB_UNITS: unit, _SI_UNITS: attributes.get(_SI_UNITS, given)}
        values = dataset[name].variable * factor
        converted = {name: (values.dims, values.data, attributes | told)}
        is_axis = name in dataset.coords
        dataset = dataset.assign_coords(converted) if is_axis else dataset.assign(converted)
    return dataset


def in_si(dataset: xr.Dataset) -> xr.Dataset:
    """Take back what `in_units` has converted, as pictures and reports need it; they show its units."""
    names = [str(name) for name, array in dataset.variables.items() if _SI_UNITS in array.attrs]
    if not names:
        return dataset
    restored = in_units(dataset, {name: dataset[name].attrs[_SI_UNITS] for name in names})
    for name in names:
        restored[name].attrs[JOB_UNITS] = dataset[name].attrs["units"]
        del restored[name].attrs[_SI_UNITS]
    return restored
