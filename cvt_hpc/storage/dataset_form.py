"""The form of a dataset: attributes and types as this program writes them, whoever made it.

All that draws, reports or compares relies on it, so that it is checked once, where a dataset comes in.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.errors import LONGEST_KEY, mismatch, show

if TYPE_CHECKING:
    import xarray as xr

_TABLES = ("job", "versions", "point", "point_units")  # attributes of a dataset that are texts in JSON
TEXTS = (  # that are texts
    *(*_TABLES, "title", "source", "history", "command", "host", "job_name", "git_revision"),
    *("job_fingerprint", "cvt_hpc_content", "starts"),
)
UNITS = ("units", "job_units")  # of a variable
WORDS = (*UNITS, "long_name", "comment", "flag_meanings", "spacing", "derived")
_PACKING = ("scale_factor", "add_offset")  # of a variable's attributes or, once applied, its encoding
LARGEST = 1e100  # finite value of a parameter, coordinate or packing [SI]: squares and cubes are numbers, too


def check_form(dataset: xr.Dataset, source: str) -> None:
    """Raise InputError where names, types, attributes or coordinates are of no use to what reads them.

    Parameters
    ----------
    dataset : Dataset
        Results, a history or anything else. Of values only coordinates are looked at.
    """
    for key in TEXTS:
        _check_text(dataset.attrs, key, source)
    for key in _TABLES:
        _check_table(dataset.attrs, key, source)
    for name in (*dataset.dims, *dataset.variables):
        if not isinstance(name, str) or not name.isprintable() or len(name) > LONGEST_KEY:
            expected = f"names of at most {LONGEST_KEY} printable characters"
            raise mismatch(source, expected, show(name if isinstance(name, str) else str(name)))
    for name, variable in dataset.variables.items():
        _check_variable(variable, f"{source}: {name}")
        if name in dataset.coords:
            _check_coordinate(variable, f"{source}: {name}")


def _check_text(attributes: Mapping[str, object], key: str, place: str) -> None:
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
    if key == "job" and not isinstance(table.get("model", ""), str):
        raise mismatch(f"{place}: {key}: model", "a text", show(table["model"]))


def _check_variable(variable: xr.Variable, place: str) -> None:
    kind, attributes = variable.dtype.kind, variable.attrs
    if kind not in "biufmMOSTU" or (kind == "O" and not _holds_texts(variable)):
        raise mismatch(place, "numbers or texts", "something else")
    for key in WORDS:
        _check_text(attributes, key, place)
    for key in UNITS:
        if not (unit := attributes.get(key, "")).isprintable() or len(unit) > LONGEST_KEY:
            raise mismatch(f"{place}: {key}", "a unit", show(unit))
    for key in _PACKING:
        number = attributes.get(key, variable.encoding.get(key, 1.0))
        if np.ndim(number) or not isinstance(number, (int, float, np.number)) or not math.isfinite(number):
            raise mismatch(f"{place}: {key}", "a number", show(number))
        if abs(float(number)) > LARGEST:
            raise mismatch(f"{place}: {key}", f"a number of at most {LARGEST:g}", show(number))
        if number == 0.0 and key == _PACKING[0]:
            raise mismatch(f"{place}: {key}", "a factor, with which values differ", show(number))
    if "flag_meanings" in attributes:
        values = np.atleast_1d(attributes.get("flag_values", ()))
        count = len(attributes["flag_meanings"].split())
        if values.dtype.kind not in "iuf" or values.shape != (count,):
            expected = f"{count} numbers, as many as flag_meanings"
            raise mismatch(f"{place}: flag_values", expected, show(values))


def _holds_texts(variable: xr.Variable) -> bool:
    """Whether a variable of Python's objects holds texts, by the first one that it has."""
    if variable.encoding.get("dtype") in (str, np.dtype("S1")) or not variable.size:
        return True
    first = variable[(0,) * variable.ndim].values.item()
    # nan or 0, where it is not known; tuples of stacked axes
    return isinstance(first, (str, bytes, int, float, tuple))


def _check_coordinate(variable: xr.Variable, place: str) -> None:
    if variable.ndim != 1 or variable.dtype.kind not in "fOU" or not isinstance(variable.data, np.ndarray):
        return
    if variable.dtype.kind == "f":
        largest = np.abs(variable.values[np.isfinite(variable.values)]).max(initial=0.0)
        if largest > LARGEST:
            raise mismatch(place, f"values of at most {LARGEST:g}", f"{largest:g}")
    elif not all(map(str.isprintable, map(str, variable.values))):
        raise mismatch(place, "texts of printable characters", "others")
