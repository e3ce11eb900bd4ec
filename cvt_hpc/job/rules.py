"""Rules by which the value of one parameter follows from others, point by point."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any

from cvt_hpc.errors import few_of, mismatch, show
from cvt_hpc.job.axes import Axis
from cvt_hpc.job.formula import Formula
from cvt_hpc.job.values import in_words, read_value
from cvt_hpc.parameters import Parameter, Substitute

_MOST_NAMED = 8


@dataclass(frozen=True)
class Rule:
    """How the value of one parameter follows from others.

    Attributes
    ----------
    key : str
        The parameter.
    source : Formula, Link or Substituted
        The formula, function or list that gives its value.
    where : str
        File and key, for errors.
    parameter : Parameter
        Declaration of the key.
    """

    key: str
    source: Formula | Link | Substituted
    where: str = field(compare=False)
    parameter: Parameter = field(compare=False, repr=False)

    @property
    def needs(self) -> tuple[str, ...]:
        """The parameters that it follows from."""
        return self.source.names

    @property
    def words(self) -> str:
        """How it follows, for people."""
        return self.source.text

    @property
    def is_substituted(self) -> bool:
        """Whether it is the model's, and stands in no table of the job."""
        return isinstance(self.source, Substituted)

    def read(self, parameters: Mapping[str, Any]) -> set[str]:
        """Return the parameters that its value follows from at flat parameters [SI], where it has one."""
        noted = Noted(parameters)
        self.source.value(noted)
        return noted.read

    def value(self, parameters: Mapping[str, Any]) -> Any:
        """Return the value [SI] at flat parameters [SI].

        Raises
        ------
        InputError
            If there is none, or it is not legal.
        """
        return read_value(self.parameter, self._raw(parameters), self.where)

    def _raw(self, parameters: Mapping[str, Any]) -> Any:
        try:
            return self.source.value(parameters)
        except ValueError as error:
            if isinstance(self.source, Formula):
                raise mismatch(self.where, "a finite value", f"{show(self.words)} ({error})") from None
            blamed, unit, wanted = self.source.names[0], self.source.unit, self.source.wanted
            raise mismatch(self.where, str(error), in_words(parameters[blamed], unit, wanted)) from None


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
        """How the values follow, for people."""
        return f"linked to {self.axis}"

    def value(self, parameters: Mapping[str, Any]) -> Any:
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
        """How the value follows, for people."""
        return f"by {self.by}"

    def value(self, parameters: Mapping[str, Any]) -> float:
        """Return the value [SI]."""
        return self.substitute.value(parameters)


class Noted(Mapping[str, Any]):
    """Flat parameters that note which of them were read, and evaluate those of `later` at that time."""

    def __init__(
        self, known: Mapping[str, Any], later: Mapping[str, Callable[[], Any]] | None = None
    ) -> None:
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


def follow(rules: Iterable[Rule], parameters: Mapping[str, Any]) -> dict[str, Any]:
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


def places(
    axes: Iterable[Axis], names: Collection[str], *, sampled: bool = False
) -> Iterator[dict[str, Any]]:
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
