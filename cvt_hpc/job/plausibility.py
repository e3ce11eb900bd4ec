"""Numbers without a unit that are far from usual: rpm where rad/s is read, millimetres for metres."""

import math
import numbers
import warnings
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from cvt_hpc.errors import UnitWarning
from cvt_hpc.job.units import UnitError, from_si, to_si, unit_in
from cvt_hpc.parameters import Parameter

# Units in which people give a quantity, by the SI unit in which a bare number is read
_CUSTOMARY = {
    "Hz": ("kHz",),
    "N": ("kN",),
    "N m": ("kN m",),
    "N m^2": ("N mm^2",),
    "N/m": ("N/mm", "kN/m"),
    "N/m^2": ("N/mm^2",),
    "kg": ("g",),
    "kg m^2": ("kg mm^2",),
    "kg/m": ("g/m",),
    "m": ("mm", "um"),
    "m/s": ("mm/s",),
    "rad": ("deg",),
    "rad/s": ("rpm",),
    "s": ("ms", "us"),
}


def angle_in_words(value: Any, unit: str) -> str:
    """Return an angle or a speed of rotation [SI] as people give it, such as "11 deg"; "" of all else."""
    wanted = {"rad": "deg", "rad/s": "rpm"}.get(unit, "")
    return f"{from_si(value, unit, wanted):.6g} {wanted}" if wanted and value else ""


def meant(raw: Any, parameter: Parameter) -> str:
    """Return a number without a unit in the customary units in which it is sensible, such as '"11 deg"'.

    Several are joined by "or"; "" where there is none, or the number has a unit.
    """
    if parameter.sensible is None or _bare(raw) is None:
        return ""
    low, high = parameter.sensible
    texts = (f"{raw} {unit}" for unit in _CUSTOMARY.get(parameter.unit, ()))
    return " or ".join(f'"{text}"' for text in texts if low <= abs(to_si(text, parameter.unit)) <= high)


def warn_of_bare_numbers(parameter: Parameter, raw: Any, where: str) -> None:
    """Warn of the first number without a unit that is outside the sensible range of a parameter.

    Zero and infinity mean the same in any unit.

    Parameters
    ----------
    parameter : Parameter
        Declaration of the key.
    raw : Any
        The value, list, array or range found.
    where : str
        File and key.
    """
    if parameter.sensible is None:
        return
    low, high = parameter.sensible
    for item in _items(raw):
        value = _bare(item)
        if value and math.isfinite(value) and not low <= abs(value) <= high:
            unit = parameter.unit
            other = meant(item, parameter)
            text = (
                f"{where}: {item} is read as {item} {unit}, far from the usual {low:g} to {high:g} {unit}; "
            )
            text += f"write {other} if that is meant, or " if other else "if that is meant write "
            warnings.warn(f'{text}"{item} {unit}"', UnitWarning, stacklevel=2)
            return


def _items(raw: Any) -> Iterator[Any]:
    """Yield the values of a list, an array or a range, at any depth."""
    if isinstance(raw, Mapping):
        raw = [raw.get("from"), raw.get("to")]
    if isinstance(raw, np.ndarray):
        raw = raw.tolist()
    if isinstance(raw, (list, tuple)):
        for item in raw:
            yield from _items(item)
    else:
        yield raw


def _bare(raw: Any) -> float | None:
    """Return the value of a number without a unit, None for all else."""
    if isinstance(raw, bool) or not isinstance(raw, (numbers.Real, str)) or unit_in(raw):
        return None
    try:
        return to_si(raw, "") if isinstance(raw, str) else float(raw)
    except (UnitError, OverflowError):
        return None
