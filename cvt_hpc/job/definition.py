"""A validated job: its runs, with every default resolved.

`handed_to` gives the same runs to another model of the ladder, which knows fewer tables.
"""

import hashlib
import json
import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any, Self

from cvt_hpc.errors import mismatch
from cvt_hpc.job.assignments import Assignments, read_assignments, split_assignments
from cvt_hpc.job.axes import SAMPLE, SWAPPED, Axes, thinned
from cvt_hpc.job.crosscheck import check_point, complete_point
from cvt_hpc.job.design import Design, Runs
from cvt_hpc.job.formula import Formula
from cvt_hpc.job.rules import Link, Rule, follow, needed_rules, ordered_rules, overridden, places, varied_by
from cvt_hpc.job.schema import Schema, load_schema
from cvt_hpc.job.uncertain import TABLE, Scatter, with_samples
from cvt_hpc.job.units import unit_in
from cvt_hpc.job.values import Document, Point
from cvt_hpc.models.contract import load_model
from cvt_hpc.parameters import Parameters

HEADER = ("name", "model", "stepper", "description")


@dataclass(frozen=True)
class Derived:
    """A parameter whose value is derived from axes."""

    name: str  # of the parameter
    axes: tuple[str, ...]  # those along which it varies, in the job's order
    unit: str  # of the parameter, as its description
    description: str
    words: str  # the rule: a formula, or the parameter that it is linked to or given by
    evaluate: Callable[[], tuple] = field(compare=False, repr=False)  # returns `values`

    @cached_property
    def values(self) -> tuple:
        """Its values [unit] along the axes in C order; of a sampled job those of all samples.

        Computed at the first access, because for a huge grid that takes long. InputError where one
        is not legal.
        """
        return self.evaluate()


