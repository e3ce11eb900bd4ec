"""The parameters that a job may set: tables of its model and its stepper, and tables of all transients."""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from importlib import import_module
from typing import NamedTuple

from cvt_hpc import recording
from cvt_hpc.errors import InputError, did_you_mean, few_of, mismatch, nearest, show, unknown
from cvt_hpc.job.values import Point, Table, in_words
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import Model, load_model
from cvt_hpc.parameters import Parameter, Problem
from cvt_hpc.steppers import STEPPERS
from cvt_hpc.vibration import settings as vibration_settings

SHARED = recording, vibration_settings  # with tables of every job with a transient

Check = Callable[[Point], list[Problem]]
Inert = Callable[[Point], dict[str, str]]

_MOST_NAMED = 16
_RETIRED = {"contact_sweeps": "contact is solved exactly; delete the line"}  # keys of earlier versions


class Entry(NamedTuple):
    """Declaration that stands at a key."""

    parameter: Parameter  # declaration of the key
    raw: object
    where: str  # file and key


@dataclass(frozen=True)
class Schema:
    """The parameters of a job with a certain model and stepper."""

    model: str  # its name
    stepper: str | None  # its name; None for a model without a transient
    # section -> key -> Parameter; keys are unique over all sections
    sections: dict[str, dict[str, Parameter]]
    # the checks that lie between parameters, the model's first: flat values -> list of problems
    checks: tuple[Check, ...]
    # flat values -> the keys without effect on such a run, each with the setting that makes it so
    inert: Inert
    # by key the unit in which the job gives a parameter, where it names one; values are shown in it
    units: Mapping[str, str] = field(default_factory=dict)

    def in_words(self, key: str, value: object) -> str:
        """Return a value [SI] of a parameter for people to read, in the unit of the job."""
        return in_words(value, self.parameters[key].unit, self.units.get(key, ""))

    def unit_in_words(self, key: str) -> str:
        """Return the unit in which a parameter is shown to people."""
        return self.units.get(key, self.parameters[key].unit)

    @cached_property
    def section_of(self) -> dict[str, str]:
        """Section by key."""
        return {key: section for section, table in self.sections.items() for key in table}

    @cached_property
    def parameters(self) -> dict[str, Parameter]:
        """Parameter by key."""
        return {key: parameter for table in self.sections.values() for key, parameter in table.items()}

    def problems(self, parameters: Point) -> Iterator[Problem]:
        """Yield the conflicts between the values [SI] of a run, as (key, expected, found).

        The checks run one after the other, so that a caller that stops at the first problem spares a
        stepper's check a scene that the model refuses.
        """
        for check in self.checks:
            yield from check(parameters)

    def find(self, name: str, where: str, section: str | None = None) -> str:
        """Return the key that a name means: a bare key, or "section.key".

        If it stands in the table of a `section`, it has to belong there.

        Raises
        ------
        InputError
            If there is no such key, or it belongs in another table.
        """
        head, _, tail = name.rpartition(".")
        if section is None and head in self.sections:
            section, name = head, tail
        home = self.section_of.get(name)
        if home is not None and section in (None, home):
            return name
        if home is not None:
            raise InputError(f"{where}: belongs in [{home}], found in [{section}]")
        if name in _RETIRED:
            raise InputError(f"{where}: no key of this version; {_RETIRED[name]}")
        if near := self.nearest(name, section):
            raise InputError(f"{where}: unknown key{near}")
        if known := self.sections.get(section or ""):
            raise unknown(where, "key", name, known)
        keys = list(self.parameters)
        then = f"; `cvt-hpc models {self.model}` lists all {len(keys)}" if len(keys) > _MOST_NAMED else ""
        raise InputError(f"{where}: unknown key; known: {few_of(keys, _MOST_NAMED)}{then}")

    def flatten(self, table: Table) -> Iterator[tuple[str, object]]:
        """Yield name and value; TOML reads a line `scene.load = ...` as a table "scene" with a key "load"."""
        for name, raw in table.items():
            if name in self.sections and isinstance(raw, Mapping):
                yield from ((f"{name}.{key}", value) for key, value in raw.items())
            else:
                yield name, raw

    def entries(
        self, pairs: Iterable[tuple[str, object]], where: str, section: str | None = None
    ) -> Iterator[tuple[str, Entry]]:
        """Yield the key of each pair of a name and a value, and its entry; further arguments as of `find`."""
        for name, raw in pairs:
            key = self.find(name, f"{where} {name}", section)
            yield key, Entry(self.parameters[key], raw, f"{where} {name}")

    def nearest(self, name: str, section: str | None = None) -> str:
        """Return "; did you mean KEY?" for the nearest key, with its table where that is another one."""
        near = nearest(name, self.sections.get(section or "", {})) or nearest(name, self.parameters)
        if near is None:
            return ""
        home = self.section_of[near]
        return f"; did you mean {near}{'' if home == section else f' in [{home}]'}?"


