"""Runs from their start to their records.

Histories of runs are datasets.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Collection, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cvt_hpc.job import Job
from cvt_hpc.job.assignments import Assignments, read_assignments, warn_of_bare_assignments
from cvt_hpc.job.values import POINT_UNITS
from cvt_hpc.models.contract import Model, load_model
from cvt_hpc.simulation.marching import Interrupted, More, march_runs, no_more
from cvt_hpc.simulation.record import (
    Point,
    blank_record,
    in_lanes,
    record_coordinates,
    record_variables,
    recorded_model,
)
from cvt_hpc.storage.netcdf import attributes, global_attributes, variable_attributes
from cvt_hpc.variables import Outcome, Values

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.job import Job


def run_point(job: Job, point: Point, interrupt: Callable[[], str | None]) -> Values:
    """Do the run of a point, its flat parameters [SI].

    Returns the value of each of `record_variables`. A run that fails has its reason, and no numbers but its
    cost. `interrupt` is called every few tens of milliseconds; a text ends the run.

    Raises
    ------
    Interrupted
        With the text of `interrupt`.
    """
    return run_points(job, [point], interrupt)[0]


def run_points(
    job: Job, points: Sequence[Point], interrupt: Callable[[], str | None], more: More = no_more
) -> list[Values]:
    """Do several runs that advance together, in the lanes of the processor's registers.

    Points are flat parameters of the runs [SI], as `lane_groups` puts them together; `interrupt` and `more`
    are as `march_runs` takes them. Records are in the order of the points, each bitwise equal to `run_point`
    of its point alone.

    Raises
    ------
    Interrupted
        With the text of `interrupt`.
    """
    return [record for _, record in do(job, points, interrupt, more=more)]


def do(
    job: Job,
    points: Sequence[Point],
    interrupt: Callable[[], str | None],
    kept: Collection[int] = (),
    more: More = no_more,
) -> list[tuple[Any, Values]]:
    """Do a batch of runs as `run_points`; beside each record the input of `histories`, if kept."""
    model = recorded_model(job)
    if job.stepper is None:
        return _solve(job, model, points, interrupt)
    return march_runs(job, points, interrupt, kept, more)


def _solve(
    job: Job, model: Model, points: Sequence[Point], interrupt: Callable[[], str | None]
) -> list[tuple[Any, Values]]:
    """Runs of a model without a transient: their records follow from the parameters at once."""
    blank, done = blank_record(job), {}
    for group in in_lanes(model, None, range(len(points)), points.__getitem__, lambda place: None):
        if stop := interrupt():
            raise Interrupted(stop)
        started = time.process_time()
        solutions = model.solve_together([points[place] for place in group])
        judged = model.judge_together(solutions)
        cost = {"core_seconds": (time.process_time() - started) / len(group)}
        for place, solution, values in zip(group, solutions, judged, strict=True):
            done[place] = solution, blank | values | cost
    return [done[place] for place in range(len(points))]


def simulate(job: Job, at: Assignments | None = None) -> xr.Dataset:
    """Do one run and keep its history.

    Where `lanes` is not given, its stations fill the lanes of the registers: it is done sooner than in a
    sweep, and its numbers are equal to the sweep's run but for round-off.

    Parameters
    ----------
    job : Job
        A validated job.
    at : mapping, or sequence of "KEY=VALUE", optional
        Values [SI, or texts with units] by key where the run departs from the base scene.

    Returns
    -------
    Dataset
        The record's names as scalars of the run, and the model's further data: of a transient
        `displacement` (time, probe), histories over `time`, and means over the judged part by `position`.

    Raises
    ------
    InputError
        If a value is not fit for its key.
    """
    return alone(job, at).history()


class Alone(NamedTuple):
    """A single run that has ended."""

    job: Job
    point: Point  # parameters [SI]
    run: Any  # what its histories are made of
    record: Values  # value of each of `record_variables`

    def outcomes(self) -> list[Outcome]:
        """Return what its record has without a dimension or along one."""
        places = record_coordinates(self.job)
        return [
            Outcome(
                one.name,
                np.asarray(self.record[one.name]),
                one.dims,
                variable_attributes(one),
                places[one.dims[0]].values if one.dims else (),
            )
            for one in record_variables(self.job)
            if len(one.dims) <= 1
        ]

    def history(self) -> xr.Dataset:
        """Return the dataset of `simulate`."""
        return _history(*self)


def alone(job: Job, at: Assignments | None = None) -> Alone:
    """Do one run as `simulate`, without a dataset."""
    given, schema = at or {}, job.schema
    job = job.with_units_of(given, "at")
    at = read_assignments(given, schema, job.source, "at")
    warn_of_bare_assignments(given, schema, job.source, "at")
    point = job.point_at(at)
    if "lanes" in point and "lanes" not in {*at, *job.given, *(axis.name for axis in job.axes)}:
        point["lanes"] = "stations"
    ((run, record),) = do(job, [point], lambda: None, kept=(0,))
    return Alone(job, point, run, record)


def run_points_keeping(
    job: Job, points: Sequence[Point], interrupt: Callable[[], str | None], kept: Collection[int]
) -> tuple[list[Values], dict[int, xr.Dataset]]:
    """Do as `run_points`, and return the histories of the runs at some places of `points` as well.

    They are datasets as `simulate` returns them, by place.
    """
    done = do(job, points, interrupt, kept)
    histories = {place: _history(job, points[place], *done[place]) for place in kept}
    return [record for _, record in done], histories


def _history(job: Job, point: Point, run: Any, record: Values) -> xr.Dataset:
    """A run that has ended, or a result without a run, as a dataset."""
    import xarray as xr

    coordinates = {
        name: (name, c.values, attributes(c.long_name, c.units, c.comment))
        for name, c in record_coordinates(job).items()
    }
    variables: dict[str, Any] = {}
    for variable in record_variables(job):
        value = record[variable.name]
        value = value if variable.dtype.startswith("S") else np.asarray(value, variable.dtype)
        variables[variable.name] = (variable.dims, value, variable_attributes(variable))
    told: dict[str, Any] = {
        **global_attributes(job, job.resolved(), f"model {job.model}"),
        "point": json.dumps({key: repr(value) if value == np.inf else value for key, value in point.items()}),
        POINT_UNITS: json.dumps(dict(job.units)),
    }
    if job.stepper is not None and run is not None:
        told["judged_fraction"] = run.parameters["judged_fraction"]  # less than requested if prolonged
    dataset = xr.Dataset(variables, coordinates, told)
    return dataset.merge(load_model(job.model).histories(run), combine_attrs="override")
