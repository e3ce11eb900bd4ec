"""A branch and its results as arrays that are kept, and back; the kinds of Hopf points follow."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from enum import IntEnum
from itertools import chain, islice
from typing import Any, TypeVar, get_type_hints

import numpy as np

from cvt_hpc.archives import Arrays
from cvt_hpc.bifurcation.attractors import FROM, Attractor
from cvt_hpc.bifurcation.followed import Followed
from cvt_hpc.bifurcation.job import Asked, Diagram
from cvt_hpc.bifurcation.kinds import kinds_of
from cvt_hpc.models.elastic_belt.belt import mesh
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from cvt_hpc.models.linear_stability.branch import Branch, Onset, Point
from cvt_hpc.models.linear_stability.modes import Mode
from cvt_hpc.models.steady_variator.equations import LATE
from cvt_hpc.models.steady_variator.walking import Steady, SteadyBelt

_MOST = np.iinfo(np.int8).max  # of the counts in the dataset
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
    }


def unpacked(diagram: Diagram, asked: Asked, arrays: Arrays) -> Followed:
    """Return the branch that `packed` has made arrays of.

    Parameters
    ----------
    diagram, asked : Diagram, Asked
        The requested diagram, and the requested branch of it.
    arrays : dict
        The arrays; they may come from somebody else.

    Raises
    ------
    KeyError, ValueError, TypeError
        If they are not of such a branch.
    """
    known = _values(float, arrays["point load"])
    missed = dict(_pairs((float, str), arrays["missed load"], arrays["missed reason"]))
    if known != sorted(known) or sorted([*known, *missed]) != [*diagram.loads]:
        raise ValueError("of other loads")
    belt, unknowns, modes = (
        SteadyBelt(asked.parameters),
        arrays["point unknowns"],
        _rows("mode", Mode, arrays),
    )
    _require(unknowns.dtype.kind == "f" and np.isfinite(unknowns).all(), "unknowns")
    states = [belt.known(load, own) for load, own in zip(known, unknowns, strict=True)]
    _check_modes(modes, states)
    left, counts = iter(modes), _values(int, arrays["point modes"])
    points = [Point(state, [*islice(left, count)]) for state, count in zip(states, counts, strict=True)]
    kinds = (float, bool, int)
    columns = [
        _values(kind, arrays[f"onset {name}"])
        for kind, name in zip(kinds, ("load", "rising", "others"), strict=True)
    ]
    onsets = [
        Onset(load, mode, rising, others) for load, rising, others, mode in zip(*columns, left, strict=True)
    ]
    _require(all(0 <= onset.others <= _MOST for onset in onsets), "other modes")
    _require(arrays["hidden"].shape[1:] == (2,), "hidden changes of stability")
    hidden, runs = _pairs((float, float), *arrays["hidden"].T), _rows("run", Attractor, arrays)
    _require(all(run.start in range(len(FROM)) for run in runs), "starts")
    loads = chain((onset.load for onset in onsets), *hidden, (run.value for run in runs))
    _require(all(diagram.loads[0] <= load <= diagram.loads[-1] for load in loads), "loads")
    return Followed(
        asked,
        mesh(asked.parameters),
        Branch(points, missed),
        onsets,
        hidden,
        runs,
        kinds_of(diagram, asked, onsets, hidden, runs),
    )


def _check_modes(modes: list[Mode], states: list[Steady]) -> None:
    """Raise ValueError unless these may be modes of a belt with such steady states."""
    if not states:
        return _require(not modes, "modes")
    belt = states[0].belt
    shapes = {
        "amplitudes": (4,),
        "fed": belt.cell.shape,
        "displacement": belt.cell.shape,
        "vector": flat_belt(belt, LATE).origin.shape,
    }
    for mode in modes:
        for name, shape in shapes.items():
            array = getattr(mode, name)
            kind = "c" if name in ("displacement", "vector") else "f"
            _require(array.dtype.kind == kind and array.shape == shape, name)
        _require(abs(np.abs(mode.displacement).max() - 1.0) < 1e-6, "displacement")  # by round-off alone
        _require(mode.strand in (0, 1) and 1 <= mode.half_waves <= _MOST, "strands or half waves")
        _require(np.isfinite([mode.growth, mode.frequency]).all(), "growth rates or frequencies")


def _require(holds: Any, name: str) -> None:
    """Raise ValueError with the name of the impossible entry unless the condition holds."""
    if not holds:
        raise ValueError(f"{name} as no branch has them")


def _pairs(kinds: tuple[type, type], one: np.ndarray, other: np.ndarray) -> list[tuple[Any, Any]]:
    return list(zip(_values(kinds[0], one), _values(kinds[1], other), strict=True))


def _columns(name: str, kind: Callable[..., Row], rows: Iterable[Row]) -> Arrays:
    """Return named tuples of numbers, texts and arrays as an array for each of their fields."""
    return {f"{name} {key}": np.array([getattr(row, key) for row in rows]) for key in get_type_hints(kind)}


def _rows(name: str, kind: Callable[..., Row], arrays: Arrays) -> list[Row]:
    """Return the named tuples that `_columns` has made arrays of."""
    columns = [_values(hint, arrays[f"{name} {key}"]) for key, hint in get_type_hints(kind).items()]
    return [kind(*values) for values in zip(*columns, strict=True)]


def _values(kind: Any, array: np.ndarray) -> list[Any]:
    """Return the values of an array, all of such a type; TypeError if they are of another."""
    if kind is np.ndarray:
        return [*array]
    values = array.tolist()
    plain = int if issubclass(kind, IntEnum) else kind
    if not all(type(value) is plain for value in values):
        raise TypeError(f"{array.dtype} in the place of {plain.__name__}")
    return [kind(value) for value in values] if plain is not kind else values
