"""Texts with units ("50 kN", "3000 rpm", "20 %") to numbers in SI; pint is loaded where a text needs it.

It takes a second to load, which most jobs are spared: their texts have a prefix before the wanted unit, or
are in rpm, degrees or per cent.

`read_duration` reads time spans of the command line: "2h30m", "90 min", "1 d 12 h", or a number of seconds.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import Decimal
from functools import lru_cache
from typing import TYPE_CHECKING

from cvt_hpc.errors import mismatch, show

if TYPE_CHECKING:
    import pint

_QUANTITY = re.compile(
    r"\s*(?P<number>[+-]?(?:(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|(?:inf|nan)(?![A-Za-z])))\s*(?P<unit>.*?)\s*"
)
_TOKEN = re.compile(
    r"(?P<name>[A-Za-zµμ_]+)(?:(?:\s*(?:\^|\*\*)\s*)?(?P<power>[+-]?[1-9]))?(?!\d)|"
    r"[*/()]|1(?!\d)|\s+"
)
_TYPOGRAPHY = str.maketrans(
    {"·": "*", "²": "2", "³": "3", "⁻": "-", "¹": "1", "%": " percent ", "°": " degree "}
)
_LONGEST_UNIT = 40
_PREFIXES = {"M": 6, "k": 3, "m": -3, "u": -6, "µ": -6, "μ": -6}  # powers of ten
_PREFIXED = re.compile(r"(?:m|s|N|Hz)(?:[ /].*)?")  # a prefix belongs to the first of the units
# Of 28 digits, as decimal numbers are rounded
_PI = Decimal("3.141592653589793238462643383")
_PLAIN = {
    ("rpm", "rad/s"): lambda number: number * _PI / 30,
    ("deg", "rad"): lambda number: number * _PI / 180,
    ("%", ""): lambda number: number.scaleb(-2),
}
_MEANT = {("U/min", "rad/s"): "rpm", ("kg", "N"): "kgf"}  # by what is written of what is wanted

_PART = re.compile(r"\s*(\d+\.?\d*|\.\d+)\s*([A-Za-z]*)\s*")
_EXPECTED = 'a time above 0, such as "2h30m", "90 min" or a bare number in s'


class UnitError(ValueError):
    """A text that is not a number with a unit of the expected dimension; its text may state the reason."""


def to_si(text: str, unit: str) -> float:
    """Convert a text such as "50 kN" to a number in an SI unit.

    The conversion is decimal and rounded once, so that "75 mm" is the same number as 0.075.

    Parameters
    ----------
    text : str
        A number, with or without a unit; without one it is taken to be in `unit`.
    unit : str
        The SI unit wanted, as pint or CF writes it ("N m", "rad/s", "s m-1"); "" or "1" for dimensionless.

    Returns
    -------
    float
        The value [unit].

    Raises
    ------
    UnitError
        If the text is not a number with a unit, or the unit is of another dimension.
    """
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise UnitError
    number, given = match["number"], match["unit"]
    if not given or given == unit:
        return float(number)
    factor_free = not math.isfinite(float(number))
    magnitude = _convert(Decimal(1) if factor_free else Decimal(number), given, unit)
    return float(number) if factor_free else float(magnitude)


def from_si(value: float, unit: str, wanted: str) -> float:
    """Convert a number [unit], an SI unit, to another unit; errors as of `to_si`."""
    if wanted == unit or not math.isfinite(value):
        return value
    return float(_convert(Decimal(repr(float(value))), unit, wanted))


@lru_cache
def factor_to(given: str, unit: str) -> float | None:
    """Return what turns numbers in a given unit into those in another one; None where nothing does."""
    try:
        return from_si(1.0, given, unit)
    except UnitError:
        return None


def is_unit(text: str) -> bool:
    """Return whether a text is a unit, of whatever dimension."""
    try:
        return bool(_parse_unit(text))
    except UnitError:
        return False


def unit_in(raw: object) -> str:
    """Return the unit that a value of a job is written with, of a list, range or distribution the first one.

    Returns
    -------
    str
        As it stands there; "" where there is none.
    """
    if isinstance(raw, str):
        match = _QUANTITY.fullmatch(raw)
        return match["unit"] if match else ""
    if isinstance(raw, Mapping):
        raw = [raw.get(key) for key in ("from", "to", "step", "mode", "mean")]
    return next(filter(None, map(unit_in, raw)), "") if isinstance(raw, (list, tuple)) else ""


def _convert(number: Decimal, given: str, unit: str) -> Decimal:
    if given[1:] == unit and given[0] in _PREFIXES and _PREFIXED.fullmatch(unit):
        return number.scaleb(_PREFIXES[given[0]])
    if unit[1:] == given and unit[0] in _PREFIXES and _PREFIXED.fullmatch(given):
        return number.scaleb(-_PREFIXES[unit[0]])
    if plain := _PLAIN.get((given, unit)):
        return plain(number)
    factor, shift = _conversion(given, unit)
    return number * factor + shift


@lru_cache
def _conversion(given: str, unit: str) -> tuple[Decimal, Decimal]:
    """Factor between two units, and what a zero of the first one is in the second one."""
    if meant := _MEANT.get((given, unit)):
        raise UnitError(f"write {meant}")
    source, target = _parse_unit(given), _parse_unit(unit)
    if source.dimensionality != target.dimensionality:
        raise UnitError
    # pint counts a radian as 1, so that 50 Hz would pass for 50 rad/s.
    if "[mass]" not in source.dimensionality and _angle_power(source) != _angle_power(target):
        per_minute, hint = _parse_unit("1/minute"), ""
        if source.dimensionality == per_minute.dimensionality and not _angle_power(source):
            hint = "; write rpm" if source == per_minute else "; write turn/s if turns are meant"
        raise UnitError(f"{given} and {unit or 'a plain number'} differ by an angle{hint}")
    try:
        zero, one = (_registry().Quantity(Decimal(n), source).to(target).magnitude for n in (0, 1))
    except TypeError:  # pint's and Python's: decibels, or degrees Celsius within a product
        raise UnitError(f"{given} is no plain multiple of {unit or 1}") from None
    return one - zero, zero


def _parse_unit(text: str) -> pint.Unit:
    """Return pint's unit for a text; only names go to pint, whose own parser evaluates any expression."""
    tokens = _tokens(text.translate(_TYPOGRAPHY))
    unit = _product(tokens)
    if tokens:
        raise UnitError
    return unit


