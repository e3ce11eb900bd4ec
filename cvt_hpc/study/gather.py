"""From record logs to the dataset: `results.nc`, netCDF-4 with CF conventions.

Values are read block by block, compressed by all cores, and written chunk by chunk. HDF5 compresses in one
thread, and searches digits that look random for repetitions. The chunks written here are chunks as its
filters shuffle and deflate would have made them, so that every netCDF library reads them.
"""

from __future__ import annotations

import itertools
import json
import logging
import math
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.job.values import JOB_UNITS, Document, file_names
from cvt_hpc.storage.files import discard, kind_of, naming_refusals, written_aside
from cvt_hpc.storage.libraries import LIBRARIES
from cvt_hpc.storage.locks import locked
from cvt_hpc.storage.netcdf import global_attributes, open_netcdf, variable_attributes
from cvt_hpc.storage.provenance import history_line
from cvt_hpc.study.description import Dimension, Study
from cvt_hpc.study.folder import StudyFolder, study_instead
from cvt_hpc.study.job_difference import difference_in_words, places_in
from cvt_hpc.study.planning import inferred_classes
from cvt_hpc.study.record.index import Records, block_length
from cvt_hpc.study.record.log import KEPT
from cvt_hpc.variables import Status, Variable
from cvt_hpc.vibration.classes import OccurrenceClass

if TYPE_CHECKING:
    import h5py
    import netCDF4
    import xarray as xr

CHUNK = 1 << 17  # [bytes] at most; a map takes some hundred of them, the spectra of one run a single one

_INFERENCE = "class of the run; where status is not_run, the class of the runs around it, which is inferred"
_INFERRED = Variable("inferred_class", "", _INFERENCE, dtype="i1", flags=OccurrenceClass)
LONGEST = 64  # numbers of a run in a variable that is no spectrum
PATIENCE = 600.0  # [s]; 10^6 runs are gathered within a minute
_logger = logging.getLogger(__name__)


class LossError(InputError):
    """A dataset holds runs of which the logs have no records."""


def gather(out: str | Path) -> Path:
    """Write the dataset of all runs recorded so far in the output folder of a run, and return its path.

    Works while a run is at work.

    Raises
    ------
    InputError
        If the folder is not that of a run, or cannot be written to, or runs of the dataset that is there are
        not on record.
    """
    folder = StudyFolder(out)
    for warning in gather_records(folder, folder.load()).warnings:
        _logger.warning(warning)
    return folder.results


def gather_records(
    folder: StudyFolder, study: Study, interrupt: Callable[[], str | None] = lambda: None
) -> Records:
    """Write the dataset of all runs recorded so far, and return their records.

    One process at a time reads and writes, so that of several the last one's dataset holds most.

    Parameters
    ----------
    folder, study
        The study that is gathered.
    interrupt : callable
        Returns a reason not to wait for another process that gathers, None to wait.

    Raises
    ------
    BusyError
        If another process has gathered for longer than PATIENCE.
    LossError
        If runs of the dataset that is there are not on record.
    StorageError
        If the system refuses; the dataset that was there is then untouched.
    """
    with locked(folder.gather_lock, patience=PATIENCE, interrupt=interrupt):
        for leftover in folder.leftovers():
            discard(leftover)
        records = folder.read_records(study)
        _refuse_loss(folder.results, study, records)
        with written_aside(folder.results, advice=KEPT) as aside:
            _declare(aside, records, study.variables)
            fill(aside, records, study.variables)
    return records


def _refuse_loss(path: Path, study: Study, records: Records) -> None:
    """Raise LossError if a dataset holds runs that are not on record, except those that begin again."""
    job, status = _read_held(path)
    held = np.flatnonzero(status != Status.NOT_RUN)
    places, why = places_in(job, study.job), ""
    if places is None or places.size != status.size:
        lost, why = held.size, f", since it is of another job ({difference_in_words(job, study.job)})"
    else:
        gone = ~records.recorded & (records.attempts == 1)
        lost = int(gone[places[held]].sum())
    if lost:
        raise LossError(
            f"{path}: expected all of its {held.size} runs on record, found {lost} of them missing{why}; it "
            "stays as it is. Bring back job.json and records, or rename it and gather again"
        )


def _read_held(path: Path) -> tuple[Document, np.ndarray]:
    """Return the resolved job of a dataset, and how each of its runs has ended; or nothing."""
    import h5py

    from cvt_hpc.storage.foreign_files import DAMAGE, check_hdf5

    nothing: tuple[Document, np.ndarray] = {}, np.zeros(0, np.int8)
    if kind_of(path) != "a file":
        return nothing
    try:
        check_hdf5(path, path.stat().st_size, str(path))
        with LIBRARIES, h5py.File(path, "r", locking=False) as file:  # whoever else has locked it
            return json.loads(file.attrs["job"]), np.ravel(file["status"][()])
    except (InputError, *DAMAGE):
        return nothing


