"""Files of courses over time: gaps, and values for which the model is not meant, each told with its row.

ASSUMPTION: a step of more than GAP times the median one is a gap, whatever the number of rows, since nobody
knows what drove the rig meanwhile. Where no value changes across it, the course rests, as between phases; in
a file that is sampled regularly it is a gap all the same (`variator/profiles.py`).

The range of a quantity is what its declaration states that users give, with room; it is above 0 but for a
load.
"""

import warnings
from collections.abc import Callable, Iterable, Sequence

import numpy as np

from cvt_hpc.errors import UnitWarning, mismatch
from cvt_hpc.job.units import from_si
from cvt_hpc.parameters import Column, Parameter
from cvt_hpc.variator.profiles import GAP

Samples = Sequence[float] | np.ndarray


def check_gaps(times: Samples, courses: Iterable[Samples], unit: str, named: Callable[[int], str]) -> None:
    """Raise InputError at the row where a gap ends, which `named` names; times [s] are told in a `unit`."""
    steps = np.diff(times)
    most = GAP * float(np.median(steps))
    changes = np.any([np.diff(values) != 0.0 for values in courses], axis=0)
    if not (is_gap := (steps > most) & changes).any():
        return
    row = int(np.argmax(is_gap)) + 1
    first, last, longest = (
        f"{from_si(float(t), 's', unit):g} {unit}" for t in (*times[row - 1 : row + 1], most)
    )
    expected = f"no step over {longest} ({GAP:g} median ones) where a value changes"
    then = "write rows between them if the course is a straight line there"
    raise mismatch(named(row), expected, f"a gap from {first} to {last}", then)


def check_range(
    key: str, parameter: Parameter, column: Column, unit: str, named: Callable[[int], str]
) -> None:
    """Raise InputError at the first row beyond the range of a quantity, and warn of one below what is usual.

    Values are told in a `unit`. A load may pass through 0: only its greatest one is compared with the usual.
    """
    low, high = parameter.sensible or (0.0, np.inf)
    size = np.abs(column.values)

    def told(value: float) -> str:
        return f"{from_si(float(value), parameter.unit, unit):.7g} {unit}"

    span = f"{from_si(low, parameter.unit, unit):.7g} to {told(high)}"
    if (beyond := np.flatnonzero(size > high)).size:
        row = int(beyond[0])
        most = told(high) + " in size" * (parameter.minimum < 0.0)
        expected = f"{key} within the range of the model, up to {most}"
        raise mismatch(named(row), expected, told(column.values[row]))
    row = int(np.argmax(size) if parameter.minimum < 0.0 else np.argmin(size))
    if 0.0 < size[row] < low:
        read = f"{key} {told(column.values[row])} is below the usual {span}"
        warnings.warn(f"{named(row)}: {read}; check the unit of the column", UnitWarning, stacklevel=4)
