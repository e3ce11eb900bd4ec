"""The record of a run: its content, and how it is made of a run that has ended.

Batches are groups of runs that can advance together; their cost is here as well.
"""

import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from cvt_hpc.job import Job
from cvt_hpc.job.definition import Derived
from cvt_hpc.job.rules import Noted, places, varied_by
from cvt_hpc.models.contract import Model, Parameters, Run, load_model
from cvt_hpc.recording import longest_duration
from cvt_hpc.variables import LONGEST_REASON, Coordinate, Status, Values, Variable, Vibrates, shortened

_VERDICT = (
    Variable("status", "", "how the run ended", dtype="i1", flags=Status),
    Variable(
        "vibrates",
        "",
        "whether the belt vibrates; has a meaning where status is done",
        dtype="i1",
        flags=Vibrates,
    ),
    Variable("reason", "", "why the run failed, or was found to vibrate or not", dtype=f"S{LONGEST_REASON}"),
)
_COST = (
    Variable(
        "core_seconds",
        "s",
        "processor time, all tries; of runs that advance together, their time divided by their number",
        volatile=True,
        words="processor time",
    ),
)
_MARCH = (
    Variable(
        "simulated_seconds",
        "s",
        "more than asked where a run was prolonged, less where it failed or slipped through",
        words="simulated time",
    ),
    Variable("time_step", "s", "time step of the run that counts"),
    Variable("refinements", "1", "times that the run was done again at half the step", dtype="i1"),
    Variable("steps", "1", "time steps taken, all tries", dtype="i8"),
    Variable("contact_solves", "1", "linear solves of the contact problem, all tries", dtype="i8"),
)
COMMON = (*_VERDICT, *_COST, *_MARCH)  # of all models; those without a march have none of its

_EARLY_SHARE = 0.58  # of the first transient where runs may end at a quarter of it, as measured there, too
_LEFT_SHARE = 1.0  # extra cost of refined and prolonged runs in a map, as measured by lebrecht_2004.toml
_MOST_ESTIMATED = 2_000  # runs whose costs are averaged
BATCH_SECONDS = 30.0  # of computing in a batch, as predicted: so much a process that dies may lose
SOLVED_TOGETHER, SOLVED_SECONDS = 64, 0.1  # runs without a march in a batch, and the time [s] of all
Item = TypeVar("Item")
Point = dict[str, Any]  # flat parameters of a run [SI]

MOST_TURNS = 16  # groups of lanes in a batch: with more, those of the runs left would be hardly fuller


def recorded_model(job: Job) -> Model:
    """Return the model of a job; InputError where its runs are not judged and recorded."""
    model = load_model(job.model)
    model.check_recorded(job.source)
    return model


def record_variables(job: Job) -> tuple[Variable, ...]:
    """Quantities of a run's record, `status` first.

    Those along a dimension that the job's record does not have are left out.
    """
    march = () if job.stepper is None else _MARCH
    model, dims = recorded_model(job), record_coordinates(job).keys()
    own = (variable for variable in model.variables if dims >= {*variable.dims})
    return (*_VERDICT, *own, *_COST, *march)


def declared_record(model: str, source: str) -> tuple[list[Variable], dict[str, Coordinate]]:
    """Return all quantities that a model declares of a run, with default settings or others, and dimensions.

    Raises
    ------
    InputError
        If there is no such model, or its runs are not recorded.
    """
    from cvt_hpc.job import build_job

    job = build_job({"name": model, "model": model}, source)
    variables = {v.name: v for v in (*record_variables(job), *recorded_model(job).variables)}
    return list(variables.values()), record_coordinates(job)


def record_coordinates(job: Job) -> dict[str, Coordinate]:
    """Dimensions of a run's record beside the grid's."""
    return recorded_model(job).coordinates(job.parameters)


