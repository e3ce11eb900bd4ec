"""What is known of a job's times before its sweep: by records, by a few short batches, or by prediction."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from cvt_hpc.study.batches import Batch
from cvt_hpc.study.cost_model import CostModel, Fit, fit_recorded
from cvt_hpc.study.description import describe
from cvt_hpc.study.simulator import Simulator
from cvt_hpc.study.status import find_records
from cvt_hpc.study.task import Task
from cvt_hpc.variables import Status

if TYPE_CHECKING:
    from cvt_hpc.job import Job


class Knowledge(NamedTuple):
    """What is known of the times of a job's batches.

    Attributes
    ----------
    fit : Fit
        Time [s] of a batch over the predicted cost of its longest run.
    basis : str
        Where it is from, in words.
    history_bytes : float
        Size of the history of a run in memory [byte]; NaN where it is not known.
    """

    fit: Fit
    basis: str
    history_bytes: float = math.nan


def find_out(job: Job, simulator: Simulator, groups: Sequence[Batch], out: Path, pilots: int) -> Knowledge:
    """Return what is known of the times of a job's batches.

    Parameters
    ----------
    job : Job
        A validated job.
    simulator : Simulator
        What does the runs, and predicts their cost in core-seconds.
    groups : sequence of tuple of int
        All runs, in full batches.
    out : Path
        The output folder, whose records tell where no pilots are asked for.
    pilots : int
        Number of batches to be done for this, shortened and without a trace in the folder.
    """
    costs = simulator.run_costs(job)
    if pilots:
        found = run_pilots(job, simulator, groups, pilots)
        if found.fit.batches:
            return found
    else:
        records = find_records(out, job)
        if records is not None:
            fit = fit_recorded(costs, records.timings, records.status == Status.DONE)
            if fit.batches:
                return Knowledge(fit, f"batches on record ({fit.batches})")
    # The cost of a run is its share of a full batch.
    lanes = max(map(len, groups))
    failed = "; no pilot batch came to its end" if pilots else ""
    return Knowledge(Fit(mean=math.log(lanes)), f"predicted costs, right within a factor of two{failed}")


def run_pilots(job: Job, simulator: Simulator, groups: Sequence[Batch], count: int) -> Knowledge:
    """Do batches from all over the grid for a part of their duration, and scale their times."""
    short, scale, share = job, 1.0, simulator.pilot_share(job)
    # Where the duration is an axis or follows from others, its values count, and without a transient there is
    # none: done in full.
    fixed = {axis.name for axis in job.axes} | {rule.key for rule in job.rules}
    if "duration" in job.parameters and "duration" not in fixed:
        duration = share * job.parameters["duration"]
        short, scale = replace(job, parameters={**job.parameters, "duration": duration}), 1 / share
    places = {int((k + 0.5) * len(groups) / count) for k in range(count)}
    chosen = [groups[place] for place in sorted(places)]
    if job.histories:
        short = replace(short, histories=(chosen[0][0],))
    task = Task(short, describe(short, simulator), simulator)
    model, history_bytes = CostModel(simulator.run_costs(job)), math.nan
    for batch in chosen:
        for result in task.do(batch, lambda: None, lambda batch: None):
            if result.failed < len(result.records):
                model.learn(result.batch, scale * result.seconds)
            for _, history in result.histories:
                history_bytes = scale * history.nbytes
    noun = "pilot batch" if model.fit.batches == 1 else "pilot batches"
    words = f"{model.fit.batches} {noun} of {1 / scale:.0%} of the simulated time"
    return Knowledge(model.fit, words, history_bytes)
