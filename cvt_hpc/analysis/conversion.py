"""Datasets as xarray and its companions leave them, in the form that this program writes, and other units."""

from collections.abc import Callable, Iterator, Mapping
from functools import lru_cache, partial
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import DTypeLike
from xarray.indexes import PandasMultiIndex

from cvt_hpc.errors import mismatch, show, unknown
from cvt_hpc.job.units import factor_to, is_unit
from cvt_hpc.job.values import JOB_UNITS
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.storage.dataset_form import check_form
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.classes import OccurrenceClass

# Units of the values in datasets of this program; of those of one dimension the first is taken.
UNITS = (
    *("1", "m", "s", "N", "N m", "W", "Hz", "rad", "rad s-1", "m s-1", "N m-1", "W m-1", "s m-1", "kg", "Pa"),
    *("s-1", "J", "J m-1", "N s", "N m s", "N s m-2", "kg/m", "kg/m^3", "kg m^2", "N m^2", "m/N", "N s/m"),
    *("N m/rad", "N m s/rad", "m/(N s)", "1/s", "N s/m^2", "N/m", "N/m^2", "N/s", "m/s", "m/s^2", "rad/s"),
    "s/m",
)
_BLANKS = {  # what flags mean where they are missing
    "status": Status.NOT_RUN,
    "vibrates": Vibrates.UNDECIDED,
    "occurrence_class": OccurrenceClass.NOT_RUN,
    "inferred_class": OccurrenceClass.NOT_RUN,
}


def in_units(dataset: xr.Dataset, units: Mapping[str, str]) -> xr.Dataset:
    """Convert values and the attribute `units` of variables and coordinates; nothing is computed of chunks.

    `units` are by the name of a variable or coordinate one of its dimension, as pint reads it. InputError if
    there is no such variable, it has no unit, or the unit is of another dimension.
    """
    converted = {}
    for name, unit in units.items():
        if name not in dataset.variables:
            raise unknown("results", "variable", name, map(str, dataset.variables))
        variable = _without_pint(dataset.variables[name])
        if "units" not in variable.attrs:
            raise mismatch(f"results: {name}", "a variable with a unit", "a flag or a text")
        given = str(variable.attrs["units"])
        if (factor := factor_to(given, unit)) is None:
            raise mismatch(f"results: {name}", f"a unit of the dimension of {given}", unit)
        converted[name] = _changed_to(variable, variable.data * factor, **{"units": unit, JOB_UNITS: unit})
    return _with(dataset, converted)


def standard(dataset: xr.Dataset, source: str = "results") -> xr.Dataset:
    """Return a dataset in the form in which this program writes it, whatever has been done to it.

    Pictures, sentences and tables are made of this form: as of `plain`, with numbers in SI units. Numbers
    without a unit have the one that their model documents. Of a chunked dataset nothing is computed yet.
    InputError, which names the source, if a unit cannot be read, or is of another dimension than the
    documented one; or as of `plain`.
    """
    dataset = plain(dataset, source)
    for name in map(str, dataset.data_vars):
        if dataset[name].dtype.kind not in "biuf" and documented_units(False).get(name, "1") != "1":
            raise mismatch(f"{source}: {name}", "numbers", "texts or others")
    converted = {
        str(name): _in_si(variable, str(name), name in dataset.coords, source)
        for name, variable in dataset.variables.items()
        if variable.dtype.kind in "iuf" and name not in _BLANKS and "flag_values" not in variable.attrs
    }
    return _with(dataset, converted)


def plain(dataset: xr.Dataset, source: str = "results") -> xr.Dataset:
    """Return a dataset as numbers, flags and texts, in the units that it has.

    Quantities of pint and durations become numbers; characters become texts; flags are whole numbers where
    `where`, `concat` or `merge` have left nan; stacked axes become those of samples. InputError, which names
    the source, if the dataset is not as `check_form` has it, or flags are no whole numbers, which is raised
    when they are computed.
    """
    for name in [key for key in dataset.dims if isinstance(dataset.xindexes.get(key), PandasMultiIndex)]:
        dataset = dataset.reset_index(name).rename_dims({name: "run"} if name != "run" else {})
    check_form(dataset, source)
    if any(variable.dtype.kind == "S" for variable in dataset.variables.values()):
        dataset = xr.decode_cf(dataset, decode_times=False, decode_timedelta=False)
    return _with(dataset, dict(_restored(dataset, source)))