@dataclass(frozen=True)
class Job(Runs):
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
        Value by key. A key that is also an axis has the value of its table, or else the axis' first one. What
        follows from others does so here, too.
    axes : tuple of Axis
        The axes that the study varies, the last one fastest; empty for a single run.
    given : frozenset of str
        The keys that the file or an override sets, defaults excluded.
    design : dict
        The table [design], resolved; empty for the full grid of the axes.
    histories : tuple of int
        Indices of the runs whose history a sweep keeps; without effect on any number.
    rules : tuple of Rule
        Rules for derived parameters, in an order in which each finds its sources.
    units : dict
        By key the unit in which the job gives a parameter, where it names one.
    files : dict
        By key the name of each file that gives parameters; `parameters` has what stood in it.
    told : dict
        By key in words what a file has, where `parameters` has averages of that.
    """

    name: str
    model: str
    stepper: str | None
    description: str
    source: str
    parameters: Point
    axes: Axes
    given: frozenset[str] = field(default=frozenset(), compare=False)
    design: Design = field(default_factory=dict)
    histories: tuple[int, ...] = field(default=(), compare=False)
    rules: tuple[Rule, ...] = ()
    units: Mapping[str, str] = field(default_factory=dict, compare=False)
    files: Mapping[str, str] = field(default_factory=dict, compare=False)
    told: Mapping[str, str] = field(default_factory=dict, compare=False)

    def __len__(self) -> int:
        """Number of runs."""
        return self.size

    def __getstate__(self) -> dict[str, Any]:
        """Return the fields alone: declarations may hold functions that cannot travel to another process."""
        return {one.name: getattr(self, one.name) for one in fields(self)}

    @cached_property
    def schema(self) -> Schema:
        """Declarations of the model and the stepper, and of the axes of uncertain parameters."""
        schema = replace(load_schema(self.model, self.stepper, self.source), units=self.units)
        table = self._stated_rules().get(TABLE)
        return with_samples(schema, table) if table else schema

    @cached_property
    def derived(self) -> tuple[Derived, ...]:
        """The parameters that follow from axes, with their values over these."""
        varied = varied_by(self.rules, [axis.name for axis in self.axes])
        found = []
        for rule in self.rules:
            if along := varied[rule.key]:
                words = rule.parameter.unit, rule.parameter.description, rule.in_words(self.units)
                found.append(Derived(rule.key, along, *words, partial(self._values_of, rule.key, along)))
        return tuple(found)

    def _values_of(self, key: str, along: tuple[str, ...]) -> tuple:
        schema, needed = self.schema, needed_rules(self.rules, key)
        each = places(self.axes, along, sampled=self.is_sampled)
        return tuple(complete_point(schema, needed, self.parameters, place)[key] for place in each)

    def thinned(self, most: int) -> Self:
        """Return this job with runs from all over it, as many as `most` if it has more; for estimates."""
        axes = thinned(self.axes, most, sampled=self.is_sampled)
        design = self.design | ({"runs": len(axes[0].values)} if self.is_sampled else {})
        return replace(self, axes=axes, design=design, histories=())

    def complete(self, values: Parameters) -> Point:
        """Return the base scene with values [SI] of axes, and with the values derived from them."""
        return follow(self.rules, {**self.parameters, **values})

    def point(self, index: int) -> Point:
        """Return the parameters of run `index`, counted in C order over the grid, or over the samples.

        Raises
        ------
        IndexError
            If there is no such run.
        """
        if not 0 <= index < self.size:
            raise IndexError(f"run {index} of {self.size}")
        return self.complete(self.place(index))

    def with_units_of(self, at: Assignments, label: str = "at") -> Self:
        """Return this job with the units of `at`, as of `point_at`, for its parameters without a unit."""
        written = split_assignments(at, self.source, label).items()
        entries = self.schema.entries(written, f"{self.source}: {label}")
        found = {key: unit for key, entry in entries if (unit := unit_in(entry.raw))}
        return replace(self, units=found | {**self.units})

    def point_at(self, at: Assignments, label: str = "at") -> Point:
        """Return the parameters of a run at chosen values, whether they lie on the axes or not.

        Parameters
        ----------
        at : mapping, or sequence of "KEY=VALUE"
            Numbers [SI] or texts with units, by key. A parameter that follows from others has this value
            instead; a parameter that gives it otherwise, as `load_share` gives `load`, is then without value.
        label : str
            Name of `at` in an error.

        Raises
        ------
        InputError
            If a key is unknown, or a value is not legal, alone or together with the others.
        """
        schema = self.schema
        values = read_assignments(at, schema, self.source, label)
        for key in values:
            if schema.parameters[key].file is not None:
                raise mismatch(f"{self.source}: {label} {key}", "one file for all runs", "another one")
        if not self.rules and not overridden(values, schema):
            point = {**self.parameters, **values}
        else:
            point = self._derive_anew(values, schema)
        check_point(schema, point, self.source, varied=values)
        return point

    def _derive_anew(self, values: Parameters, schema: Schema) -> Point:
        """Return the base scene with other values, and with the values that are then derived.

        The values may be those of a whole run, with a parameter and its source, if these agree.
        """
        gives = {key: schema.parameters[key].gives for key in values}
        told = {by.key: key for key, by in gives.items() if by and by.key in values}
        point = self._with_rules({key: value for key, value in values.items() if key not in told}, schema)
        for key, by in told.items():
            if point[key] != values[key]:
                where = f"{self.source}: [{schema.section_of[by]}] {by}"
                raise mismatch(where, f"either {by} or {key}", "both, which do not agree")
        return point

    def _with_rules(self, values: Parameters, schema: Schema) -> Point:
        gone = {*values, *overridden(values, schema)}
        stated = [rule for rule in self.rules if not rule.is_substituted and rule.key not in gone]
        follows = {rule.key for rule in self.rules}
        scene = {key: value for key, value in self.parameters.items() if key not in gone | follows}
        given = {*scene} & {*self.given, *(axis.name for axis in self.axes)} | {*values}
        return complete_point(schema, ordered_rules(stated, given, schema, self.source), scene, values)

    def resolved(self) -> Document:
        """Return all entries that determine the numbers, as a document that `build_job` takes.

        Returns
        -------
        dict
            As a job file is laid out, in JSON types; SI units, and the text "inf" for infinity.
        """
        elsewhere = {axis.name for axis in self.axes} | {rule.key for rule in self.rules}
        tables, stated = self.tables(self.parameters, elsewhere), self._stated_rules()
        return {
            **{key: getattr(self, key) for key in HEADER},
            **{key: {**tables.get(key, {}), **stated.get(key, {})} for key in (tables | stated)},
            **({"design": self.design} if self.design else {}),
            "axes": {axis.name: [_to_json(value) for value in axis.values] for axis in self.axes},
        }

    def tables(self, point: Parameters, left_out: Collection[str] = ()) -> dict[str, Document]:
        """Return flat parameters [SI] as the tables of a job file, in JSON types."""
        return {
            section: {key: _to_json(point[key]) for key in table if key in point and key not in left_out}
            for section, table in self.schema.sections.items()
        }

    def _stated_rules(self) -> Document:
        """Return the tables [derived], [linked] and [uncertain], where there are any, in JSON types."""
        derived = {rule.key: rule.words for rule in self.rules if isinstance(rule.source, Formula)}
        linked: dict[str, Document] = {}
        for rule in self.rules:
            if isinstance(link := rule.source, Link):
                linked.setdefault(link.axis, {})[rule.key] = [_to_json(value) for value in link.values]
        scatters = (rule.source for rule in self.rules if isinstance(rule.source, Scatter))
        uncertain = next((scatter.uncertain.document() for scatter in scatters), {})
        tables = {"derived": derived, "linked": linked, TABLE: uncertain}
        return {name: table for name, table in tables.items() if table}

    def fingerprint(self) -> str:
        """Return the SHA-256 [hex] of entries that determine numbers; name and description do not count."""
        document = {key: one for key, one in self.resolved().items() if key not in ("name", "description")}
        # the order of the axes counts, that of tables does not
        return digest(document | {"axes": list(document["axes"].items())})


def digest(document: object) -> str:
    """Return the SHA-256 [hex] of a document of JSON types, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(document, sort_keys=True).encode()).hexdigest()


