"""How datasets become netCDF files with CF conventions; used by all rooms that write some."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr


def write_netcdf(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as netCDF-4.

    All is compressed. Texts are stored as characters, since CF wants labels of a dimension to be arrays of them.
    Only real numbers that are no coordinates have a fill value: CF forbids it for coordinates.

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
