"""Differences between the job of an output folder and the requested one."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from cvt_hpc.errors import InputError
from cvt_hpc.study.description import Study


def refuse_other(path: Path, found: Study, asked: Study) -> None:
    """Raise InputError unless the study in a folder is the requested one."""
    if found.fingerprint != asked.fingerprint:
        raise another_job(path, found.job, asked.job, f"job {found.name}: ")
    if _layout(found) != _layout(asked):
        raise InputError(
            f"{path}: expected records with the quantities of this version, found others; choose "
            "another --out, or --fresh to throw them away"
        )


def another_job(path: Path, found: dict[str, Any], asked: dict[str, Any], name: str = "") -> InputError:
    """Return the error that a folder holds the results of another resolved job."""
    difference = f"{name}{_difference(found, asked)}"
    return InputError(
        f"{path}: expected the folder of this job, found that of another ({difference}); choose another "
        "--out, or --fresh to throw its results away"
    )


def _difference(found: dict[str, Any], asked: dict[str, Any]) -> str:
    """The first few entries in which two resolved jobs differ, as "key is 1 there, 2 here"."""
    entries = [
        f"{key} is {short(there)} there, {short(here)} here"
        for key, (there, here) in differences(found, asked).items()
    ]
    return "; ".join(entries[:3]) + ("; ..." if len(entries) > 3 else "")


def differences(one: dict[str, Any], other: dict[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return the values, None where there is none, of each key "section.key" in which documents differ."""
    here, there = flatten(one), flatten(other)
    pairs = {key: (here.get(key), there.get(key)) for key in {**here, **there}}
    return {key: pair for key, pair in pairs.items() if pair[0] != pair[1]}


def _layout(study: Study) -> dict[str, Any]:
    """Return the entries in which records must agree to be of one dataset."""
    return {
        "quantities": [(v.name, v.dims, v.dtype) for v in study.variables],
        "coordinates": [(dimension.name, dimension.values) for dimension in study.coordinates],
    }


def flatten(entry: Any, prefix: str = "") -> dict[str, Any]:
    """Return the values of nested tables by "section.key"."""
    if not isinstance(entry, dict):
        return {prefix: entry}
    parts = (flatten(value, f"{prefix}.{key}" if prefix else key) for key, value in entry.items())
    return {key: value for part in parts for key, value in part.items()}


def short(value: Any) -> str:
    """Return a value of a resolved job in 40 letters at most."""
    text = "not set" if value is None else json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."
