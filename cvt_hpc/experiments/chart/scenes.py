"""A scene of a chart job, with the data from which its runs are built.

It also declares the keys of a chart job beside the tables of a job: [chart] and the tables in it.
"""

import math
import re
import warnings
from dataclasses import dataclass, replace
from typing import Any

from cvt_hpc.errors import NoEffectWarning, mismatch, show, unknown
from cvt_hpc.experiments.chart.plan import Lead, Quantity, Scene
from cvt_hpc.experiments.chart.quantities import read_quantity
from cvt_hpc.job import Job, build_job
from cvt_hpc.job.assignments import read_assignments
from cvt_hpc.job.document import read_set, read_table, read_tables
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.values import read_value
from cvt_hpc.models.contract import load_model
from cvt_hpc.parameters import Parameter, positive

CHART = {
    "repeats": Parameter(3, "", "how often a quick run is timed; the shortest time counts", minimum=1),
    "time_limit": positive(
        300.0, "s", "core-seconds after which a run is given up", sensible=(0.01, 100000.0)
    ),
}
LEAD = {
    "stepper": Parameter(None, "", "stepper"),
    "until": positive(None, "s", "when the methods take over", sensible=(1e-05, 1000.0)),
}
SCENE = {
    "time_limit": positive(
        math.inf,
        "s",
        "core-seconds after which a run of this scene is given up, where the chart allows more",
        sensible=(0.01, 100000.0),
        allow_infinite=True,
    ),
    "title": Parameter("", "", "heading of the scene's picture"),
    "model": Parameter(
        "", "", "model, where it is not that of the job; the job's own tables then do not count"
    ),
    "starts": Parameter(
        1, "", "runs from as many random starts; results are pooled", minimum=1, maximum=1024
    ),
}
METHOD = {
    "label": Parameter("", "", "name in tables and pictures"),
    "stepper": Parameter(None, "", "stepper"),
    "model": Parameter("", "", "model, where it is not the scene's; it is told all that the scene sets"),
    "lanes": Parameter(1, "", "runs that advance together; costs are those of one", minimum=1, maximum=64),
}
BUDGET = {
    "label": Parameter("the base", "", "what the choices are compared with, for people"),
    "scene": Parameter("", "", "scene whose errors are taken apart"),
    "stepper": Parameter("", "", "stepper of the base and, unless they say otherwise, of all choices"),
}
CHOICE = {
    "label": Parameter("", "", "name in tables and pictures"),
    "stepper": Parameter(
        "", "", "stepper, where it is not the base's; what the base sets then does not count"
    ),
    "model": Parameter("", "", "model, where it is not the scene's; it is told all that the scene sets"),
    "starts": Parameter(0, "", "the first of the scene's starts, so many; 0: all", minimum=0),
    "refines": Parameter(
        False, "", "nearer to the truth than the base: the difference is an error of the base"
    ),
}
SETTINGS = ("step", "tolerance")  # keys in which the points of a series may differ

_WORD = re.compile(r"[A-Za-z0-9][A-Za-z0-9_]{0,59}")


@dataclass(frozen=True)
class Stage:
    """A scene with the data from which its runs are built."""

    scene: Scene  # as the chart knows it
    document: dict[str, Any]  # job file without the chart
    values: dict[str, Any]  # further values of the scene, or of the command line
    where: str  # file and table, for the errors

    @property
    def until(self) -> float:
        """Return the end of the march of its runs [s]; inf: their own end."""
        return max(q.until for q in self.scene.quantities) if self.scene.lead else math.inf

    def job(self, where: str, model: str = "", **values: Any) -> Job:
        """Return the job of a run of this scene, or of another model, with further values set.

        Raises
        ------
        InputError
            If a value is not legal, or the model has no transient that methods could march.
        """
        # None: the model's own choice of a stepper
        values = {key: value for key, value in values.items() if value is not None}
        document = {**self.document, "model": model} if model else self.document
        with warnings.catch_warnings():  # of a comparison each part has values without effect on others
            warnings.simplefilter("ignore", NoEffectWarning)
            job = build_job(document, where, {**self.values, **values}, "set")
        if job.axes:
            raise mismatch(f"{where}: set {job.axes[0].name}", "one value in a chart", "an axis")
        if job.stepper is None:
            raise mismatch(f"{where}: model", "one with a transient", job.model)
        return job

    def setting(self, stepper: str, key: str, raw: Any, where: str, place: str, model: str = "") -> float:
        """Return a step or a tolerance [SI] of a stepper; where is its table, and place the value's in it."""
        schema = load_schema(model or self.document.get("model"), stepper, where)
        if key not in schema.parameters:
            known = [name for name in SETTINGS if name in schema.parameters]
            raise unknown(f"{where} {key}", f"key of stepper {stepper}", key, known)
        return read_value(schema.parameters[key], raw, place)


