"""Checks of a study's job file, whose content may come from anybody."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

import numpy as np

_DTYPE = re.compile(r"f[48]|[iu][1248]|S[1-9]\d{0,3}")
_FINGERPRINT = re.compile(r"[0-9a-f]{64}")
_MOST_RUNS = 10**8
_LARGEST_RECORD = 1 << 26  # [bytes]
_NEEDED = {"status": "i1", "vibrates": "i1"}  # `reason`, where there is one, is a text


def check_stored(entry: Mapping[str, Any]) -> None:
    """Check that a document may be a result of `Study.to_json`.

    Parameters
    ----------
    entry : mapping
        In JSON types, not nested too deep.

    Raises
    ------
    ValueError
        If it is not; the text states the finding.
    """
    for key in ("name", "description"):
        _need(_is_text(entry[key]), key, "a text")
    _need(_matches(_FINGERPRINT, entry["fingerprint"]), "fingerprint", "64 digits")
    for key in ("axes", "variables", "coordinates", "derived"):
        found = entry.get(key, []) if key == "derived" else entry[key]
        _need(
            isinstance(found, list) and all(isinstance(one, dict) for one in found), key, "a list of tables"
        )
    axes, coordinates, derived = entry["axes"], entry["coordinates"], entry.get("derived", [])
    for dimension in (*axes, *coordinates, *derived):
        _check_dimension(dimension)
    names = [one["name"] for one in (*axes, *coordinates, *derived, *entry["variables"])]
    _need(all(isinstance(name, str) and name.isidentifier() for name in names), "names", "plain words")
    _need(len(set(names)) == len(names), "names", "different ones")
    shape = _check_job(entry["job"], axes)
    size = math.prod(shape.values())
    _need(size <= _MOST_RUNS, "axes", f"{_MOST_RUNS} runs at most")
    for one in derived:
        along = one["dims"]
        _need(isinstance(along, list) and all(name in [*shape] for name in along), one["name"], "axes")
        count = math.prod(shape[name] for name in along)
        _need(len(one["values"]) == count, one["name"], f"{count} values")
        _need(isinstance(one["follows"], str), one["name"], "a text")
    _check_variables(entry["variables"], {one["name"]: len(one["values"]) for one in coordinates})


def _check_dimension(entry: Mapping[str, Any]) -> None:
    name, values = entry["name"], entry["values"]
    _need(all(isinstance(entry[key], str) for key in ("name", "units", "long_name")), str(name)[:40], "texts")
    _need(
        all(isinstance(entry.get(key, ""), str) for key in ("spacing", "comment", "job_units")), name, "texts"
    )
    _need(isinstance(values, list) and len(values) > 0, name, "values")
    if entry["texts"] is True:
        _need(all(isinstance(value, str) and "\0" not in value for value in values), name, "texts")
    else:
        _need(entry["texts"] is False and all(map(_is_number, values)), name, "numbers")


def _check_job(job: Any, axes: Iterable[Mapping[str, Any]]) -> dict[str, int]:
    """Check the resolved job against the axes of its study; return the length of each dimension of runs."""
    _need(isinstance(job, dict) and isinstance(job.get("model", ""), str), "job", "a job")
    lengths = {axis["name"]: len(axis["values"]) for axis in axes}
    values = {axis["name"]: _plain(axis["values"]) for axis in axes}
    stated = job["axes"]
    _need(isinstance(stated, dict) and [*stated] == [*values], "axes", "those of its job")
    for name, own in stated.items():
        _need(isinstance(own, list) and _plain(own) == values[name], name, "the values of its job")
    design = job.get("design", {})
    _need(isinstance(design, dict), "design", "a table")
    if "runs" in design:
        runs = design["runs"]
        _need(
            type(runs) is int and lengths and {*lengths.values()} == {runs}, "design", "runs as of the axes"
        )
        return {"run": runs}
    if "first_spacing" in design:
        spacings = design["first_spacing"]
        sound = isinstance(spacings, dict) and all(type(one) is int and one > 0 for one in spacings.values())
        _need(sound, "first_spacing", "numbers of cells")
    return lengths


def _check_variables(entries: list[Mapping[str, Any]], lengths: Mapping[str, int]) -> None:
    size = 0
    for entry in entries:
        name, dims, dtype, flags = (entry[key] for key in ("name", "dims", "dtype", "flags"))
        texts = entry["units"], entry["long_name"], entry.get("comment", "")
        _need(all(isinstance(text, str) for text in texts), name, "texts")
        _need(isinstance(entry["volatile"], bool), name, "true or false")
        _need(_matches(_DTYPE, dtype), name, "a type of numbers or texts")
        _need(
            isinstance(dims, list) and len(dims) <= 8 and all(one in [*lengths] for one in dims),
            name,
            "dimensions",
        )
        size += np.dtype(dtype).itemsize * math.prod(lengths[one] for one in dims)
        if flags is not None:
            meanings = flags["members"]
            _need(isinstance(flags["name"], str) and isinstance(meanings, dict) and meanings, name, "flags")
            _need(dtype[0] in "iu", name, "flags by numbers")
            values = [*meanings.values()]
            _need(all(type(one) is int and 0 <= one < 128 for one in values), name, "flags from 0 to 127")
            _need(len({*values}) == len(values), name, "different flags")
    types = {entry["name"]: entry["dtype"] for entry in entries if not entry["dims"]}
    _need([*types][:1] == ["status"] and types.items() >= _NEEDED.items(), "variables", "how runs have ended")
    _need(types.get("reason", "S")[0] == "S", "variables", "why runs have failed")
    _need(size <= _LARGEST_RECORD, "variables", f"records of {_LARGEST_RECORD >> 20} MiB at most")


def _is_number(value: Any) -> bool:
    """Return whether a value is a number that JSON holds as it is, or the text of one that it lacks."""
    if isinstance(value, str):
        return value in ("inf", "-inf", "nan")
    return type(value) is float or (type(value) is int and abs(value) < 1 << 63)


def _plain(values: list[Any]) -> list[Any]:
    """Return values so that equal ones are equal, whether as 1 or 1.0."""
    return [value if isinstance(value, str) else float(value) for value in values]


def _is_text(value: Any) -> bool:
    """Return whether a value is a text that a dataset can hold; it is escaped when it is shown."""
    return isinstance(value, str) and "\0" not in value and not any("\ud800" <= c <= "\udfff" for c in value)


def _matches(pattern: re.Pattern[str], text: Any) -> bool:
    return isinstance(text, str) and pattern.fullmatch(text) is not None


def _need(condition: Any, where: str, what: str) -> None:
    if not condition:
        raise ValueError(f"{where}: not {what}")
