"""Profiles over time: lists of a job that give multiples of one of its values, linear between their times."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np


def multiple(parameters: Mapping[str, Any], name: str, time: float) -> float:
    """Multiple of a value at a time [s], by `profile_time` and the list of its name; 1 without a list.

    Before the first and after the last time it is constant.
    """
    values = parameters[f"{name}_profile"]
    return float(np.interp(time, parameters["profile_time"], values)) if values else 1.0


def nested(values: Sequence[Any]) -> bool:
    """Whether values are lists in their turn."""
    return any(isinstance(value, Sequence) for value in values)


def nested_problems(parameters: Mapping[str, Any], keys: Iterable[str]) -> list[tuple[str, str, str]]:
    """The first list whose values are no numbers, in the form of a model's check: (key, expected, found)."""
    for key in keys:
        if nested(parameters[key]):
            return [(key, "a list of numbers", f"{list(parameters[key])}")]
    return []


def length_problems(parameters: Mapping[str, Any], keys: Sequence[str]) -> list[tuple[str, str, str]]:
    """Lists that are missing beside others, or not as long as most of them: (key, expected, found)."""
    lengths = {key: len(parameters[key]) for key in keys}
    usual = Counter(filter(None, lengths.values())).most_common(1)[0][0]
    first = next(key for key, length in lengths.items() if length == usual)
    expected = f"as many values as {first} has, {usual}"
    return [(key, expected, f"{length or 'none'}") for key, length in lengths.items() if length != usual]