def record_of(
    job: Job,
    run: Run,
    marched: float,
    judge: Callable[[Run], Values | None] | None = None,
    blank: Values | None = None,
) -> Values:
    """The record of a transient, a run as the model's batch has them, that has ended.

    `marched` is the processor time that it has taken [s]. `judge` gives the values of a run that has reached
    its end, by default as the model judges its runs; None, and the record's status is not_run, where it does
    not answer. `blank` is an empty record of the job, by default a new one.
    """
    started = time.process_time()
    blank = blank_record(job) if blank is None else blank
    record, failure = dict(blank), run.failure
    if has_result(run) and (values := (judge or load_model(job.model).judge)(run)) is not None:
        record |= values
        if failure is None:
            failure = run.numerical_doubt(record)
    if failure is not None and failure[0] is not Status.DONE:
        status, why = failure
        record = blank | {"status": status, "reason": shortened(f"at {run.time * 1e3:.4g} ms: {why}")}
    return record | {
        "core_seconds": marched + time.process_time() - started,
        "simulated_seconds": run.time,
        "time_step": run.step,
        "steps": run.steps,
        "contact_solves": run.contact_solves,
    }


def has_result(run: Run) -> bool:
    """Whether a transient that has ended can be judged."""
    return run.failure is None or run.failure[0] is Status.DONE


def record_without_run(job: Job, values: Values) -> Values:
    """The record of a run that needed no transient."""
    return blank_record(job) | values | {"core_seconds": 0.0, "simulated_seconds": 0.0}


def blank_record(job: Job) -> Values:
    """An empty record."""
    sizes = {name: len(c.values) for name, c in record_coordinates(job).items()}
    return {
        v.name: v.blank
        if v.dtype.startswith("S")
        else np.full(tuple(sizes[dim] for dim in v.dims), v.blank, v.dtype)
        for v in record_variables(job)
    }


def run_costs(job: Job) -> np.ndarray:
    """Core-seconds of each run, in the order of indices: within a factor of two on usual processors."""
    values = [np.asarray(axis.values) for axis in job.axes]
    grids = values if job.is_sampled else np.meshgrid(*values, indexing="ij", sparse=True)
    p = Noted(
        {**job.parameters, **dict(zip((axis.name for axis in job.axes), grids, strict=True))},
        {derived.name: partial(_over_the_grid, job, derived) for derived in job.derived},
    )
    model = recorded_model(job)
    cost = model.cost(p, job.stepper) / model.lanes(job.parameters, job.stepper)
    return np.broadcast_to(cost * _allowance(p), job.shape).ravel()


def _allowance(p: Parameters) -> Any:
    """Cost of a run over that of its first transient, mean of a map: a number or an array of them."""
    if "longest_duration" not in p:
        return 1.0
    goes_on = longest_duration(p) > p["duration"]
    early = np.where(np.equal(p["shortest_duration"], 0.0), 1.0, _EARLY_SHARE)
    return early + _LEFT_SHARE * (goes_on | (p["most_refinements"] > 0))


def _over_the_grid(job: Job, derived: Derived) -> np.ndarray:
    """Values of a parameter that follows from axes, of a shape that broadcasts with that of the job."""
    values = np.asarray(derived.values)
    if job.is_sampled:
        return values
    return values.reshape([len(axis.values) if axis.name in derived.axes else 1 for axis in job.axes])


def estimate_cost(job: Job) -> float:
    """Core-seconds of a run, mean over the job; of a huge one, over runs from all over it.

    Not known (nan) of a model that no study runs.
    """
    if not load_model(job.model).is_recorded:
        return float("nan")
    return float(run_costs(job.thinned(_MOST_ESTIMATED)).mean())


