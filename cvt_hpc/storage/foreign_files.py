"""HDF5 files of anybody: links, types and sizes are checked before any value is read.

HDF5 lets a variable lie in another file, by links, raw storage or virtual parts. A few bytes of a file may
stand for any number of values, a group may contain itself, and types may be nested. netCDF-4 files are HDF5
files, and what this program writes needs none of it.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5o, h5t, h5z

from cvt_hpc.errors import InputError, mismatch, show
from cvt_hpc.storage.libraries import LIBRARIES

EXPANSION = 1032  # bytes of values that deflate keeps in one byte, at most
SMALL = 1 << 26  # [bytes] of values that any file may declare
_LONGEST_TEXT = 1_000  # [bytes] of an attribute by which this program knows a file
_MOST_PARTS = 5_000  # variables and attributes; a study has some 600
_MOST_ATTRIBUTES = 200  # of a variable or the file; the library goes through all of them to find one
# The netCDF library writes beyond its memory where names are longer, and where what it reads itself is not as
# it writes it.
LONGEST_NAME = 256  # [bytes] of a variable or an attribute
_OWN_TEXTS = (b"CLASS", b"NAME", b"_NCProperties")
_OWN_NUMBERS = (b"_Netcdf4Dimid", b"_Netcdf4Coordinates")  # of the dimension, of all of a variable
DAMAGE = (  # what fails in a file with changed bytes
    *(ArithmeticError, AttributeError, LookupError, MemoryError, OSError, RuntimeError),
    *(TypeError, ValueError),
)


def check_hdf5(source: Path | BinaryIO, size: int, place: str) -> None:
    """Raise InputError unless an HDF5 file holds nothing but variables of numbers and texts, all in itself.

    No values are read, only what describes them.

    Parameters
    ----------
    size : int
        Its size [bytes]. All its values together may take `EXPANSION` times as much memory, or `SMALL`.
    place : str
        Name of the file, for the error.

    Raises
    ------
    InputError
        Something is a link, a group, a named type, or of a type other than numbers and texts; its values lie
        in another file; the declared sizes do not fit the size of the file; or the file is damaged.
    """
    try:
        with LIBRARIES, h5py.File(source, "r", locking=False) as file:
            most, total = max(SMALL, EXPANSION * size), 0
            for part, (where, taken) in enumerate(_parts(file, size, most, place), 1):
                total += taken
                if total > most:
                    told = f"values of at most {most} bytes in a file of {size} bytes"
                    raise mismatch(where, told, f"{total} up to here")
                if part > _MOST_PARTS:
                    raise mismatch(place, f"at most {_MOST_PARTS} variables and attributes", "more")
    except InputError:
        raise
    except DAMAGE:
        raise mismatch(place, "a netCDF file", "one that is damaged") from None


def global_text(path: Path, name: str) -> str | None:
    """Return a short text among the attributes of a file; None where it is not there, or not readable."""
    try:
        with LIBRARIES, h5py.File(path, "r", locking=False) as file:
            size = _attribute(h5a.open(file.id, name.encode()), file.id, SMALL, SMALL, name)
            found = file.attrs[name] if size < _LONGEST_TEXT else None
    except DAMAGE:
        return None
    return found.decode("utf-8", "replace") if isinstance(found, bytes) else found


def _parts(file: h5py.File, size: int, most: int, place: str) -> Iterator[tuple[str, int]]:
    """Yield the place of each attribute and variable, and the bytes that it takes in memory, at most."""
    yield from _attributes(file.id, size, most, place)
    for name in file:
        where = f"{place}, {name}"
        if not isinstance(file.get(name, getlink=True), h5py.HardLink):
            raise mismatch(where, "values in this file", "a link")
        stored = h5o.open(file.id, _checked(name.encode("utf-8", "surrogateescape"), place))
        if isinstance(stored, h5g.GroupID):  # with links of its own
            raise mismatch(where, "a file without groups", "a group")
        if not isinstance(stored, h5d.DatasetID):
            raise mismatch(where, "a variable", "a type of the file's own")
        yield where, _values(stored, size, where)
        yield from _attributes(stored, size, most, where)


def _values(stored: h5d.DatasetID, size: int, place: str) -> int:
    """Return the bytes that the values of a variable take in memory, at most."""
    layout = stored.get_create_plist()
    if layout.get_layout() == h5d.VIRTUAL or layout.get_external_count():
        raise mismatch(place, "values in this file", "values in another one")
    kind = stored.get_type()
    width = _width(kind, size)
    if not width or (kind.get_class() == h5t.STRING and kind.get_size() > 1 and not kind.is_variable_str()):
        raise mismatch(place, "numbers, or texts as characters", "something else")
    filters = {layout.get_filter(k)[0] for k in range(layout.get_nfilters())}
    if len(filters - {h5z.FILTER_SHUFFLE, h5z.FILTER_FLETCHER32}) > 1 or len(filters) < layout.get_nfilters():
        raise mismatch(place, "values that are compressed once", "several times")
    # One value takes the whole of its chunk, which may be larger than a variable that can grow.
    chunk = layout.get_chunk() if layout.get_layout() == h5d.CHUNKED else ()
    return width * max(math.prod(stored.shape), math.prod(chunk))


def _attributes(stored: Any, size: int, most: int, place: str) -> Iterator[tuple[str, int]]:
    if (count := h5a.get_num_attrs(stored)) > _MOST_ATTRIBUTES:
        raise mismatch(place, f"at most {_MOST_ATTRIBUTES} attributes", str(count))
    for index in range(count):
        one = h5a.open(stored, index=index)
        where = f"{place}: {_checked(one.name, place).decode('utf-8', 'replace')}"
        yield where, _attribute(one, stored, size, most, where)


def _attribute(one: h5a.AttrID, stored: Any, size: int, most: int, place: str) -> int:
    kind, count = one.get_type(), one.get_space().get_simple_extent_npoints()
    within = kind.get_class()
    if one.name == b"DIMENSION_LIST":  # of the netCDF library's own: what leads to the coordinates
        sound = within == h5t.VLEN and kind.get_super().get_class() == h5t.REFERENCE and count == stored.rank
    elif one.name == b"REFERENCE_LIST":  # and back
        members = range(kind.get_nmembers()) if within == h5t.COMPOUND else ()
        sound = [kind.get_member_class(k) for k in members] == [h5t.REFERENCE, h5t.INTEGER]
    elif one.name in _OWN_TEXTS:
        is_text = within == h5t.STRING and not kind.is_variable_str()
        sound = is_text and count == 1 and getattr(stored, "rank", 1) > 0  # a dimension is no single value
    elif one.name in _OWN_NUMBERS:
        sound = within == h5t.INTEGER and count == (1 if one.name == _OWN_NUMBERS[0] else stored.rank)
        sound = sound and _all_below(one, _MOST_PARTS)  # room is made for as many dimensions
    else:
        sound = _width(kind, size) > 0
    if not sound:
        is_own = one.name in (*_OWN_TEXTS, *_OWN_NUMBERS)
        expected = "what the netCDF library writes there" if is_own else "numbers or a text"
        raise mismatch(place, expected, "something else")
    is_variable = within == h5t.STRING and kind.is_variable_str()
    if count * _width(kind, size) > (most if is_variable else size):
        raise mismatch(place, f"an attribute that fits into a file of {size} bytes", "a larger one")
    if not is_variable:
        return count * kind.get_size()
    texts = np.empty(one.shape, h5py.string_dtype())
    one.read(texts)
    return sum(map(len, texts.flat))


def _checked(name: bytes, place: str) -> bytes:
    if len(name) > LONGEST_NAME:
        found = show(name.decode("utf-8", "replace"))
        raise mismatch(place, f"names of at most {LONGEST_NAME} bytes", found)
    return name


def _all_below(one: h5a.AttrID, most: int) -> bool:
    numbers = np.empty(one.shape, np.int64)
    one.read(numbers)
    return bool(((numbers >= 0) & (numbers < most)).all())


def _width(kind: h5t.TypeID, size: int) -> int:
    """Return the bytes that a value takes in memory, at most: all of a file for a text of any length.

    0 of what is neither a number nor a text.
    """
    if kind.committed():
        return 0
    if kind.get_class() == h5t.STRING:
        return size if kind.is_variable_str() else kind.get_size()
    known = {h5t.INTEGER: (1, 2, 4, 8), h5t.FLOAT: (4, 8)}.get(kind.get_class(), ())
    return kind.get_size() if kind.get_size() in known else 0
