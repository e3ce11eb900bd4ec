"""A job of the elastic belt on the pushbelt of rigid elements, as the reference of its ladder."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from cvt_hpc.errors import mismatch
from cvt_hpc.job import Job, rebuild_job
from cvt_hpc.job.assignments import warn_of_bare_assignments
from cvt_hpc.job.for_model import handed_to
from cvt_hpc.job.rules import varied_by
from cvt_hpc.job.schema import known_keys, load_schema
from cvt_hpc.job.values import in_words
from cvt_hpc.models.pushbelt.continuous import FOLLOWS, ONLY
from cvt_hpc.models.pushbelt.profiles import PARAMETERS as PROFILES

PUSHBELT = "pushbelt"
# Of the model below the reference: half as many elements as a belt has, at the default step
COARSER: dict[str, Any] = {"elements": 216, "step": 1e-5}
# Errors of first order are then the distance between the two, and of second order a third of it.
FINER = 2


def pushbelt_jobs(job: Job, settings: Mapping[str, Any]) -> tuple[Job, Job]:
    """Return the runs of a job of the elastic belt on the pushbelt, and the same refined.

    Parameters
    ----------
    job : Job
        Of the elastic belt.
    settings : mapping
        Further keys of the pushbelt: of COARSER, or keys that the elastic belt does not know.

    Raises
    ------
    InputError
        If the pushbelt has no counterpart of the job, or a setting is not legal.
    """
    where, label = f"{job.source}: [ladder]", "set"
    _check_settings(job, settings, f"{where} {label}")
    document = _document(job)
    coarser = rebuild_job(document, where, job.units, {**COARSER, **settings}, label)
    warn_of_bare_assignments(settings, coarser.schema, where, label)
    if [axis.name for axis in coarser.axes] != [axis.name for axis in job.axes]:
        raise mismatch(f"{where} {label}", "one value for each key", "an axis")
    refined = coarser.resolved()
    refined["belt"]["elements"] *= FINER
    refined["numerics"]["step"] /= FINER
    return coarser, rebuild_job(refined, where, job.units)


def _check_settings(job: Job, settings: Mapping[str, Any], where: str) -> None:
    """Refuse keys that the elastic belt knows as well: both would be different belts."""
    schema = load_schema(PUSHBELT, None, job.source)
    own = {*known_keys(PUSHBELT)} - {*known_keys(job.model, job.stepper), *PROFILES} | {*FOLLOWS, *COARSER}
    for name in settings:
        if schema.find(name, f"{where} {name}") not in own:
            expected = "a key that the elastic belt does not know, since all else is that belt's"
            raise mismatch(f"{where} {name}", expected, "one of both")


def _document(job: Job) -> dict[str, Any]:
    """The pushbelt of which the job's belt is the continuum: common keys, and keys that follow."""
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
