"""HDF5 files of anybody: links, types and sizes are checked before any value is read.

HDF5 lets a variable lie in another file, by links, raw storage or virtual parts. A few bytes of a file may
stand for any number of values, a group may contain itself, and types may be nested. netCDF-4 files are HDF5
files, and what this program writes needs none of it.

The form of a dataset: attributes and types as this program writes them, whoever made it.

All that draws, reports or compares relies on it, so that it is checked once, where a dataset comes in.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO

import h5py
import numpy as np
from h5py import h5a, h5d, h5g, h5o, h5t, h5z

from cvt_hpc.errors import LONGEST_KEY, InputError, mismatch, show

if TYPE_CHECKING:
    import xarray as xr

TABLES = ("job", "versions", "point", "point_units")  # attributes of a dataset that are texts in JSON
TEXTS = (  # that are texts
    *TABLES,
    "title",
    "source",
    "history",
    "command",
    "host",
    "job_name",
    "git_revision",
    "job_fingerprint",
    "cvt_hpc_content",
    "starts",
)
UNITS = ("units", "job_units")  # of a variable
WORDS = (*UNITS, "long_name", "comment", "flag_meanings", "spacing", "derived")
PACKING = ("scale_factor", "add_offset")  # of a variable's attributes or, once applied, its encoding
LARGEST = 1e100  # finite value of a parameter or coordinate [SI]: squares and cubes are numbers, too

EXPANSION = 1032  # bytes of values that deflate keeps in one byte, at most
SMALL = 1 << 26  # [bytes] of values that any file may declare
LONGEST_TEXT = 1_000  # [bytes] of an attribute by which this program knows a file
MOST_PARTS = 5_000  # variables and attributes; a study has some 600
MOST_ATTRIBUTES = 200  # of a variable or the file; the library goes through all of them to find one
DAMAGE = (  # what fails in a file with changed bytes
    ArithmeticError,
    AttributeError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
)


def check_hdf5(source: Path | BinaryIO, size: int, place: str) -> None:
    """Raise InputError unless an HDF5 file holds nothing but variables of numbers and texts, all in itself.

    No values are read, only what describes them.

    Parameters
    ----------
    source : Path or binary file
        The file.
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
        with h5py.File(source, "r", locking=False) as file:
            most, total = max(SMALL, EXPANSION * size), 0
            for part, (where, taken) in enumerate(_parts(file, size, most, place), 1):
                total += taken
                if total > most:
                    told = f"values of at most {most} bytes in a file of {size} bytes"
                    raise mismatch(where, told, f"{total} up to here")
                if part > MOST_PARTS:
                    raise mismatch(place, f"at most {MOST_PARTS} variables and attributes", "more")
    except InputError:
        raise
    except DAMAGE:
        raise mismatch(place, "a netCDF file", "one that is damaged") from None


def global_text(path: Path, name: str) -> str | None:
    """Return a short text among the attributes of a file; None where it is not there, or not readable."""
    try:
        with h5py.File(path, "r", locking=False) as file:
            size = _attribute(h5a.open(file.id, name.encode()), file.id, SMALL, SMALL, name)
            found = file.attrs[name] if size < LONGEST_TEXT else None
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
        stored = h5o.open(file.id, name.encode("utf-8", "surrogateescape"))
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
    if (count := h5a.get_num_attrs(stored)) > MOST_ATTRIBUTES:
        raise mismatch(place, f"at most {MOST_ATTRIBUTES} attributes", str(count))
    for index in range(count):
        one = h5a.open(stored, index=index)
        where = f"{place}: {one.name.decode('utf-8', 'replace')}"
        yield where, _attribute(one, stored, size, most, where)


def _attribute(one: h5a.AttrID, stored: Any, size: int, most: int, place: str) -> int:
    kind, count = one.get_type(), one.get_space().get_simple_extent_npoints()
    within = kind.get_class()
    if one.name == b"DIMENSION_LIST":  # of the netCDF library's own: what leads to the coordinates
        sound = within == h5t.VLEN and kind.get_super().get_class() == h5t.REFERENCE and count == stored.rank
    elif one.name == b"REFERENCE_LIST":  # and back
        parts = (
            [kind.get_member_class(k) for k in range(kind.get_nmembers())] if within == h5t.COMPOUND else []
        )
        sound = parts == [h5t.REFERENCE, h5t.INTEGER]
    else:
        sound = _width(kind, size) > 0
    if not sound:
        raise mismatch(place, "numbers or a text", "something else")
    is_variable = within == h5t.STRING and kind.is_variable_str()
    if count * _width(kind, size) > (most if is_variable else size):
        raise mismatch(place, f"an attribute that fits into a file of {size} bytes", "a larger one")
    if not is_variable:
        return count * kind.get_size()
    texts = np.empty(one.shape, h5py.string_dtype())
    one.read(texts)
    return sum(map(len, texts.flat))


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