def _tokens(text: str) -> list[re.Match]:
    """Take a unit's text apart; the list is in reverse, so that the next token is popped off its end."""
    tokens, position = [], 0
    while position < len(text):
        token = _TOKEN.match(text, position)
        if token is None or len(text) > _LONGEST_UNIT:
            raise UnitError
        tokens.append(token)
        position = token.end()
    return [token for token in reversed(tokens) if not token[0].isspace()]


def _product(tokens: list[re.Match]) -> pint.Unit:
    """Consume factors joined by "*", "/" or a space, up to the end or a closing bracket."""
    unit = _registry().Unit("")
    power = 1
    while tokens and tokens[-1][0] != ")":
        if tokens[-1][0] in "*/":
            power = -1 if tokens.pop()[0] == "/" else 1
        unit *= _factor(tokens) ** power
        power = 1
    return unit


def _factor(tokens: list[re.Match]) -> pint.Unit:
    token = tokens.pop() if tokens else None
    if token is None or token[0] in "*/)":
        raise UnitError
    if token[0] == "1":
        return _registry().Unit("")
    if token[0] == "(":
        unit = _product(tokens)
        if not tokens:
            raise UnitError
        tokens.pop()
        return unit
    return _named_unit(token["name"]) ** int(token["power"] or 1)


def _named_unit(name: str) -> pint.Unit:
    import pint

    try:
        return _registry().Unit(name)
    except (pint.PintError, ValueError):  # ValueError: "NaN" is a number to pint
        raise UnitError(f"{name} is no known unit") from None


def _angle_power(unit: pint.Unit) -> float:
    return dict(_registry().get_root_units(unit)[1]._units).get("radian", 0)


@lru_cache(maxsize=1)
def _registry() -> pint.UnitRegistry:
    import pint

    registry = pint.UnitRegistry(non_int_type=Decimal, on_redefinition="ignore")
    # "120 Nm" is how everyone writes a torque; to pint Nm is a measure of yarn.
    registry.define("newton_metre = newton * metre = Nm")
    return registry


def read_duration(text: str, where: str) -> float:
    """Return a time span in seconds.

    Unlike in a job file, where m is the metre, it is the minute here.

    Parameters
    ----------
    text : str
        Numbers with units, which are added; without a unit one number [s].
    where : str
        Its name in an error.

    Raises
    ------
    InputError
        If the text is not a time span, or none above 0.
    """
    parts = _PART.findall(text)
    is_sum = not _PART.sub("", text) and (len(parts) == 1 or all(unit for _, unit in parts))
    try:
        seconds = sum(to_si(f"{number} {'min' if unit == 'm' else unit}", "s") for number, unit in parts)
    except UnitError:
        is_sum = False
    if not is_sum or seconds <= 0:
        raise mismatch(where, _EXPECTED, show(text))
    return seconds
