"""The computing of a sweep: batches of runs, each of which ends with a record in every case.

Failed runs are done again at a shorter time step, and checks of others at another one than their job's.
"""

from __future__ import annotations

import logging
import math
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import mismatch, show
from cvt_hpc.job import Job
from cvt_hpc.job.values import Point, file_names
from cvt_hpc.study.batches import Batch, Turns
from cvt_hpc.study.description import Study
from cvt_hpc.study.forecast.cost_model import Fit, fit_recorded
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.record.log import Record
from cvt_hpc.study.simulator import Interrupt, RecordValues, Simulator
from cvt_hpc.variables import Status

if TYPE_CHECKING:
    import xarray as xr

STEP = "step"  # the key of the time step, of steppers that have a fixed one
_MOST_REFINED = 1000.0

Begin = Callable[[Batch], None]
Join = Callable[[Batch, float], Batch]  # of the runs at work, and their time [s]: those that join, or none

_logger = logging.getLogger(__name__)


class Result(NamedTuple):
    """Result of runs that were done together."""

    records: list[Record]  # run index and record of each
    seconds: float = 0.0  # time [s] that they took together; 0 where it is not known
    # run index and history of each run whose history is kept
    histories: Sequence[tuple[int, xr.Dataset]] = ()

    @property
    def batch(self) -> Batch:
        """The run indices."""
        return tuple(index for index, _ in self.records)

    @property
    def failed(self) -> int:
        """Number of runs without results."""
        return sum(bool(row["status"] != Status.DONE) for _, row in self.records)


class _Outside(BaseException):
    """An error while runs join or ask whether to go on; no `except Exception` takes it for that of a run."""


class _Trouble(NamedTuple):
    """Why a batch has no records: status and reason of a run, and the text for several runs."""

    status: Status
    reason: str
    in_company: str


@dataclass(frozen=True)
class Task:
    """The runs of a job and the simulator that does them."""

    job: Job  # the job to run
    study: Study  # the layout of its records
    simulator: Simulator  # does the runs
    run_limit: float = math.inf  # time [s] that a run may take; infinite for no limit
    # returns on rank 0 the requested runs, shape (runs,); by default those of the job's design
    chosen: Callable[[], np.ndarray] | None = None
    # returns on rank 0 the time step [s] of runs that do not take the job's step, by run index
    asked_steps: Callable[[], Mapping[int, float]] | None = None
    # time step [s] of the runs that do not take the job's step, by run index: requested, or shortened by a
    # retry
    steps: Mapping[int, float] = field(default_factory=dict)

    @property
    def turns(self) -> Turns:
        """Return the number of times that so many runs fill the lanes."""
        return partial(self.simulator.turns, self.job)

    def fit(self, records: Records, costs: np.ndarray) -> Fit:
        """Return the factor of the machine by the batches on record and the predicted costs of runs [s]."""
        return fit_recorded(costs, records.timings, records.status == Status.DONE, self.turns)

    def do(
        self, batch: Batch, interrupt: Interrupt, begin: Begin, join: Join | None = None
    ) -> Iterator[Result]:
        """Do the runs of a batch, and yield their records as they come; none of runs that are broken off.

        All come at once, unless an exception or the time limit ends the batch. Then its runs are done one by
        one, so that only runs that fail alone count as failed, and each record comes when its run ends.
        `begin` is called with the runs before, again when kernels of a march are loaded and its clock starts,
        and with all of them when others have joined.
        """
        runs = [*batch]
        try:
            result, trouble = self._attempt(runs, interrupt, begin, join)
            if trouble is None:
                yield result
            elif len(runs) == 1:
                yield self._failure(runs[0], trouble)
            else:
                yield from self._do_one_by_one(runs, trouble, interrupt, begin)
        except self.simulator.Interrupted:
            return
        except _Outside as outside:
            raise outside.__cause__ or outside from None

    def _do_one_by_one(
        self, batch: Sequence[int], trouble: _Trouble, interrupt: Interrupt, begin: Begin
    ) -> Iterator[Result]:
        found = False
        for index in batch:
            result, own_trouble = self._attempt([index], interrupt, begin)
            found = found or own_trouble is not None
            yield result if own_trouble is None else self._failure(index, own_trouble)
        if not found:
            # Every record is sound, but the time that lanes save is lost, and nobody would know.
            runs = ", ".join(map(str, batch))
            _logger.warning("runs %s, done together, %s; none of them does alone", runs, trouble.in_company)

    def _attempt(
        self, runs: list[int], interrupt: Interrupt, begin: Begin, join: Join | None = None
    ) -> tuple[Result, _Trouble | None]:
        """Return the records of all runs, or none and the reason why the batch ended; `runs` grows."""

        def begin_all() -> None:
            try:
                begin(tuple(runs))
            except Exception as error:
                raise _Outside from error

        begin_all()
        marches = self.job.stepper is not None  # else a run loads its kernels itself
        limit = self.run_limit * self.turns(len(runs))
        watch = _Watch(interrupt, limit, begin_all if marches else lambda: None)

        def more() -> Sequence[Point]:
            further: Batch = ()
            try:
                if join is not None:
                    further = join(tuple(runs), watch.elapsed())
            except Exception as error:
                raise _Outside from error
            if further:
                runs.extend(further)
                begin_all()
                watch.limit = self.run_limit * self.turns(len(runs))
            return self._points(further)

        try:
            points = self._points(runs)
            kept = [place for place, index in enumerate(runs) if index in self.job.histories]
            if kept:
                found, histories = self.simulator.run_points_keeping(self.job, points, watch, kept)
            else:
                found, histories = self.simulator.run_points(self.job, points, watch, more), {}
            records = [(index, self._pack(values)) for index, values in zip(runs, found, strict=True)]
            files = file_names(self.job.files)
            named = [(runs[place], one.assign_attrs(files)) for place, one in histories.items()]
            return Result(records, watch.elapsed(), named), None
        except self.simulator.Interrupted:
            if not watch.is_over:
                raise
            reason = f"took longer than the limit of {self.run_limit:g} s for a run"
            return Result([]), _Trouble(Status.TIMED_OUT, reason, reason)
        except Exception as error:  # one run's defect must not cost the others
            words = _in_words(error)
            return Result([]), _Trouble(Status.FAILED_ERROR, words, f"raised {words}")

    def _points(self, runs: Sequence[int]) -> list[Point]:
        """Return the parameters of runs, each at its own time step where it has one."""
        own = ({STEP: self.steps[index]} if index in self.steps else {} for index in runs)
        return [self.job.point(index) | step for index, step in zip(runs, own, strict=True)]

    def _failure(self, index: int, trouble: _Trouble) -> Result:
        return Result([(index, self.study.pack_failure(trouble.reason, trouble.status))])

    def _pack(self, values: RecordValues) -> np.ndarray:
        """Return the record of a run's result; that of a failure if the result is no record."""
        try:
            return self.study.pack(values)
        except Exception as error:
            return self.study.pack_failure(_in_words(error))