def load_schema(model: str | None, stepper: str | None, source: str) -> Schema:
    """Return the parameters that a job of a model and a stepper may set.

    Those of both, and of the tables that all transients share; of these a model may declare keys with its own
    defaults. No stepper stands for the model's default, which is none for a model without a transient.

    Raises
    ------
    InputError
        If there is no such model or stepper, or the model does not take it.
    """
    loaded = load_model(_known(model, MODELS, "model", source))
    stepper = loaded.default_stepper if stepper is None else stepper
    tables, checks, inert = [loaded.parameters], [loaded.check], [loaded.inert]
    if stepper is not None:
        modules = [import_module(_stepper(loaded, stepper, source)), *SHARED]
        tables += [module.PARAMETERS for module in modules]
        checks += [module.check for module in modules if hasattr(module, "check")]
        inert += [module.inert for module in modules if hasattr(module, "inert")]
    sections: dict[str, dict[str, Parameter]] = {}
    for sectioned in tables:
        for section, table in sectioned.items():
            known = sections.setdefault(section, {})
            known.update({key: parameter for key, parameter in table.items() if key not in known})
    for key, substitute in loaded.gives.get(stepper or "", {}).items():
        section = next(name for name, table in sections.items() if key in table)
        sections[section][key] = replace(sections[section][key], gives=substitute)
    return Schema(loaded.name, stepper, sections, tuple(checks), partial(_all_inert, inert))


def known_keys(model: str, stepper: str | None = None) -> tuple[str, ...]:
    """Return every key that a job of a model and a stepper may set or vary."""
    return tuple(load_schema(model, stepper, "known_keys").parameters)


def _all_inert(found: Sequence[Inert], parameters: Point) -> dict[str, str]:
    return {key: setting for inert in found for key, setting in inert(parameters).items()}


def _stepper(model: Model, stepper: object, source: str) -> str:
    """The module that declares a stepper which the model takes."""
    where = f"{source}: stepper"
    if isinstance(stepper, str) and stepper in model.steppers:
        return model.steppers[stepper]
    # a step lives in the room of one model, whichever others take it
    places = [(name, place, other) for other in MODELS for name, place in load_model(other).steppers.items()]
    owners: dict[str, str] = {}
    for name, _, other in sorted(places, key=lambda found: not found[1].startswith(f"{MODELS[found[2]]}.")):
        if name not in STEPPERS:
            owners.setdefault(name, other)
    name = _known(stepper, STEPPERS | owners, "stepper", source, told=model.steppers)
    if not model.steppers:
        raise mismatch(where, f"none, since {model.name} has no transient", show(name))
    reason = model.refused.get(name) or f"it is {owners[name]}'s own step"
    expected = f"one that {model.name} takes ({', '.join(model.steppers)})"
    raise mismatch(where, expected, f"{show(name)}: {reason}")


def _known(
    name: object, registry: Collection[str], what: str, source: str, told: Collection[str] | None = None
) -> str:
    """Return a name of the registry; the error names those `told`, by default all."""
    if not isinstance(name, str) or name not in registry:
        expected = f"one of {', '.join(registry if told is None else told) or 'none'}"
        hint = did_you_mean(name, registry) if isinstance(name, str) else ""
        then = "`cvt-hpc models` says what each is" if registry is MODELS and not hint else ""
        raise mismatch(f"{source}: {what}", expected, show(name) + hint, then)
    return name
