"""Rules by which the value of one parameter follows from others, point by point.

The tables [derived], [linked.AXIS] and [uncertain] of a job and substitutes give the rules. [derived] has
formulas, [linked.AXIS] the parameters that follow an axis value by value, [uncertain] those that follow the
number of a sample. Substitutes are the model's: `belt_length` gives `driven_radius`, and `step_error` gives
`step` where the job gives neither. Each rule comes after the rules that give its sources.
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from graphlib import CycleError, TopologicalSorter
from itertools import product
from typing import Any

from cvt_hpc.errors import few_of, mismatch, show, unknown
from cvt_hpc.job.axes import Axis, read_values
from cvt_hpc.job.formula import Formula, read_formula
from cvt_hpc.job.schema import Schema
from cvt_hpc.job.uncertain import Scatter
from cvt_hpc.job.values import Point, Table, in_words, kind_of, read_value
from cvt_hpc.parameters import Parameter, Parameters, Substitute

_MOST_NAMED = 8


@dataclass(frozen=True)
class Link:
    """Values that follow those of an axis, or of a former axis, place by place."""

    axis: str
    at: tuple
    values: tuple
    unit: str  # of the axis
    wanted: str = field(default="", compare=False)  # its unit in the job

    @property
    def names(self) -> tuple[str, ...]:
        """The axis."""
        return (self.axis,)

    @property
    def text(self) -> str:
        """State how the values follow, for people."""
        return f"linked to {self.axis}"

    def value(self, parameters: Parameters) -> Any:
        """Return the value that belongs to the axis' value; ValueError if that one is not on the axis."""
        place = parameters[self.axis]
        if place not in self.at:
            known = few_of([in_words(value, self.unit, self.wanted) for value in self.at], _MOST_NAMED)
            raise ValueError(f"a value of {self.axis} that it is linked to ({known})")
        return self.values[self.at.index(place)]


@dataclass(frozen=True)
class Substituted:
    """A value that follows from a parameter given in its place."""

    by: str
    names: tuple[str, ...]
    unit: str  # of `by`
    substitute: Substitute = field(compare=False, repr=False)
    wanted: str = field(default="", compare=False)  # its unit in the job

    @property
    def text(self) -> str:
        """State how the value follows, for people."""
        return f"by {self.by}"

    def value(self, parameters: Parameters) -> float:
        """Return the value [SI]."""
        return self.substitute.value(parameters)


@dataclass(frozen=True)
class Rule:
    """Rule by which the value of one parameter follows from others."""

    key: str  # of the parameter
    source: Formula | Link | Scatter | Substituted  # what gives its value
    where: str = field(compare=False)  # file and key, for errors
    parameter: Parameter = field(compare=False, repr=False)  # declaration of the key

    @property
    def needs(self) -> tuple[str, ...]:
        """The parameters that it follows from."""
        return self.source.names

    @property
    def words(self) -> str:
        """State how it follows, for people."""
        return self.in_words({})

    def in_words(self, units: Mapping[str, str]) -> str:
        """State how it follows, with values in the units of a job, by key, where it names one."""
        if isinstance(self.source, Scatter):
            return self.source.in_words(self.parameter.unit, units.get(self.key, ""))
        return self.source.text

    @property
    def is_substituted(self) -> bool:
        """Whether it is the model's, and stands in no table of the job."""
        return isinstance(self.source, Substituted)

    def read(self, parameters: Parameters) -> set[str]:
        """Return the parameters that its value follows from at flat parameters [SI], where it has one."""
        noted = Noted(parameters)
        self.source.value(noted)
        return noted.read

    def value(self, parameters: Parameters) -> Any:
        """Return the value [SI] at flat parameters [SI].

        Raises
        ------
        InputError
            If there is none, or it is not legal.
        """
        try:
            raw = self.source.value(parameters)
        except ValueError as error:
            if not isinstance(self.source, (Link, Substituted)):
                raise mismatch(self.where, "a finite value", f"{show(self.words)} ({error})") from None
            blamed, unit, wanted = self.source.names[0], self.source.unit, self.source.wanted
            raise mismatch(self.where, str(error), in_words(parameters[blamed], unit, wanted)) from None
        return read_value(self.parameter, raw, self.where)


class Noted(Mapping[str, Any]):
    """Flat parameters that note which of them were read, and evaluate those of `later` at that time."""

    def __init__(self, known: Parameters, later: Mapping[str, Callable[[], Any]] | None = None) -> None:
        self._known, self._later = dict(known), later or {}
        self.read: set[str] = set()

    def __getitem__(self, key: str) -> Any:
        if key in self._later and key not in self.read:
            self._known[key] = self._later[key]()
        self.read.add(key)
        return self._known[key]

    def __iter__(self) -> Iterator[str]:
        return iter({**self._known, **self._later})

    def __len__(self) -> int:
        return len({**self._known, **self._later})


def follow(rules: Iterable[Rule], parameters: Parameters) -> Point:
    """Return flat parameters [SI] with those derived from them.

    Raises
    ------
    InputError
        If one of these has no value, or none that is legal.
    """
    values = dict(parameters)
    for rule in rules:
        values[rule.key] = rule.value(values)
    return values


def varied_by(rules: Iterable[Rule], axes: Collection[str]) -> dict[str, tuple[str, ...]]:
    """Return for each key of a rule the axes along which its value varies, in the order of the axes."""
    found: dict[str, tuple[str, ...]] = {}
    for rule in rules:
        along = {axis for need in rule.needs for axis in found.get(need, (need,))}
        found[rule.key] = tuple(axis for axis in axes if axis in along)
    return found


