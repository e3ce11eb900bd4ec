"""The class with which a run's record is declared: one `Variable` per quantity, once for all packages.

A variable carries the function that gives its value of a measured run, and `values` makes the record.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from itertools import groupby
from operator import attrgetter
from textwrap import shorten
from typing import Any, NamedTuple

import numpy as np


class Status(IntEnum):
    """End of a run; the CF flags of `status` in results.nc."""

    NOT_RUN = 0
    DONE = 1
    FAILED_NUMERICS = 2
    FAILED_ERROR = 3
    TIMED_OUT = 4


class Vibrates(IntEnum):
    """Whether a run vibrates; the CF flags of `vibrates` in results.nc.

    UNDECIDED: a longer run may decide. IRREGULAR: a longer run would not, because the amplitude comes and
    goes about the threshold without a trend. SLIPS: the load is more than friction carries.
    """

    NO = 0
    YES = 1
    UNDECIDED = 2
    SLIPS = 3
    IRREGULAR = 4


Values = dict[str, Any]  # of a record, by the names of its variables
Failure = tuple[Status, str]  # how a run ended before its time, and why; a result, if the status is done

LONGEST_REASON = 240  # bytes that a record keeps of the reason


def shortened(reason: str, longest: int = LONGEST_REASON) -> str:
    """Return a reason as `longest` bytes hold it: its first clauses, "...; and 2 more".

    Of a single clause that is too long the first words stay.
    """
    clauses, left = reason.split("; "), 0
    if told := re.fullmatch(r"and (\d+) more", clauses[-1]):
        left = int(told[1])
        clauses.pop()
    for kept in range(len(clauses), 0, -1):
        others = left + len(clauses) - kept
        text = "; ".join([*clauses[:kept], *([f"and {others} more"] if others else [])])
        if len(text.encode()) <= longest:
            return text
    return shorten(clauses[0], longest, placeholder=" ...")


@dataclass(frozen=True)
class Variable:
    """One quantity of a run's record.

    Attributes
    ----------
    name : str
        Name in the dataset.
    units : str
        CF unit ("1" if dimensionless, "" for flags and texts).
    comment : str
        CF comment: the meaning, in a sentence.
    dims : tuple of str
        Dimensions beside those of the sweep's grid, e.g. ("strand",).
    dtype : str
        numpy type: "f8", "i8", "i1", or "S240" for a text.
    flags : type of IntEnum or None
        Meaning of the values of a flag variable.
    volatile : bool
        Depends on the machine and the hour (timings): exempt from bitwise reproducibility.
    words : str
        A few words for an axis label, where `name` is not enough.
    of : callable
        Gives the value of what the model measures, a run or a state; None: not known of it. By default its
        attribute of the variable's name.
    early : bool
        Is known of a run, too, that slips through before its end.
    may_miss : bool
        May be blank, as of a ramp, in the record of a run that has reached its end.
    """

    name: str
    units: str
    comment: str
    dims: tuple[str, ...] = ()
    dtype: str = "f8"
    flags: type[IntEnum] | None = None
    volatile: bool = False
    words: str = ""
    of: Callable[[Any], Any] = field(default=None, compare=False, repr=False)  # type: ignore[assignment]
    early: bool = field(default=False, compare=False)
    may_miss: bool = field(default=False, compare=False)

    def __post_init__(self) -> None:
        if self.of is None:
            object.__setattr__(self, "of", attrgetter(self.name))

    @property
    def long_name(self) -> str:
        """CF long_name, which fits an axis label."""
        return self.words or self.name.replace("_", " ")

    @property
    def meaning(self) -> str:
        """Meaning in a line: words, comment, and the values of a flag."""
        told = f"{self.words}: {self.comment}" if self.words else self.comment
        if self.flags is None:
            return told
        return f"{told} ({', '.join(f'{flag.value} {flag.name.lower()}' for flag in self.flags)})"

    @property
    def blank(self) -> float | int | str:
        """Value where nothing is known: NaN, 0, an empty text, and UNDECIDED of flags that have it."""
        if self.flags is not None:
            return int(self.flags.__members__.get("UNDECIDED", 0))
        blanks: dict[str, float | str] = {"f": np.nan, "S": ""}
        return blanks.get(np.dtype(self.dtype).kind, 0)


def together(of: Callable[[Any], Any], *variables: Variable, **changes: Any) -> tuple[Variable, ...]:
    """Return variables whose values, in their order, one function gives."""
    return tuple(replace(variable, of=of, **changes) for variable in variables)


def values(variables: Iterable[Variable], measured: Any) -> dict[str, Any]:
    """Return values by name of what a model measures, as far as they are known."""
    found: dict[str, Any] = {}
    for of, group in groupby(variables, lambda variable: variable.of):
        names = [variable.name for variable in group]
        if (value := of(measured)) is not None:
            found |= zip(names, value if len(names) > 1 else [value], strict=True)
    return found


def flag_in_words(flag: int, attributes: Mapping[str, Any]) -> str:
    """Return the meaning of a flag by the attributes that it has in a dataset."""
    meanings = dict(zip(attributes["flag_values"], attributes["flag_meanings"].split(), strict=True))
    return str(meanings[flag])


class Outcome(NamedTuple):
    """A number, a text or a flag that a run leaves, or one for each place of a dimension.

    Attributes
    ----------
    name : str
        Its name in a dataset.
    values : array
        Of no or one dimension [SI].
    dims : tuple of str
        The dimension.
    attributes : mapping
        Units and flags, as in a dataset.
    places : array or ()
        Labels along the dimension.
    """

    name: str
    values: np.ndarray
    dims: tuple[Any, ...]
    attributes: Mapping[str, Any]
    places: np.ndarray | tuple[()]


class Coordinate(NamedTuple):
    """A dimension of the record beside the grid's.

    Attributes
    ----------
    values : array, shape (n,)
        Numbers [SI] or labels.
    units : str
        CF unit ("" for labels).
    long_name : str
        CF long_name: a few words for an axis label.
    comment : str
        CF comment.
    """

    values: np.ndarray
    units: str
    long_name: str
    comment: str = ""

    @property
    def meaning(self) -> str:
        """Meaning in a line: long name and comment."""
        return ": ".join(filter(None, (self.long_name, self.comment)))
