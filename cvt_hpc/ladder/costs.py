"""Expected cost of the models of a ladder, by their cost models."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from cvt_hpc.errors import InputError
from cvt_hpc.job import Job
from cvt_hpc.job.summary import core_time_in_words
from cvt_hpc.ladder.loading import Ladder
from cvt_hpc.ladder.pushbelt import PUSHBELT, pushbelt_jobs
from cvt_hpc.ladder.rungs import Rung
from cvt_hpc.simulation import run_costs
from cvt_hpc.study.status import find_records
from cvt_hpc.tables import columns, short


def cost_left(rung: Rung, out: Path | None) -> tuple[int, float]:
    """Return how many runs of a model are not on record, and their predicted core-seconds.

    Parameters
    ----------
    rung : Rung
        The model.
    out : Path or None
        The folder of its ladder; None: all runs are left.
    """
    records = None if out is None else find_records(out / rung.name, rung.job)
    left = np.ones(rung.job.size, bool) if records is None else ~records.recorded
    return int(left.sum()), float(run_costs(rung.job)[left].sum())


def plan_lines(asked: Ladder, out: Path) -> Iterator[str]:
    """Yield the lines that state the runs of a ladder on each model, and their expected cost."""
    job, rungs = asked.job, asked.rungs
    yield f"ladder {job.name} ({job.source}): {job.size} runs with {len(rungs)} models"
    if job.description:
        yield job.description
    left = {rung.name: cost_left(rung, out) for rung in rungs}
    heads = ["name", "model", "runs", "left", "core-s left", "answers"]
    yield from columns(
        [
            heads,
            *(
                [r.name, r.job.model, str(r.job.size), str(left[r.name][0]), short(left[r.name][1])]
                + [", ".join(r.answers)]
                for r in rungs
            ),
        ]
    )
    yield from (f"{name} left out: {why}" for name, why in asked.refusals.items())
    total = sum(core_seconds for _, core_seconds in left.values())
    yield f"estimated cost of what is left: {core_time_in_words(total)}, shared by all ranks"
    if rungs[-1].job.model != PUSHBELT:
        yield f"with --set ladder.reference={PUSHBELT}: {_pushbelt_cost(job)}"


def _pushbelt_cost(job: Job) -> str:
    """Additional cost of the pushbelt as the reference, or the reason why it cannot take the job."""
    try:
        jobs = pushbelt_jobs(job, {})
    except InputError as error:
        return f"refused, {error}"
    total = sum(float(run_costs(each).sum()) for each in jobs)
    return f"{core_time_in_words(total)} more, for errors against a belt of rigid elements"
