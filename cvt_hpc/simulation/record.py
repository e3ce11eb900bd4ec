"""The record of a run: what it holds, and how it is made of a run that has ended."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.simulation.modules import record_module
from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates
from cvt_hpc.vibration.assessment import Occurrence, assess

if TYPE_CHECKING:
    from cvt_hpc.job import Job

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


def record_variables(job: Job) -> tuple[Variable, ...]:
    """Quantities of a run's record, `status` first.

    Parameters
    ----------
    job : Job
        Of which only the model counts.
    """
    return (*_VERDICT, *_OCCURRENCE, *record_module(job).VARIABLES, *_COST)


def record_coordinates(job: Job) -> dict[str, Coordinate]:
    """Dimensions of a run's record beside the grid's.

    Parameters
    ----------
    job : Job
        A validated job.
    """
    return record_module(job).coordinates(job.parameters)


def record_of(job: Job, run: Any, marched: float) -> dict[str, Any]:
    """The record of a run that has ended.

    Parameters
    ----------
    job : Job
        For its model.
    run : object
        A run as the model's batch has them.
    marched : float
        Processor time that it has taken [s].
    """
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
        **record_module(job).evaluate(run, strongest),
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
