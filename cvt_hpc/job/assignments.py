"""Values that a user sets beside the job file: KEY=VALUE on the command line, a mapping in Python."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from typing import Any

from cvt_hpc.errors import mismatch, show, unknown
from cvt_hpc.job.schema import Schema
from cvt_hpc.job.values import kind_of, read_value
from cvt_hpc.parameters import Parameter

Assignments = Mapping[str, Any] | Sequence[str]


def split_assignments(assignments: Assignments, source: str, label: str) -> dict[str, Any]:
    """Return the values by the names that the user wrote; of a name set twice the last value counts.

    Parameters
    ----------
    assignments : mapping, or sequence of "KEY=VALUE"
        As the user gave them.
    source, label : str
        The job file, and what to call the assignments in an error, e.g. "--set".

    Raises
    ------
    InputError
        If a text is not KEY=VALUE.
    """
    if isinstance(assignments, Mapping):
        return dict(assignments)
    pairs = {}
    for text in [assignments] if isinstance(assignments, str) else assignments:
        key, equals, value = text.partition("=")
        if not equals or not key.strip():
            raise mismatch(f"{source}: {label}", "KEY=VALUE", show(text))
        pairs[key.strip()] = value.strip()
    return pairs


def read_assignments(assignments: Assignments, schema: Schema, source: str, label: str) -> dict[str, Any]:
    """Return the values [SI] by key.

    Parameters
    ----------
    assignments : mapping, or sequence of "KEY=VALUE"
        Numbers [SI] or texts with units; a key may be written section.key.
    schema : Schema
        What may be set.
    source, label : str
        The job file, and what to call the assignments in an error, e.g. "--set".

    Raises
    ------
    InputError
        If a key is unknown or a value not legal.
    """
    values = {}
    for name, raw in split_assignments(assignments, source, label).items():
        where = f"{source}: {label} {name}"
        key = schema.find(name, where)
        parameter = schema.parameters[key]
        raw = _list_in(raw) if kind_of(parameter) is tuple and isinstance(raw, str) else raw
        values[key] = read_value(parameter, raw, where)
    return values


def read_coordinates(
    assignments: Sequence[str], units: Mapping[str, str | None], source: str, label: str
) -> dict[str, Any]:
    """Return the values of coordinates of a dataset by name: numbers in its units, texts where it has none.

    Parameters
    ----------
    assignments : sequence of "KEY=VALUE"
        Numbers, or texts with units.
    units : mapping
        CF unit of each coordinate; None for one of texts.
    source, label : str
        The dataset, and what to call the assignments in an error.

    Raises
    ------
    InputError
        If a coordinate is unknown or a value is not in its unit.
    """
    values: dict[str, Any] = split_assignments(assignments, source, label)
    for name, text in values.items():
        if name not in units:
            raise unknown(f"{source}: {label} {name}", "axis", name, units)
        if (unit := units[name]) is not None:
            number = Parameter(0.0, "" if unit == "1" else unit, "", allow_infinite=True)
            values[name] = read_value(number, text, f"{source}: {label} {name}")
    return values


def _list_in(text: str) -> Any:
    """Return the list that a text on the command line holds, or the text as it is."""
    try:
        return tomllib.loads(f"list = {text}")["list"]
    except ValueError:
        return text
