"""The coordinates of a dataset: axes, parameters that follow from them, and extra ones of the record."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

import numpy as np

from cvt_hpc.job import Axis, Job
from cvt_hpc.job.definition import Derived
from cvt_hpc.job.shown import JOB_UNITS
from cvt_hpc.netcdf import attributes


@dataclass(frozen=True)
class Dimension:
    """A dimension of the dataset with its coordinate: an axis of the job, or an extra one of the record.

    Attributes
    ----------
    name : str
        Name of the dimension and of its coordinate.
    values : tuple
        Coordinate values in SI units, or texts.
    units : str
        CF unit; "" for texts.
    long_name : str
        CF long_name.
    spacing : str
        "log" for samples that are spread evenly by their logarithm.
    comment : str
        CF comment.
    job_units : str
        Unit in which the job gives the values; "" where it has none.
    """

    name: str
    values: tuple
    units: str
    long_name: str
    spacing: str = "linear"
    comment: str = ""
    job_units: str = ""

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of its coordinate in a dataset."""
        spacing = {"spacing": self.spacing} if self.spacing == "log" else {}
        job_units = {JOB_UNITS: self.job_units} if self.job_units else {}
        return attributes(self.long_name, self.units, self.comment) | spacing | job_units

    @property
    def holds_texts(self) -> bool:
        """Whether the values are texts."""
        return isinstance(self.values[0], str)

    def to_json(self) -> dict[str, Any]:
        """Return the dimension as JSON types; infinities, which JSON lacks, as texts."""
        values = [v if isinstance(v, str) or math.isfinite(v) else str(v) for v in self.values]
        return {**asdict(self), "values": values, "texts": self.holds_texts}

    @classmethod
    def from_json(cls, entry: Mapping[str, Any]) -> Self:
        """Return the dimension that `to_json` wrote."""
        entry = dict(entry)
        if not entry.pop("texts"):
            entry["values"] = [float(v) if isinstance(v, str) else v for v in entry["values"]]
        fields: dict[str, Any] = {
            key: tuple(value) if isinstance(value, list) else value for key, value in entry.items()
        }
        return cls(**fields)


@dataclass(frozen=True)
class DerivedCoordinate(Dimension):
    """A parameter that follows from axes: a coordinate of the runs which is no dimension.

    Attributes
    ----------
    name, units, long_name
        As of a dimension.
    values : tuple
        In C order over `dims`.
    dims : tuple of str
        Names of the axes along which it varies, or `run`.
    follows : str
        How it follows, for people.
    """

    dims: tuple[str, ...] = ()
    follows: str = ""

    @property
    def attributes(self) -> dict[str, Any]:
        """Attributes of its coordinate in a dataset: with the formula by which it follows."""
        return super().attributes | {"derived": self.follows}


def axis_dimension(axis: Axis, job: Job) -> Dimension:
    """Return the dimension of an axis of a job."""
    values, units = _values_and_units(axis)
    return Dimension(axis.name, values, units, spacing=axis.spacing, **_named(axis, job))


def derived_coordinate(derived: Derived, job: Job) -> DerivedCoordinate:
    """Return the coordinate of a parameter that follows from axes; of samples it lies along `run`."""
    dims = ("run",) if "runs" in job.design else derived.axes
    values, units = _values_and_units(derived)
    named = _named(derived, job)
    return DerivedCoordinate(derived.name, values, units, **named, dims=dims, follows=derived.words)


def _named(varied: Axis | Derived, job: Job) -> dict[str, str]:
    """Return the label of a coordinate for people."""
    named = {"long_name": _in_words(varied.name), "comment": varied.description}
    return named | {"job_units": job.units.get(varied.name, "")}


def _in_words(name: str) -> str:
    return name.replace("_", " ")


def _values_and_units(varied: Axis | Derived) -> tuple[tuple, str]:
    """Return the values and their CF unit."""
    values = tuple(np.asarray(varied.values).tolist())
    return values, "" if isinstance(values[0], str) else varied.unit or "1"
