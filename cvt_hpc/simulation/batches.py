"""Which runs can advance together, and what they cost."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.simulation.modules import has_record, record_module

if TYPE_CHECKING:
    from cvt_hpc.job import Job

PILOT_SHARE = 0.25


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
    values = [np.asarray(axis.values) for axis in job.axes]
    grids = values if job.is_sampled else np.meshgrid(*values, indexing="ij", sparse=True)
    p = {**job.parameters, **dict(zip((axis.name for axis in job.axes), grids, strict=True))}
    model = record_module(job)
    cost = model.cost(p, job.stepper) / model.lanes(job.parameters, job.stepper)
    return np.broadcast_to(cost, job.shape).ravel()


def estimate_cost(job: Job) -> float:
    """Core-seconds of a run, mean over the job.

    Not known (nan) of a model that no study runs.

    Parameters
    ----------
    job : Job
        A validated job.
    """
    if not has_record(job):
        return float("nan")
    return float(run_costs(job).mean())


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
        Each index once, in as few batches as can be, of nearly equal size.
    """
    model = record_module(job)
    groups: dict[Any, list[int]] = {}
    for index in indices:
        groups.setdefault(model.lane_key(job.point(index)), []).append(index)
    batches = []
    for group in groups.values():
        most = model.lanes(job.point(group[0]), job.stepper)
        parts = -(-len(group) // most)
        bounds = [len(group) * part // parts for part in range(parts + 1)]
        batches += [tuple(group[first:last]) for first, last in pairwise(bounds)]
    return batches


def turns(job: Job, runs: int) -> int:
    """How many groups of lanes a batch does one after the other.

    Parameters
    ----------
    job : Job
        A validated job.
    runs : int
        Runs of the batch.
    """
    return -(-runs // lanes_at_once(job, job.parameters))


def lanes_at_once(job: Job, parameters: dict[str, Any]) -> int:
    """How many runs advance together.

    Parameters
    ----------
    job : Job
        For its model and stepper.
    parameters : dict
        Flat parameters of one of them [SI].
    """
    model = record_module(job)
    return model.lanes(parameters, job.stepper) // getattr(model, "LANE_GROUPS", 1)


def pilot_share(job: Job) -> float:
    """Share of a run's simulated time that tells what the whole run costs."""
    return getattr(record_module(job), "PILOT_SHARE", PILOT_SHARE)
