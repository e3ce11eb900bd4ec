"""A job for `cvt-hpc ladder`: an ordinary job of the elastic belt, with a table [ladder] or without.

`ladder` gives the models with which the job can be done, from the cheapest up. Beside them stands a model
that takes longer than the elastic belt and answers the same questions, if a job requests it. The reference
may be the pushbelt of rigid elements, beside which the spatial one may stand. The expected cost follows from
the models' cost models.
"""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

from cvt_hpc.errors import InputError, mismatch, show
from cvt_hpc.experiments.sweeps import Sweep, handed, sweep_lines
from cvt_hpc.job import Job, build_job, known_keys, rebuild_job
from cvt_hpc.job.assignments import Assignments, split_assignments, take_own, warn_of_bare_assignments
from cvt_hpc.job.definition import handed_to
from cvt_hpc.job.document import read_document, read_set, read_table
from cvt_hpc.job.rules import varied_by
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.summary import core_time_in_words
from cvt_hpc.job.values import in_words
from cvt_hpc.models.pushbelt.continuous import FOLLOWS, ONLY
from cvt_hpc.parameters import Parameter
from cvt_hpc.simulation import run_costs
from cvt_hpc.vibration.ramped import CONSTANT, QUANTITIES

PUSHBELT = "pushbelt"
# Of the model below the reference: half as many elements as a belt has, at the default step
COARSER: dict[str, Any] = {"elements": 216, "step": 1e-5}
# Errors of first order are then the distance between the two, and of second order a third of it.
_FINER_PUSHBELT = 2

QUESTIONS = ("occurrence", "onset", "frequency", "amplitude", "forces")
MODEL, _STEPPER = "elastic_belt", "imex"
REFERENCE = "reference"
# In the reference mesh, step and transient shrink together: by 1.5 each error of first order falls by a third
# and of second order by more than half, while a run costs 4.5 times as much, which keeps it below a second.
_FINER = 1.5
_LONGER = 2.0  # times as long: slow growth has its time, and the judged half begins a whole run later


# By name its model, the content of a table of that name, and the questions that it answers. Of auto, question
# forces without a margin takes every answer of the coarse transient as it is.
_LOWER: dict[str, tuple[str, dict[str, Any], tuple[str, ...]]] = {
    "criterion": ("criterion", {}, ("occurrence",)),
    "strand": ("strand", {}, ("frequency",)),
    "steady_variator": ("steady_variator", {}, ("forces",)),
    "linear_stability": ("linear_stability", {}, ("occurrence", "onset", "frequency", "forces")),
    "coarse": ("auto", {"question": "forces", "least_margin": 0.0}, QUESTIONS),
    "auto": ("auto", {"question": "occurrence"}, ("occurrence", "onset")),
}
NONE = "none"
SPATIAL = "spatial_pushbelt"
BESIDE = ("quasi_static_belt", SPATIAL)
# Both sheaves of a pulley move alike, as those of the planar pushbelt do
_AS_PLANAR = {"driving_loose_side": "both", "driven_loose_side": "both"}


def ladder(
    job: Job, pushbelt: Mapping[str, Any] | None = None, beside: str = NONE
) -> tuple[tuple[Sweep, ...], dict[str, str]]:
    """Return the models of a job's ladder, and why others refuse it, by the name of the model.

    From the cheapest up, then a requested continuous model, the job itself, a requested spatial pushbelt, the
    pushbelt of the reference, the reference last. The reference is the model before it, refined.

    Parameters
    ----------
    job : Job
        Of the elastic belt, a grid with `load` among its axes.
    pushbelt : mapping, optional
        Further keys of the pushbelt, as `pushbelt_jobs` takes them: the reference is a pushbelt then.
    beside : str
        A requested entry of BESIDE, or NONE. SPATIAL is the pushbelt below the reference, out of its plane.

    Raises
    ------
    InputError
        If it is another job, one that cannot be refined, or one that the requested pushbelt cannot take.
    """
    _check(job)
    rungs, refusals = [], {}
    models = _LOWER if beside in (NONE, SPATIAL) else _LOWER | {beside: (beside, {}, QUESTIONS)}
    for name, (model, table, answers) in models.items():
        try:
            rungs.append(Sweep(name, answers, handed(job, model, table)))
        except InputError as error:
            refusals[name] = str(error)
    rungs.append(Sweep(MODEL, QUESTIONS, job))
    if pushbelt is None:
        reference = rebuild_job(_refined(job), job.source, job.units)
    else:
        coarser, reference = pushbelt_jobs(job, pushbelt)
        if beside == SPATIAL:
            whole = replace(coarser, given=frozenset(coarser.parameters))
            document = handed_to(whole, SPATIAL, "a model of its ladder")
            out_of_plane = rebuild_job(document, job.source, job.units, _AS_PLANAR)
            rungs.append(Sweep(SPATIAL, QUESTIONS, out_of_plane))
        rungs.append(Sweep(PUSHBELT, QUESTIONS, coarser))
    return (*rungs, Sweep(REFERENCE, (), reference)), refusals


