"""One value of a job file against the parameter that declares it: type, unit, bounds, choices.

A number without a unit that is far from usual draws a warning: rpm where rad/s is read, millimetres for
metres. Values of axes are shown in the unit in which the job gives them, by the attributes of a coordinate.
"""

import json
import math
import numbers
import re
import warnings
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

import numpy as np

from cvt_hpc.errors import UnitWarning, did_you_mean, mismatch, show, unknown
from cvt_hpc.job.units import UnitError, factor_to, from_si, to_si, unit_in
from cvt_hpc.parameters import Parameter
from cvt_hpc.storage.dataset_form import LARGEST

# Units in which people give a quantity, by the SI unit in which a bare number is read
_CUSTOMARY = {
    "Hz": ("kHz",), "N": ("kN",), "N m": ("kN m",), "N m^2": ("N mm^2",), "N/m": ("N/mm", "kN/m"),
    "N/m^2": ("N/mm^2",), "kg": ("g",), "kg m^2": ("kg mm^2",), "kg/m": ("g/m",), "m": ("mm", "um"),
    "m/s": ("mm/s",), "rad": ("deg",), "rad/s": ("rpm",), "s": ("ms", "us"),
}  # fmt: skip

_FAR = 100.0  # times the greatest sensible value: refused of a file

SEPARATE = "; decimals have a point, as 2.4, thousands have no mark, and several values are a list, as [2, 4]"
_SEPARATED = re.compile(r"\s*\[?\s*[-+]?\d[\d.]*[^,;\d]*[,;]\s*[-+]?\d")
Table = Mapping[str, Any]  # of a job file, as TOML gives it
Document = dict[str, Any]  # a whole job, or a table of it, as TOML or JSON gives it
Units = Mapping[str, str]  # by key, of parameters that the job gives in others than SI units
Point = dict[str, Any]  # the parameters of a run, flat [SI]

JOB_UNITS = "job_units"  # attribute of a coordinate, beside `units`
JOB_FILES = "job_files"  # attribute of results: by key the name of each file that gives parameters
POINT_UNITS = "point_units"  # attribute of a history: by key, beside the values `point`


def read_value(parameter: Parameter, raw: object, where: str) -> Any:
    """Check a value as it stands in a job file, and return it in SI units and in the parameter's type.

    Parameters
    ----------
    parameter : Parameter
        Declaration of the key.
    raw : object
        The value found: a number, a text with or without a unit, a bool, or a (nested) list.
    where : str
        File and key, for the error.

    Returns
    -------
    float, int, bool, str, or nested tuple of float
        The value [parameter.unit].

    Raises
    ------
    InputError
        If the value does not fit the declaration of the parameter.
    """
    readers = {tuple: _read_table, str: _read_text, bool: _read_flag, int: _read_whole, float: _read_number}
    return readers[kind_of(parameter)](parameter, raw, where)


def read_or_default(declared: Mapping[str, Parameter], table: Table, where: str) -> Point:
    """Return the values of a table by declared key, defaults included; as of `read_value`."""
    given = ((key, one, table.get(key, one.default)) for key, one in declared.items())
    return {key: read_value(one, raw, f"{where} {key}") for key, one, raw in given}


def refuse_unknown(table: Iterable[str], known: Collection[str], place: str, what: str = "key") -> None:
    """Raise InputError with the first key of a table that is not known; `place` stands before it."""
    for key in table:
        if key not in known:
            raise unknown(f"{place}{key}", what, key, known)


def as_list(array: np.ndarray, where: str, dimensions: tuple[int, ...]) -> list:
    """Return an array of floats or integers of any width as a (nested) list.

    Raises
    ------
    InputError
        If it is none of numbers, or has another number of dimensions than is legal.
    """
    if array.ndim not in dimensions or array.dtype.kind not in "iuf":
        shapes = " or ".join(f"{ndim}-D" for ndim in dimensions)
        raise mismatch(where, f"a {shapes} array of numbers", f"{show(array)} of {array.dtype}")
    return array.tolist()


def kind_of(parameter: Parameter) -> type:
    """Return the type of a parameter's values: float, int, bool, str or tuple."""
    if parameter.default is None:
        return str if parameter.choices else float
    # bool before int, its base class; numpy's scalars count as the plain types they derive from
    return next(kind for kind in (bool, int, float, str, tuple) if isinstance(parameter.default, kind))


def expectation(parameter: Parameter) -> str:
    """Return the legal values of a parameter, e.g. 'a value in N (such as "1 N" or a bare number in N)'."""
    kind = kind_of(parameter)
    if kind is str:
        return f"one of {', '.join(parameter.choices)}" if parameter.choices else "a text"
    if kind is bool:
        return "true or false"
    if kind is tuple:
        return _with_unit("a list of numbers", parameter)
    return _number_in_words(parameter)


def in_words(value: object, unit: str, wanted: str = "") -> str:
    """Return a value [unit] for people to read, e.g. "50000 N"; in another unit where one is wanted."""
    if wanted:
        value, unit = _converted(value, unit, wanted), wanted
    if isinstance(value, tuple):
        text = f"[{', '.join(in_words(item, '') for item in value)}]"
    elif isinstance(value, bool):
        text = show(value)
    else:
        text = f"{value:.10g}" if isinstance(value, float) else str(value)
    return f"{text} {unit}".rstrip()


