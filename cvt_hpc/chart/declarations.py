"""What a chart job may say beside the tables of a job: the keys of [chart] and of the tables in it."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from cvt_hpc.errors import mismatch, show, unknown
from cvt_hpc.job.definition import HEADER
from cvt_hpc.job.values import expectation, read_value
from cvt_hpc.parameters import Parameter

CHART = {
    "repeats": Parameter(3, "", "how often a quick run is timed; the shortest time counts", minimum=1),
    "time_limit": Parameter(
        300.0, "s", "core-seconds after which a run is given up", minimum=0.0, exclusive=True
    ),
}
LEAD = {
    "stepper": Parameter(None, "", "stepper"),
    "until": Parameter(None, "s", "when the methods take over", minimum=0.0, exclusive=True),
}
SCENE = {
    "time_limit": Parameter(
        math.inf,
        "s",
        "core-seconds after which a run of this scene is given up, where the chart allows more",
        minimum=0.0,
        exclusive=True,
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
SETTINGS = ("step", "tolerance")  # what the points of a series may differ in


def read_table(
    declared: Mapping[str, Parameter], raw: Any, where: str, tables: tuple[str, ...] = ()
) -> dict[str, Any]:
    """Return the values of a table by key, defaults included.

    Parameters
    ----------
    declared : mapping
        What the table may hold.
    raw : Any
        What stands in the file.
    where : str
        File and table, for the errors.
    tables : tuple of str
        Further keys that are legal and read elsewhere.

    Raises
    ------
    InputError
        If it is no table, or a key is unknown, missing or not legal.
    """
    if not isinstance(raw, Mapping):
        raise mismatch(where, "a table", show(raw))
    for key in raw:
        if key not in declared and key not in tables:
            raise unknown(f"{where} {key}", "key", key, [*declared, *tables])
    values = {}
    for key, parameter in declared.items():
        if key in raw:
            values[key] = read_value(_typed(parameter), raw[key], f"{where} {key}")
        elif parameter.default is None:
            raise mismatch(f"{where} {key}", expectation(_typed(parameter)), "nothing")
        else:
            values[key] = parameter.default
    return values


def read_tables(raw: Any, where: str, what: str) -> Mapping[str, Any]:
    """Return a table of tables.

    Raises
    ------
    InputError
        If it is none, or empty.
    """
    if not isinstance(raw, Mapping) or not raw:
        found = "an empty one" if isinstance(raw, Mapping) else show(raw)
        raise mismatch(where, f"a table of {what}", found)
    return raw


def read_set(raw: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Return the values that the table `set` of a table gives to parameters.

    Raises
    ------
    InputError
        If it is no table, or names something of the job's head.
    """
    values = raw.get("set", {})
    if not isinstance(values, Mapping):
        raise mismatch(f"{where} set", "a table", show(values))
    for key in values:
        if key in HEADER:
            raise mismatch(f"{where} set {key}", "a parameter", f"the job's {key}")
    return dict(values)


def _typed(parameter: Parameter) -> Parameter:
    """Return a declaration without a default as that of a text, where it has no unit."""
    if parameter.default is None and not parameter.unit:
        return Parameter("", "", parameter.description)
    return parameter
