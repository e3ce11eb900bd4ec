"""Conditions that must hold between parameters, checked for every run before any computing."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.job.axes import NONE, SAMPLE, SWAPPED, Axes, Axis, thinned
from cvt_hpc.job.rules import Rule, follow, needed_rules, places, varied_by
from cvt_hpc.job.schema import Schema
from cvt_hpc.job.uncertain import Scatter
from cvt_hpc.job.values import Point
from cvt_hpc.parameters import Parameters

MOST_CHECKED_POINTS, MOST_CHECKED_VALUES = 20_000, 5_000  # of runs, and of parameters that follow from others


def check_grid(
    schema: Schema,
    parameters: Point,
    axes: Axes,
    source: str,
    *,
    rules: Sequence[Rule] = (),
    sampled: bool = False,
    given: Iterable[str] = (),
) -> dict[str, str]:
    """Check the base scene and every run, and that axes are of effect; of a huge study, some runs.

    Of a grid these are the extremes of its axes, and of its uncertain parameters; of samples those with an
    extreme value, and others from all over them.

    Parameters
    ----------
    schema, source
        The checks, and the job file, for the error.
    parameters : dict
        The base scene [SI].
    axes, rules
        The grid, and how parameters follow from others.
    sampled : bool
        Whether the values of the axes at one place make a run, instead of all their combinations.
    given : iterable of str
        Further keys to be checked for an effect.

    Returns
    -------
    dict
        Those of the given keys that change no run, each with the setting that makes it so.

    Raises
    ------
    InputError
        With the first problem found, and the run that has it; or with an axis that changes no run.
    """
    check_point(schema, parameters, source)
    sizes = {axis.name: len(axis.values) for axis in axes}
    scattered = [rule.key for rule in rules if isinstance(rule.source, Scatter)]
    idle = dict.fromkeys([*given, *scattered, *(name for name, size in sizes.items() if size > 1)], "")
    for varied in _samples_to_check(axes) if sampled else _points_to_check(axes, rules):
        point = follow(rules, {**parameters, **varied})
        check_point(schema, point, source, varied)
        inert = _inert(schema, rules, point) if idle else {}
        idle = {name: inert[name] for name in idle if name in inert}
    for name in filter(idle.__contains__, sizes):
        expected = f"one value, since it has no effect with {idle[name]}"
        raise mismatch(f"{source}: [axes] {name}", expected, f"{sizes[name]} values")
    for name in filter(idle.__contains__, scattered):
        expected = f"a parameter of effect, which it has not with {idle[name]}"
        raise mismatch(f"{source}: [uncertain] {name}", expected, "a distribution")
    return idle


def check_point(schema: Schema, parameters: Point, source: str, varied: Parameters | None = None) -> None:
    """Check the parameters of one run.

    Parameters
    ----------
    schema, parameters, source
        As of `check_grid`.
    varied : mapping, optional
        The values that set the run apart, to be named in the error.

    Raises
    ------
    InputError
        With the first problem found.
    """
    for key, expected, found in schema.problems(parameters):
        unit, value = schema.parameters[key].unit, parameters[key]
        told_in_si = isinstance(value, float) and found == f"{value:g} {unit}".rstrip()
        if told_in_si and schema.unit_in_words(key) != unit:
            found = f"{found} ({schema.in_words(key, value)})"
        where = f"{source}: [{schema.section_of[key]}] {key}"
        raise mismatch(where, expected, found + _place(schema, varied or {}))


def complete_point(
    schema: Schema, rules: Iterable[Rule], parameters: Parameters, varied: Parameters
) -> Point:
    """Return the parameters [SI] of a run with those derived from them.

    Raises
    ------
    InputError
        If one of these has no legal value; the error names the run by its values `varied`.
    """
    try:
        return follow(rules, {**parameters, **varied})
    except InputError as error:
        raise InputError(f"{error}{_place(schema, varied)}") from None


def _place(schema: Schema, varied: Parameters) -> str:
    words = (f"{key} = {schema.in_words(key, value)}" for key, value in varied.items())
    return f" (at {', '.join(words)})" if varied else ""


def check_rules(
    schema: Schema, parameters: Parameters, axes: Axes, rules: Sequence[Rule], *, sampled: bool = False
) -> None:
    """Check parameters that follow from others, along the axes with which they vary.

    Where these make a huge grid, at values all over it: illegal values in between are refused when the runs
    begin. Arguments as of `check_grid`; the base scene is without these parameters.

    Raises
    ------
    InputError
        With the first parameter that has no legal value, and its place.
    """
    for key, along in varied_by(rules, [axis.name for axis in axes]).items():
        needed = needed_rules(rules, key)
        varying = tuple(axis for axis in axes if axis.name in along)
        few = thinned(varying, MOST_CHECKED_VALUES, sampled=sampled)
        for varied in places(few, along, sampled=sampled):
            complete_point(schema, needed, parameters, varied)


def without_effect(
    schema: Schema, parameters: Parameters, axes: Axes, rules: Sequence[Rule], *, sampled: bool = False
) -> dict[str, str]:
    """Return the parameters without effect on any run, each with the setting that makes it so.

    All runs are checked: of a huge grid the axes should be `thinned`. Arguments as of `check_grid`.
    """
    found: dict[str, str] | None = None
    for varied in places(axes, [axis.name for axis in axes], sampled=sampled and bool(axes)):
        inert = _inert(schema, rules, follow(rules, {**parameters, **varied}))
        found = inert if found is None else {key: found[key] for key in found if key in inert}
    return found or {}


def _inert(schema: Schema, rules: Sequence[Rule], point: Point) -> dict[str, str]:
    """Return the parameters without effect: sources of derived ones have an effect as far as these have."""
    inert = dict(schema.inert(point))
    for rule in reversed(rules):
        if rule.is_substituted and rule.key in inert:
            inert[rule.needs[0]] = inert[rule.key]
    for rule in reversed(rules):
        if rule.key not in inert:
            read = rule.read(point)
            inert = {key: setting for key, setting in inert.items() if key not in read}
    return inert


def _points_to_check(axes: Axes, rules: Sequence[Rule]) -> Iterable[Point]:
    if math.prod(len(axis.values) for axis in axes) > MOST_CHECKED_POINTS:
        axes = tuple(replace(axis, values=_extremes(axis, rules)) for axis in axes)
    return places(axes, {axis.name for axis in axes})


def _extremes(axis: Axis, rules: Sequence[Rule]) -> tuple:
    if axis.name == SAMPLE:
        return _extreme_samples(axis, rules)
    return axis.values if isinstance(axis.values[0], str) else (min(axis.values), max(axis.values))


def _extreme_samples(axis: Axis, rules: Sequence[Rule]) -> tuple:
    """Return the samples in which an uncertain parameter has its least or its largest value."""
    found = set()
    for rule in rules:
        if isinstance(rule.source, Scatter):
            values = [rule.value({SAMPLE: sample, SWAPPED: NONE}) for sample in axis.values]
            found |= {axis.values[values.index(end)] for end in (min(values), max(values))}
    return tuple(sorted(found))


def _samples_to_check(axes: Axes) -> Iterable[Point]:
    is_huge = len(axes[0].values) > MOST_CHECKED_POINTS
    some = thinned(axes, MOST_CHECKED_VALUES, sampled=True) if is_huge else axes
    yield from places(some, {axis.name for axis in axes}, sampled=True)
    ends = {axis.values.index(end) for axis in axes for end in (min(axis.values), max(axis.values))}
    for place in sorted(ends):
        yield {axis.name: axis.values[place] for axis in axes}
