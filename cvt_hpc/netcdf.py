"""How datasets become netCDF files with CF conventions; used by all rooms that write some."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


def write_netcdf(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as netCDF-4.

    Texts are stored as characters: a variable of strings with the name of its dimension would be a coordinate
    by CF, and these have to be numbers. Only real numbers have a fill value, and coordinates must not.

    Parameters
    ----------
    dataset : Dataset
        Numbers and texts.
    path : Path
        The file.
    """
    encoding = {
        name: _encoding(variable, name in dataset.coords) for name, variable in dataset.variables.items()
    }
    dataset.to_netcdf(path, engine="netcdf4", format="NETCDF4", encoding=encoding)


def _encoding(variable: xr.Variable, is_coordinate: bool) -> dict[str, Any]:
    """Return how a variable is stored."""
    kind = variable.dtype.kind
    encoding: dict[str, Any] = {"zlib": True} if variable.ndim else {}
    if kind in "OUST":
        encoding["dtype"] = "S1"
    elif kind != "f" or is_coordinate:
        encoding["_FillValue"] = None
    return encoding