class _Watch:
    """Decides during a run whether to continue: by the given question and by the run's own limit [s].

    The clock starts with the first question: kernels, which a run may have to wait for, are compiled by then.
    `start` is called at that time.
    """

    def __init__(self, interrupt: Interrupt, limit: float, start: Callable[[], None]) -> None:
        self.is_over = False
        self.limit = limit
        self._interrupt, self._start = interrupt, start
        self._started: float | None = None

    def __call__(self) -> str | None:
        """Return why the run should end, None if it should continue."""
        if self._started is None:
            self._start()
            self._started = time.monotonic()
        try:
            reason = self._interrupt()
        except Exception as error:  # such as of a rank that is lost
            raise _Outside from error
        if reason is None and self.elapsed() > self.limit:
            self.is_over = True
            reason = "run limit"
        return reason

    def elapsed(self) -> float:
        """Return the time [s] since the first question; 0 before it."""
        return 0.0 if self._started is None else time.monotonic() - self._started


def _in_words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"


def asked_step(job: Job, index: int) -> float:
    """Return the time step of a run by its job [s]."""
    return job.point(index)[STEP]


def refined_steps(job: Job, records: Records, others: Mapping[int, float]) -> dict[int, float]:
    """Return the time steps [s] of the runs that do not take that of their job, by run index.

    Those are `others`, on record or not, and the runs whose step a retry shortens by the factor on record.
    """
    steps = dict(others)
    for index in np.flatnonzero(records.refinements != 1.0).tolist():
        step = steps[index] if index in steps else asked_step(job, index)
        steps[index] = step / float(records.refinements[index])
    return steps


def untried_factor(job: Job, records: Records, again: NDArray[np.int64], retry: Collection[Status]) -> float:
    """Return the factor by which a retry shortens time steps where none is given: half of the shortest tried.

    The same run at the same step would only fail again. Where not failed numerics alone are done again, or
    the job has no fixed step, it is 1. `again` are the indices of the runs, which have ended as `retry` says.
    """
    if set(retry) != {Status.FAILED_NUMERICS} or STEP not in job.parameters or not again.size:
        return 1.0
    tried = records.refinements[again].max() * 2.0 ** job.parameters.get("most_refinements", 0)
    return min(2.0 * float(tried), _MOST_REFINED)


def check_refinement(job: Job, refine: float, retry: Collection[Status]) -> None:
    """Raise InputError unless runs that ended as `retry` says can be done again at a step over a factor.

    A shorter step is a cure for failed numerics alone.
    """
    if not 1.0 <= refine <= _MOST_REFINED:
        raise mismatch("--refine", f"a factor of 1 or more, at most {_MOST_REFINED:g}", show(refine))
    if set(retry) != {Status.FAILED_NUMERICS}:
        found = ", ".join(Status(status).name.lower() for status in retry) or "no --retry"
        raise mismatch("--refine", "--retry failed_numerics beside it, and no other", found)
    if STEP not in job.point(0):
        raise mismatch("--refine", "a job whose stepper has a fixed step", stepper_in_words(job))


def stepper_in_words(job: Job) -> str:
    """Return which stepper a job has, for an error."""
    return f"stepper {job.stepper}" if job.stepper else f"model {job.model}, which has none"
