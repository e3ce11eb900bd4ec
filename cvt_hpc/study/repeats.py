"""A sample of a study's runs, done again another way, to see how far its results depend on the way.

The sample is drawn by the runs' indices: a continued study, or a larger share, continues
with the same sample. Its runs are a study of their own, in a folder of that of the first one.

A step check shows how far a study depends on its time step: a sample of its runs is done again at half the
step, or explicitly. A run of model auto is repeated by that model: its coarse and
its full transient are both at half the step, so that an error shows that both have in common. By the explicit
step it is done in full.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import mismatch, show
from cvt_hpc.job import Job, rebuild_job
from cvt_hpc.job.definition import handed_to
from cvt_hpc.job.rules import overridden
from cvt_hpc.job.values import Document
from cvt_hpc.models.auto.rules import COARSENESS, Rung
from cvt_hpc.models.contract import load_model
from cvt_hpc.storage.files import refuse_link
from cvt_hpc.study.description import Study, describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.simulator import default_simulator
from cvt_hpc.study.status import RunReport, expected_cost
from cvt_hpc.study.sweep import check_start, run
from cvt_hpc.study.task import STEP, stepper_in_words
from cvt_hpc.variables import Status

AUDIT = "audit"  # folder of the runs of an audit, in that of the study
AUDITED, FULL_MODEL = "auto", "elastic_belt"  # what answers some runs cheaply, and what does all in full

_FLAG = "--check-step"
_EXPLICIT = "explicit"
# By name of a way its words, and the folder of its runs
WAYS = {"half": ("at half the step", "check_step"), _EXPLICIT: ("by the explicit step", "check_explicit")}


def _of_the_job(records: Records, runs: NDArray[np.intp]) -> Mapping[int, float]:
    return {}


@dataclass(frozen=True)
class Repeat:
    """A sample of the runs of a study, and another way to do them."""

    label: str  # its name in messages
    way: str  # how the runs are done again, in words
    first: Job  # the runs as they were done
    out: Path  # their folder; all of them are done before the sample is drawn
    folder: str  # where the repeated runs are kept, in that folder
    job: Job  # the same runs as they are done again
    fraction: float  # share of the eligible runs that is done again; one run at least, if any is eligible
    # returns by the records of the first study the runs that may be drawn, shape (runs,)
    eligible: Callable[[Records], NDArray[np.bool_]]
    # returns the expected cost of a repeated run [core-seconds], mean over the job
    core_seconds: Callable[[], float]
    # returns by these records and the indices of drawn runs the time step [s] of runs that are not to take
    # that of `job`, by index
    steps: Callable[[Records, NDArray[np.intp]], Mapping[int, float]] = _of_the_job

    @property
    def place(self) -> Path:
        """The output folder of the repeated runs."""
        return self.out / self.folder

    @cached_property
    def study(self) -> Study:
        """The first study."""
        return describe(self.first, default_simulator())

    @cached_property
    def records(self) -> Records:
        """Records of the first study, as they are at the first access."""
        return StudyFolder(self.out).read_records(self.study)

    @cached_property
    def may_be_drawn(self) -> NDArray[np.bool_]:
        """Which runs of the first study are eligible, shape (runs,)."""
        return self.eligible(self.records)

    @property
    def sample(self) -> NDArray[np.bool_]:
        """Which runs are done again, shape (runs,): each by a lot that is drawn for its index."""
        lots = np.random.default_rng(int(self.study.fingerprint[:16], 16)).random(self.study.size)
        lots = np.where(self.may_be_drawn, lots, np.inf)
        # the lowest lot is in every larger sample as well
        return np.isfinite(lots) & (lots <= max(self.fraction, lots.min()))

    def check(self, fresh: bool) -> None:
        """Raise the InputError that `run` would raise before it computes anything; touches nothing."""
        refuse_link(self.place)
        check_start(self.job, self.place, fresh=fresh)

    def run(self, **options: Any) -> RunReport:
        """Do the runs of the sample again; on all ranks, with the options of `cvt_hpc.study.run`."""
        refuse_link(self.place)
        return run(
            self.job,
            self.place,
            chosen=lambda: self.sample,
            asked_steps=lambda: self.steps(self.records, np.flatnonzero(self.sample)),
            **options,
        )


def check_fraction(flag: str, fraction: float, part: str | None = None) -> None:
    """Raise InputError where a share is none, or where only a part of a study is to be done."""
    if not 0.0 < fraction <= 1.0:
        raise mismatch(flag, "a fraction above 0, at most 1", show(fraction))
    if part is not None:
        raise mismatch(flag, "a run of the whole study, once its parts have ended", f"part {part}")


def built(job: Job, document: Document) -> Job:
    """Return the job of a document of the same runs; of the whole grid where the first one chooses some."""
    if job.in_rounds:
        document = {key: table for key, table in document.items() if key != "design"}
    return rebuild_job(document, job.source, job.units)


def step_check(job: Job, out: Path, fraction: float, way: str = "half") -> Repeat:
    """Return the check of a study's time step: a share of the runs in a folder, done again by one of WAYS.

    Raises
    ------
    InputError
        If the job has no fixed step, varies it, or cannot be done the other way.
    """
    _check(job, way)
    words, folder = WAYS[way]
    other = built(job, _explicit(job) if way == _EXPLICIT else _halved(job))

    def cost() -> float:
        return expected_cost(other, out / folder)[0] if way == _EXPLICIT else 2.0 * expected_cost(job, out)[0]

    # at half the step each run has a step of its own to be halved
    steps = _of_the_job if way == _EXPLICIT else _halved_steps
    return Repeat("step check", words, job, out, folder, other, fraction, _eligible, cost, steps)


def _halved_steps(records: Records, runs: NDArray[np.intp]) -> Mapping[int, float]:
    """Return half of the time step [s] that each run has taken, by its index.

    As recorded, so that it holds for runs whose step was shortened, or chosen for their scene.
    """
    steps = 0.5 * records.read(runs, "time_step")
    if "rung" in records.study.record_names:  # of auto, whose parameter is the step of the full run
        steps = np.where(records.read(runs, "rung") == Rung.COARSE, COARSENESS * steps, steps)
    return dict(zip(runs.tolist(), steps.tolist(), strict=True))


def _check(job: Job, way: str) -> None:
    if STEP not in job.parameters:
        raise mismatch(_FLAG, "a job whose stepper has a fixed step", stepper_in_words(job))
    if varied := [axis.name for axis in job.axes if job.schema.section_of[axis.name] == _section(job)]:
        raise mismatch(_FLAG, f"a job with one value of {varied[0]}", "an axis")
    if way == _EXPLICIT and job.stepper == _EXPLICIT:
        raise mismatch(f"{_FLAG}-by {_EXPLICIT}", "a job of another stepper", f"stepper {job.stepper}")


def _section(job: Job) -> str:
    return job.schema.section_of[STEP]


def _halved(job: Job) -> Document:
    document = _without(job.resolved(), _section(job), (STEP, *overridden((STEP,), job.schema)))
    document[_section(job)][STEP] = 0.5 * job.parameters[STEP]
    return document


def _explicit(job: Job) -> Document:
    """Return the runs by the explicit step with its own defaults, in full if the model is auto."""
    model = FULL_MODEL if job.model == AUDITED else job.model
    document = handed_to(job, model, "by the explicit step, to check the step")
    stepper = load_model(job.model).steppers[job.stepper]  # type: ignore[index]  # with a step there is one
    own = import_module(stepper).PARAMETERS[_section(job)]
    return _without(document, _section(job), own) | {"stepper": _EXPLICIT}


def _without(document: Document, section: str, keys: Iterable[str]) -> Document:
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
