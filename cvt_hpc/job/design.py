"""Which points of the space of its axes a study runs: all of a grid, those along boundaries, or samples.

Of a grid with samples of uncertain parameters it runs as many in each cell as a stated interval needs.

Samples of the space that the ranges of axes span are drawn by scipy.stats.qmc. A job also names the runs
whose whole history a sweep is to keep, as grid points or run indices. They do not determine the numbers: a
folder takes the job with any of them.
"""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.errors import mismatch, show, unknown
from cvt_hpc.job.axes import (
    LARGEST_AXIS,
    SAMPLE,
    SWAPPED,
    Axes,
    Axis,
    read_bounds,
    read_spacing,
    read_values,
    without_rounding,
)
from cvt_hpc.job.schema import Entry, Schema
from cvt_hpc.job.values import Point, Table, kind_of, read_or_default, read_value, refuse_unknown
from cvt_hpc.parameters import Parameter, Parameters

KEY = ("record", "history")
_FORMS = "a list of runs, each a table {axis = value, ...} with all axes, or a run index"

_SPACING = Parameter(
    4, "", "cells between the runs that a trace begins with", minimum=1, maximum=LARGEST_AXIS
)
_FIRST = Parameter(32, "", "samples that all cells have", minimum=2, maximum=2**16)
_WIDEST = Parameter(
    0.2, "", "95 % interval of the probability, with which a cell is left", minimum=0.001, maximum=1.0
)
_RUNS = Parameter(64, "", "samples", minimum=1, maximum=2**24)
SEED = Parameter(1, "", "of the samples", minimum=0)
ADAPTIVE = "adaptive"
LISTED = "listed"  # samples that the job gives itself, drawn elsewhere
_KEYS: dict[str, dict[str, Parameter]] = {  # beside `kind`
    "grid": {},
    "trace": {"first_spacing": _SPACING},
    ADAPTIVE: {"first_samples": _FIRST, "widest_interval": _WIDEST},
    "sobol": {"runs": _RUNS, "seed": SEED},
    "latin_hypercube": {"runs": _RUNS, "seed": SEED},
    LISTED: {"runs": _RUNS},
}
KEYS_OF_A_DESIGN = {"kind"}.union(*_KEYS.values())
_KIND = Parameter("grid", "", "which points are run", choices=tuple(_KEYS))

Design = dict[str, Any]  # empty: the full grid


def is_in_rounds(design: Table) -> bool:
    """Return whether the runs depend on results of earlier ones: of a trace, and of adaptive samples."""
    return "first_spacing" in design or "first_samples" in design


class Runs:
    """The runs that axes and a design make: the common part of a job and of a study that is read again."""

    axes: tuple  # the varied values: a grid, whose last axis is the fastest, or those of all samples
    design: Design

    @property
    def is_sampled(self) -> bool:
        """Whether the values of the axes at one place make a run, instead of all their combinations."""
        return "runs" in self.design

    @property
    def is_traced(self) -> bool:
        """Whether boundaries are traced."""
        return "first_spacing" in self.design

    @property
    def in_rounds(self) -> bool:
        """Whether the runs depend on the results of earlier ones."""
        return is_in_rounds(self.design)

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values on each axis, () for a single run; the number of runs where these are samples."""
        return (self.design["runs"],) if self.is_sampled else tuple(len(axis.values) for axis in self.axes)

    @property
    def size(self) -> int:
        """Number of runs; of a trace, of all runs that it chooses from."""
        return math.prod(self.shape)

    def place(self, index: int) -> Point:
        """Return the axes' values of run `index`, by axis name, counted in C order or over the samples."""
        if self.is_sampled:
            return {axis.name: axis.values[index] for axis in self.axes}
        places = np.unravel_index(index, self.shape) if self.axes else ()
        return {axis.name: axis.values[i] for axis, i in zip(self.axes, places, strict=True)}


_SAMPLED = ("from", "to", "spacing")


