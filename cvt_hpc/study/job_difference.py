"""Differences between the job of an output folder and the requested one."""

import json
import os.path
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from cvt_hpc.errors import InputError, few_of

_LONGEST = 40  # letters of a value


def another_job(path: Path, found: dict[str, Any], asked: dict[str, Any], name: str = "") -> InputError:
    """Return the error that a folder holds the results of another resolved job."""
    difference = f"{name}{difference_in_words(found, asked)}"
    return InputError(
        f"{path}: expected the folder of this job, found that of another ({difference}); choose another name "
        "or --out, or --fresh to throw its results away"
    )


def difference_in_words(found: Mapping[str, Any], asked: Mapping[str, Any]) -> str:
    """Return the first few entries in which two resolved jobs differ, as "key is 1 there, 2 here"."""
    pairs = differences(found, asked).items()
    entries = [f"{key} {_pair_in_words(there, here)}" for key, (there, here) in pairs]
    return "; ".join(entries[:3]) + ("; ..." if len(entries) > 3 else "")


def _pair_in_words(there: Any, here: Any) -> str:
    """Return in words how two values differ: of lists the values that only one of them has."""
    if not isinstance(there, list) or not isinstance(here, list) or len(f"{there}{here}") <= _LONGEST:
        return "is {} there, {} here".format(*short_pair(there, here))
    gone, more = (
        [value for value in one if value not in other] for one, other in ((there, here), (here, there))
    )
    parts = [
        f"has {len(values)} value{'s' * (len(values) > 1)} {where} ({_few(values)})"
        for values, where in ((gone, "there that it lacks here"), (more, "here that it lacks there"))
        if values
    ]
    return " and ".join(parts) or "has its values in another order"


def _few(values: list) -> str:
    return few_of([short(value) for value in values], 4)


def differences(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, tuple[Any, Any]]:
    """Return the values, None where there is none, of each key "section.key" in which documents differ."""
    here, there = flatten(one), flatten(other)
    pairs = {key: (here.get(key), there.get(key)) for key in {**here, **there}}
    return {key: pair for key, pair in pairs.items() if pair[0] != pair[1]}


def flatten(entry: Any, prefix: str = "") -> dict[str, Any]:
    """Return the values of nested tables by "section.key"."""
    if not isinstance(entry, Mapping):
        return {prefix: entry}
    parts = (flatten(value, f"{prefix}.{key}" if prefix else key) for key, value in entry.items())
    return {key: value for part in parts for key, value in part.items()}


def short(value: Any) -> str:
    """Return a value of a resolved job in 40 letters at most."""
    text = "not set" if value is None else json.dumps(value)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def short_pair(one: Any, other: Any) -> list[str]:
    """Return two values of a resolved job that differ, each as short, from where they differ if need be."""
    if (first := short(one)) != (second := short(other)):
        return [first, second]
    texts = [json.dumps(one), json.dumps(other)]
    begin = max(len(os.path.commonprefix(texts)) - 10, 0)
    return [f"...{text[begin:][:_LONGEST]}" for text in texts]
