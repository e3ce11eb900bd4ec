"""Datasets as netCDF files with CF conventions: their attributes, storage and origin."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Mapping, Sequence
from contextlib import closing
from enum import IntEnum
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import DTypeLike

from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.storage.dataset_form import check_form
from cvt_hpc.storage.files import kind_of, naming_refusals, open_regular, written_aside
from cvt_hpc.storage.libraries import LIBRARIES
from cvt_hpc.storage.locks import refuse_locked
from cvt_hpc.storage.provenance import command, git_revision, history_line, merge_versions, versions

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.variables import Variable

CONTENT = "cvt_hpc_content"  # global attribute by which this program knows its own files
HISTORY = "history of one run"
Entry = Mapping[str, Any]  # as JSON has it
VOLATILE = "depends on the machine and the hour; not reproduced bitwise"


class Named(Protocol):
    """The content of a dataset: a job, a study or a chart."""

    @property
    def name(self) -> str:
        """In one word."""

    @property
    def description(self) -> str:
        """In a line; may be empty."""


def global_attributes(
    named: Named, job: Entry, subject: str, *, makers: Sequence[Entry] = (), earlier: Sequence[str] = ()
) -> dict[str, str]:
    """Return the global attributes that all datasets of this program have.

    Parameters
    ----------
    named : Named
        Gives `title` and `job_name`.
    job : mapping
        The whole resolved job, as JSON types.
    subject : str
        The computed object, as the end of `source`: "model elastic_belt".
    makers : sequence of mapping
        `versions` and `git_revision` of all processes that have computed; by default of this process.
    earlier : sequence of str
        Lines of `history` that precede that of this process, oldest first.

    Returns
    -------
    dict
        Conventions, title, source, history, command and host of this process, job_name, job, versions,
        git_revision.
    """
    makers = makers or [{"versions": versions(), "git_revision": git_revision()}]
    found = merge_versions([maker["versions"] for maker in makers])
    revision = ", ".join(filter(None, dict.fromkeys(maker["git_revision"] for maker in makers)))
    program = f"cvt_hpc {found.get('cvt_hpc', 'of unknown version')}"
    here = history_line(f"{command()} (on {platform.node()})")
    return {
        "Conventions": "CF-1.11",
        "title": named.description or named.name,
        "source": ", ".join(filter(None, (program, revision and f"revision {revision}", subject))),
        "history": "\n".join([*earlier, here]),
        "command": command(),
        "host": platform.node(),
        "job_name": named.name,
        "job": json.dumps(job),
        "versions": json.dumps(found),
        "git_revision": revision,
    }


def attributes(long_name: str, units: str = "", comment: str = "") -> dict[str, str]:
    """Return the attributes of a variable; without empty ones."""
    named = {"long_name": long_name, "units": units, "comment": comment}
    return {key: text for key, text in named.items() if text}


def flag_attributes(kind: type[IntEnum], dtype: DTypeLike = np.int8) -> dict[str, str | np.ndarray]:
    """Return the attributes that explain a flag variable of type `dtype`."""
    meanings = " ".join(flag.name.lower() for flag in kind)
    return {"flag_values": np.array([int(flag) for flag in kind], dtype), "flag_meanings": meanings}


def variable_attributes(variable: Variable) -> dict[str, str | np.ndarray]:
    """Return the attributes of a quantity of a run's record."""
    comment = "; ".join(filter(None, (variable.comment, VOLATILE if variable.volatile else "")))
    named: dict[str, str | np.ndarray] = {**attributes(variable.long_name, variable.units, comment)}
    if variable.flags is not None:
        named |= flag_attributes(variable.flags, variable.dtype)
    return named | ({"volatile": "yes"} if variable.volatile else {})