def lane_groups(job: Job, indices: Sequence[int]) -> list[tuple[int, ...]]:
    """Split runs into batches, in which lanes can be filled again with the runs that are left.

    The model of the job gives by `lanes` how many runs a stepper takes at once, and by `lane_key` of a run's
    parameters which ones: runs with equal keys. Each run index comes once, in as few batches as can be, of
    nearly equal size.
    """
    runs = np.asarray(indices, np.int64)
    kinds = _lane_kinds(job)[runs]
    order = np.argsort(kinds, kind="stable")
    ends = np.flatnonzero(np.diff(kinds[order])) + 1
    batches = []
    for group in sorted(np.split(runs[order], ends), key=lambda group: group[:1].tolist()):
        if group.size:
            parts = -(-group.size // _batch_size(job, job.point(int(group[0]))))
            bounds = [group.size * part // parts for part in range(parts + 1)]
            batches += [tuple(group[first:last].tolist()) for first, last in pairwise(bounds)]
    return batches


def _lane_kinds(job: Job) -> np.ndarray:
    """Number of the lane key of each run, shape (runs,).

    A key follows from the parameters that are read for it. It is therefore evaluated at all places along the
    axes with which these vary, and along no other axis.
    """
    names, model = [axis.name for axis in job.axes], load_model(job.model)
    varied = varied_by(job.rules, names)
    first = {axis.name: axis.values[0] for axis in job.axes}
    along: set[str] = set()
    while True:
        kinds: dict[tuple, int] = {}
        numbers, read = [], set()
        for place in places(job.axes, along, sampled=job.is_sampled and bool(along)):
            point = Noted(job.complete({**first, **place}))
            numbers.append(kinds.setdefault(model.lane_key(point), len(kinds)))
            read |= point.read
        asked = {axis for key in read for axis in varied.get(key, (key,)) if axis in first}
        if asked <= along:
            break
        along |= asked
    if job.is_sampled:
        return np.broadcast_to(np.array(numbers, np.int32), job.shape)
    lengths = [len(axis.values) if axis.name in along else 1 for axis in job.axes]
    return np.broadcast_to(np.array(numbers, np.int32).reshape(lengths), job.shape).ravel()


def in_lanes(
    model: Model,
    stepper: str | None,
    runs: Iterable[Item],
    parameters: Callable[[Item], Parameters],
    apart: Callable[[Item], Any],
) -> Iterator[list[Item]]:
    """Yield groups of runs that can advance together, as many as there are lanes.

    Runs are anything that stands for one; `parameters` gives the flat ones of such a run [SI], and `apart`
    further values that the runs of a group have in common.
    """
    groups: dict[Any, list[Item]] = {}
    for run in runs:
        groups.setdefault((model.lane_key(parameters(run)), apart(run)), []).append(run)
    for group in groups.values():
        most = model.lanes(parameters(group[0]), stepper)
        for first in range(0, len(group), most):
            yield group[first : first + most]


def may_join(job: Job, runs: Sequence[int], others: Sequence[int]) -> bool:
    """Tell whether other runs can be done in the batch of some, and fill the lanes with them.

    Both are run indices of one batch.
    """
    model, parameters = load_model(job.model), job.point(runs[0])
    if len(runs) + len(others) > _batch_size(job, parameters):
        return False
    return model.lane_key(parameters) == model.lane_key(job.point(others[0]))


def _batch_size(job: Job, parameters: Parameters) -> int:
    """Most runs of a batch: several times the lanes, unless a process that dies would lose too much."""
    model = load_model(job.model)
    most = model.lanes(parameters, job.stepper)
    if job.stepper is None:  # they take their turns, and have the cost of a batch in common
        return int(np.clip(most * SOLVED_SECONDS / model.cost(parameters, None), most, SOLVED_TOGETHER))
    if most == 1:
        return 1
    return most * int(np.clip(BATCH_SECONDS / model.cost(parameters, job.stepper), 1, MOST_TURNS))


def turns(job: Job, runs: int) -> int:
    """Number of groups of lanes that a batch does one after the other, including runs that are left apart."""
    return -(-runs // load_model(job.model).lanes(job.parameters, job.stepper))


def forget(job: Job) -> None:
    """Have the next batch take its full time, whatever runs of the job's model before it have left."""
    load_model(job.model).forget()


def profile_bytes(job: Job) -> int:
    """Size of a kept history's values along the belt at each sample, of a job, at most [byte]."""
    model = load_model(job.model)
    return max((model.profile_bytes(job.point(index)) for index in job.histories), default=0)


def pilot_share(job: Job) -> float:
    """Share of a run's simulated time from which the cost of the whole run is estimated."""
    return load_model(job.model).pilot_share