def _converted(value: Any, unit: str, wanted: str) -> Any:
    if isinstance(value, tuple):
        return tuple(_converted(item, unit, wanted) for item in value)
    return from_si(value, unit, wanted) if isinstance(value, float) else value


def _read_number(parameter: Parameter, raw: object, where: str) -> float:
    if isinstance(raw, bool) or not isinstance(raw, (numbers.Real, str)):
        listed = isinstance(raw, (list, tuple, np.ndarray))
        hint = "; what a study varies stands in [axes]" if listed else ""
        raise mismatch(where, _number_in_words(parameter), show(raw) + hint)
    try:
        value = to_si(raw, parameter.unit) if isinstance(raw, str) else float(raw)
    except UnitError as error:
        reason = f" ({error})" if str(error) else separated(raw)
        raise mismatch(where, _number_in_words(parameter), show(raw) + reason) from None
    except OverflowError:
        value = math.inf
    if math.isnan(value) or (math.isinf(value) and not parameter.allow_infinite):
        raise mismatch(where, _with_unit("a finite value", parameter), show(raw))
    if LARGEST < abs(value) < math.inf:
        raise mismatch(where, _with_unit(f"a value of at most {LARGEST:g}", parameter), show(raw))
    _check_bounds(parameter, value, raw, where)
    return value + 0.0  # -0.0 and 0.0 are one value, and shall be one job


def separated(raw: object) -> str:
    """Return advice on a text with numbers between commas or semicolons, such as "2,4"; "" of all else."""
    if not isinstance(raw, str) or not _SEPARATED.match(raw):
        return ""
    return SEPARATE


def _check_bounds(parameter: Parameter, value: float, raw: object, where: str) -> None:
    low, high = parameter.minimum, parameter.maximum
    inside = low < value < high if parameter.exclusive else low <= value <= high
    # The bounds of an unbounded side are infinite, and an infinite value that is allowed lies on them.
    if inside or (parameter.allow_infinite and value in (low, high) and math.isinf(value)):
        return
    strict = "" if parameter.exclusive else "="
    unit = unit_in(raw) or parameter.unit
    low, high = (from_si(bound, parameter.unit, unit) for bound in (low, high))
    bounds = [f">{strict} {low:g}"] if low > -math.inf else []
    bounds += [f"<{strict} {high:g}"] if high < math.inf else []
    other = meant(raw, parameter) if value > 0.0 or parameter.minimum < 0.0 else ""
    hint = f"; did you mean {other}?" if other else ""
    raise mismatch(where, f"{' and '.join(bounds)} {unit}".rstrip(), show(raw) + hint)


def _read_whole(parameter: Parameter, raw: object, where: str) -> int:
    value = _read_number(parameter, raw, where)
    if not value.is_integer():
        raise mismatch(where, "a whole number", show(raw))
    return int(value)


def _read_text(parameter: Parameter, raw: object, where: str) -> str:
    if isinstance(raw, str) and (raw in parameter.choices or not parameter.choices):
        return raw
    near = did_you_mean(raw, parameter.choices) if isinstance(raw, str) else ""
    raise mismatch(where, expectation(parameter), show(raw) + near)


def _read_flag(parameter: Parameter, raw: object, where: str) -> bool:
    if raw in ("true", "false"):
        return raw == "true"
    if not isinstance(raw, bool):
        raise mismatch(where, expectation(parameter), show(raw))
    return raw


def _read_table(parameter: Parameter, raw: object, where: str) -> tuple:
    if isinstance(raw, np.ndarray):
        raw = as_list(raw, where, (1, 2))
    if not isinstance(raw, (list, tuple)):
        raise mismatch(where, expectation(parameter), show(raw) + separated(raw))
    rows = []
    for i, item in enumerate(raw, 1):
        read = _read_table if isinstance(item, (list, tuple)) else _read_number
        rows.append(read(parameter, item, f"{where}, item {i}"))
    return tuple(rows)


def _number_in_words(parameter: Parameter) -> str:
    unit = parameter.unit
    if kind_of(parameter) is int and not unit:
        return "a whole number"
    return f'a value in {unit} (such as "1 {unit}" or a bare number in {unit})' if unit else "a number"


def _with_unit(text: str, parameter: Parameter) -> str:
    return f"{text} in {parameter.unit}" if parameter.unit else text


def angle_in_words(value: float, unit: str) -> str:
    """Return an angle or a speed of rotation [SI] as people give it, such as "11 deg"; "" of all else."""
    wanted = {"rad": "deg", "rad/s": "rpm"}.get(unit, "")
    return f"{from_si(value, unit, wanted):.6g} {wanted}" if wanted and value else ""


