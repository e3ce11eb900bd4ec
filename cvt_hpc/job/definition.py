"""A validated job: what is run, with every default resolved."""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field
from typing import Any

from cvt_hpc.job.assignments import Assignments, read_assignments
from cvt_hpc.job.axes import Axis
from cvt_hpc.job.crosscheck import check_point
from cvt_hpc.job.design import Design
from cvt_hpc.job.schema import Schema, load_schema

HEADER = ("name", "model", "stepper", "description")


@dataclass(frozen=True)
class Job:
    """A validated job: every default resolved, every value in SI units.

    Attributes
    ----------
    name, model, description : str
        From the head of the file.
    stepper : str or None
        From there, or the model's choice; None for a model without a transient.
    source : str
        The path as it was given.
    parameters : dict
        Value by key. A key that is also an axis has the value of its table, or else the axis' first one.
    axes : tuple of Axis
        What the study varies, the last axis fastest; empty for a single run.
    given : frozenset of str
        The keys that the file or an override sets, defaults excluded.
    design : dict
        The table [design], resolved; empty for the full grid of the axes.
    histories : tuple of int
        Indices of the runs whose history a sweep keeps; without effect on any number.
    """

    name: str
    model: str
    stepper: str | None
    description: str
    source: str
    parameters: dict[str, Any]
    axes: tuple[Axis, ...]
    given: frozenset[str] = field(default=frozenset(), compare=False)
    design: Design = field(default_factory=dict)
    histories: tuple[int, ...] = field(default=(), compare=False)

    @property
    def is_sampled(self) -> bool:
        """Whether the values of the axes at one place make a run, instead of all their combinations."""
        return "runs" in self.design

    @property
    def shape(self) -> tuple[int, ...]:
        """Number of values on each axis, () for a single run; the number of runs of a sampled job."""
        if self.is_sampled:
            return (self.design["runs"],)
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def size(self) -> int:
        """Number of runs; of a trace, of those that it chooses from."""
        return math.prod(self.shape)

    def __len__(self) -> int:
        """Number of runs."""
        return self.size

    @property
    def schema(self) -> Schema:
        """What the model and the stepper declare."""
        return load_schema(self.model, self.stepper, self.source)

    def point(self, index: int) -> dict[str, Any]:
        """Return the parameters of run `index`, counted in C order over the grid, or over the samples.

        Raises
        ------
        IndexError
            If there is no such run.
        """
        if not 0 <= index < self.size:
            raise IndexError(f"run {index} of {self.size}")
        if self.is_sampled:
            return {**self.parameters, **{axis.name: axis.values[index] for axis in self.axes}}
        values = {}
        for axis in reversed(self.axes):
            index, place = divmod(index, len(axis.values))
            values[axis.name] = axis.values[place]
        return {**self.parameters, **values}

    def point_at(self, at: Assignments, label: str = "at") -> dict[str, Any]:
        """Return the parameters of a run at chosen values, whether they lie on the axes or not.

        Parameters
        ----------
        at : mapping, or sequence of "KEY=VALUE"
            Numbers [SI] or texts with units, by key.
        label : str
            What to call `at` in an error.

        Raises
        ------
        InputError
            If a key is unknown, or a value is not legal, alone or together with the others.
        """
        schema = self.schema
        values = read_assignments(at, schema, self.source, label)
        point = {**self.parameters, **values}
        check_point(schema, point, self.source, varied=values)
        return point

    def resolved(self) -> dict[str, Any]:
        """Return all that determines the numbers, as a document that `build_job` takes.

        Returns
        -------
        dict
            As a job file is laid out, in JSON types; SI units, and the text "inf" for infinity.
        """
        swept = {axis.name for axis in self.axes}
        tables = {
            section: {key: _to_json(self.parameters[key]) for key in table if key not in swept}
            for section, table in self.schema.sections.items()
        }
        return {
            **{key: getattr(self, key) for key in HEADER},
            **tables,
            **({"design": self.design} if self.design else {}),
            "axes": {axis.name: [_to_json(value) for value in axis.values] for axis in self.axes},
        }

    def fingerprint(self) -> str:
        """Return the SHA-256 [hex] of what determines the numbers; name and description do not count."""
        document = self.resolved()
        del document["name"], document["description"]
        document["axes"] = list(
            document["axes"].items()
        )  # the order of the axes counts, that of tables does not
        return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def _to_json(value: Any) -> Any:
    if isinstance(value, tuple):
        return [_to_json(item) for item in value]
    return str(value) if isinstance(value, float) and math.isinf(value) else value
