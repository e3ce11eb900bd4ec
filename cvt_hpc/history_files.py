"""The history of one run as a netCDF file, which is complete or not there."""

from __future__ import annotations

from pathlib import Path

import xarray as xr

from cvt_hpc.errors import mismatch
from cvt_hpc.files import written_aside
from cvt_hpc.netcdf import write_netcdf

CONTENT = "cvt_hpc_content"  # global attribute by which this program knows its own files
HISTORY = "history of one run"
DIAGRAM = "bifurcation diagram"


def write_history(dataset: xr.Dataset, path: Path) -> Path:
    """Write the history of one run as netCDF, where there is no other file.

    Parameters
    ----------
    dataset : Dataset
        As `cvt_hpc.simulate` returns it.
    path : Path
        The file; its folder is made if needed.

    Returns
    -------
    Path
        `path`.

    Raises
    ------
    InputError
        `path` exists and is not a history that this program wrote, or the system refuses.
    """
    path = Path(path)
    if path.exists() and not is_history(path):
        raise mismatch(
            str(path), "a new file, or a history written by cvt_hpc", "another file, left as it is"
        )
    store_history(dataset, path)
    return path


def store_history(dataset: xr.Dataset, path: Path) -> None:
    """Write the history of one run aside, and put it in the place of whatever is at `path`.

    Raises
    ------
    StorageError
        If the system refuses.
    """
    marked = dataset.assign_attrs({CONTENT: HISTORY})
    with written_aside(path, parents=True) as aside:
        write_netcdf(marked, aside)


def is_history(path: Path) -> bool:
    """Whether a file is a history that this program wrote."""
    return holds(path, HISTORY)


def holds(path: Path, content: str) -> bool:
    """Whether a file is a dataset of this program with such content: HISTORY or DIAGRAM."""
    if not Path(path).is_file():  # a pipe would be waited for
        return False
    try:
        with xr.open_dataset(path, engine="netcdf4", decode_cf=False) as dataset:
            return dataset.attrs.get(CONTENT) == content
    except (OSError, ValueError):
        return False