def _check(job: Job) -> None:
    where, axes = job.source, [axis.name for axis in job.axes]
    if job.model != MODEL:
        raise mismatch(f"{where}: model", f"{MODEL}, the top of the ladder", job.model)
    if job.stepper != _STEPPER:
        raise mismatch(f"{where}: stepper", f"{_STEPPER}, as all transients below have it", str(job.stepper))
    if job.design:
        raise mismatch(f"{where}: [design]", "none: a ladder goes over the whole grid", job.design["kind"])
    if "load" not in axes:
        raise mismatch(f"{where}: [axes]", "load among the axes, for its onsets", ", ".join(axes) or "none")
    for key in (quantity.history for quantity in QUANTITIES.values()):
        if (course := job.parameters[key]) not in CONSTANT:
            place = f"{where}: [{job.schema.section_of[key]}] {key}"
            raise mismatch(place, "constant, as the cheaper models have it", in_words(course, ""))
    stated = [rule.key for rule in job.rules if not rule.is_substituted]
    varied = dict.fromkeys(stated, ("derived", "a formula"))
    varied |= dict.fromkeys(axes, ("axes", "an axis"))
    for name in ("stations", "step_error", "step", "duration", "shortest_duration", "longest_duration"):
        if name in varied:
            table, found = varied[name]
            raise mismatch(f"{where}: [{table}] {name}", "one value, which the reference refines", found)


def _refined(job: Job) -> dict[str, Any]:
    document = job.resolved()
    document["mesh"]["stations"] = round(_FINER * job.parameters["stations"])
    # a step that follows from the scene follows from that of the finer mesh
    setting = "step_error" if any(rule.key == "step" for rule in job.rules) else "step"
    document["numerics"][setting] = job.parameters[setting] / _FINER
    for name in ("duration", "shortest_duration", "longest_duration"):
        document["run"][name] = _LONGER * job.parameters[name]
    return document


def pushbelt_jobs(job: Job, settings: Mapping[str, Any]) -> tuple[Job, Job]:
    """Return the runs of a job of the elastic belt on the pushbelt, and the same refined.

    Further keys of the pushbelt are of COARSER, or keys that the elastic belt does not know. An InputError
    names what has no counterpart there.
    """
    where, label = f"{job.source}: [ladder]", "set"
    _check_settings(job, settings, f"{where} {label}")
    document = _document(job)
    coarser = rebuild_job(document, where, job.units, {**COARSER, **settings}, label)
    warn_of_bare_assignments(settings, coarser.schema, where, label)
    if [axis.name for axis in coarser.axes] != [axis.name for axis in job.axes]:
        raise mismatch(f"{where} {label}", "one value for each key", "an axis")
    refined = coarser.resolved()
    refined["belt"]["elements"] *= _FINER_PUSHBELT
    refined["numerics"]["step"] /= _FINER_PUSHBELT
    return coarser, rebuild_job(refined, where, job.units)


def _check_settings(job: Job, settings: Mapping[str, Any], where: str) -> None:
    """Refuse keys that the elastic belt knows as well: both would be different belts."""
    schema = load_schema(PUSHBELT, None, job.source)
    own = {key for key in known_keys(PUSHBELT) if schema.section_of[key] != "profiles"}
    own = own - {*known_keys(job.model, job.stepper)} | {*FOLLOWS, *COARSER}
    for name in settings:
        if schema.find(name, f"{where} {name}") not in own:
            expected = "a key that the elastic belt does not know, since all else is that belt's"
            raise mismatch(f"{where} {name}", expected, "one of both")


