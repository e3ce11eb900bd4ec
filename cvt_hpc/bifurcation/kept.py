"""A branch with all that was found of it, as arrays that are kept, and back."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from enum import IntEnum
from itertools import islice
from typing import Any, TypeVar, get_type_hints

import numpy as np

from cvt_hpc.archives import Arrays
from cvt_hpc.bifurcation.attractors import Attractor
from cvt_hpc.bifurcation.followed import Followed
from cvt_hpc.bifurcation.job import Asked
from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.linear_stability.branch import Branch, Onset, Point
from cvt_hpc.models.linear_stability.modes import Mode
from cvt_hpc.models.steady_variator.walking import SteadyBelt
from cvt_hpc.vibration.criticality import Criticality

Row = TypeVar("Row")  # a named tuple


def packed(followed: Followed) -> Arrays:
    """Return a branch as arrays; of a steady state the unknowns alone, from which all else follows."""
    points, onsets = followed.branch.points, followed.onsets
    modes = [mode for point in points for mode in point.modes] + [onset.mode for onset in onsets]
    missed = followed.branch.missed
    return {
        "point load": np.array([point.steady.load for point in points], float),
        "point unknowns": np.array([point.steady.unknowns for point in points], float),
        "point modes": np.array([len(point.modes) for point in points], int),
        "missed load": np.array([*missed], float),
        "missed reason": np.array([*missed.values()], str),
        "onset load": np.array([onset.load for onset in onsets], float),
        "onset rising": np.array([onset.rising for onset in onsets], bool),
        "onset others": np.array([onset.others for onset in onsets], int),
        "hidden": np.array(followed.hidden, float).reshape(-1, 2),
        **_columns("mode", Mode, modes),
        **_columns("run", Attractor, followed.runs),
        **_columns("kind", Criticality, followed.kinds),
    }


def unpacked(asked: Asked, loads: Sequence[float], arrays: Arrays) -> Followed:
    """Return the branch that `packed` has made arrays of.

    Parameters
    ----------
    asked : Asked
        What was asked for.
    loads : sequence of float
        Of the diagram [N m].
    arrays : dict
        The arrays.

    Raises
    ------
    KeyError, ValueError, TypeError
        If they are not of such a branch.
    """
    known = arrays["point load"].tolist()
    missed = _pairs(arrays["missed load"], arrays["missed reason"])
    if sorted([*known, *(load for load, _ in missed)]) != [*loads]:
        raise ValueError("of other loads")
    belt, modes = SteadyBelt(asked.parameters), iter(_rows("mode", Mode, arrays))
    points = [
        Point(belt.known(load, unknowns), [*islice(modes, int(count))])
        for load, unknowns, count in zip(known, arrays["point unknowns"], arrays["point modes"], strict=True)
    ]
    columns = (arrays[f"onset {name}"].tolist() for name in ("load", "rising", "others"))
    onsets = [
        Onset(load, mode, rising, others) for load, rising, others, mode in zip(*columns, modes, strict=True)
    ]
    kinds = _rows("kind", Criticality, arrays)
    if len(kinds) != len(onsets):
        raise ValueError("not one kind for each Hopf point")
    return Followed(
        asked,
        mesh(asked.parameters),
        Branch(points, dict(missed)),
        onsets,
        _pairs(*arrays["hidden"].T),
        _rows("run", Attractor, arrays),
        kinds,
    )


def _pairs(one: np.ndarray, other: np.ndarray) -> list[tuple[Any, Any]]:
    return list(zip(one.tolist(), other.tolist(), strict=True))


def _columns(name: str, kind: Callable[..., Row], rows: Iterable[Row]) -> Arrays:
    """Return named tuples of numbers, texts and arrays as an array for each of their fields."""
    return {f"{name} {key}": np.array([getattr(row, key) for row in rows]) for key in get_type_hints(kind)}


def _rows(name: str, kind: Callable[..., Row], arrays: Arrays) -> list[Row]:
    """Return the named tuples that `_columns` has made arrays of."""
    columns = [
        [_value(hint, value) for value in arrays[f"{name} {key}"]]
        for key, hint in get_type_hints(kind).items()
    ]
    return [kind(*values) for values in zip(*columns, strict=True)]


def _value(kind: Any, value: Any) -> Any:
    """Return a field of such a type."""
    if kind is np.ndarray:
        return value
    return kind(int(value)) if issubclass(kind, IntEnum) else kind(value)
