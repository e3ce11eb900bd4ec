"""The content of a study, as its folder keeps it: enough to read and gather it without the model.

The coordinates of its dataset are axes, parameters that follow from them, and extra ones of the record.
"""

import math
from collections.abc import Collection, Iterable, Mapping
from dataclasses import asdict, dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Any, Self

import numpy as np

from cvt_hpc.errors import mismatch
from cvt_hpc.job import Axis, Job
from cvt_hpc.job.definition import Derived
from cvt_hpc.job.design import Design, Runs
from cvt_hpc.job.values import JOB_UNITS, Document, Table, shown
from cvt_hpc.storage.netcdf import attributes
from cvt_hpc.study.simulator import RecordValues, Simulator
from cvt_hpc.variables import Status, Variable

_HEAD = ("name", "description", "fingerprint", "job")  # the first attributes of a study, kept as they are
MOST_DERIVED = 200_000  # values of a parameter that follows from axes: these take some seconds


@dataclass(frozen=True)
class Dimension:
    """A dimension of the dataset with its coordinate: an axis of the job, or an extra one of the record."""

    name: str  # name of the dimension and of its coordinate
    values: tuple  # coordinate values in SI units, or texts
    units: str  # CF unit; "" for texts
    long_name: str  # CF long_name
    spacing: str = "linear"  # "log" for samples that are spread evenly by their logarithm
    comment: str = ""  # CF comment
    job_units: str = ""  # unit in which the job gives the values; "" where it has none

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of its coordinate in a dataset."""
        spacing = {"spacing": self.spacing} if self.spacing == "log" else {}
        job_units = {JOB_UNITS: self.job_units} if self.job_units else {}
        return attributes(self.long_name, self.units, self.comment) | spacing | job_units

    @property
    def holds_texts(self) -> bool:
        """Whether the values are texts."""
        return isinstance(self.values[0], str)

    def to_json(self) -> Document:
        """Return the dimension as JSON types; infinities, which JSON lacks, as texts."""
        values = [v if isinstance(v, str) or math.isfinite(v) else str(v) for v in self.values]
        return {**asdict(self), "values": values, "texts": self.holds_texts}

    @classmethod
    def from_json(cls, entry: Table) -> Self:
        """Return the dimension that `to_json` wrote."""
        entry = dict(entry)
        if not entry.pop("texts"):
            entry["values"] = [float(v) if isinstance(v, str) else v for v in entry["values"]]
        fields: dict[str, Any] = {key: tuple(v) if isinstance(v, list) else v for key, v in entry.items()}
        return cls(**fields)


@dataclass(frozen=True)
class DerivedCoordinate(Dimension):
    """A parameter that follows from axes: a coordinate of the runs which is no dimension.

    Its values are in C order over `dims`.
    """

    dims: tuple[str, ...] = ()  # names of the axes along which it varies, or `run`
    follows: str = ""  # how it follows, for people

    @property
    def attributes(self) -> dict[str, str]:
        """Attributes of its coordinate in a dataset: with the formula by which it follows."""
        return super().attributes | {"derived": self.follows}


def axis_dimension(axis: Axis, job: Job) -> Dimension:
    """Return the dimension of an axis of a job."""
    return Dimension(**_common(axis, job), spacing=axis.spacing)


def derived_coordinate(derived: Derived, job: Job) -> DerivedCoordinate:
    """Return the coordinate of a parameter that follows from axes; of samples it lies along `run`."""
    dims = ("run",) if "runs" in job.design else derived.axes
    return DerivedCoordinate(**_common(derived, job), dims=dims, follows=derived.words)


def _common(varied: Axis | Derived, job: Job) -> Document:
    """Return the attributes of a coordinate that each has."""
    values = tuple(np.asarray(varied.values).tolist())
    units = "" if isinstance(values[0], str) else varied.unit or "1"
    named = {"name": varied.name, "long_name": varied.name.replace("_", " "), "comment": varied.description}
    return {**named, "values": values, "units": units, "job_units": job.units.get(varied.name, "")}


@dataclass(frozen=True)
class Study(Runs):
    """A job together with the layout of its records."""

    name: str  # of the job, as the next two
    description: str
    fingerprint: str
    job: Document  # the whole resolved job, as JSON types
    # the varied values: a grid, through which run indices count in C order, or the values of all samples.
    # Empty for a single run.
    axes: tuple[Dimension, ...]
    variables: tuple[Variable, ...]  # the quantities of a record, `status` first
    coordinates: tuple[Dimension, ...]  # dimensions of the variables beside the grid
    # parameters that follow from the axes, except those with more than `MOST_DERIVED` values
    derived: tuple[DerivedCoordinate, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict)  # units in which the job gives values, by key
    files: Mapping[str, str] = field(default_factory=dict)  # names of files that give parameters, by key

    @property
    def design(self) -> Design:  # type: ignore[override]  # it stands in the job
        """The job's table [design]; empty for the full grid."""
        return self.job.get("design", {})

    @property
    def dims(self) -> tuple[str, ...]:
        """Names of the dimensions along which the runs lie: the axes, or `run` for samples."""
        return ("run",) if self.is_sampled else tuple(axis.name for axis in self.axes)

    @cached_property
    def record_dtype(self) -> np.dtype:
        """Structured type of one record."""
        return record_type(self.variables, self.coordinates)

    @property
    def record_names(self) -> tuple[str, ...]:
        """Quantities of a record, by their names in `record_dtype`."""
        return self.record_dtype.names or ()

    def place_in_words(self, index: int) -> str:
        """Return the axes' values of run `index` for people; "" without axes."""
        attributes = {axis.name: axis.attributes for axis in self.axes}
        place = self.place(index).items()
        return ", ".join(f"{name} = {shown(value, attributes[name])}" for name, value in place)

    @cached_property
    def _blank_row(self) -> np.ndarray:
        return self.blank_rows()

    @cached_property
    def _fields(self) -> dict[str, tuple[tuple[int, ...], int]]:
        """Shape of each quantity of a record, and of a text its bytes, else 0."""
        fields = {name: self.record_dtype[name] for name in self.record_names}
        return {name: (one.shape, one.itemsize * (one.kind == "S")) for name, one in fields.items()}

    def blank_rows(self, shape: int | tuple[int, ...] = ()) -> np.ndarray:
        """Return empty records of runs."""
        rows = np.zeros(shape, self.record_dtype)
        for variable in self.variables:
            rows[variable.name] = variable.blank
        return rows

    def pack(self, values: RecordValues) -> np.ndarray:
        """Return the record, shape (), of a run's result.

        Raises
        ------
        ValueError
            If a quantity is missing, unknown, or has another shape than declared, or the run says that it was
            not run.
        """
        row, fields = self._blank_row.copy(), self._fields
        if values.keys() != fields.keys():
            raise ValueError(f"a record needs {sorted(self.record_names)}, found {sorted(values)}")
        for name, value in values.items():
            shape, letters = fields[name]
            found = () if isinstance(value, float | int | str) else np.shape(value)
            if found != shape:
                raise ValueError(f"{name}: expected shape {shape}, found {found}")
            row[name] = _fit_text(value, letters) if letters else value
        if row["status"] == Status.NOT_RUN:
            raise ValueError("a run that ended has the status not_run")
        return row

    def pack_failure(self, reason: str, status: Status = Status.FAILED_ERROR) -> np.ndarray:
        """Return the record, shape (), of a run that ended without results."""
        row = self.blank_rows()
        row["status"] = status
        row["reason"] = _fit_text(reason, row.dtype["reason"].itemsize)
        return row

    def to_json(self) -> Document:
        """Return the study as JSON types."""
        return {
            **{key: getattr(self, key) for key in _HEAD},
            "axes": [axis.to_json() for axis in self.axes],
            "variables": [_variable_to_json(variable) for variable in self.variables],
            "coordinates": [dimension.to_json() for dimension in self.coordinates],
            "derived": [coordinate.to_json() for coordinate in self.derived],
            "units": dict(self.units),
            "files": dict(self.files),
        }

    @classmethod
    def from_json(cls, entry: Table) -> Self:
        """Return the study that `to_json` wrote."""
        return cls(
            **{key: entry[key] for key in _HEAD},
            axes=tuple(map(Dimension.from_json, entry["axes"])),
            variables=tuple(map(_variable_from_json, entry["variables"])),
            coordinates=tuple(map(Dimension.from_json, entry["coordinates"])),
            derived=tuple(map(DerivedCoordinate.from_json, entry.get("derived", ()))),
            units=entry.get("units", {}),
            files=entry.get("files", {}),
        )