def check_form(dataset: xr.Dataset, source: str) -> None:
    """Raise InputError where names, types, attributes or coordinates are of no use to what reads them.

    Parameters
    ----------
    dataset : Dataset
        Results, a history or anything else. Of values only coordinates are looked at.
    source : str
        Where it is from, for the error.
    """
    for key in TEXTS:
        _check_text(dataset.attrs, key, source)
    for key in TABLES:
        _check_table(dataset.attrs, key, source)
    for name in (*dataset.dims, *dataset.variables):
        if not isinstance(name, str) or not name.isprintable() or len(name) > LONGEST_KEY:
            expected = f"names of at most {LONGEST_KEY} printable characters"
            raise mismatch(source, expected, show(name if isinstance(name, str) else str(name)))
    for name, variable in dataset.variables.items():
        _check_variable(variable, f"{source}: {name}")
        if name in dataset.coords:
            _check_coordinate(variable, f"{source}: {name}")


def _check_text(attributes: Mapping[Any, Any], key: str, place: str) -> None:
    if key in attributes and not isinstance(attributes[key], str):
        raise mismatch(f"{place}: {key}", "a text", show(attributes[key]))


def _check_table(attributes: Mapping[Any, Any], key: str, place: str) -> None:
    if key not in attributes:
        return
    try:
        table = json.loads(attributes[key])
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise mismatch(f"{place}: {key}", "a table in JSON", "none")
    for inner in ("axes", "vibration") if key == "job" else ():
        if not isinstance(table.get(inner, {}), dict):
            raise mismatch(f"{place}: {key}: {inner}", "a table", show(table[inner]))


def _check_variable(variable: xr.Variable, place: str) -> None:
    kind, attributes = variable.dtype.kind, variable.attrs
    if kind not in "biufmMOSTU" or (kind == "O" and not _holds_texts(variable)):
        raise mismatch(place, "numbers or texts", "something else")
    for key in WORDS:
        _check_text(attributes, key, place)
    for key in UNITS:
        if not (unit := attributes.get(key, "")).isprintable() or len(unit) > LONGEST_KEY:
            raise mismatch(f"{place}: {key}", "a unit", show(unit))
    for key in PACKING:
        number = attributes.get(key, variable.encoding.get(key, 1.0))
        if np.ndim(number) or not isinstance(number, (int, float, np.number)) or not math.isfinite(number):
            raise mismatch(f"{place}: {key}", "a number", show(number))
    if "flag_meanings" in attributes:
        values = np.atleast_1d(attributes.get("flag_values", ()))
        count = len(attributes["flag_meanings"].split())
        if values.dtype.kind not in "iuf" or values.shape != (count,):
            raise mismatch(
                f"{place}: flag_values", f"{count} numbers, as many as flag_meanings", show(values)
            )


def _holds_texts(variable: xr.Variable) -> bool:
    """Whether a variable of Python's objects holds texts, by the first one that it has."""
    if variable.encoding.get("dtype") in (str, np.dtype("S1")) or not variable.size:
        return True
    first = variable[(0,) * variable.ndim].values.item()
    return isinstance(first, (str, bytes, float, tuple))  # nan, where it is not known; of stacked axes


def _check_coordinate(variable: xr.Variable, place: str) -> None:
    if variable.ndim != 1 or variable.dtype.kind not in "fOU" or not isinstance(variable.data, np.ndarray):
        return
    if variable.dtype.kind == "f":
        largest = np.abs(variable.values)
        if np.any(np.isfinite(largest) & (largest > LARGEST)):
            raise mismatch(
                place, f"values of at most {LARGEST:g}", f"{largest[np.isfinite(largest)].max():g}"
            )
    elif not all(map(str.isprintable, map(str, variable.values))):
        raise mismatch(place, "texts of printable characters", "others")