def read_design(table: Table, source: str) -> Design:
    """Check a job file's table [design].

    Returns
    -------
    dict
        The table with its defaults, in JSON types; empty for the full grid. `first_spacing` is left as it
        was found, because it depends on the axes.

    Raises
    ------
    InputError
        If a key or a value is not legal.
    """
    where = f"{source}: [design]"
    kind = read_value(_KIND, table.get("kind", _KIND.default), f"{where} kind")
    refuse_unknown(table, ("kind", *_KEYS[kind]), f"{where} ", f"key of a design of kind {show(kind)}")
    if kind == "grid":
        return {}
    if kind == "trace":
        return {"kind": kind, "first_spacing": table.get("first_spacing", _SPACING.default)}
    if "runs" in _KEYS[kind] and "runs" not in table:
        raise mismatch(f"{where} runs", "the number of samples", "nothing")
    found = read_or_default(_KEYS[kind], table, where)
    if kind in (ADAPTIVE, "sobol"):
        counted = "first_samples" if kind == ADAPTIVE else "runs"
        check_power_of_2(found[counted], f"{where} {counted}")
    return {"kind": kind, **found}


def check_power_of_2(count: int, where: str) -> None:
    """Raise InputError unless so many points of a Sobol sequence fill the space evenly."""
    if count & (count - 1):
        lower = 2 ** (count.bit_length() - 1)
        raise mismatch(where, f"a power of 2 (the nearest: {lower} and {2 * lower})", str(count))


def check_adaptive(axes: Axes, source: str) -> None:
    """Raise InputError unless a job with these axes can choose the number of samples of each cell."""
    names = [axis.name for axis in axes]
    if SAMPLE not in names or SWAPPED in names:
        expected = "samples of [uncertain] without indices, as many of which are run as a cell needs"
        raise mismatch(f"{source}: [design] kind", expected, f"the axes {', '.join(names) or '(none)'}")


def resolve_spacing(design: Design, axes: Axes, source: str) -> Design:
    """Return the design of a trace with its first spacing on each axis along which it traces.

    A table names these axes. A number stands for all numeric axes of more than twice as many values: shorter
    ones, on which neighbours are far apart, are run in full. Of samples each one has a trace of its own.

    Raises
    ------
    InputError
        If an axis is not known, not of numbers, or its values do not rise or fall all the way, or if none is
        long enough.
    """
    where = f"{source}: [design] first_spacing"
    found, axes = design["first_spacing"], tuple(axis for axis in axes if axis.name != SAMPLE)
    if isinstance(found, Mapping):
        spacings = {name: read_value(_SPACING, raw, f"{where}.{name}") for name, raw in found.items()}
    else:
        spacing = read_value(_SPACING, found, where)
        long = [axis for axis in axes if len(axis.values) > 2 * spacing]
        spacings = {axis.name: spacing for axis in long if _is_numeric(axis)}
        if not spacings:
            raise mismatch(where, f"an axis of more than {2 * spacing} numbers, to trace along", "none")
    known = {axis.name: axis for axis in axes}
    for name in spacings:
        if name not in known:
            raise unknown(f"{where}.{name}", "axis", name, known)
        if not _is_numeric(known[name]):
            raise mismatch(f"{where}.{name}", "an axis of numbers", "one of texts")
        rising = sorted(known[name].values)
        if list(known[name].values) not in (rising, rising[::-1]):
            expected = "values that rise or fall all the way, to trace along them"
            raise mismatch(f"{source}: [axes] {name}", expected, "others")
    return {**design, "first_spacing": spacings}


def _is_numeric(axis: Axis) -> bool:
    return not isinstance(axis.values[0], (str, bool))


def sampled_axes(found: Mapping[str, Entry], design: Design, source: str) -> Axes:
    """Return the axes of a sampled study, each with the value of every sample.

    Parameters
    ----------
    found : mapping
        By name the entry in the job file, a table with from, to and optionally spacing. In the place of all
        ranges may stand the lists of drawn values, as the resolved job in a dataset gives them; with the kind
        "listed" they have to.
    design : dict
        Kind, `runs` and `seed`.
    source : str
        The job file, for the error.

    Returns
    -------
    tuple of Axis
        With `runs` values each; values at one place belong together.

    Raises
    ------
    InputError
        If there is no axis, or one has no continuous values or no legal range.
    """
    if not found:
        raise mismatch(f"{source}: [axes]", "one axis or more, to draw samples from", "none")
    for parameter, _, where in found.values():
        if kind_of(parameter) is not float:
            raise mismatch(where, "a parameter with continuous values, to draw samples from", "another one")
    drawn = all(isinstance(raw, list) and len(raw) == design["runs"] for _, raw, _ in found.values())
    if drawn or design["kind"] == LISTED:
        return tuple(_read_listed(name, design["runs"], *entry) for name, entry in found.items())
    ranges = [read_range(*entry) for entry in found.values()]
    shares = _draw(design, len(ranges)).T
    return tuple(
        Axis(name, tuple(between(*ends, share).tolist()), parameter.unit, parameter.description, ends[2])
        for (name, (parameter, _, _)), ends, share in zip(found.items(), ranges, shares, strict=True)
    )