def describe(job: Job, simulator: Simulator) -> Study:
    """Return the study of a job; errors as of `check_names`."""
    check_names(job, simulator)
    variables, coordinates = record_layout(job, simulator)
    axes = tuple(axis_dimension(axis, job) for axis in job.axes)
    few = (one for one in job.derived if _runs_along(job, one.axes) <= MOST_DERIVED)
    derived = tuple(derived_coordinate(one, job) for one in few)
    head = job.name, job.description, job.fingerprint(), job.resolved()
    return Study(*head, axes, variables, coordinates, derived, job.units, job.files)


def _runs_along(job: Job, names: Collection[str]) -> int:
    """Return the number of combinations of values on some axes of a job; of samples their number."""
    if "runs" in job.design:
        return job.design["runs"]
    return math.prod(len(axis.values) for axis in job.axes if axis.name in names)


def record_layout(job: Job, simulator: Simulator) -> tuple[tuple[Variable, ...], tuple[Dimension, ...]]:
    """Return the quantities of a record, and their dimensions beside the grid's."""
    coordinates = (
        Dimension(name, tuple(np.asarray(c.values).tolist()), c.units, c.long_name, comment=c.comment)
        for name, c in simulator.record_coordinates(job).items()
    )
    return tuple(simulator.record_variables(job)), tuple(coordinates)