def read_stage(name: str, raw: Any, document: dict[str, Any], replaced: dict[str, Any], source: str) -> Stage:
    """Return a scene as its table in a chart job describes it.

    `document` is the job file without the chart; values `replaced` from the command line take precedence over
    those of the scene.

    Raises
    ------
    InputError
        If the table is not legal.
    """
    where = f"{source}: [chart.scenes.{name}]"
    check_word(name, where)
    own = read_table(SCENE, raw, where, ("set", "quantities", "reference", "lead"))
    base = document
    if own["model"]:
        head: dict[str, Any] = {key: document[key] for key in ("name", "description") if key in document}
        base = {**head, "model": own["model"]}
    if replaced:
        _check_replaced(replaced, base.get("model"), where, source)
    asked = read_tables(raw.get("quantities"), f"{where} quantities", "quantities")
    quantities = tuple(
        read_quantity(key, table, f"{source}: [chart.scenes.{name}.quantities] {key}")
        for key, table in asked.items()
    )
    exact = raw.get("reference") == "exact"
    title = own["title"] or in_words(name)
    scene = Scene(name, title, quantities, own["starts"], exact, own["time_limit"])
    stage = Stage(scene, base, {**read_set(raw, where), **replaced}, where)
    if "lead" not in raw:
        return stage
    return replace(stage, scene=replace(scene, lead=_read_lead(stage, raw["lead"])))


def _check_replaced(replaced: dict[str, Any], model: Any, where: str, source: str) -> None:
    """Raise errors in values of the command line, for all steppers of the scene's model."""
    schemas = [load_schema(model, None, where)]
    schemas += [load_schema(model, name, where) for name in load_model(model).steppers]
    for name, raw in replaced.items():
        key = name.rpartition(".")[2]
        schema = next((schema for schema in schemas if key in schema.parameters), schemas[0])
        read_assignments({name: raw}, schema, source, "--set")


def _read_lead(stage: Stage, raw: Any) -> Lead:
    """Return the lead-in run to the state where the methods of a scene take over."""
    where = f"{stage.where} lead"
    own = read_table(LEAD, raw, where, ("set",))
    if stage.scene.exact:
        raise mismatch(f"{stage.where} reference", "a stepper, because methods take over", '"exact"')
    for quantity in stage.scene.quantities:
        _check_led(quantity, own["until"], f"{stage.where} quantities.{quantity.name}")
    return Lead(stage.job(where, stepper=own["stepper"], **read_set(raw, where)), own["until"])


def _check_led(quantity: Quantity, until: float, where: str) -> None:
    if quantity.name != "trajectory":
        raise mismatch(where, "the trajectory alone, because methods take over", quantity.name)
    if quantity.since < until:
        expected = f"{until:g} s or more, when methods take over"
        raise mismatch(f"{where}.since", expected, f"{quantity.since:g} s")


def check_word(name: str, where: str) -> None:
    """Raise InputError unless a name may be part of a file's name."""
    if not _WORD.fullmatch(name):
        raise mismatch(where, "a name of letters, digits and '_' (it names files)", show(name))


def in_words(name: str) -> str:
    """Return a name as people write it."""
    return name.replace("_", " ")
