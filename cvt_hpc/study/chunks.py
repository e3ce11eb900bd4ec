"""The values of results.nc: read block by block, compressed by all cores, written chunk by chunk.

HDF5 compresses in one thread, and searches digits that look random for repetitions. The chunks written here
are chunks as its filters shuffle and deflate would have made them, so that every netCDF library reads them.
"""

from __future__ import annotations

import itertools
import zlib
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.study.description import Study
from cvt_hpc.study.record.index import Records, block_length

if TYPE_CHECKING:
    import h5py

CHUNK = 1 << 17  # [bytes] at most; a map takes some hundred of them, the spectra of one run a single one


def chunk_shape(study: Study, name: str) -> tuple[int, ...]:
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


def fill(path: Path, study: Study, records: Records) -> None:
    """Write the values of all quantities into a file that declares them.

    Parameters
    ----------
    path : Path
        A netCDF-4 file with the quantities as `chunk_shape` has them, shuffled and deflated.
    study : Study
        The quantities.
    records : Records
        Their values.
    """
    import h5py

    runs = np.arange(study.size).reshape(study.shape)
    with h5py.File(path, "r+") as file, ThreadPoolExecutor() as pool:
        for block in _parts(study.shape, contiguous_part(study.shape, block_length(study))):
            rows = records.read(runs[block])
            for name in study.record_names:
                _fill_block(file[name], block, rows[name], pool)


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
    cuts = [
        [slice(first, min(first + step, length)) for first in range(0, length, step)]
        for length, step in zip(shape, part, strict=True)
    ]
    return itertools.product(*cuts)
