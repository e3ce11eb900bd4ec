"""A job in words, for `cvt-hpc check`; messages tell of values that another key makes void."""

import math
import warnings
from collections.abc import Mapping
from typing import Any

from cvt_hpc.errors import NoEffectWarning, mismatch, one_line, show
from cvt_hpc.job.axes import Axis
from cvt_hpc.job.crosscheck import without_effect
from cvt_hpc.job.definition import Derived, Job
from cvt_hpc.job.schema import Schema
from cvt_hpc.job.values import angle_in_words, in_words
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.parameters import Parameters
from cvt_hpc.tables import columns

_FEW = 8
_MOST_DESCRIBED = 20  # lines
_MOST_EVALUATED = 2_000  # values of derived parameters
_MOST_ASKED = 500  # runs, for parameters without effect


def summarize(job: Job, core_seconds: float, measured: int = 0) -> str:
    """Return the content of a job in lines: every parameter with its origin, the axes, and the cost.

    The cost of a run [core-seconds] is estimated by as many recorded ones as are `measured`.
    """
    stepper = "no transient" if job.stepper is None else f"stepper {job.stepper}"
    lines = [f"job {job.name} ({one_line(job.source)}): model {job.model}, {stepper}"]
    lines += [*job.description.splitlines()[:_MOST_DESCRIBED], "", f"models: {', '.join(MODELS)}"]
    if steppers := load_model(job.model).steppers:
        lines.append(f"steppers of {job.model}: {', '.join(steppers)}")
    schema = job.schema
    for section, rows in _tables(job, schema).items():
        lines += ["", f"[{section}]", *columns(rows)]
    if job.axes:
        noun = "samples" if job.is_sampled else "values"
        in_short = _range_in_words if job.is_sampled else values_in_words
        axes = [(axis.name, in_short(axis, schema), f"{len(axis.values)} {noun}") for axis in job.axes]
        lines += ["", "[axes]", *columns(axes)]
    if job.rules:
        lines += ["", "[derived]", *columns(rules_in_words(job, schema))]
    if job.design:
        design = [(key, _setting_in_words(value)) for key, value in job.design.items()]
        lines += ["", "[design]", *columns(design)]
    product = f" = {' x '.join(map(str, job.shape))}" if len(job.shape) > 1 else ""
    at_most = "at most " if job.in_rounds else ""
    basis = f" (by what {measured} runs on record took)" if measured else ""
    cost = f"estimated cost: {at_most}{cost_in_words(core_seconds, job.size)}{basis}"
    lines += ["", f"runs: {at_most}{job.size}{product}"]
    if job.histories:
        lines.append(f"histories kept: of runs {', '.join(map(str, job.histories))}")
    return "\n".join([*lines, cost])


def _tables(job: Job, schema: Schema) -> dict[str, list[tuple[str, ...]]]:
    kinds = dict.fromkeys((*job.given, *job.files), "given") | {axis.name: "axis" for axis in job.axes}
    kinds |= {rule.key: "derived" for rule in job.rules}
    axes = job.thinned(_MOST_ASKED).axes
    inert = without_effect(schema, job.parameters, axes, job.rules, sampled=job.is_sampled)
    elsewhere = {"axis": "see [axes]", "derived": "see [derived]"}
    tables: dict[str, list[tuple[str, ...]]] = {}
    for section, table in schema.sections.items():
        rows: list[tuple[str, ...]] = []
        for key, parameter in table.items():
            kind = kinds.get(key, "default")
            value = value_in_words(schema, key, job.parameters[key]) if key in job.parameters else "none"
            value = job.files.get(key, job.told.get(key, value))
            text = parameter.description
            text += f" ({', '.join(parameter.choices)})" if parameter.choices else ""
            text = f"without effect with {inert[key]}: {text}" if key in inert else text
            rows.append((key, elsewhere.get(kind, value), kind, text))
        tables[section] = rows
    return tables


