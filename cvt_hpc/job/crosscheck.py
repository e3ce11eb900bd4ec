"""What must hold between parameters, asked for every run before any computing."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from typing import Any

from cvt_hpc.errors import mismatch
from cvt_hpc.job.axes import Axis
from cvt_hpc.job.schema import Schema
from cvt_hpc.job.values import in_words

MOST_CHECKED_POINTS = 20_000


def check_grid(
    schema: Schema, parameters: dict[str, Any], axes: tuple[Axis, ...], source: str, *, sampled: bool = False
) -> None:
    """Check the base scene and every run, and that axes are of effect; of a huge grid, the axes' extremes.

    Parameters
    ----------
    schema : Schema
        With the checks.
    parameters : dict
        The base scene [SI].
    axes : tuple of Axis
        The grid.
    source : str
        The job file, for the error.
    sampled : bool
        Whether the values of the axes at one place make a run, instead of all their combinations.

    Raises
    ------
    InputError
        With the first problem found, and the run that has it; or with an axis that changes no run.
    """
    check_point(schema, parameters, source)
    sizes = {axis.name: len(axis.values) for axis in axes}
    idle = {name: "" for name, size in sizes.items() if size > 1}
    for values in zip(*(axis.values for axis in axes), strict=True) if sampled else _points_to_check(axes):
        varied = dict(zip(sizes, values, strict=True))
        point = {**parameters, **varied}
        check_point(schema, point, source, varied)
        inert = schema.inert(point) if idle else {}
        idle = {name: inert[name] for name in idle if name in inert}
    for name, setting in idle.items():
        expected = f"one value, since it has no effect with {setting}"
        raise mismatch(f"{source}: [axes] {name}", expected, f"{sizes[name]} values")


def check_point(
    schema: Schema, parameters: dict[str, Any], source: str, varied: Mapping[str, Any] | None = None
) -> None:
    """Check the parameters of one run.

    Parameters
    ----------
    schema : Schema
        With the checks.
    parameters : dict
        Value [SI] by key.
    source : str
        The job file, for the error.
    varied : mapping, optional
        Those of the values that set the run apart, to be named in the error.

    Raises
    ------
    InputError
        With the first problem found.
    """
    for key, expected, found in schema.problems(parameters):
        place = ", ".join(
            f"{name} = {in_words(value, schema.parameters[name].unit)}"
            for name, value in (varied or {}).items()
        )
        raise mismatch(
            f"{source}: [{schema.section_of[key]}] {key}",
            expected,
            found + (f" (at {place})" if place else ""),
        )


def _points_to_check(axes: tuple[Axis, ...]) -> Iterable[tuple]:
    size = math.prod(len(axis.values) for axis in axes)
    thin = size > MOST_CHECKED_POINTS
    return itertools.product(*(_extremes(axis.values) if thin else axis.values for axis in axes))


def _extremes(values: tuple) -> tuple:
    return values if isinstance(values[0], str) else (min(values), max(values))