def write_netcdf(dataset: xr.Dataset, path: Path) -> None:
    """Write a dataset as netCDF-4.

    Texts are stored as characters: a variable of strings with the name of its dimension would be a coordinate
    by CF, and these have to be numbers. Only real numbers have a fill value, and coordinates must not.

    Parameters
    ----------
    dataset : Dataset
        Numbers and texts.
    """
    from xarray.backends import NetCDF4DataStore

    encoding = {name: _encoding(one, name in dataset.coords) for name, one in dataset.variables.items()}
    loaded = dataset.compute()  # it may come from files that others have opened, by the lock of xarray
    # Not by to_netcdf, which has a lock for values alone.
    with LIBRARIES, closing(NetCDF4DataStore.open(path, mode="w", lock=LIBRARIES)) as file:
        loaded.dump_to_store(file, encoding=encoding)


def _encoding(variable: xr.Variable, is_coordinate: bool) -> dict[str, bool | str | None]:
    """Return how a variable is stored."""
    kind = variable.dtype.kind
    encoding: dict[str, bool | str | None] = {"zlib": True} if variable.ndim else {}
    if kind in "OUST":
        encoding["dtype"] = "S1"
    elif kind != "f" or is_coordinate:
        encoding["_FillValue"] = None
    return encoding


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
        expected = "a new file, or a history written by cvt_hpc"
        raise mismatch(str(path), expected, "another file, left as it is")
    store_history(dataset, path)
    return path


def store_history(dataset: xr.Dataset, path: Path) -> None:
    """Write the history of one run as `store` writes a dataset."""
    store(dataset.assign_attrs({CONTENT: HISTORY}), path)


def store(dataset: xr.Dataset, path: Path) -> Path:
    """Write a dataset aside, put it in the place of whatever is at `path`, and return the path.

    Raises
    ------
    StorageError
        If the system refuses.
    """
    with written_aside(path, parents=True) as aside:
        write_netcdf(dataset, aside)
    return path


def is_history(path: Path) -> bool:
    """Whether a file that the user names, or the target of a link, is a history that this program wrote."""
    if kind_of(path, follow=True) != "a file":  # a pipe would be waited for
        return False
    from cvt_hpc.storage.foreign_files import global_text

    return global_text(path, CONTENT) == HISTORY


def open_netcdf(path: Path, *, follow: bool = False, **options: Any) -> xr.Dataset:
    """Open a dataset on the disk, which may be somebody else's: all that opens one does so by this function.

    Parameters
    ----------
    path : Path
        A netCDF-4 file.
    follow : bool
        Whether a link may lead to the file, since the user named it herself.
    **options
        Of `xarray.open_dataset`.

    Returns
    -------
    Dataset
        Read from the file as it is used. Quantities in seconds are numbers, not dates.

    Raises
    ------
    StorageError
        Something other than a file is there, or the system refuses.
    BusyError
        A process that may write to the file has it open.
    InputError
        The file is not netCDF-4, is damaged, or is not as `check_hdf5` and `check_form` have it.
    """
    import xarray as xr

    from cvt_hpc.storage.foreign_files import DAMAGE, check_hdf5

    place = str(path)
    with naming_refusals(path, "a netCDF dataset"):
        with os.fdopen(open_regular(path, follow=follow), "rb") as file:
            size, first = os.fstat(file.fileno()).st_size, file.read(4)
        if first[:3] == b"CDF":
            then = f"`nccopy -k nc4 {path.name} NEW.nc` of the netCDF library turns one into the other"
            raise mismatch(place, "netCDF-4", "netCDF-3", then)
        check_hdf5(path, size, place)
        options = {"engine": "netcdf4", "decode_times": False, "lock": LIBRARIES, **options}
        try:
            with LIBRARIES:
                dataset = xr.open_dataset(path, **options)
        except OSError as error:
            refuse_locked(path)
            if error.errno and error.errno > 0:  # of the system, not of the library
                raise
            raise mismatch(place, "a netCDF dataset", "one that is damaged") from None
        except DAMAGE as error:
            raise mismatch(place, "a netCDF dataset", f"one that xarray cannot read: {error}") from None
    try:
        check_form(dataset, place)
    except InputError:
        dataset.close()
        raise
    return dataset
