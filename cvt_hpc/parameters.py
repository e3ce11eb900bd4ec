"""The classes with which models and steppers declare the parameters that a job file may set."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

Range = tuple[float, float]
Parameters = Mapping[str, Any]  # flat, of one run [SI]
Problem = tuple[str, str, str]  # between parameters: key, expected, found


@dataclass(frozen=True)
class Substitute:
    """Rule by which a parameter follows from another one that a job gives instead.

    Attributes
    ----------
    key : str
        The parameter that is derived.
    needs : tuple of str
        Parameters that decide its value; a model may know only some of them.
    value : callable
        Flat values [SI] -> the value [SI]. It raises ValueError where there is none; the text states the
        value expected of the parameter that the job gives.
    """

    key: str
    needs: tuple[str, ...]
    value: Callable[[Mapping[str, Any]], float]


class RowError(ValueError):
    """An error in one row of a file.

    Parameters
    ----------
    row : int
        Counted from 0, without the header.
    expected, found : str
        The expected content, and the content that was found.
    """

    def __init__(self, row: int, expected: str, found: str) -> None:
        super().__init__(f"expected {expected}, found {found}")
        self.row, self.expected, self.found = row, expected, found


@dataclass(frozen=True)
class Column:
    """A column of a file: values [unit], where `unit` is the SI unit of the file's own one."""

    unit: str
    values: tuple[float, ...]


@dataclass(frozen=True)
class FromFile:
    """Rule by which a CSV or netCDF file gives other parameters.

    Attributes
    ----------
    columns : mapping
        By name the SI units that a column may have; "" for dimensionless numbers.
    required : tuple of str
        Columns that have to be there.
    gives : tuple of str
        The parameters.
    arrange : callable
        Column by name -> raw value by parameter. It raises RowError for a row, ValueError else.
    other_names : mapping
        Further names of columns in CSV files, in lower case with _ between words, and the columns.
    """

    columns: Mapping[str, tuple[str, ...]]
    required: tuple[str, ...]
    gives: tuple[str, ...]
    arrange: Callable[[Mapping[str, Column]], dict[str, Any]]
    other_names: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Parameter:
    """One quantity that a job file may set.

    Attributes
    ----------
    default : Any
        Value in SI units; None where a job must give it, or may (see `gives`). Its type is the parameter's
        type: float, int, bool, str, or a (nested) tuple of floats for tables.
    unit : str
        SI unit as pint reads it ("N m", "rad/s"); "" for dimensionless numbers and texts.
    description : str
        One line, field-standard term first; shown by `cvt-hpc check`.
    minimum, maximum : float
        Bounds, inclusive unless `exclusive` is set.
    exclusive : bool
        The bounds themselves are refused (a mass must be positive, not zero).
    allow_infinite : bool
        `inf` is a legal value (rigid sheaves).
    choices : tuple of str
        The legal texts of a str parameter.
    gives : Substitute or None
        Another parameter that is derived if the job gives this one instead; a job that gives both is refused.
        Runs know it only where the other one follows from it: where the job gives it, or where the job gives
        neither and this one has a default.
    sensible : tuple of float or None
        Smallest and largest magnitude [unit] that users give, with room: a number without a unit beyond them,
        other than 0, draws a warning that it may be in another unit. Every parameter with a unit has them.
    file : FromFile or None
        For a text that is the path of a file: the parameters that the file gives. Runs do not know such a
        parameter.
    """

    default: Any
    unit: str
    description: str
    minimum: float = float("-inf")
    maximum: float = float("inf")
    exclusive: bool = False
    allow_infinite: bool = False
    choices: tuple[str, ...] = ()
    gives: Substitute | None = None
    sensible: tuple[float, float] | None = None
    file: FromFile | None = None


def positive(
    default: Any, unit: str, description: str, sensible: Range | None = None, **further: Any
) -> Parameter:
    """Return a number above 0; `further` are other attributes of the `Parameter`."""
    further |= {"minimum": 0.0, "exclusive": True, "sensible": sensible}
    return Parameter(default, unit, description, **further)


def not_negative(
    default: Any, unit: str, description: str, sensible: Range | None = None, **further: Any
) -> Parameter:
    """Return a number of 0 or more; `further` as of `positive`."""
    return Parameter(default, unit, description, minimum=0.0, sensible=sensible, **further)