def value_in_words(schema: Schema, key: str, value: Any) -> str:
    """Return a value [SI] of a job for people; a long list as its length and its ends."""
    if not isinstance(value, tuple):
        in_customary = "" if key in schema.units else angle_in_words(value, schema.parameters[key].unit)
        return schema.in_words(key, value) + (f" ({in_customary})" if in_customary else "")
    if len(value) <= _FEW:
        return schema.in_words(key, value)
    if isinstance(value[0], tuple):
        return f"{len(value)} rows of {len(value[0])}"
    return f"{len(value)} values from {schema.in_words(key, value[0])} to {schema.in_words(key, value[-1])}"


def rules_in_words(job: Job, schema: Schema) -> list[tuple[str, ...]]:
    """Return for each parameter that follows from others its values, how it follows, and along which axes.

    Of a huge grid the values are those at places all over it.
    """
    varied = {derived.name: derived for derived in job.thinned(_MOST_EVALUATED).derived}
    rows: list[tuple[str, ...]] = []
    for rule in job.rules:
        if rule.key in varied and len(set(varied[rule.key].values)) > 1:
            values = _range_in_words(varied[rule.key], schema)
            along = f"varies with {', '.join(varied[rule.key].axes)}"
        else:
            values, along = schema.in_words(rule.key, job.parameters[rule.key]), "the same in all runs"
        rows.append((rule.key, values, rule.in_words(schema.units), along))
    return rows


def values_in_words(axis: Axis, schema: Schema) -> str:
    """Return the values of an axis for people, few of them if there are many."""
    values = axis.values if len(axis.values) <= _FEW else (*axis.values[:3], axis.values[-1])
    words = [schema.in_words(axis.name, value) for value in values]
    unit = schema.unit_in_words(axis.name)
    words = [word.removesuffix(unit).rstrip() for word in words]
    if len(axis.values) > _FEW:
        words.insert(3, "...")
    return f"{', '.join(words)} {unit}".rstrip()


def _range_in_words(axis: Axis | Derived, schema: Schema) -> str:
    if isinstance(axis.values[0], str):
        return ", ".join(dict.fromkeys(axis.values))
    unit = schema.unit_in_words(axis.name)
    low, high = (schema.in_words(axis.name, value) for value in (min(axis.values), max(axis.values)))
    return f"{low.removesuffix(unit).rstrip()} to {high}"


def _setting_in_words(value: object) -> str:
    if not isinstance(value, dict):
        return in_words(value, "")
    return ", ".join(f"{count} along {name}" for name, count in value.items())


def cost_in_words(core_seconds: float, runs: int) -> str:
    """Return the cost of runs, of each and of all; nan: not known."""
    if math.isnan(core_seconds):
        return "not known for this model"
    return f"{core_seconds:.3g} core-seconds per run, {core_time_in_words(core_seconds * runs)} in all"


def core_time_in_words(core_seconds: float) -> str:
    """Return a processor time."""
    is_short = core_seconds < 3600
    return f"{core_seconds:.3g} core-seconds" if is_short else f"{core_seconds / 3600:.3g} core-hours"


def tell_of_no_effect(
    schema: Schema, values: Parameters, files: Mapping[str, str], without: Mapping[str, str], source: str
) -> None:
    """Refuse files and lists without effect on any run, and warn of other values, unless they are defaults.

    Parameters
    ----------
    schema, values, source
        Of the job.
    files : mapping
        By key the name of each file that the job gives.
    without : mapping
        Given keys without effect, each with the setting that makes it so.

    Raises
    ------
    InputError
        With the first file or list without effect.
    """
    of_files = {one: key for key in files if (file := schema.parameters[key].file) for one in file.gives}
    told = []
    for key, setting in without.items():
        value, shown = values[key], of_files.get(key, key)
        if value == schema.parameters[key].default:
            continue
        if isinstance(value, tuple):
            found, nothing = (files[shown], '""') if shown in files else (value, "[]")
            where = f"{source}: [{schema.section_of[key]}] {shown}"
            expected, then = f"nothing, as it has no effect with {setting}", f"delete it, or set {shown} = "
            raise mismatch(where, expected, show(found), then + nothing)
        told.append(f"{key} (with {setting})")
    if told:
        text = f"{source}: without effect on all runs: {', '.join(told)}"
        warnings.warn(text, NoEffectWarning, stacklevel=4)
