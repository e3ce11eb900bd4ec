"""One run: a model marched by a stepper, recorded, judged, and turned into one record or a full history."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Collection, Mapping, Sequence
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.errors import InputError
from cvt_hpc.models import MODELS
from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates
from cvt_hpc.vibration.assessment import Occurrence, assess

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.job import Job

SAMPLES_BETWEEN_POLLS = 200  # 10 ms of simulated time, some 50 ms of computing

_VERDICT = (
    Variable("status", (), "i1", "", "how the run ended", Status),
    Variable(
        "vibrates", (), "i1", "", "whether the belt vibrates; has a meaning where status is done", Vibrates
    ),
    Variable("reason", (), "S240", "", "why the run failed, or was found to vibrate or not"),
)
_OCCURRENCE = (
    Variable("amplitude", ("strand",), "f8", "m", "band-limited peak amplitude at the strongest probe"),
    Variable("frequency", ("strand",), "f8", "Hz", "dominant frequency at the strongest probe"),
    Variable("growth_rate", ("strand",), "f8", "s-1", "growth rate of the amplitude over the judged part"),
    Variable("growth_error", ("strand",), "f8", "s-1", "standard error of the growth rate"),
)
_COST = (
    Variable(
        "core_seconds",
        (),
        "f8",
        "s",
        "processor time of the run; of runs that advance together, their time divided by their number",
        volatile=True,
    ),
    Variable("simulated_seconds", (), "f8", "s", "simulated time, less than asked where the run failed"),
    Variable("time_step", (), "f8", "s", "time step"),
    Variable("steps", (), "i8", "1", "time steps taken"),
    Variable("contact_solves", (), "i8", "1", "linear solves of the contact problem"),
)


class Interrupted(Exception):
    """The run was asked to stop before its end; the text says why."""


def record_variables(job: Job) -> tuple[Variable, ...]:
    """Quantities of a run's record, `status` first.

    Parameters
    ----------
    job : Job
        Of which only the model counts.
    """
    return (*_VERDICT, *_OCCURRENCE, *_model_record(job).VARIABLES, *_COST)


def record_coordinates(job: Job) -> dict[str, Coordinate]:
    """Dimensions of a run's record beside the grid's.

    Parameters
    ----------
    job : Job
        A validated job.
    """
    return _model_record(job).coordinates(job.parameters)


def run_costs(job: Job) -> np.ndarray:
    """Core-seconds of each run: within a factor of two on processors of the last years.

    Parameters
    ----------
    job : Job
        A validated job.

    Returns
    -------
    (runs,) array
        In the order of run indices.
    """
    grids = np.meshgrid(*(axis.values for axis in job.axes), indexing="ij", sparse=True)
    p = {**job.parameters, **dict(zip((axis.name for axis in job.axes), grids, strict=True))}
    model = _model_record(job)
    # of general steppers, some of which choose their step, little is known beforehand
    cost = model.STEP_COST.get(job.stepper, 1e-5) * p["stations"] * p["duration"] / p.get("step", 1e-6)
    cost = cost / model.lanes(job.parameters, job.stepper)
    return np.broadcast_to(cost, job.shape).ravel()


def estimate_cost(job: Job) -> float:
    """Core-seconds of a run, mean over the job.

    Not known (nan) of a model that no study runs.

    Parameters
    ----------
    job : Job
        A validated job.
    """
    if not _has_record(job):
        return float("nan")
    return float(run_costs(job).mean())


def run_point(job: Job, point: dict[str, Any], interrupt: Callable[[], str | None]) -> dict[str, Any]:
    """Do one run.

    Parameters
    ----------
    job : Job
        For its model and stepper.
    point : dict
        Flat parameters of the run [SI].
    interrupt : callable
        Asked every few tens of milliseconds; a text ends the run.

    Returns
    -------
    dict
        Value of each of `record_variables`. A run that fails has its reason, and no numbers but its cost.

    Raises
    ------
    Interrupted
        With the text of `interrupt`.
    """
    return run_points(job, [point], interrupt)[0]


def run_points(
    job: Job, points: Sequence[dict[str, Any]], interrupt: Callable[[], str | None]
) -> list[dict[str, Any]]:
    """Do several runs that advance together, in the lanes of the processor's registers.

    Parameters
    ----------
    job : Job
        For its model and stepper.
    points : sequence of dict
        Flat parameters of the runs [SI], as `lane_groups` puts them together.
    interrupt : callable
        As `run_point` takes it.

    Returns
    -------
    list of dict
        Records in the order of the points, each bitwise what `run_point` makes of its point alone.

    Raises
    ------
    Interrupted
        With the text of `interrupt`.
    """
    return [record for _, record in _march(job, points, interrupt)]


def run_points_keeping(
    job: Job, points: Sequence[dict[str, Any]], interrupt: Callable[[], str | None], kept: Collection[int]
) -> tuple[list[dict[str, Any]], dict[int, xr.Dataset]]:
    """Do as `run_points`, and return the histories of the runs at some places of `points` as well.

    Parameters
    ----------
    job, points, interrupt
        As `run_points` takes them.
    kept : collection of int
        Places in `points`.

    Returns
    -------
    records : list of dict
        As of `run_points`.
    histories : dict
        Datasets as `simulate` returns them, by place.
    """
    marched = _march(job, points, interrupt)
    histories = {place: _history(job, points[place], *marched[place]) for place in kept}
    return [record for _, record in marched], histories


def lane_groups(job: Job, indices: Sequence[int]) -> list[tuple[int, ...]]:
    """Split runs into batches that can advance together.

    Parameters
    ----------
    job : Job
        A validated job. Its model's record says by `lanes` how many runs a stepper takes at once, and by
        `lane_key` of a run's parameters which ones: those with equal keys.
    indices : sequence of int
        Run indices.

    Returns
    -------
    list of tuple of int
        Each index once, in batches of as many as the processor's registers hold.
    """
    model = _model_record(job)
    groups: dict[Any, list[int]] = {}
    for index in indices:
        groups.setdefault(model.lane_key(job.point(index)), []).append(index)
    batches = []
    for group in groups.values():
        most = model.lanes(job.point(group[0]), job.stepper)
        batches += [tuple(group[first : first + most]) for first in range(0, len(group), most)]
    return batches


def simulate(job: Job, at: Mapping[str, Any] | None = None) -> xr.Dataset:
    """Do one run and keep its history.

    Parameters
    ----------
    job : Job
        A validated job.
    at : mapping, optional
        Values [SI, or texts with units] by key where the run departs from the base scene.

    Returns
    -------
    Dataset
        The record's names as scalars of the run, `displacement` (time, probe), the model's histories over
        `time`, and its means over the judged part by `position`.

    Raises
    ------
    InputError
        If a value is not fit for its key.
    """
    point = job.point_at(at or {})
    ((run, record),) = _march(job, [point], lambda: None)
    return _history(job, point, run, record)


def _history(job: Job, point: dict[str, Any], run: Any, record: dict[str, Any]) -> xr.Dataset:
    """A run that has ended, as a dataset."""
    import xarray as xr

    coordinates = {
        name: (name, c.values, _attributes(c.long_name, c.units))
        for name, c in record_coordinates(job).items()
    }
    variables: dict[str, Any] = {}
    for variable in record_variables(job):
        value = record[variable.name]
        value = value if variable.dtype.startswith("S") else np.asarray(value, variable.dtype)
        variables[variable.name] = (variable.dims, value, _variable_attributes(variable))
    histories = _model_record(job).histories(run)
    attributes = {
        "Conventions": "CF-1.11",
        "title": job.description or job.name,
        "job_name": job.name,
        "job": json.dumps(job.resolved()),
        "point": json.dumps({key: repr(value) if value == np.inf else value for key, value in point.items()}),
    }
    dataset = xr.Dataset(variables, coordinates, attributes)
    return dataset.merge(histories, combine_attrs="override")


def _march(
    job: Job, points: Sequence[dict[str, Any]], interrupt: Callable[[], str | None]
) -> list[tuple[Any, dict[str, Any]]]:
    """March a batch of runs, and make their records."""
    batch = _model(job).batch(points, job.stepper)
    batch.advance(0)  # compiles or loads the kernels, which is no cost of these runs
    started = time.process_time()
    while batch.running:
        if stop := interrupt():
            raise Interrupted(stop)
        batch.advance(SAMPLES_BETWEEN_POLLS)
    marched = (time.process_time() - started) / len(points)
    return [(run, _record(job, run, marched)) for run in batch.runs]


def _record(job: Job, run: Any, marched: float) -> dict[str, Any]:
    """The record of a run that has ended."""
    started = time.process_time()
    record, failure = _blank(job), run.failure
    if failure is None:
        record |= _judge(job, run, run.parameters)
        failure = run.numerical_doubt(record)
    if failure is not None:
        status, why = failure
        record = _blank(job) | {"status": status, "reason": f"at {run.time * 1e3:.4g} ms: {why}"[:240]}
    return record | {
        "core_seconds": marched + time.process_time() - started,
        "simulated_seconds": run.time,
        "time_step": run.step,
        "steps": run.steps,
        "contact_solves": run.contact_solves,
    }


def _judge(job: Job, run: Any, point: dict[str, Any]) -> dict[str, Any]:
    """The record of a run that has reached its end."""
    regions = [probe.label.split()[0] for probe in run.probes]
    on_strands = [k for k, region in enumerate(regions) if region in ("t1", "t2")]
    found: Occurrence = assess(
        run.displacement[:, on_strands], point["sampling_rate"], [regions[k] for k in on_strands], point
    )
    strongest = np.array(on_strands)[found.strongest_probe]
    return {
        "status": Status.DONE,
        "vibrates": found.vibrates,
        "reason": found.reason,
        "amplitude": found.amplitude,
        "frequency": found.frequency,
        "growth_rate": found.growth_rate,
        "growth_error": found.growth_error,
        **_model_record(job).evaluate(run, strongest),
    }


def _blank(job: Job) -> dict[str, Any]:
    """A record in which nothing is known: numbers are not numbers, counts and flags 0."""
    sizes = {name: len(c.values) for name, c in record_coordinates(job).items()}
    blank: dict[str, Any] = {}
    for variable in record_variables(job):
        if variable.dtype.startswith("S"):
            blank[variable.name] = ""
        else:
            shape = tuple(sizes[dim] for dim in variable.dims)
            blank[variable.name] = np.full(shape, np.nan if variable.dtype == "f8" else 0, variable.dtype)
    return blank


def _model(job: Job) -> ModuleType:
    _check_recorded(job)
    return import_module(MODELS[job.model] + ".transient")


def _model_record(job: Job) -> ModuleType:
    _check_recorded(job)
    return import_module(MODELS[job.model] + ".record")


def _check_recorded(job: Job) -> None:
    if not _has_record(job):
        raise InputError(
            f"{job.source}: model: expected one whose runs are judged and recorded (elastic_belt), "
            f"found {job.model}, which is there to compare steppers: `cvt-hpc chart`"
        )


def _has_record(job: Job) -> bool:
    return find_spec(MODELS[job.model] + ".record") is not None


def _attributes(long_name: str, units: str) -> dict[str, str]:
    return {"long_name": long_name, **({"units": units} if units else {})}


def _variable_attributes(variable: Variable) -> dict[str, Any]:
    attributes: dict[str, Any] = _attributes(variable.long_name, variable.units)
    if variable.flags is not None:
        attributes["flag_values"] = np.array([int(flag) for flag in variable.flags], variable.dtype)
        attributes["flag_meanings"] = " ".join(flag.name.lower() for flag in variable.flags)
    return attributes