def open_results(path: str | Path) -> xr.Dataset:
    """Open the dataset of a study.

    Parameters
    ----------
    path : str or Path
        The output folder of a run, or a dataset.

    Returns
    -------
    xarray.Dataset
        Read from the file as it is used, in the chunks of the file, so that quantities larger than the
        memory can be reduced; close it, or use it in a `with`.

    Raises
    ------
    InputError
        If there is no dataset, or none that can be read.
    """
    found = Path(path)
    with naming_refusals(found, "a netCDF dataset"):
        if is_folder := found.is_dir():
            folder = StudyFolder(found)
            found = folder.results
            if not found.exists() or kind_of(folder.job_file) is not None:
                folder.load()
            if not found.exists():
                raise mismatch(str(found), "a dataset", "nothing", f"`cvt-hpc gather {path}` writes it")
        if not found.exists():
            raise mismatch(str(found), "a netCDF dataset", "nothing", study_instead(found))
        if found.suffix == ".toml":
            expected = "the output folder of a run, or a dataset"
            raise mismatch(str(found), expected, "a job file", study_instead(found))
    return open_netcdf(found, follow=not is_folder, chunks={})


@contextmanager
def recorded_results(records: Records) -> Iterator[xr.Dataset]:
    """The dataset of records that were read, without spectra, open within; their folder stays as it is."""
    study = records.study
    kept = [one for one in study.variables if math.prod(study.record_dtype[one.name].shape) <= LONGEST]
    with TemporaryDirectory(prefix="cvt-hpc-") as aside:
        path = Path(aside) / "results.nc"
        _declare(path, records, kept)
        fill(path, records, kept)
        with open_netcdf(path) as dataset:
            yield dataset


def _declare(path: Path, records: Records, variables: Sequence[Variable]) -> None:
    """Write a file with the coordinates and some variables over the runs.

    Not through xarray: its first dataset loads dask, scipy and pint, a second at the end of each sweep.
    """
    import netCDF4

    study = records.study
    with LIBRARIES, netCDF4.Dataset(path, "w") as file:
        file.setncatts(_global_attributes(records))
        for name, length in zip(study.dims, study.shape, strict=True):
            file.createDimension(name, length)
        for axis in study.axes:
            _write_coordinate(file, axis, study.dims if study.is_sampled else (axis.name,))
        for extra in study.coordinates:
            file.createDimension(extra.name, len(extra.values))
            _write_coordinate(file, extra, (extra.name,))
        for derived in study.derived:
            _write_coordinate(file, derived, derived.dims)
        for variable in variables:
            _create(file, study, variable, _chunk_shape(study, variable.name))
        if study.is_traced:
            _create(file, study, _INFERRED, study.shape)[:] = inferred_classes(study, records)


def _write_coordinate(file: netCDF4.Dataset, dimension: Dimension, along: tuple[str, ...]) -> None:
    """Add the values of a coordinate, given in C order, to a file with its dimensions."""
    values = np.array(dimension.values)
    named = dimension.attributes
    if dimension.holds_texts:
        values = np.char.encode(values, "utf-8")
        named = {**named, "_Encoding": "utf-8"}  # the netCDF library's convention: readers return texts
    elif values.dtype == bool:
        values = values.astype(np.int8)
        named = {**named, "dtype": "bool"}  # xarray's convention
    values = values.reshape([len(file.dimensions[name]) for name in along])
    if dimension.holds_texts:
        along = (*along, _character_dimension(file, values.dtype.itemsize))
        values = values[..., np.newaxis].view("S1")
    stored = file.createVariable(dimension.name, values.dtype, along, compression="zlib" if along else None)
    stored.set_auto_chartostring(False)
    stored[...] = values
    stored.setncatts(named)


def _character_dimension(file: netCDF4.Dataset, length: int) -> str:
    """Return the name of the dimension along the bytes of texts, made where there is none."""
    name = f"string{length}"
    if name not in file.dimensions:
        file.createDimension(name, length)
    return name