def _read_listed(name: str, runs: int, parameter: Parameter, raw: object, where: str) -> Axis:
    """Return an axis with the value of each sample, as it stands in the job; values may come again."""
    found = f"{len(raw)} values" if isinstance(raw, (list, tuple, np.ndarray)) else show(raw)
    if found != f"{runs} values":
        raise mismatch(where, f"a list of {runs} values, one for each of the runs of [design]", found)
    return Axis(name, read_values(parameter, raw, where), parameter.unit, parameter.description)


def read_range(parameter: Parameter, raw: object, where: str) -> tuple[float, float, str]:
    """Return the ends of a range and the spacing of the values drawn from it."""
    if not isinstance(raw, dict):
        raise mismatch(where, "a range {from=, to=}, to draw samples from", show(raw))
    refuse_unknown(raw, _SAMPLED, f"{where}.", "key of a range to draw samples from")
    start, stop = read_bounds(parameter, raw, where)
    return start, stop, read_spacing(raw, start, stop, where)


def _draw(design: Design, dimensions: int) -> np.ndarray:
    """Return samples of the unit cube, shape (runs, dimensions)."""
    from scipy.stats import qmc

    engine = {"sobol": qmc.Sobol, "latin_hypercube": qmc.LatinHypercube}[design["kind"]]
    return engine(dimensions, seed=np.random.default_rng(design["seed"])).random(design["runs"])


def between(start: float, stop: float, spacing: str, share: np.ndarray) -> np.ndarray:
    """Return the values at shares of the way from `start` to `stop`, by their spacing."""
    return start * (stop / start) ** share if spacing == "log" else start + (stop - start) * share


def read_histories(
    raw: object, schema: Schema, axes: Axes, replaced: Parameters, source: str, samples: int | None = None
) -> tuple[int, ...]:
    """Return the indices of the runs that a list of a job names, in order.

    Parameters
    ----------
    raw, schema, axes, source
        The list as TOML gives it, and the job: what it declares, its grid, and its file for the errors.
    replaced : mapping
        By key the replacement of an axis or a value by overrides: a value, or None for an axis of
        their own. A run that they have taken off the grid is left out.
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
    entries = {f"{where}, run {i}": entry for i, entry in enumerate(raw, 1)}
    if samples is not None:
        return tuple(sorted({_numbered(entry, samples, place) for place, entry in entries.items()}))
    found = {_index(entry, schema, axes, replaced, place) for place, entry in entries.items()}
    return tuple(sorted(index for index in found if index is not None))


def _index(entry: object, schema: Schema, axes: Axes, replaced: Parameters, where: str) -> int | None:
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
        place = _place(axis, values.pop(axis.name), schema, f"{where}, {axis.name}")
        index = index * len(axis.values) + place
    for key in values:
        if key not in replaced:
            raise mismatch(where, f"axes of this job ({', '.join(axis.name for axis in axes)})", key)
    return index if all(without_rounding(replaced[key]) == value for key, value in values.items()) else None


def _numbered(entry: object, size: int, where: str) -> int:
    if isinstance(entry, bool) or not isinstance(entry, int) or not 0 <= entry < size:
        raise mismatch(where, f"an index from 0 to {size - 1}", show(entry))
    return entry


def _place(axis: Axis, value: float | str, schema: Schema, where: str) -> int:
    if value in axis.values:
        return axis.values.index(value)
    if isinstance(value, str):
        raise mismatch(where, f"one of {', '.join(axis.values)}", show(value))
    below = max((v for v in axis.values if v < value), default=min(axis.values))
    above = min((v for v in axis.values if v > value), default=max(axis.values))
    near = " or ".join(dict.fromkeys(schema.in_words(axis.name, v) for v in (below, above)))
    raise mismatch(where, f"a value of the axis, such as {near}", schema.in_words(axis.name, value))