def meant(raw: object, parameter: Parameter) -> str:
    """Return a number without a unit in the customary units in which it is sensible, such as '"11 deg"'.

    Several are joined by "or"; "" where there is none, or the number has a unit.
    """
    if parameter.sensible is None or _bare(raw) is None:
        return ""
    low, high = parameter.sensible
    texts = (f"{raw} {unit}" for unit in _CUSTOMARY.get(parameter.unit, ()))
    return " or ".join(f'"{text}"' for text in texts if low <= abs(to_si(text, parameter.unit)) <= high)


def warn_of_bare_numbers(parameter: Parameter, raw: object, where: str) -> None:
    """Warn of the first number without a unit that is outside the sensible range of a parameter.

    Zero and infinity mean the same in any unit. Arguments as of `read_value`; it may be a list or a range.
    """
    if parameter.sensible is None:
        return
    low, high = parameter.sensible
    for item in _items(raw):
        value = _bare(item)
        if value and math.isfinite(value) and not low <= abs(value) <= high:
            unit = parameter.unit
            other = meant(item, parameter)
            read = f"{item} is read as {item} {unit}, far from the usual {low:g} to {high:g} {unit}"
            then = f"write {other} if that is meant, or" if other else "if that is meant write"
            warnings.warn(f'{where}: {read}; {then} "{item} {unit}"', UnitWarning, stacklevel=2)
            return


def check_usual(parameter: Parameter, value: object, wanted: str, where: str) -> None:
    """Warn where the greatest of a file's values [SI] is outside the sensible range of a parameter.

    InputError where it is far above it: no machine has that. Both state it in the unit that is `wanted`.
    """
    found = [abs(one) for one in _items(value) if isinstance(one, float) and math.isfinite(one)]
    most = max(found, default=0.0)
    if not most or parameter.sensible is None:
        return
    low, high = parameter.sensible
    text = in_words(most, parameter.unit, wanted)
    least, usual, limit = (f"{from_si(one, parameter.unit, wanted):g}" for one in (low, high, _FAR * high))
    if most > _FAR * high:
        raise mismatch(where, f"at most {limit} {wanted}".rstrip() + f", {_FAR:g} times the usual", text)
    if not low <= most <= high:
        read = f"{text} is far from the usual {least} to {usual} {wanted}".rstrip()
        warnings.warn(f"{where}: {read}; check the unit of the column", UnitWarning, stacklevel=2)


def _items(raw: object) -> Iterator[object]:
    """Yield the values of a list, an array, a range or a distribution, at any depth."""
    if isinstance(raw, Mapping):
        raw = [raw.get(key) for key in ("from", "to", "mode", "mean")]
    if isinstance(raw, np.ndarray):
        raw = raw.tolist()
    if isinstance(raw, (list, tuple)):
        for item in raw:
            yield from _items(item)
    else:
        yield raw


def _bare(raw: object) -> float | None:
    """Return the value of a number without a unit, None for all else."""
    if isinstance(raw, bool) or not isinstance(raw, (numbers.Real, str)) or unit_in(raw):
        return None
    try:
        return to_si(raw, "") if isinstance(raw, str) else float(raw)
    except (UnitError, OverflowError):
        return None


def file_names(files: Mapping[str, str]) -> dict[str, str]:
    """Return the attribute of results that names the files which give parameters, if there are any."""
    return {JOB_FILES: json.dumps(dict(files))} if files else {}


def si_unit(attributes: Mapping[str, object]) -> str:
    """Return the SI unit of a coordinate with these attributes; "" for texts and plain numbers."""
    unit = str(attributes.get("units", ""))
    return "" if unit == "1" else unit


def shown_unit(attributes: Mapping[str, object]) -> str:
    """Return the unit in which a coordinate is shown: that of the job, else the SI unit."""
    unit, wanted = si_unit(attributes), str(attributes.get(JOB_UNITS, ""))
    # a dataset may be that of anybody
    return wanted if wanted and (factor_to(unit, wanted) or 0.0) > 0.0 else unit


def shown_number(value: Any, attributes: Mapping[str, object]) -> Any:
    """Return a value [SI] of a coordinate in its `shown_unit`; a text as it is."""
    return from_si(value, si_unit(attributes), shown_unit(attributes)) if isinstance(value, float) else value


def shown(value: object, attributes: Mapping[str, object]) -> str:
    """Return a value [SI] of a coordinate with its `shown_unit`, such as "3000 rpm"."""
    return in_words(value, si_unit(attributes), shown_unit(attributes))


def number_within(value: float, closest: float, attributes: Mapping[str, object]) -> str:
    """Return `shown_number` of a value [SI] with as many decimals as show differences of `closest` [SI]."""
    decimals = -math.floor(math.log10(shown_number(closest, attributes)) + 1e-9)
    return f"{shown_number(value, attributes):.{max(decimals, 0)}f}"


def shown_as_read(value: float, attributes: Mapping[str, object]) -> str:
    """Return the same for an error, with the value [SI], which may have been meant in another unit."""
    in_si = in_words(value, si_unit(attributes))
    return in_si if (text := shown(value, attributes)) == in_si else f"{text} ({in_si})"


def heading(name: str, attributes: Mapping[str, object]) -> str:
    """Return the head of a table's column of `shown_number`, such as "driving_speed [rpm]"."""
    unit = shown_unit(attributes)
    return f"{name} [{unit}]" if unit else name
