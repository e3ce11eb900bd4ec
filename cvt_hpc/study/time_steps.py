"""Runs at another time step than that of their job: failed ones at a shorter one, and checks of others."""

from collections.abc import Collection, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import mismatch, show
from cvt_hpc.job import Job
from cvt_hpc.study.record.index import Records
from cvt_hpc.variables import Status

STEP = "step"  # the key of the time step, of steppers that have a fixed one
MOST_REFINED = 1000.0


def asked_step(job: Job, index: int) -> float:
    """Return the time step of a run by its job [s]."""
    return job.point(index)[STEP]


def refined_steps(job: Job, records: Records, others: Mapping[int, float]) -> dict[int, float]:
    """Return the time steps [s] of the runs that do not take that of their job, by run index.

    Parameters
    ----------
    job : Job
        The job that is run.
    records : Records
        With the factors by which retries shorten steps.
    others : mapping
        Time steps by run index, for runs that do not take the job's step, on record or not.
    """
    steps = dict(others)
    for index in np.flatnonzero(records.refinements != 1.0).tolist():
        step = steps[index] if index in steps else asked_step(job, index)
        steps[index] = step / float(records.refinements[index])
    return steps


def point_at_step(job: Job, index: int, steps: Mapping[int, float]) -> dict[str, Any]:
    """Return the parameters of a run, at its time step of `steps` where that has one."""
    point = job.point(index)
    return {**point, STEP: steps[index]} if index in steps else point


def untried_factor(job: Job, records: Records, again: NDArray[np.int64], retry: Collection[Status]) -> float:
    """Return the factor by which a retry shortens time steps where none is given: half of the shortest tried.

    The same run at the same step would only fail again. Where not failed numerics alone are done again, or
    the job has no fixed step, it is 1.

    Parameters
    ----------
    job : Job
        The job that is run.
    records : Records
        With the factors of earlier retries.
    again : array of int
        Indices of the runs that are done again.
    retry : collection of Status
        How these ended.
    """
    if set(retry) != {Status.FAILED_NUMERICS} or STEP not in job.parameters or not again.size:
        return 1.0
    tried = records.refinements[again].max() * 2.0 ** job.parameters.get("most_refinements", 0)
    return min(2.0 * float(tried), MOST_REFINED)


def check_refinement(job: Job, refine: float, retry: Collection[Status]) -> None:
    """Raise InputError unless failed runs of a job can be done again at a step shorter by a factor.

    Parameters
    ----------
    job : Job
        A validated job.
    refine : float
        The factor.
    retry : collection of Status
        How the runs ended that are done again: a shorter step is a cure for failed numerics alone.
    """
    if not 1.0 <= refine <= MOST_REFINED:
        raise mismatch("--refine", f"a factor of 1 or more, at most {MOST_REFINED:g}", show(refine))
    if set(retry) != {Status.FAILED_NUMERICS}:
        found = ", ".join(Status(status).name.lower() for status in retry) or "no --retry"
        raise mismatch("--refine", "--retry failed_numerics beside it, and no other", found)
    if STEP not in job.point(0):
        raise mismatch("--refine", "a job whose stepper has a fixed step", stepper_in_words(job))


def stepper_in_words(job: Job) -> str:
    """Return which stepper a job has, for an error."""
    return f"stepper {job.stepper}" if job.stepper else f"model {job.model}, which has none"
