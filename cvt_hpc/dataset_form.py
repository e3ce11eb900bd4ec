"""The form of a dataset: attributes and types as this program writes them, whoever made it.

All that draws, reports or compares relies on it, so that it is checked once, where a dataset comes in.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.errors import LONGEST_KEY, mismatch, show

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
        is_text = variable.ndim == 1 and variable.dtype.kind in "OU" and isinstance(variable.data, np.ndarray)
        if name in dataset.coords and is_text and not all(map(str.isprintable, map(str, variable.values))):
            raise mismatch(f"{source}: {name}", "texts of printable characters", "others")


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


def _check_variable(variable: xr.Variable, place: str) -> None:
    kind, attributes = variable.dtype.kind, variable.attrs
    if kind not in "biufmMOSTU" or (kind == "O" and not _holds_texts(variable)):
        raise mismatch(place, "numbers or texts", "something else")
    for key in WORDS:
        _check_text(attributes, key, place)
    for key in UNITS:
        if not (unit := attributes.get(key, "")).isprintable() or len(unit) > LONGEST_KEY:
            raise mismatch(f"{place}: {key}", "a unit", show(unit))


def _holds_texts(variable: xr.Variable) -> bool:
    """Whether a variable of Python's objects holds texts, by the first one that it has."""
    if variable.encoding.get("dtype") in (str, np.dtype("S1")) or not variable.size:
        return True
    first = variable[(0,) * variable.ndim].values.item()
    return isinstance(first, (str, bytes, float, tuple))  # nan, where it is not known; of stacked axes
