"""Values that a user sets beside the job file: KEY=VALUE on the command line, a mapping in Python.

Arrays and quantities of other libraries become what a job file has; none of these libraries is imported.
"""

import tomllib
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from cvt_hpc.errors import check_keys, mismatch, show, unknown
from cvt_hpc.job.axes import is_axis
from cvt_hpc.job.schema import Entry, Schema
from cvt_hpc.job.values import Document, Point, Table, kind_of, read_value, warn_of_bare_numbers
from cvt_hpc.parameters import Parameter

_PLAIN = {bool, int, float, str}

Assignments = Table | Sequence[str]


def split_assignments(assignments: Assignments, source: str, label: str) -> Document:
    """Return the values by the names that the user wrote; of a name set twice the last value counts.

    Parameters
    ----------
    assignments : mapping, or sequence of "KEY=VALUE"
        As the user gave them.
    source, label : str
        The job file, and the name of the assignments in an error, e.g. "--set".

    Raises
    ------
    InputError
        If a text is not KEY=VALUE.
    """
    if isinstance(assignments, Mapping):
        return plain(assignments)
    pairs = {}
    for text in [assignments] if isinstance(assignments, str) else assignments:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise mismatch(f"{source}: {label}", "KEY=VALUE", show(text))
        pairs[key.strip()] = value.strip()
    check_keys(pairs, f"{source}: {label}")
    return pairs


def read_assignments(assignments: Assignments, schema: Schema, source: str, label: str) -> Point:
    """Return the values [SI] by key of assignments as of `split_assignments`; a key may be section.key.

    Raises
    ------
    InputError
        If a key is unknown or a value not legal.
    """
    return {key: read_value(*entry) for key, entry in _entries(assignments, schema, source, label)}


def warn_of_bare_assignments(assignments: Assignments, schema: Schema, source: str, label: str) -> None:
    """Warn of numbers without a unit that are far from usual, in the result of `read_assignments`."""
    for _, entry in _entries(assignments, schema, source, label):
        warn_of_bare_numbers(*entry)


def read_axes_and_values(
    assignments: Assignments, schema: Schema, source: str, label: str
) -> tuple[dict[str, Entry], Point]:
    """Return the assignments that are axes, and the values [SI] of the others; as of `read_assignments`.

    An axis is a list or a range, as a table [axes] has it, of a parameter with a single value.
    """
    axes, values = {}, {}
    for key, entry in [*_entries(assignments, schema, source, label)]:  # unknown keys are the first errors
        if isinstance(entry.raw, Mapping) and "distribution" in entry.raw:
            expected = f"one value, or uncertain.{key} for a distribution"
            raise mismatch(entry.where, expected, "a distribution")
        if kind_of(entry.parameter) is not tuple and is_axis(entry.raw):
            axes[key] = entry
        else:
            values[key] = read_value(*entry)
    return axes, values


def _entries(
    assignments: Assignments, schema: Schema, source: str, label: str
) -> Iterator[tuple[str, Entry]]:
    """Yield the key and the entry of each assignment, in which texts of lists and tables are such."""
    pairs = split_assignments(assignments, source, label)
    for key, entry in schema.entries(pairs.items(), f"{source}: {label}"):
        is_free_text = kind_of(entry.parameter) is str and not entry.parameter.choices
        yield key, entry if is_free_text else entry._replace(raw=structured(entry.raw))


def read_coordinates(
    assignments: Sequence[str], units: Mapping[str, str | None], source: str, label: str
) -> Point:
    """Return the values of coordinates of a dataset by name: numbers in its units, texts where it has none.

    The assignments are numbers, or texts with units; `units` has the CF unit of each coordinate, None for one
    of texts.

    Raises
    ------
    InputError
        If a coordinate is unknown or a value is not in its unit.
    """
    values = split_assignments(assignments, source, label)
    for name, text in values.items():
        if name not in units:
            raise unknown(f"{source}: {label} {name}", "axis", name, units)
        if (unit := units[name]) is not None:
            number = Parameter(0.0, "" if unit == "1" else unit, "", allow_infinite=True)
            values[name] = read_value(number, text, f"{source}: {label} {name}")
    return values


def take_own(assignments: Document, table: str) -> Document:
    """Take the values of a command's own table, TABLE.KEY, off the assignments, and return them by KEY."""
    own = [key for key in assignments if key.startswith(f"{table}.")]
    return {key.removeprefix(f"{table}."): structured(assignments.pop(key)) for key in own}


def structured(raw: object) -> object:
    """Return the list, table or quoted text that a text of the command line holds, or the value as it is."""
    if not isinstance(raw, str) or not raw.startswith(("[", "{", '"')):
        return raw
    try:
        return tomllib.loads(f"value = {raw}")["value"]
    except (ValueError, RecursionError):
        return raw


def plain(value: Any) -> Any:
    """Return a value of a job in which pandas, xarray and pint objects are numpy arrays, lists and texts.

    Parameters
    ----------
    value : Any
        As a job has it, tables and lists included. A quantity, or an array that names its unit in its
        attribute `units`, gives texts with that unit.
    """
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return value if set(map(type, value)) <= _PLAIN else [plain(entry) for entry in value]
    if hasattr(value, "magnitude"):
        return _with_unit(np.asarray(value.magnitude), f"{value.units:~C}")
    if not hasattr(value, "to_numpy"):
        return value
    if hasattr(data := getattr(value, "data", None), "magnitude"):
        return plain(data)
    return _with_unit(value.to_numpy(), str(getattr(value, "attrs", {}).get("units", "")))


def _with_unit(array: np.ndarray, unit: str) -> object:
    """Return an array of numbers as it is, or as texts with its unit; of a scalar or of texts its content."""
    if array.dtype.kind not in "iuf":
        return plain(array.tolist())
    if unit not in ("", "1"):
        return _texts(array.tolist(), unit)
    return array if array.ndim else array.item()


def _texts(value: object, unit: str) -> object:
    return [_texts(entry, unit) for entry in value] if isinstance(value, list) else f"{value!r} {unit}"
