"""netCDF files that give parameters of a job: variables with units, one error for all faults.

A file may come from somebody else: `cvt_hpc/storage/foreign_files.py` says what is not read.
"""

from __future__ import annotations

import io
import math
import warnings
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.errors import did_you_mean, mismatch, show
from cvt_hpc.job.csv_files import BARE, MOST_BYTES, FileValues, arranged, content_of, told, unit_of
from cvt_hpc.job.units import factor_to
from cvt_hpc.parameters import Column, FromFile
from cvt_hpc.storage.libraries import LIBRARIES

if TYPE_CHECKING:
    import netCDF4

MOST_VALUES = 2**22  # of a variable
SUFFIX = ".nc"
_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_netcdf(file: FromFile, name: str, source: str, where: str) -> FileValues:
    """Return the raw values of the parameters that a file gives.

    Each column of `file` is a variable with an attribute `units`. A variable over several dimensions takes
    the values of the variables with their names, as a table does of its row and column; where both dimensions
    of a matrix are the same, x, its rows stand for `other_x`. Other variables do not count.

    Parameters
    ----------
    file, name, source, where
        As of `csv_files.read_csv`.

    Raises
    ------
    InputError
        If the file is missing, a link, no regular file, too large or no netCDF, or if a variable is not
        legal.
    """
    path = Path(source).parent / name
    place = f"{where}: {path}"
    content = content_of(path, MOST_BYTES, place, "a netCDF file", SUFFIX)
    columns, units = _columns(file, content, place)
    return arranged(file, columns, place, lambda row: f"entry {row + 1}", units)


def _columns(file: FromFile, content: bytes, place: str) -> tuple[dict[str, Column], dict[str, str]]:
    """Return the columns of a file, in SI units, and the units in which it has them."""
    import netCDF4

    if _HDF5 in content:  # netCDF looks for it behind a block of the user's, too
        from cvt_hpc.storage.foreign_files import check_hdf5

        check_hdf5(io.BytesIO(content), len(content), place)
    try:
        with LIBRARIES, netCDF4.Dataset("file", memory=content) as dataset:
            known = dataset.variables
            for name in file.required:
                if name not in known:
                    found = f"none among {', '.join(known)}" if known else "no variables"
                    raise mismatch(place, f"a variable {told(name, file)}", found + did_you_mean(name, known))
            given = {name: known[name] for name in file.columns if name in known}
            units = {name: _unit(file, name, one) for name, one in given.items()}
            return _in_rows(file, given, units, place), units
    except (OSError, RuntimeError) as error:
        raise mismatch(place, "a netCDF file", getattr(error, "strerror", None) or str(error)) from None


def _in_rows(
    file: FromFile, variables: dict[str, netCDF4.Variable], units: dict[str, str], place: str
) -> dict[str, Column]:
    """Return all columns over all combinations of their dimensions."""
    found = {name: _values(file, name, one, units[name], place) for name, one in variables.items()}
    dimensions = {name: _dimensions(name, variables, file, place) for name in variables}
    for name in list(found):
        if (other := f"other_{name}") in {own for of in dimensions.values() for own in of} - set(found):
            found[other], dimensions[other] = found[name], (other,)
    grid = max(dimensions.values(), key=len)
    sizes = {}
    for name, own in dimensions.items():
        for dimension, size in zip(own, found[name][1].shape, strict=True):
            if dimension not in grid:
                raise mismatch(f"{place}, {name}", f"over {' x '.join(grid)}", f"over {' x '.join(own)}")
            sizes[dimension] = size
    places = dict(zip(grid, np.indices([sizes[dimension] for dimension in grid]), strict=True))
    columns = {}
    for name, (unit, values) in found.items():
        spread = values[tuple(places[dimension] for dimension in dimensions[name])]
        columns[name] = Column(unit, tuple(spread.ravel().tolist()))
    return columns


def _dimensions(
    name: str, variables: dict[str, netCDF4.Variable], file: FromFile, place: str
) -> tuple[str, ...]:
    """Dimensions of a variable; those of a matrix are columns."""
    own = tuple(variables[name].dimensions)
    found = " x ".join(own) or "none"
    if len(own) == 2 and own[0] == own[1]:
        own = (f"other_{own[0]}", own[1])
    if not own or (len(own) > 1 and not set(own) <= set(file.columns) - {name}):
        legal = ", ".join(key for key in file.columns if key != name)
        raise mismatch(f"{place}, {name}", f"dimensions among {legal}", found)
    return own


def _values(
    file: FromFile, name: str, variable: netCDF4.Variable, unit: str, place: str
) -> tuple[str, np.ndarray]:
    """SI unit and values [SI] of a variable in a unit."""
    place = f"{place}, {name}"
    if getattr(variable.dtype, "kind", None) not in ("f", "i", "u"):
        raise mismatch(place, "numbers", "something else")
    if math.prod(variable.shape) > MOST_VALUES:
        raise mismatch(place, f"at most {MOST_VALUES} values", str(math.prod(variable.shape)))
    si, factor = _conversion(file, name, unit, place)
    try:
        with warnings.catch_warnings(action="error", category=UserWarning):
            read = variable[...]
    except UserWarning as warning:  # scale_factor and the like, which netCDF4 would not apply
        raise mismatch(place, "numbers that can be unpacked", str(warning).rstrip(".")) from None
    values = np.ma.filled(np.ma.asarray(read, dtype=float), np.nan) * factor
    if not np.isfinite(values).all():
        raise mismatch(place, "finite numbers", "others")
    return si, values


def _unit(file: FromFile, name: str, variable: netCDF4.Variable) -> str:
    """Unit of a variable as it is written here."""
    return unit_of(file, name, str(getattr(variable, "units", "")).strip())


def _conversion(file: FromFile, name: str, unit: str, place: str) -> tuple[str, float]:
    """SI unit of a variable in a unit, and the factor to it."""
    bare = unit in BARE
    for si in file.columns[name]:
        if bare == (not si) and (factor := 1.0 if bare else factor_to(unit, si)):
            return si, factor
    raise mismatch(place, f"units {told(name, file)}", show(unit) if unit else "none")