def places(axes: Iterable[Axis], names: Collection[str], *, sampled: bool = False) -> Iterator[Point]:
    """Yield the values on some axes, by name: their combinations in C order, or the values of each sample."""
    along = {axis.name: axis.values for axis in axes if axis.name in names}
    for values in zip(*along.values(), strict=True) if sampled else product(*along.values()):
        yield dict(zip(along, values, strict=True))


def needed_rules(rules: Iterable[Rule], key: str) -> list[Rule]:
    """Return the rules on which the value of a key rests, its own last."""
    kept: list[Rule] = []
    wanted = {key}
    for rule in reversed(list(rules)):
        if rule.key in wanted:
            kept.insert(0, rule)
            wanted |= set(rule.needs)
    return kept


def read_derived(table: Table, schema: Schema, source: str) -> list[Rule]:
    """Return the rules of a job file's table [derived].

    Raises
    ------
    InputError
        If a key is unknown, no number, or has no legal formula.
    """
    rules = []
    for key, (parameter, raw, where) in schema.entries(schema.flatten(table), f"{source}: [derived]"):
        if kind_of(parameter) not in (int, float):
            raise mismatch(where, "a parameter that is a number", key)
        formula = read_formula(raw, schema.parameters, where)
        # a formula gives SI values: none is a number that may be meant in another unit
        rules.append(Rule(key, formula, where, replace(parameter, sensible=None)))
    return rules


def read_linked(tables: Table, axes: Iterable[Axis], schema: Schema, source: str) -> list[Rule]:
    """Return the rules of a job file's tables [linked.AXIS], where `axes` are the grid as the file gives it.

    Raises
    ------
    InputError
        If an axis or a key is unknown, or there are more or fewer values.
    """
    known = {axis.name: axis for axis in axes}
    rules = []
    for axis_name, table in tables.items():
        where = f"{source}: [linked.{axis_name}]"
        if not isinstance(table, Mapping):
            raise mismatch(f"{source}: [linked] {axis_name}", f"a table [linked.{axis_name}]", show(table))
        if axis_name not in known:
            raise unknown(where, "axis", axis_name, known)
        at, axis, wanted = known[axis_name].values, known[axis_name], schema.units.get(axis_name, "")
        for key, entry in schema.entries(table.items(), where):
            values = read_values(*entry)
            if len(values) != len(at):
                expected = f"{len(at)} values, one for each of {axis_name}"
                raise mismatch(entry.where, expected, str(len(values)))
            link = Link(axis_name, at, values, axis.unit, wanted)
            rules.append(Rule(key, link, entry.where, entry.parameter))
    return rules


def relinked(rules: Iterable[Rule], axes: Iterable[Axis]) -> list[Rule]:
    """Return rules whose links follow the values that overrides have left of their axes.

    Raises
    ------
    InputError
        If an axis has a value for which a link has none.
    """
    left = {axis.name: axis.values for axis in axes}
    found = []
    for rule in rules:
        if isinstance(link := rule.source, Link) and link.axis in left:
            at = left[link.axis]
            values = tuple(rule.value({link.axis: value}) for value in at)
            rule = replace(rule, source=replace(link, at=at, values=values))
        found.append(rule)
    return found


def overridden(keys: Collection[str], schema: Schema) -> set[str]:
    """Return the keys that these keys disable: the parameters that they give, and their other sources."""
    given = {gives.key for key in keys if (gives := schema.parameters[key].gives)}
    return given | {key for key, p in schema.parameters.items() if p.gives and p.gives.key in keys}


def ordered_rules(rules: Iterable[Rule], given: Collection[str], schema: Schema, source: str) -> list[Rule]:
    """Return the rules of a job, substitutes included, in an order in which each finds its sources.

    Parameters
    ----------
    rules, schema, source
        Those of its tables, what it declares, and its file, for the error.
    given : collection of str
        The keys that have a value of their own, or several on an axis; defaults excluded.

    Raises
    ------
    InputError
        If a parameter is given twice, or a rule needs one that has no value, or rules run in a circle.
    """
    found: dict[str, Rule] = {}
    for rule in rules:
        if rule.key in given or rule.key in found:
            raise mismatch(rule.where, "one source of its values", f"a second one of {rule.key}")
        found[rule.key] = rule
    found |= _substituted({*given, *found}, schema, source)
    known = {*given, *found, *(rule.needs[0] for rule in found.values() if rule.is_substituted)}
    for rule in found.values():
        for need in rule.needs:
            if need not in known and schema.parameters[need].gives is not None:
                raise mismatch(rule.where, "parameters that the job gives", f"{need}, which it does not")
    # in the order of declaration where they are free of each other: a job's rules do not depend on its layout
    needs = {key: found[key].needs for key in schema.parameters if key in found}
    try:
        return [found[key] for key in TopologicalSorter(needs).static_order() if key in found]
    except CycleError as error:
        circle = error.args[1]
        rule = next(found[key] for key in circle if not isinstance(found[key].source, Substituted))
        raise mismatch(rule.where, "formulas without a circle", " -> ".join(circle)) from None


def _substituted(known: set[str], schema: Schema, source: str) -> dict[str, Rule]:
    rules: dict[str, Rule] = {}
    for key, parameter in schema.parameters.items():
        substitute = parameter.gives
        if substitute is None or (key not in known and parameter.default is None):
            continue
        target = substitute.key
        is_taken = target in known or target in rules
        where = f"{source}: [{schema.section_of[key]}] {key}"
        if key in known and is_taken:
            raise mismatch(where, f"either {key} or {target}", "both")
        if not is_taken:
            names = (key, *(need for need in substitute.needs if need in schema.parameters and need != key))
            gives = Substituted(key, names, parameter.unit, substitute, schema.units.get(key, ""))
            rules[target] = Rule(target, gives, where, schema.parameters[target])
    return rules
