"""How far a study depends on its time step: a sample of its runs done again at half the step, or explicitly.

Both ways are repeats as `repeats.py` has them. A run of model auto is repeated by that model: its coarse and
its full transient are both at half the step, so that an error shows that both have in common. By the explicit
step it is done in full.
"""

from collections.abc import Iterable, Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import mismatch
from cvt_hpc.job import Job
from cvt_hpc.job.derivation import overridden
from cvt_hpc.job.for_model import handed_to
from cvt_hpc.models.auto.rules import COARSENESS, Rung
from cvt_hpc.models.contract import load_model
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.repeats import AUDITED, FULL_MODEL, Repeat, built
from cvt_hpc.study.status import expected_cost
from cvt_hpc.study.time_steps import STEP, stepper_in_words
from cvt_hpc.variables import Status

FLAG = "--check-step"
EXPLICIT = "explicit"
# By name of a way its words, and the folder of its runs
WAYS = {
    "half": ("at half the step", "check_step"),
    EXPLICIT: ("by the explicit step", "check_explicit"),
}


def step_check(job: Job, out: Path, fraction: float, way: str = "half") -> Repeat:
    """Return the check of a study's time step.

    Parameters
    ----------
    job : Job
        The job, with a stepper of a fixed step.
    out : Path
        Its folder.
    fraction : float
        Share of the runs that is done again.
    way : str
        One of WAYS.

    Raises
    ------
    InputError
        If the job has no fixed step, varies it, or cannot be done the other way.
    """
    _check(job, way)
    words, folder = WAYS[way]
    if way == EXPLICIT:
        other = built(job, _explicit(job))
        own: dict[str, Any] = {"core_seconds": lambda: expected_cost(other, out / folder)[0]}
    else:
        # each run has a step of its own to be halved
        other = built(job, _halved(job))
        own = {"core_seconds": lambda: 2.0 * expected_cost(job, out)[0], "steps": halved_steps}
    return Repeat("step check", words, job, out, folder, other, fraction, _eligible, **own)


def halved_steps(records: Records, runs: NDArray[np.intp]) -> Mapping[int, float]:
    """Return half of the time step [s] that each run has taken, by its index.

    As recorded, so that it holds for runs whose step was shortened, or chosen for their scene.
    """
    steps = 0.5 * records.read(runs, "time_step")
    if "rung" in records.study.record_names:  # of auto, whose parameter is the step of the full run
        steps = np.where(records.read(runs, "rung") == Rung.COARSE, COARSENESS * steps, steps)
    return dict(zip(runs.tolist(), steps.tolist(), strict=True))


def _check(job: Job, way: str) -> None:
    if STEP not in job.parameters:
        raise mismatch(FLAG, "a job whose stepper has a fixed step", stepper_in_words(job))
    varied = [axis.name for axis in job.axes if job.schema.section_of[axis.name] == _section(job)]
    if varied:
        raise mismatch(FLAG, f"a job with one value of {varied[0]}", "an axis")
    if way == EXPLICIT and job.stepper == EXPLICIT:
        raise mismatch(f"{FLAG}-by {EXPLICIT}", "a job of another stepper", f"stepper {job.stepper}")


def _section(job: Job) -> str:
    return job.schema.section_of[STEP]


def _halved(job: Job) -> dict[str, Any]:
    document = _without(job.resolved(), _section(job), (STEP, *overridden((STEP,), job.schema)))
    document[_section(job)][STEP] = 0.5 * job.parameters[STEP]
    return document


def _explicit(job: Job) -> dict[str, Any]:
    """The same runs by the explicit step with its own defaults, in full if the model is auto."""
    model = FULL_MODEL if job.model == AUDITED else job.model
    document = handed_to(job, model, "by the explicit step, to check the step")
    stepper = load_model(job.model).steppers[job.stepper]  # type: ignore[index]  # with a step there is one
    own = import_module(stepper).PARAMETERS[_section(job)]
    return _without(document, _section(job), own) | {"stepper": EXPLICIT}


def _without(document: dict[str, Any], section: str, keys: Iterable[str]) -> dict[str, Any]:
    """The document without some keys, whether its tables, its formulas or its links give them."""
    tables = (document.get(section, {}), document.get("derived", {}), *document.get("linked", {}).values())
    for table in tables:
        for key in keys:
            table.pop(key, None)
    return document


def _eligible(records: Records) -> NDArray[np.bool_]:
    """Whether a run has ended with results, and has taken steps for them, shape (runs,)."""
    done = records.status == Status.DONE
    places = np.flatnonzero(done)
    done[places] = np.isfinite(records.read(places, "time_step"))
    return done
