"""From a chart job to its measurements: every run of it is built and checked before any computing.

The points of a chart are references, methods over their settings, and the error budget.
"""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from cvt_hpc.errors import InputError, mismatch, show, unknown
from cvt_hpc.experiments.chart.plan import Chart, Point, Role, Scene
from cvt_hpc.experiments.chart.scenes import (
    BUDGET,
    CHART,
    CHOICE,
    METHOD,
    SETTINGS,
    Stage,
    check_word,
    in_words,
    read_stage,
)
from cvt_hpc.job import Job
from cvt_hpc.job.assignments import Assignments, split_assignments
from cvt_hpc.job.definition import HEADER
from cvt_hpc.job.document import read_document, read_set, read_table, read_tables
from cvt_hpc.job.schema import load_schema

_COARSER = {"step": 2.0, "tolerance": 10.0}  # by which the coarser reference is coarser
_COUNTED = ("elements", "ring_beams")  # a mesh outside of [mesh]


def load(path: str | Path, overrides: Assignments = ()) -> Chart:
    """Read and validate a chart job, and build and check every run.

    It is a TOML file: a job with a table [chart]. Overrides replace values of the job and of all its scenes.

    Raises
    ------
    InputError
        If anything is wrong with the file or an override.
    """
    source = str(path)
    document = read_document(Path(path))
    if "chart" not in document:
        then = "`cvt-hpc examples chart_oscillator` copies a job that has one"
        raise mismatch(f"{source}: chart", "a table [chart]", "nothing", then)
    table = document.pop("chart")
    if "axes" in document:
        raise InputError(f"{source}: [axes]: expected no axes in a chart job, found some")
    replaced = split_assignments(overrides, source, "--set")
    for key in replaced:
        if key in HEADER:
            raise mismatch(f"{source}: --set {key}", "a parameter of the scenes", f"the job's {key}")
    where = f"{source}: [chart]"
    settings = read_table(CHART, table, where, ("scenes", "methods", "budget"))
    scenes = read_tables(table.get("scenes"), f"{where} scenes", "scenes")
    stages = [read_stage(name, raw, document, replaced, source) for name, raw in scenes.items()]
    points: list[Point] = []
    for stage, raw in zip(stages, scenes.values(), strict=True):
        points += _reference_points(stage, raw.get("reference"))
    for name, raw in read_tables(table.get("methods"), f"{where} methods", "methods").items():
        points += _method_points(name, raw, stages, f"{source}: [chart.methods.{name}]")
    budgeted: tuple[str, ...] = ()
    if "budget" in table:
        choices, budgeted = _budget_points(table["budget"], stages, f"{source}: [chart.budget]")
        points += choices
    chosen = tuple(stage.scene for stage in stages)
    return Chart(points[0].job, source, chosen, tuple(points), **settings, budgeted=budgeted)


def _reference_points(stage: Stage, raw: Any) -> Iterator[Point]:
    """Yield the reference of a scene and, unless it is exact, the coarser one that gives its error.

    The reference is "exact", or a table with a stepper, its step or tolerance, that of the coarser one (by
    default twice the step or ten times the tolerance), and keys to be set. A coarser one on another mesh is
    a table, too.
    """
    where = f"{stage.where} reference"
    name, starts = stage.scene.name, stage.scene.starts
    if stage.scene.exact:
        job = stage.job(where)
        _check_starts(stage, job)
        _check_quantities(stage, job)
        yield Point(f"{name}-exact", name, Role.REFERENCE, "exact", "exact", "", job, starts)
        return
    if not isinstance(raw, Mapping):
        raise mismatch(where, '"exact", or a table with a stepper and its step or tolerance', show(raw))
    read_table({"stepper": METHOD["stepper"]}, raw, where, ("set", "coarser", *SETTINGS))
    key = _setting_key(raw, where)
    stepper, others = raw["stepper"], read_set(raw, where)
    fine = stage.setting(stepper, key, raw[key], where, f"{where} {key}")
    setting: dict[str, Any] = {key: fine}
    job = stage.job(where, stepper=stepper, **others, **setting)
    _check_starts(stage, job)
    _check_quantities(stage, job)
    coarse, own = raw.get("coarser", fine * _COARSER[key]), f"{where} coarser"
    if isinstance(coarse, Mapping):
        read_table({}, coarse, own, ("set", key))
        others |= read_set(coarse, own)
        if key in others:
            raise mismatch(own, f"{key} beside set", f"{key} in it")
        coarse = coarse.get(key, fine * _COARSER[key])
    coarser = stage.setting(stepper, key, coarse, where, own)
    if coarser <= fine:
        raise mismatch(own, f"more than {key} = {fine:g}", f"{coarse}")
    setting = {key: coarser}
    coarser_job = stage.job(own, stepper=stepper, **others, **setting)
    for mesh, section in job.schema.section_of.items():
        if section == "mesh" or mesh in _COUNTED:
            most, found = job.parameters[mesh], coarser_job.parameters[mesh]
            if found > most:
                raise mismatch(f"{own} set {mesh}", f"at most {most}, the mesh of the reference", f"{found}")
    label = in_words(stepper)
    both: dict[str, Any] = {"starts": starts, "until": stage.until}
    yield Point(f"{name}-reference", name, Role.REFERENCE, stepper, label, key, job, **both)
    yield Point(f"{name}-coarser", name, Role.COARSER, stepper, label, key, coarser_job, **both)


