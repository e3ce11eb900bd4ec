"""The content of a bifurcation job: branches along the load, and the runs beside them.

The expected cost follows from the cost models of steady states and runs.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.errors import mismatch
from cvt_hpc.experiments.parts import numbers_of
from cvt_hpc.job import Job, build_job, rebuild_job
from cvt_hpc.job.assignments import Assignments, split_assignments
from cvt_hpc.job.axes import Axis
from cvt_hpc.job.definition import digest
from cvt_hpc.job.document import read_document, read_set, read_table
from cvt_hpc.job.rules import varied_by
from cvt_hpc.job.summary import core_time_in_words, values_in_words
from cvt_hpc.job.values import JOB_UNITS
from cvt_hpc.models.contract import load_model
from cvt_hpc.parameters import Parameter, positive
from cvt_hpc.storage.netcdf import attributes
from cvt_hpc.tables import columns

_STEADY, TRANSIENT = "linear_stability", "elastic_belt"
LOAD = "torque at the driving pulley"
_BRANCH = {
    "disturbance": Parameter(
        (1e-6, 3e-4),
        "m",
        "of the runs from the steady state and from the large start; []: no runs",
        sensible=(1e-12, 0.01),
    ),
    "resolution": positive(
        1.0, "N m", "spacing of the runs where vibration begins or ends", sensible=(0.01, 100.0)
    ),
}

# of a first state: a further one beside a known state with its modes, 40 ms and 100 ms where that takes 1 s
FURTHER = 0.14
ENDS = 2  # places along the load where vibration begins or ends, with closer runs beside them


@dataclass(frozen=True)
class Asked:
    """One requested branch."""

    place: dict[str, Any]  # values of the axes other than the load [SI]
    parameters: dict[str, Any]  # resolved parameters of the steady belt [SI]
    runs: Job  # of its transients, without axes


@dataclass(frozen=True)
class Diagram:
    """The content of a job."""

    job: Job  # of linear stability, with the load among its axes
    axes: tuple[Axis, ...]  # those other than the load
    loads: tuple[float, ...]  # ascending [N m]
    branches: tuple[Asked, ...]  # one for each combination of the other axes' values, the last axis fastest
    # of the runs from near the steady state and from the large start [m]; () for no runs
    disturbance: tuple[float, ...]
    resolution: float  # spacing of the runs where vibration begins or ends [N m]
    settings: dict[str, Any]  # further keys of the runs, as the job gives them

    def resolved(self) -> dict[str, Any]:
        """Return all entries that determine the numbers, as a job file is laid out, in JSON types."""
        table = {
            "disturbance": list(self.disturbance),
            "resolution": self.resolution,
            "set": self.settings,
        }
        return {**self.job.resolved(), "branch": table}

    def fingerprint(self) -> str:
        """Return the SHA-256 [hex] of all entries that determine the numbers."""
        return digest(numbers_of(self.resolved()))


def load_attributes(job: Job) -> dict[str, Any]:
    """Return the attributes of the loads, by which people read them in the unit of the job."""
    unit = job.schema.units.get("load")
    return attributes("load", "N m", LOAD) | ({JOB_UNITS: unit} if unit else {})


def load(path: str | Path, overrides: Assignments = ()) -> Diagram:
    """Read and validate a job of bifurcation diagrams, with overrides as of `load_job`.

    It is a TOML file: a job of `linear_stability` with an axis `load`, and with a table [branch] or without.

    Raises
    ------
    InputError
        If anything is wrong with the file or an override, or it sets a key of [branch].
    """
    source = str(path)
    document = read_document(Path(path))
    table = document.pop("branch", {})
    own = read_table(_BRANCH, table, f"{source}: [branch]", ("set",))
    _check_disturbance(own["disturbance"], f"{source}: [branch] disturbance")
    replaced = split_assignments(overrides, source, "--set")
    for key in replaced:
        if key.removeprefix("branch.") in (*_BRANCH, "set"):
            raise mismatch(
                f"{source}: --set {key}",
                "a parameter or an axis",
                "a key of [branch], read from the file alone",
            )
    job = build_job(document, source, replaced, "--set")
    if job.model != _STEADY:
        raise mismatch(f"{source}: model", _STEADY, job.model, "`cvt-hpc examples branch` copies such a job")
    if job.design:
        raise mismatch(f"{source}: [design]", "the full grid of the axes", job.design["kind"])
    along = [axis for axis in job.axes if axis.name == "load"]
    if not along or len(along[0].values) < 2:
        raise mismatch(f"{source}: [axes] load", "two values or more, along which to go", "fewer")
    _check_beside_load(job)
    axes = tuple(axis for axis in job.axes if axis.name != "load")
    settings = read_set(table, f"{source}: [branch]")
    branches = []
    for values in product(*(axis.values for axis in axes)):
        place = dict(zip((axis.name for axis in axes), values, strict=True))
        runs = _runs(job, place, settings, f"{source}: [branch]")
        branches.append(Asked(place, job.complete(place), runs))
    loads = tuple(sorted(along[0].values))
    return Diagram(job, axes, loads, tuple(branches), own["disturbance"], own["resolution"], settings)


def _check_beside_load(job: Job) -> None:
    """Refuse parameters that follow from the load: a branch has one value of each."""
    varied = varied_by(job.rules, ("load",))
    for rule in job.rules:
        if varied[rule.key]:
            expected = "a value that does not follow from the load, along which branches go"
            raise mismatch(rule.where, expected, rule.words)


def _check_disturbance(values: tuple[float, ...], where: str) -> None:
    if values and not (len(values) == 2 and 0.0 < values[0] < values[1]):
        raise mismatch(where, "a small and a larger displacement above 0, or []", str(list(values)))


def _runs(job: Job, place: dict[str, Any], settings: dict[str, Any], where: str) -> Job:
    """Return the job of the transients beside a branch, in its scene and judged in its band."""
    alternatives = {key for key, parameter in job.schema.parameters.items() if parameter.gives}
    tables = job.tables(job.complete(place), {"load", *alternatives})
    band = tables.pop("judgement")
    document = {"name": job.name, "model": TRANSIENT, **tables}
    kept: dict[str, Any] = {key: band[key] for key in ("band_low", "band_high") if key in band}
    runs = rebuild_job(document, where, job.units, {**kept, **place, **settings}, "set")
    if runs.axes:
        raise mismatch(f"{where} set {runs.axes[0].name}", "one value", "an axis")
    return runs


class Cost(NamedTuple):
    """Cost of a branch: core-seconds of its steady states and of its runs, and the number of runs."""

    steady: float
    transient: float
    runs: int

    @property
    def total(self) -> float:
        """Core-seconds [s]."""
        return self.steady + self.transient


def predicted_cost(diagram: Diagram, asked: Asked) -> Cost:
    """Return the cost of a branch where vibration begins once and ends once."""
    first = float(load_model(diagram.job.model).cost(asked.parameters, None))
    steady = first * (1.0 + FURTHER * len(diagram.loads))
    if not diagram.disturbance:
        return Cost(steady, 0.0, 0)
    closer = np.ceil(np.diff(diagram.loads).mean() / diagram.resolution) - 1.0
    runs = len(diagram.disturbance) * (len(diagram.loads) + ENDS * int(max(closer, 0.0)))
    model, parameters, stepper = load_model(asked.runs.model), asked.runs.parameters, asked.runs.stepper
    each = float(model.cost(parameters, stepper)) / model.lanes(parameters, stepper)
    return Cost(steady, runs * each, runs)


def plan_lines(diagram: Diagram, out: Path) -> Iterator[str]:
    """Yield the lines that describe a diagram and its expected cost."""
    job, loads = diagram.job, diagram.loads
    costs = [predicted_cost(diagram, asked) for asked in diagram.branches]
    yield f"diagram {job.name} ({job.source}): {len(costs)} branches of {len(loads)} loads"
    if job.description:
        yield job.description
    axes = [(axis.name, values_in_words(axis, job.schema), f"{len(axis.values)} values") for axis in job.axes]
    yield from columns(axes)
    steady, transient = (sum(getattr(cost, name) for cost in costs) for name in ("steady", "transient"))
    yield f"steady states: {len(costs) * len(loads)}, {core_time_in_words(steady)}"
    runs = sum(cost.runs for cost in costs)
    ends = f", if vibration begins and ends once along each branch: {core_time_in_words(transient)}"
    yield f"runs: {f'about {runs}{ends}' if runs else 'none'}"
    total = core_time_in_words(steady + transient)
    yield f"estimated cost: {total}, in one process"
