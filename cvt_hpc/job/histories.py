"""Runs whose whole history a sweep is to keep, as written in a job file: grid points, or run indices.

They do not determine the numbers: a folder takes the job with any of them.
"""

import math
from collections.abc import Mapping
from typing import Any

from cvt_hpc.errors import mismatch, show
from cvt_hpc.job.axes import Axis, without_rounding
from cvt_hpc.job.schema import Schema
from cvt_hpc.job.values import read_value

KEY = ("record", "history")
_FORMS = "a list of runs, each a table {axis = value, ...} with all axes, or a run index"


def read_histories(
    raw: Any,
    schema: Schema,
    axes: tuple[Axis, ...],
    replaced: Mapping[str, Any],
    source: str,
    samples: int | None = None,
) -> tuple[int, ...]:
    """Return the indices of the runs, in order.

    Parameters
    ----------
    raw : Any
        The list as TOML gives it.
    schema : Schema
        Of the job.
    axes : tuple of Axis
        Its grid.
    replaced : mapping
        By key the replacement of an axis or a value by overrides: a value, or None for an axis of
        their own. A run that they have taken off the grid is left out.
    source : str
        The job file, for the errors.
    samples : int, optional
        Their number, if the runs are samples and no grid: these have an index alone.

    Raises
    ------
    InputError
        If it is no such list, or a run is not on the grid.
    """
    where = f"{source}: [record] history"
    if not isinstance(raw, (list, tuple)):
        raise mismatch(where, _FORMS, show(raw))
    if samples is not None:
        return tuple(
            sorted({_numbered(entry, samples, f"{where}, run {i}") for i, entry in enumerate(raw, 1)})
        )
    found = {_index(entry, schema, axes, replaced, f"{where}, run {i}") for i, entry in enumerate(raw, 1)}
    return tuple(sorted(index for index in found if index is not None))


def _index(
    entry: Any, schema: Schema, axes: tuple[Axis, ...], replaced: Mapping[str, Any], where: str
) -> int | None:
    size = math.prod(len(axis.values) for axis in axes)
    if isinstance(entry, int) and not isinstance(entry, bool):
        return _numbered(entry, size, where)
    if not isinstance(entry, Mapping):
        raise mismatch(where, _FORMS, show(entry))
    values = {}
    for name, raw in entry.items():
        key = schema.find(name, f"{where}, {name}")
        values[key] = without_rounding(read_value(schema.parameters[key], raw, f"{where}, {name}"))
    index = 0
    for axis in axes:
        if axis.name in replaced and values.get(axis.name) not in axis.values:
            return None
        if axis.name not in values:
            raise mismatch(where, "a value for each axis", f"none for {axis.name}")
        index = index * len(axis.values) + _place(
            axis, values.pop(axis.name), schema, f"{where}, {axis.name}"
        )
    for key in values.keys() - replaced.keys():
        raise mismatch(where, f"axes of this job ({', '.join(axis.name for axis in axes)})", key)
    return index if all(without_rounding(replaced[key]) == value for key, value in values.items()) else None


def _numbered(entry: Any, size: int, where: str) -> int:
    if isinstance(entry, bool) or not isinstance(entry, int) or not 0 <= entry < size:
        raise mismatch(where, f"an index from 0 to {size - 1}", show(entry))
    return entry


def _place(axis: Axis, value: Any, schema: Schema, where: str) -> int:
    if value in axis.values:
        return axis.values.index(value)
    if isinstance(value, str):
        raise mismatch(where, f"one of {', '.join(axis.values)}", show(value))
    below = max((v for v in axis.values if v < value), default=min(axis.values))
    above = min((v for v in axis.values if v > value), default=max(axis.values))
    near = " or ".join(dict.fromkeys(schema.in_words(axis.name, v) for v in (below, above)))
    raise mismatch(where, f"a value of the axis, such as {near}", schema.in_words(axis.name, value))