def _method_points(name: str, raw: Any, stages: list[Stage], where: str) -> Iterator[Point]:
    """Yield the points of a method: its settings on each of its scenes."""
    check_word(name, where)
    own = read_table(METHOD, raw, where, ("set", "scenes", *SETTINGS))
    label = own["label"] or in_words(name)
    key = _setting_key(raw, where)
    if not isinstance(raw[key], list) or not raw[key]:
        raise mismatch(f"{where} {key}", "a list of values", show(raw[key]))
    stepper, model = own["stepper"], own["model"]
    for stage in _chosen_stages(raw.get("scenes"), stages, where):
        scene, both = stage.scene, {"lanes": own["lanes"], "until": stage.until}
        for i, value in enumerate(raw[key], 1):
            place = f"{where} {key}, value {i}"
            setting: dict[str, Any] = {key: stage.setting(stepper, key, value, where, place, model)}
            job = stage.job(where, model, stepper=stepper, **read_set(raw, where), **setting)
            point = f"{scene.name}-{name}-{i}"
            yield Point(point, scene.name, Role.METHOD, name, label, key, job, scene.starts, **both)


def _budget_points(raw: Any, stages: list[Stage], where: str) -> tuple[list[Point], tuple[str, ...]]:
    """Return base and choices of the error budget, and the quantities that it shows."""
    own = read_table(BUDGET, raw, where, ("set", "quantities", "choices"))
    (stage,) = _chosen_stages([own["scene"]], stages, where)
    base = read_set(raw, where)
    stepper = own["stepper"] or None
    scene, starts = stage.scene.name, stage.scene.starts
    job = stage.job(where, stepper=stepper, **base)
    points = [Point(f"{scene}-base", scene, Role.BASE, "base", own["label"], "", job, starts)]
    for name, table in read_tables(raw.get("choices"), f"{where} choices", "choices").items():
        place = where.replace("budget]", f"budget.choices.{name}]")
        check_word(name, place)
        choice = read_table(CHOICE, table, place, ("set",))
        # keys set for the base's stepper may be unknown to another
        changed = {**({} if choice["stepper"] else base), **read_set(table, place)}
        job = stage.job(place, choice["model"], stepper=choice["stepper"] or stepper, **changed)
        point, label = f"{scene}-choice-{name}", choice["label"] or in_words(name)
        counted, refines = min(choice["starts"] or starts, starts), choice["refines"]
        points.append(Point(point, scene, Role.CHOICE, name, label, "", job, counted, refines=refines))
    return points, _budgeted(raw.get("quantities"), stage.scene, f"{where} quantities")


def _budgeted(names: Any, scene: Scene, where: str) -> tuple[str, ...]:
    """Return the named quantities, or else all of the scene but the trajectory, which no choice keeps."""
    known = [quantity.name for quantity in scene.quantities]
    if names is None:
        return tuple(name for name in known if name != "trajectory")
    if not isinstance(names, list) or not names:
        raise mismatch(where, "a list of quantities", show(names))
    for name in names:
        if name not in known:
            raise unknown(where, f"quantity {show(name)} of scene {scene.name}", str(name), known)
    return tuple(names)


def _chosen_stages(names: Any, stages: list[Stage], where: str) -> list[Stage]:
    if names is None:
        return stages
    if not isinstance(names, list):
        raise mismatch(f"{where} scenes", "a list of scenes", show(names))
    known = {stage.scene.name: stage for stage in stages}
    for name in names:
        if name not in known:
            raise unknown(f"{where} scenes", f"scene {show(name)}", str(name), known)
    return [known[name] for name in names]


def _setting_key(raw: Mapping[str, Any], where: str) -> str:
    keys = [key for key in SETTINGS if key in raw]
    if len(keys) != 1:
        raise mismatch(where, f"one of {' and '.join(SETTINGS)}", "both" if keys else "neither")
    return keys[0]


def _check_starts(stage: Stage, job: Job) -> None:
    if stage.scene.starts > 1 and "seed" not in load_schema(job.model, job.stepper, stage.where).parameters:
        raise mismatch(
            f"{stage.where} starts", f"1, because {job.model} has no seed", f"{stage.scene.starts}"
        )


def _check_quantities(stage: Stage, job: Job) -> None:
    duration = job.parameters["duration"]
    for quantity in stage.scene.quantities:
        if duration < quantity.until < math.inf:
            where = f"{stage.where} quantities.{quantity.name}.until"
            raise mismatch(where, f"a time within the run of {duration:g} s", f"{quantity.until:g} s")