def _document(job: Job) -> dict[str, Any]:
    """Return the pushbelt whose continuum is the job's belt: common keys, and keys that follow."""
    where = f"{job.source}: [ladder] reference"
    axes = {axis.name: axis for axis in job.axes}
    varied = varied_by(job.rules, axes)
    along = {key: varied.get(key, (key,) if key in axes else ()) for key in job.parameters}
    for key, only in ONLY.items():
        if along[key] or job.parameters[key] != only:
            told = "several values" if along[key] else in_words(job.parameters[key], "")
            raise mismatch(
                f"{where}: {key}", f"{in_words(only, '')}, since the pushbelt knows no other", told
            )
    scaled = along["sheave_stiffness"] or job.parameters["sheave_stiffness"] != 1.0
    if scaled and (along["stiffness_of"] or job.parameters["stiffness_of"] != "sheave"):
        expected = '"sheave", since sheave_stiffness scales all modes of opening of the pushbelt'
        raise mismatch(f"{where}: stiffness_of", expected, job.parameters["stiffness_of"])
    whole = replace(job, given=frozenset(job.parameters))  # defaults are another belt's there
    document = handed_to(whole, PUSHBELT, "the reference of its ladder")
    document.get("numerics", {}).pop("step", None)
    linked, section_of = document.setdefault("linked", {}), load_schema(PUSHBELT, None, where).section_of
    for table in (document.get("derived", {}), *linked.values()):
        for key in FOLLOWS.keys() & table.keys():
            del table[key]
    for key, (needs, value) in FOLLOWS.items():
        found = value(job.parameters)
        followed = [name for name in axes if any(name in along[need] for need in needs)]
        if key in axes or len(followed) > 1 or (followed and isinstance(found, tuple)):
            expected = f"one value, since {key} of the pushbelt follows and has one"
            raise mismatch(f"{job.source}: [axes] {followed[-1]}", expected, "several")
        table = document.setdefault(section_of[key], {})
        table.pop(key, None)  # the continuous belt uses this name for another quantity
        if not followed:
            table[key] = found
            continue
        values = [value(job.complete({followed[0]: place})) for place in axes[followed[0]].values]
        linked.setdefault(followed[0], {})[key] = values
    return document


TABLE = "ladder"
_KEYS = {
    "reference": Parameter(MODEL, "", "model of the reference", choices=(MODEL, PUSHBELT)),
    "beside": Parameter(NONE, "", "a dearer model beside those of the ladder", choices=(NONE, *BESIDE)),
}


class Ladder(NamedTuple):
    """The content of a ladder job."""

    job: Job  # of the elastic belt
    rungs: tuple[Sweep, ...]  # as `ladder` returns them
    refusals: dict[str, str]  # the reason, by the name of a model that is left out


def load(path: str | Path, overrides: Assignments = ()) -> Ladder:
    """Read and validate a job, and return its ladder.

    The table [ladder] of the TOML file may have `beside`, one of BESIDE, and `reference`, elastic_belt or
    pushbelt, for the pushbelt with `set`, a table of its further keys. Overrides are as of `load_job`;
    ladder.KEY replaces a key of the table.

    Raises
    ------
    InputError
        If anything is wrong with the file or an override, or there is no such ladder of the job.
    """
    source, document = str(path), read_document(Path(path))
    where = f"{source}: [{TABLE}]"
    replaced = split_assignments(overrides, source, "--set")
    own, table = take_own(replaced, TABLE), document.pop(TABLE, {})
    if isinstance(table, Mapping):
        table = {**table, **own}
    read = read_table(_KEYS, table, where, ("set",))
    reference, beside = read["reference"], read["beside"]
    settings = read_set(table, where)
    if settings and reference != PUSHBELT:
        raise mismatch(f"{where} set", f'reference = "{PUSHBELT}", for which it is', show(reference))
    if beside == SPATIAL and reference != PUSHBELT:
        raise mismatch(f"{where} beside", f'reference = "{PUSHBELT}", for which it is', show(beside))
    job = build_job(document, source, replaced, "--set")
    return Ladder(job, *ladder(job, settings if reference == PUSHBELT else None, beside))


def plan_lines(asked: Ladder, out: Path) -> Iterator[str]:
    """Yield the lines that state the runs of a ladder on each model, and their expected cost."""
    job, rungs = asked.job, asked.rungs
    yield f"ladder {job.name} ({job.source}): {job.size} runs with {len(rungs)} models"
    if job.description:
        yield job.description
    yield from sweep_lines(rungs, asked.refusals, out)
    if rungs[-1].job.model != PUSHBELT:
        yield f"with --set ladder.reference={PUSHBELT}: {_pushbelt_cost(job)}"


def _pushbelt_cost(job: Job) -> str:
    """Return the cost of the pushbelt as the reference, or the reason why it cannot take the job."""
    try:
        jobs = pushbelt_jobs(job, {})
    except InputError as error:
        return f"refused, {error}"
    total = sum(float(run_costs(each).sum()) for each in jobs)
    return f"{core_time_in_words(total)} more, for errors against a belt of rigid elements"