@lru_cache(maxsize=2)
def documented_units(of_axes: bool) -> dict[str, str]:
    """Units of all variables of records by name, or of parameters; without those on which models differ."""
    from cvt_hpc.simulation.record import COMMON

    found: dict[str, set[str]] = {}
    for model in map(load_model, MODELS):
        units = [(one.name, one.units) for one in (*COMMON, *model.variables)] if model.is_recorded else []
        if of_axes:
            units = [(key, one.unit) for table in model.parameters.values() for key, one in table.items()]
        for name, unit in units:
            found.setdefault(name, set()).add(unit or "1")
    return {name: next(iter(units)) for name, units in found.items() if len(units) == 1}


def _restored(dataset: xr.Dataset, source: str) -> Iterator[tuple[str, xr.Variable]]:
    """Yield variables and coordinates as numbers, flags and texts."""
    for name, given in dataset.variables.items():
        variable, key = _without_pint(given), str(name)
        kind = variable.dtype.kind
        if kind in "OSUT" and name not in dataset.xindexes:
            variable = _each(_texts, variable, object)
        elif kind == "m":
            variable = _changed_to(variable, variable.astype("m8[ns]").data.astype(float) * 1e-9, units="s")
        elif kind == "f" and key in _BLANKS:
            variable = _each(partial(_flags, blank=_BLANKS[key], where=f"{source}: {key}"), variable, np.int8)
        yield key, variable


def _in_si(variable: xr.Variable, name: str, is_axis: bool, source: str) -> xr.Variable:
    """Numbers in the unit of this program; those in a unit of none of its quantities stay as they are."""
    given = str(variable.attrs.get("units", "")).strip()
    documented = documented_units(is_axis).get(name, "")
    if not given:
        known = documented and variable.dtype.kind == "f"
        return _changed_to(variable, variable._data, units=documented) if known else variable
    if given == documented or (given in UNITS and not documented):
        return variable
    for unit in [documented] if documented else UNITS:
        if factor := factor_to(given, unit):
            return _changed_to(variable, variable.data * factor, units=unit)
    if documented or not is_unit(given):
        expected = f"of the dimension of {documented}" if documented else "such as mm, kN or rpm"
        raise mismatch(f"{source}: {name}: units", f"a unit {expected}", show(given))
    return variable


@np.vectorize(otypes=[object])
def _texts(value: object) -> str:
    """A text, of bytes too; empty where there is none."""
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    return value if isinstance(value, str) else ""


def _flags(values: np.ndarray, blank: int, where: str) -> np.ndarray:
    """Flags as whole numbers, `blank` where they are nan."""
    found = np.where(np.isnan(values), blank, values)
    with np.errstate(invalid="ignore"):  # of infinite ones
        flags = found.astype(np.int8)
    if (found != flags).any():
        raise mismatch(where, "flags, which are whole numbers", f"{found[found != flags][0]:g}")
    return flags


def _each(function: Callable, variable: xr.Variable, dtype: DTypeLike) -> xr.Variable:
    """Apply a function of arrays to a variable, lazily where it is chunked."""
    return xr.apply_ufunc(function, variable, dask="parallelized", output_dtypes=[dtype], keep_attrs=True)


def _without_pint(variable: xr.Variable) -> xr.Variable:
    """Numbers of a variable that holds quantities of pint, with their unit as attribute."""
    held: Any = variable._data  # `data` would read a file
    if not hasattr(held, "magnitude"):
        return variable
    return _changed_to(variable, held.magnitude, units=format(held.units, "D"))


def _changed_to(variable: xr.Variable, values: Any, **attributes: str) -> xr.Variable:
    return xr.Variable(variable.dims, values, {**variable.attrs, **attributes})


def _with(dataset: xr.Dataset, variables: Mapping[str, xr.Variable]) -> xr.Dataset:
    """Put those variables and coordinates that are others in the place of those of their names."""
    new = {name: one for name, one in variables.items() if one is not dataset.variables[name]}
    if not new:
        return dataset.copy()  # a hundred times as fast as to assign nothing
    coordinates = {name: new.pop(name) for name in [*new] if name in dataset.coords}
    return dataset.assign_coords(coordinates).assign(new)
