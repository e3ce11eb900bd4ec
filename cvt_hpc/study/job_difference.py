"""Differences between the job of an output folder and the requested one.

A larger study of the same job has more values on its axes, or further axes; `places_in` finds the runs of the
smaller one in it.
"""

import json
import os.path
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import HeldError, few_of
from cvt_hpc.job.values import Table
from cvt_hpc.study.description import Study

_LONGEST = 40  # letters of a value

_FREE = ("name", "description", "axes", "linked", "design")  # compared by the runs that they make


def another_job(path: Path, found: Table, asked: Table, name: str = "") -> HeldError:
    """Return the error that a folder holds the results of another resolved job."""
    another = f"that of another ({name}{difference_in_words(found, asked)})"
    then = "choose another name or --out, or --fresh to throw its results away"
    return HeldError(f"{path}: expected the folder of this job, found {another}", then)


def difference_in_words(found: Table, asked: Table) -> str:
    """Return the first few entries in which two resolved jobs differ, as "key is 1 there, 2 here"."""
    pairs = differences(found, asked).items()
    entries = [f"{key} {_pair_in_words(there, here)}" for key, (there, here) in pairs]
    return "; ".join(entries[:3]) + ("; ..." if len(entries) > 3 else "")


def _pair_in_words(there: object, here: object) -> str:
    """Return in words how two values differ: of lists the values that only one of them has."""
    if not isinstance(there, list) or not isinstance(here, list) or len(f"{there}{here}") <= _LONGEST:
        return "is {} there, {} here".format(*short_pair(there, here))
    parts = []
    for one, other, at, not_at in ((there, here, "there", "here"), (here, there, "here", "there")):
        if alone := [short(value) for value in one if value not in other]:
            count = f"{len(alone)} value{'s' * (len(alone) > 1)}"
            parts.append(f"has {count} {at} that it lacks {not_at} ({few_of(alone, 4)})")
    return " and ".join(parts) or "has its values in another order"


def differences(one: Table, other: Table) -> dict[str, tuple[object, object]]:
    """Return the values, None where there is none, of each key "section.key" in which documents differ."""
    here, there = flatten(one), flatten(other)
    pairs = {key: (here.get(key), there.get(key)) for key in {**here, **there}}
    return {key: pair for key, pair in pairs.items() if pair[0] != pair[1]}


def flatten(entry: object, prefix: str = "") -> dict[str, object]:
    """Return the values of nested tables by "section.key"."""
    if not isinstance(entry, Mapping):
        return {prefix: entry}
    parts = (flatten(value, f"{prefix}.{key}" if prefix else key) for key, value in entry.items())
    return {key: value for part in parts for key, value in part.items()}


def short(value: object) -> str:
    """Return a value of a resolved job in 40 letters at most."""
    text = "not set" if value is None else json.dumps(value)
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def short_pair(one: object, other: object) -> list[str]:
    """Return two values of a resolved job that differ, each as short, from where they differ if need be."""
    if (first := short(one)) != (second := short(other)):
        return [first, second]
    texts = [json.dumps(one), json.dumps(other)]
    begin = max(len(os.path.commonprefix(texts)) - 10, 0)
    return [f"...{text[begin:][:_LONGEST]}" for text in texts]


def refuse_other(path: Path, found: Study, asked: Study) -> None:
    """Raise HeldError unless the study in a folder is the requested one, or that one has all its runs."""
    if found.fingerprint != asked.fingerprint and places_in(found.job, asked.job) is None:
        raise another_job(path, found.job, asked.job, f"job {found.name}: ")
    if not have_one_layout(found, asked):
        then = "choose another --out, or --fresh to throw them away"
        raise HeldError(f"{path}: expected records with the quantities of this version, found others", then)


def have_one_layout(one: Study, other: Study) -> bool:
    """Return whether records of two studies can be of one dataset."""
    quantities, others = ([(v.name, v.dims, v.dtype) for v in study.variables] for study in (one, other))
    places, elsewhere = ([(d.name, d.values) for d in study.coordinates] for study in (one, other))
    return quantities == others and places == elsewhere


def places_in(found: Table, asked: Table) -> NDArray[np.int64] | None:
    """Return the index in one job of each run of another, shape (runs of `found`,); None if any is not there.

    The jobs are resolved, as of `Job.resolved`. A run is the same if all its parameters are: values of axes
    and linked parameters are compared exactly, in SI units. A constant may have become an axis, on which its
    value then has to be.
    """
    try:
        return _find_places(found, asked)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError):  # a document that is no job's
        return None


def _find_places(found: Table, asked: Table) -> NDArray[np.int64] | None:
    constants = {}  # that have become axes
    for key, (there, here) in differences(found, asked).items():
        name = key.rpartition(".")[2]
        if key.partition(".")[0] in _FREE:
            continue
        if there is None or here is not None:
            return None
        constants[name] = there
    axes, wanted = found["axes"], asked["axes"]
    kinds = [job.get("design", {}).get("kind") for job in (found, asked)]
    if {*axes, *constants} != {*wanted} or kinds[0] != kinds[1]:
        return None
    if "runs" in found.get("design", {}):
        return _among_samples(axes, constants, wanted)
    columns = {**{name: [value] for name, value in constants.items()}, **axes}
    return _in_grid(columns, wanted, found.get("linked", {}), asked.get("linked", {}))


def _in_grid(
    columns: Mapping[str, list], wanted: Mapping[str, list], links: Table, others: Table
) -> NDArray[np.int64] | None:
    """Return the indices, in C order, of a grid in another one: by axes, and by what is linked to them."""
    strides: dict[str, int] = {}
    stride = 1
    for name in reversed([*wanted]):
        strides[name], stride = stride, stride * len(wanted[name])
    places = np.zeros((), np.int64)
    for name, values in columns.items():
        of = {value: place for place, value in enumerate(wanted[name])}
        # repeated values, as a document of somebody else may have them, would make any number of runs
        if not of.keys() >= set(values) or len(set(values)) < len(values):
            return None
        own = [of[value] for value in values]
        linked = {key: [every[place] for place in own] for key, every in others.get(name, {}).items()}
        if linked != links.get(name, {}):
            return None
        places = np.add.outer(places, strides[name] * np.array(own, np.int64))
    return places.ravel()


def _among_samples(
    columns: Mapping[str, list], constants: Table, wanted: Mapping[str, list]
) -> NDArray[np.int64] | None:
    """Return the indices of samples among others; equal ones, which a list may have, in their order."""
    left: dict[tuple, list[int]] = {}
    names = [*columns, *constants]
    for place, sample in enumerate(zip(*(wanted[name] for name in names), strict=True)):
        left.setdefault(sample, []).append(place)
    rows = ((*row, *constants.values()) for row in zip(*columns.values(), strict=True))
    places = [same.pop(0) if (same := left.get(row)) else -1 for row in rows]
    return None if -1 in places else np.array(places, np.int64)
