"""Known times of a job before its sweep: by records, by a few short batches, or by prediction."""

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import NamedTuple

from cvt_hpc.job import Job
from cvt_hpc.study.attempts import predicted_costs
from cvt_hpc.study.batches import Batch, in_parts
from cvt_hpc.study.description import describe
from cvt_hpc.study.forecast.cost_model import CostModel, Fit
from cvt_hpc.study.simulator import Simulator
from cvt_hpc.study.status import find_records
from cvt_hpc.study.task import Task
from cvt_hpc.study.time_steps import refined_steps


class Knowledge(NamedTuple):
    """The times of a job's batches, as far as they are known.

    Attributes
    ----------
    fit : Fit
        Time [s] of a batch over its predicted cost.
    basis : str
        Where it is from, in words.
    history_bytes : float
        Size of the history of a run in memory [byte]; NaN where it is not known.
    """

    fit: Fit
    basis: str
    history_bytes: float = math.nan


def find_out(job: Job, simulator: Simulator, groups: Sequence[Batch], out: Path, pilots: int) -> Knowledge:
    """Return the known times of a job's batches.

    Parameters
    ----------
    job : Job
        A validated job.
    simulator : Simulator
        Does the runs, and predicts their cost in core-seconds.
    groups : sequence of tuple of int
        All runs, in full batches.
    out : Path
        The output folder, whose records are used if no pilots are requested.
    pilots : int
        Number of batches to be done for this, shortened and without a trace in the folder.
    """
    if pilots:
        found = run_pilots(job, simulator, groups, pilots)
        if found.fit.batches:
            return found
    else:
        records = find_records(out, job)
        if records is not None:
            costs = predicted_costs(job, simulator, refined_steps(job, records, {}))
            fit = Task(job, records.study, simulator).fit(records, costs)
            if fit.batches:
                return Knowledge(fit, f"batches on record ({fit.batches})")
    # The cost of a run is its share of a full batch.
    lanes = max(len(group) / simulator.turns(job, len(group)) for group in groups)
    failed = "; no pilot batch came to its end" if pilots else ""
    return Knowledge(Fit(mean=math.log(lanes)), f"predicted costs, right within a factor of two{failed}")


def run_pilots(job: Job, simulator: Simulator, groups: Sequence[Batch], count: int) -> Knowledge:
    """Do batches from all over the grid for a part of their duration, and compare with their predicted cost.

    A shortened run is neither refined nor prolonged, and its batch fills the lanes once; what refining and
    prolonging take is in the predicted costs alone.
    """
    short, share = job, simulator.pilot_share(job)
    # Where the duration is an axis or follows from others, its values count, and without a transient there is
    # none: done in full.
    fixed = {axis.name for axis in job.axes} | {rule.key for rule in job.rules}
    if share < 1.0 and "duration" in job.parameters and "duration" not in fixed:
        duration = share * job.parameters["duration"]
        bare = {"duration": duration, "longest_duration": duration, "most_refinements": 0}
        known = {key: value for key, value in bare.items() if key in job.parameters}
        short = replace(job, parameters={**job.parameters, **known})
    else:
        share = 1.0
    turns = partial(simulator.turns, job)
    if share < 1.0:
        groups = [part for group in groups for part in in_parts(group, turns(len(group)))]
    places = {int((k + 0.5) * len(groups) / count) for k in range(count)}
    chosen = [groups[place] for place in sorted(places)]
    if job.histories:
        short = replace(short, histories=(chosen[0][0],))
    task = Task(short, describe(short, simulator), simulator)
    model, history_bytes = CostModel(simulator.run_costs(short), turns=turns), math.nan
    for batch in chosen:
        simulator.forget(job)
        for result in task.do(batch, lambda: None, lambda batch: None):
            if result.failed < len(result.records):
                model.learn(result.batch, result.seconds)
            for _, history in result.histories:
                history_bytes = history.nbytes / share
    noun = "pilot batch" if model.fit.batches == 1 else "pilot batches"
    return Knowledge(
        model.fit, f"{model.fit.batches} {noun} of {share:.0%} of the simulated time", history_bytes
    )