def record_type(variables: Iterable[Variable], coordinates: Iterable[Dimension]) -> np.dtype:
    """Return the structured type of one record: packed, little-endian, so that logs move between machines."""
    lengths = {dimension.name: len(dimension.values) for dimension in coordinates}
    fields = [
        (v.name, np.dtype(v.dtype).newbyteorder("<"), tuple(lengths[d] for d in v.dims)) for v in variables
    ]
    return np.dtype(fields)


def check_names(job: Job, simulator: Simulator) -> None:
    """Refuse a job whose runs the dataset could not hold.

    Raises
    ------
    InputError
        If an axis, or a parameter that follows from one, has the name of a recorded quantity.
    """
    taken = {variable.name for variable in simulator.record_variables(job)}
    taken |= set(simulator.record_coordinates(job))
    varied = [("axes", axis.name) for axis in job.axes] + [("derived", one.name) for one in job.derived]
    for table, name in varied:
        if name in taken:
            expected = "a parameter that is not also the name of a recorded quantity"
            raise mismatch(f"{job.source}: [{table}] {name}", expected, name)


def _fit_text(text: str, size: int) -> bytes:
    """Return a text as one line of UTF-8 of at most `size` bytes, cut between characters."""
    return " ".join(text.split()).encode()[:size].decode(errors="ignore").encode()


def _variable_to_json(variable: Variable) -> Document:
    flags = variable.flags
    meanings = flags and {"name": flags.__name__, "members": {m.name: int(m) for m in flags}}
    entry = {**asdict(variable), "dims": list(variable.dims), "flags": meanings}
    for name in ("words", "of", "early", "may_miss"):
        del entry[name]
    return {**entry, "long_name": variable.long_name}


def _variable_from_json(entry: Table) -> Variable:
    meanings = entry["flags"]
    flags = meanings and IntEnum(meanings["name"], meanings["members"])
    entry = {**entry, "dims": tuple(entry["dims"]), "flags": flags}
    # folders of earlier versions have the sentence in the place of the name
    name = "words" if "comment" in entry else "comment"
    return Variable(**{name: entry.pop("long_name")}, **entry)
