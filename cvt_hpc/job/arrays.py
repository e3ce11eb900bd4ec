"""Arrays and quantities of other libraries in a job, as a job file has them; none of these is imported."""

from collections.abc import Mapping
from typing import Any

import numpy as np

_PLAIN = {bool, int, float, str}


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


def _with_unit(array: np.ndarray, unit: str) -> Any:
    """Return an array of numbers as it is, or as texts with its unit; of a scalar or of texts its content."""
    if array.dtype.kind not in "iuf":
        return plain(array.tolist())
    if unit not in ("", "1"):
        return _texts(array.tolist(), unit)
    return array if array.ndim else array.item()


def _texts(value: Any, unit: str) -> Any:
    return [_texts(entry, unit) for entry in value] if isinstance(value, list) else f"{value!r} {unit}"