def _create(file: netCDF4.Dataset, study: Study, variable: Variable, chunk: tuple[int, ...]) -> Any:
    """Return a variable that has been added to a file, without values."""
    dtype = np.dtype(variable.dtype)
    dims = study.dims + variable.dims
    is_text = dtype.kind == "S"  # stored as characters, which compress
    if is_text:
        dims += (_character_dimension(file, dtype.itemsize),)
    stored = file.createVariable(
        variable.name,
        "S1" if is_text else dtype,
        dims,
        compression="zlib" if dims else None,
        chunksizes=chunk or None,
        endian="native" if is_text else "little",  # as in the records
        fill_value=np.nan if dtype.kind == "f" else None,  # flags and counts have none
    )
    stored.setncatts(variable_attributes(variable))
    if is_text:
        stored._Encoding = "utf-8"  # the netCDF library's convention: readers return texts
    auxiliary = [d.name for d in (*(study.axes if study.is_sampled else ()), *study.derived)]
    if auxiliary:
        stored.coordinates = " ".join(auxiliary)  # by CF: these have no dimension of their own
    return stored


def _global_attributes(records: Records) -> dict[str, str]:
    study, made = records.study, records.sessions
    lines = [
        history_line(f"{s['command']} (on {s['host']}, {s['ranks']} rank(s))", s["started"]) for s in made
    ]
    model = study.job.get("model", "")
    found = global_attributes(study, study.job, f"model {model}", makers=made, earlier=lines)
    found |= {"job_fingerprint": study.fingerprint, JOB_UNITS: json.dumps(dict(study.units))}
    return found | file_names(study.files)


def _chunk_shape(study: Study, name: str) -> tuple[int, ...]:
    """Return the chunks in which a quantity is stored: neighbouring runs, each of them whole."""
    dtype = study.record_dtype[name]
    grid = contiguous_part(study.shape, min(CHUNK // dtype.itemsize, block_length(study)))
    return grid + (dtype.shape if dtype.kind != "S" else (dtype.itemsize,))


def contiguous_part(shape: tuple[int, ...], most: int) -> tuple[int, ...]:
    """Return the shape of a part of a grid with at most `most` points, at least one, that follow each other.

    Trailing axes are whole; of the first that is not, as many points as a power of two: so smaller parts
    never straddle larger ones.
    """
    part: list[int] = []
    for length in reversed(shape):
        most = max(most, 1)
        part.append(length if length <= most else 1 << (most.bit_length() - 1))
        most //= length
    return tuple(reversed(part))


def fill(path: Path, records: Records, variables: Sequence[Variable]) -> None:
    """Write the values of some variables over the runs into a file that declares them."""
    import h5py

    study = records.study
    runs = np.arange(study.size).reshape(study.shape)
    with LIBRARIES, h5py.File(path, "r+") as file, ThreadPoolExecutor() as pool:
        for block in _parts(study.shape, contiguous_part(study.shape, block_length(study))):
            rows = records.read(runs[block])
            for variable in variables:
                _fill_block(file[variable.name], block, rows[variable.name], pool)


def _fill_block(
    stored: h5py.Dataset, block: tuple[slice, ...], values: np.ndarray, pool: ThreadPoolExecutor
) -> None:
    """Write the values of one quantity in a block of the grid."""
    if stored.chunks is None:  # of the only run of a job without axes
        stored[...] = values
        return
    if values.dtype.kind == "S":
        values = values[..., np.newaxis].view("S1")
    pieces = list(_parts(values.shape, stored.chunks))
    packed = pool.map(lambda piece: _pack(values[piece], stored.chunks), pieces)
    corner = [axis.start for axis in block] + [0] * (values.ndim - len(block))
    for piece, data in zip(pieces, packed, strict=True):
        place = tuple(first + axis.start for first, axis in zip(corner, piece, strict=True))
        stored.id.write_direct_chunk(place, data)


def _pack(values: np.ndarray, shape: tuple[int, ...]) -> bytes:
    """Return a chunk as the filters shuffle and deflate make it; at the grid's edge filled up to `shape`."""
    chunk = np.zeros(shape, values.dtype)
    chunk[tuple(map(slice, values.shape))] = values
    shuffled = chunk.view(np.uint8).reshape(-1, chunk.itemsize).T
    # Runs of equal bytes are all that floating-point numbers repeat.
    deflate = zlib.compressobj(strategy=zlib.Z_RLE)
    return deflate.compress(np.ascontiguousarray(shuffled).data) + deflate.flush()


def _parts(shape: tuple[int, ...], part: tuple[int, ...]) -> Iterator[tuple[slice, ...]]:
    """Yield the parts of a grid, in C order."""
    along = ((length, step, range(0, length, step)) for length, step in zip(shape, part, strict=True))
    return itertools.product(*([slice(a, min(a + step, n)) for a in firsts] for n, step, firsts in along))
