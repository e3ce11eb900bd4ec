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
from cvt_hpc.job.csv_files import MOST_BYTES, arranged, content_of, told
from cvt_hpc.job.units import factor_to
from cvt_hpc.job.values import Point
from cvt_hpc.parameters import Column, FromFile

if TYPE_CHECKING:
    import netCDF4

MOST_VALUES = 2**22  # of a variable
SUFFIX = ".nc"
_HDF5 = b"\x89HDF\r\n\x1a\n"


def read_netcdf(file: FromFile, name: str, source: str, where: str) -> Point:
    """Return the raw values of the parameters that a file gives, by key.

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
    columns = _columns(file, content_of(path, MOST_BYTES, place, "a netCDF file", SUFFIX), place)
    return arranged(file, columns, place, lambda row: f"entry {row + 1}")


def _columns(file: FromFile, content: bytes, place: str) -> dict[str, Column]:
    import netCDF4

    if _HDF5 in content:  # netCDF looks for it behind a block of the user's, too
        from cvt_hpc.storage.foreign_files import check_hdf5

        check_hdf5(io.BytesIO(content), len(content), place)
    try:
        with netCDF4.Dataset("file", memory=content) as dataset:
            known = dataset.variables
            for name in file.required:
                if name not in known:
                    found = f"none among {', '.join(known)}" if known else "no variables"
                    raise mismatch(place, f"a variable {told(name, file)}", found + did_you_mean(name, known))
            return _in_rows(file, {name: known[name] for name in file.columns if name in known}, place)
    except (OSError, RuntimeError) as error:
        raise mismatch(place, "a netCDF file", getattr(error, "strerror", None) or str(error)) from None


def _in_rows(file: FromFile, variables: dict[str, netCDF4.Variable], place: str) -> dict[str, Column]:
    """Return all columns over all combinations of their dimensions."""
    found = {name: _values(file, name, variable, place) for name, variable in variables.items()}
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


def _values(file: FromFile, name: str, variable: netCDF4.Variable, place: str) -> tuple[str, np.ndarray]:
    """Unit and values [SI] of a variable."""
    place = f"{place}, {name}"
    if getattr(variable.dtype, "kind", None) not in ("f", "i", "u"):
        raise mismatch(place, "numbers", "something else")
    if math.prod(variable.shape) > MOST_VALUES:
        raise mismatch(place, f"at most {MOST_VALUES} values", str(math.prod(variable.shape)))
    unit, factor = _unit(file, name, getattr(variable, "units", ""), place)
    try:
        with warnings.catch_warnings(action="error", category=UserWarning):
            read = variable[...]
    except UserWarning as warning:  # scale_factor and the like, which netCDF4 would not apply
        raise mismatch(place, "numbers that can be unpacked", str(warning).rstrip(".")) from None
    values = np.ma.filled(np.ma.asarray(read, dtype=float), np.nan) * factor
    if not np.isfinite(values).all():
        raise mismatch(place, "finite numbers", "others")
    return unit, values


def _unit(file: FromFile, name: str, given: object, place: str) -> tuple[str, float]:
    text = str(given)
    for si in file.columns[name]:
        bare = text.strip() in ("", "1")
        if bare == (not si) and (factor := 1.0 if bare else factor_to(text.strip(), si)):
            return si, factor
    raise mismatch(place, f"units {told(name, file)}", show(text) if text else "none")