def _to_json(value: object) -> object:
    if isinstance(value, tuple):
        return [_to_json(item) for item in value]
    return str(value) if isinstance(value, float) and math.isinf(value) else value


def answering_model(job: Job) -> tuple[str, str] | None:
    """Return the model that answers the job's question, and the reason; None for its own model.

    Raises
    ------
    InputError
        If the runs have different questions.
    """
    answered_by = load_model(job.model).answered_by
    if any(axis.name == "question" for axis in job.axes):
        raise mismatch(f"{job.source}: [axes] question", "one question for all runs", "several")
    return answered_by.get(job.parameters.get("question", ""))


def handed_to(job: Job, model: str, why: str) -> Document:
    """Return a document of the same runs for another model, with the keys that it knows.

    The purpose `why` stands in the description and the error.

    Raises
    ------
    InputError
        If the other model does not know an axis or an uncertain parameter. A formula may still name keys that
        it does not know.
    """
    document, known = job.resolved(), load_schema(model, None, job.source).section_of
    varied = [("axes", axis.name) for axis in job.axes if axis.name not in (SAMPLE, SWAPPED)]
    for table, name in varied + [(TABLE, rule.key) for rule in job.rules if isinstance(rule.source, Scatter)]:
        if name not in known:
            where = f"{job.source}: [{table}] {name}"
            raise mismatch(where, f"a key of {model}, since {why}", "one without effect there")
    tables: dict[str, Document] = {}
    for section in filter(TABLE.__ne__, job.schema.sections):
        for key, value in document[section].items():
            if key in job.given and key in known:
                tables.setdefault(known[key], {})[key] = value  # it may belong in another table there
    derived = {key: text for key, text in document.get("derived", {}).items() if key in known}
    links = document.get("linked", {}).items()
    linked = {axis: {key: values for key, values in table.items() if key in known} for axis, table in links}
    text = f"{job.description}{'; ' if job.description else ''}{model}: {why}"
    head = {"name": job.name, "model": model, "description": text}
    rest = {key: document[key] for key in ("axes", "design", TABLE) if key in document}
    tables |= {"derived": derived, "linked": {axis: table for axis, table in linked.items() if table}}
    return head | {name: table for name, table in tables.items() if table} | rest
