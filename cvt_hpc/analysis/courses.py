"""Courses of load, speed and thrust that drive runs: in words, and over the time of a history."""

import json
import re
from collections.abc import Collection, Iterator, Mapping
from typing import Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.figures import coordinate_unit, number
from cvt_hpc.analysis.held_job import job_held
from cvt_hpc.errors import one_line
from cvt_hpc.job import Job
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.values import JOB_FILES, JOB_UNITS, POINT_UNITS
from cvt_hpc.parameters import Parameter
from cvt_hpc.storage.netcdf import attributes
from cvt_hpc.variator.profiles import FILE, TIME, multiple

_HAS_TIMES = re.compile(rf'"{TIME}":\s*\[[^]]')
DRIVEN = ("load", "driving_speed", "thrust", "driving_thrust", "driven_pressure", "ratio")


def ranges(
    point: Mapping[str, Any],
    declared: Mapping[str, Parameter],
    units: Mapping[str, str],
    varied: Collection[str] = (),
) -> dict[str, str]:
    """Return by key the range of each quantity that profiles change, such as "60 to 180 N m".

    Parameters
    ----------
    point : mapping
        Flat parameters of a run, or of a study's base scene [SI].
    declared, units : mapping
        By key the parameters of its model, and the units in which its job gives them.
    varied : collection of str
        What differs from run to run: the range is then one of multiples.
    """
    times = np.array(point.get(TIME, ()))
    found = {}
    for key in DRIVEN if times.size else ():
        is_pressed = key == "thrust" and point.get("driven_pressure_profile")
        if not (point.get(f"{key}_profile") or is_pressed):
            continue
        multiples = multiple(point, key, times)
        factor, unit = 1.0, "times its value"
        if key not in varied:
            wanted = {JOB_UNITS: units[key]} if key in units else {}
            factor, unit = coordinate_unit({"units": declared[key].unit} | wanted)
            factor *= point[key]
        ends = sorted((factor * multiples.min(), factor * multiples.max()))
        text = " to ".join(dict.fromkeys(number(value, ".4g") for value in ends))
        found[key] = f"{text} {unit}".rstrip()
    return found


def of_job(job: Job) -> dict[str, str]:
    """Return the `ranges` of a study."""
    varied = {axis.name for axis in job.axes} | {derived.name for derived in job.derived}
    return ranges(job.parameters, job.schema.parameters, job.units, varied)


def of_history(given: Mapping[str, Any]) -> dict[str, str]:
    """Return the `ranges` of a run by the attributes of its history."""
    job, point = (json.loads(given.get(name, "{}")) for name in ("job", "point"))
    if not (job and point.get(TIME)):
        return {}
    declared = load_schema(job["model"], job["stepper"], "history").parameters
    return ranges(point, declared, json.loads(given.get(POINT_UNITS, "{}")))


def in_words(changed: Mapping[str, str]) -> str:
    """Return `ranges` in words, such as "load 60 to 180 N m, speed 2900 to 3100 rpm"."""
    names = ("speed" if key == "driving_speed" else key.replace("_", " ") for key in changed)
    return ", ".join(f"{name} {text}" for name, text in zip(names, changed.values(), strict=True))


def line_of(changed: Mapping[str, str], file: str = "") -> str:
    """Return `ranges` as a line above a picture, with the file that gives them; "" where nothing changes."""
    return f"course{file and ' of '}{file}: {in_words(changed)}" if changed else ""


def file_of(given: Mapping[str, Any]) -> str:
    """Return the name of the file that gives the course of a run by the attributes of its history, or ""."""
    try:
        return one_line(str(json.loads(given.get(JOB_FILES, "{}")).get(FILE, "")))
    except (AttributeError, TypeError, ValueError, RecursionError):
        return ""


def line_of_study(dataset: xr.Dataset) -> str:
    """Return the `line_of` the results of a study; "" of several that are joined."""
    # a job of a hundred thousand samples takes seconds to read
    job = job_held(dataset) if _HAS_TIMES.search(str(dataset.attrs.get("job", ""))) else None
    if job is None or not {"run", *(axis.name for axis in job.axes)}.issuperset(dataset["status"].dims):
        return ""
    return line_of(of_job(job), job.files.get(FILE, ""))


def thrusts(history: xr.Dataset) -> Iterator[xr.DataArray]:
    """Yield the thrusts (time,) [N] that the profiles of a run change, where its history has no forces."""
    changed, point = of_history(history.attrs), json.loads(history.attrs.get("point", "{}"))
    for key, pulley in (("thrust", "driven"), ("driving_thrust", "driving")):
        if " to " in changed.get(key, "") and f"axial_force_{pulley}" not in history:
            values = point[key] * multiple(point, key, history["time"].values)
            told = attributes(key.replace("_", " "), "N", f"on the {pulley} pulley, as its profile has it")
            yield xr.DataArray(values, {"time": history["time"]}, ("time",), key, told)
