"""The axes of a sweep: lists and ranges of a job file to the very values that runs evaluate."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from decimal import Decimal
from typing import Any

import numpy as np

from cvt_hpc.errors import InputError, mismatch, show
from cvt_hpc.job.values import Table, as_list, kind_of, read_value, refuse_unknown, separated
from cvt_hpc.parameters import Parameter

LARGEST_AXIS = 100_000
SAMPLE = "sample"  # axis along which uncertain parameters take their values
SWAPPED = "swapped"  # axis of those that take them from a second set of samples, for Sobol indices
NONE, ALL = "none", "all"  # on it, beside the names of uncertain parameters
CORRELATED = "correlated"  # the correlated ones among them, together
_RANGE_KEYS = ("from", "to", "count", "step", "spacing")
_SPACING = Parameter("linear", "", "of the values of a range", choices=("linear", "log"))
_STEP_TOLERANCE = Decimal("1e-9")
_ROUNDING = 4  # units in the last place, after some additions
_COUNT = Parameter(2, "", "values of a range", minimum=2, maximum=LARGEST_AXIS)
_FORMS = "a list [v1, v2, ...] or a range {from=, to=, count=} or {from=, to=, step=}"


@dataclass(frozen=True)
class Axis:
    """A parameter that a study varies.

    Attributes
    ----------
    name : str
        Name of the parameter.
    values : tuple
        Its values in the job's order: numbers [unit], or texts.
    unit : str
        SI unit; "" for dimensionless numbers and texts.
    description : str
        Of the parameter.
    spacing : str
        Of samples: whether they are spread evenly ("linear") or by their logarithm ("log"), for pictures.
    """

    name: str
    values: tuple
    unit: str
    description: str
    spacing: str = field(default="linear", compare=False)


Axes = tuple[Axis, ...]


def thinned(axes: Axes, most: int, *, sampled: bool = False) -> Axes:
    """Return axes of fewer values, spread over those given, the first and the last among them.

    Parameters
    ----------
    axes : tuple of Axis
        A grid; of samples the values at one place belong together, and stay so.
    most : int
        Number of combinations that are to be left, or of samples. Two values of each axis stay, and all
        texts.
    sampled : bool
        Whether they are samples.
    """
    if sampled:
        return tuple(_spread(axis, most) for axis in axes)
    texts = {axis.name: len(axis.values) for axis in axes if isinstance(axis.values[0], str)}
    sizes = sorted(len(axis.values) for axis in axes if axis.name not in texts)
    left, longest = most / math.prod(texts.values()), math.inf
    for place, size in enumerate(sizes):
        share = left ** (1.0 / (len(sizes) - place))
        if size > share:
            longest = max(int(share), 2)
            break
        left /= size  # short axes stay as they are, and leave the more to long ones
    return tuple(axis if axis.name in texts else _spread(axis, longest) for axis in axes)


def _spread(axis: Axis, most: float) -> Axis:
    size = len(axis.values)
    if size <= most:
        return axis
    count = int(most)
    return replace(axis, values=tuple(axis.values[k * (size - 1) // (count - 1)] for k in range(count)))


def read_axis(name: str, parameter: Parameter, raw: object, where: str) -> Axis:
    """Check the axis of a parameter as it stands in a job file, and return it with its values.

    Parameters
    ----------
    name, parameter, where
        The key and its declaration, and file and key for the error.
    raw : object
        A list of values, a 1-D array of numbers, or a table with from, to and either count (and spacing) or
        step.

    Returns
    -------
    Axis
        With distinct values, each one legal for the parameter; 0.3 where 0.1 + 0.2 was given.

    Raises
    ------
    InputError
        If the list or the range is not legal.
    """
    read = tuple(map(without_rounding, read_values(parameter, raw, where)))
    _check_distinct(read, raw, where)
    return Axis(name, read, parameter.unit, parameter.description)


def without_rounding(value: Any) -> Any:
    """Return a number, or that of nine digits which it is but for rounding: 0.3 for 0.1 + 0.2."""
    if not isinstance(value, float) or not math.isfinite(value):
        return value
    short = float(f"{value:.9g}")
    return short if abs(short - value) <= _ROUNDING * math.ulp(value) else value


def is_axis(raw: object) -> bool:
    """Whether a value has the form of an axis: a list, an array or a range."""
    return isinstance(raw, (list, tuple, dict, np.ndarray))


def read_values(parameter: Parameter, raw: object, where: str) -> tuple:
    """Return the values [parameter.unit] of a list or a range; arguments and errors as of `read_axis`."""
    if kind_of(parameter) is tuple:
        raise mismatch(where, "a parameter with a single value", "one that takes a list")
    if parameter.file is not None:
        raise mismatch(where, "one file for all runs", "an axis of files")
    if isinstance(raw, dict):
        values: Sequence[object] = _read_range(parameter, raw, where)
    elif isinstance(raw, np.ndarray):
        values = as_list(raw, where, (1,))
    elif isinstance(raw, (list, tuple)):
        values = raw
    else:
        raise mismatch(where, _FORMS, show(raw) + separated(raw))
    if not values:
        raise mismatch(where, "at least one value", show(raw))
    if len(values) > LARGEST_AXIS:
        raise mismatch(where, f"at most {LARGEST_AXIS} values", f"{len(values)}")
    return tuple(read_value(parameter, value, f"{where}, value {i}") for i, value in enumerate(values, 1))


def _check_distinct(read: tuple, raw: Any, where: str) -> None:
    values = read if isinstance(raw, dict) else raw
    first: dict[object, int] = {}
    for i, value in enumerate(read):
        if (before := first.setdefault(value, i)) < i:
            found = f"{show(values[i])} as value {before + 1} and value {i + 1}"
            raise mismatch(where, "distinct values", found)


def _read_range(parameter: Parameter, raw: Table, where: str) -> tuple[float, ...]:
    refuse_unknown(raw, _RANGE_KEYS, f"{where}.")
    if kind_of(parameter) not in (int, float):
        raise mismatch(where, "a list of values, because the parameter is not a number", "a range")
    start, stop = read_bounds(parameter, raw, where)
    if ("count" in raw) == ("step" in raw):
        raise mismatch(where, "a range with either count or step", "both" if "step" in raw else "neither")
    if "step" in raw:
        return _stepped(start, stop, _read_step(parameter, raw, where), raw, where)
    return _counted(start, stop, raw, where)


def read_bounds(parameter: Parameter, raw: Table, where: str) -> tuple[float, float]:
    """Return `from` and `to` [parameter.unit] of a range; an infinite one is refused."""
    for key, which in (("from", "first"), ("to", "last")):
        if key not in raw:
            raise mismatch(f"{where}.{key}", f"the {which} value", "nothing")
    finite = replace(parameter, allow_infinite=False)
    start, stop = (read_value(finite, raw[key], f"{where}.{key}") for key in ("from", "to"))
    return start, stop


def read_spacing(raw: Table, start: float, stop: float, where: str) -> str:
    """Return the spacing of a range from `start` to `stop`: "linear", or "log" if that can be."""
    spacing = read_value(_SPACING, raw.get("spacing", "linear"), f"{where}.spacing")
    if start == stop:
        raise mismatch(where, "a range with from and to apart", f"{show(raw['from'])} for both")
    if spacing == "log" and (start <= 0 or stop <= 0):
        found = f"{show(raw['from'])} and {show(raw['to'])}"
        raise mismatch(where, "from > 0 and to > 0 for log spacing", found)
    return spacing


def _read_step(parameter: Parameter, raw: Table, where: str) -> float:
    if "spacing" in raw:
        raise InputError(f"{where}.spacing: expected to stand with count, found with step")
    # A step has the parameter's unit, but not its bounds.
    free = Parameter(kind_of(parameter)(0), parameter.unit, "")
    step = read_value(free, raw["step"], f"{where}.step")
    if step == 0:
        raise mismatch(f"{where}.step", "a step other than 0", show(raw["step"]))
    return step


def _counted(start: float, stop: float, raw: Table, where: str) -> tuple[float, ...]:
    """Return `count` values; in decimal, so that a third step of 0.1 is 0.3 and can be selected as 0.3."""
    count = read_value(_COUNT, raw["count"], f"{where}.count")
    spacing = read_spacing(raw, start, stop, where)
    first, last = _decimal(start), _decimal(stop)
    shares = [Decimal(i) / (count - 1) for i in range(1, count - 1)]
    if spacing == "linear":
        between = (first + (last - first) * share for share in shares)
    else:
        between = (first * (last / first) ** share for share in shares)
    return (start, *map(float, between), stop)


def _stepped(start: float, stop: float, step: float, raw: Table, where: str) -> tuple[float, ...]:
    """Return values from `start` to `stop` by `step`; errors quote `raw`, in the units of the job."""
    first, last, stride = _decimal(start), _decimal(stop), _decimal(step)
    steps, along = (last - first) / stride, f"from {show(raw['from'])} to {show(raw['to'])}"
    if steps < 0:
        sign = "above" if last > first else "below"
        raise mismatch(f"{where}.step", f"a step {sign} 0, {along}", show(raw["step"]))
    count = round(steps)
    if count < 1 or abs(steps - count) > _STEP_TOLERANCE:
        expected = f"a step that leads {along} in whole steps"
        raise mismatch(f"{where}.step", expected, f"{show(raw['step'])}, which takes {steps:.6g} steps")
    if count >= LARGEST_AXIS:
        raise mismatch(where, f"at most {LARGEST_AXIS} values", f"about {steps:.0e}")
    return (start, *(float(first + i * stride) for i in range(1, count)), stop)


def _decimal(value: float) -> Decimal:
    return Decimal(repr(float(value)))
