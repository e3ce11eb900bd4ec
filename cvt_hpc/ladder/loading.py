"""A job for `cvt-hpc ladder`: an ordinary job of the elastic belt, with a table [ladder] or without.

Expected cost of the models of a ladder, by their cost models.
"""

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cvt_hpc.errors import InputError, mismatch, show
from cvt_hpc.job import Job, build_job
from cvt_hpc.job.assignments import Assignments, split_assignments, take_own
from cvt_hpc.job.document import read_document, read_set, read_table
from cvt_hpc.job.summary import core_time_in_words
from cvt_hpc.ladder.rungs import BESIDE, MODEL, NONE, PUSHBELT, Rung, ladder, pushbelt_jobs
from cvt_hpc.parameters import Parameter
from cvt_hpc.simulation import run_costs
from cvt_hpc.study.status import find_records
from cvt_hpc.tables import columns, short

TABLE = "ladder"
_KEYS = {
    "reference": Parameter(MODEL, "", "model of the reference", choices=(MODEL, PUSHBELT)),
    "beside": Parameter(NONE, "", "a dearer model beside those of the ladder", choices=(NONE, *BESIDE)),
}


class Ladder(NamedTuple):
    """The content of a ladder job.

    Attributes
    ----------
    job : Job
        Of the elastic belt.
    rungs : tuple of Rung
        As `ladder` returns them.
    refusals : dict
        The reason, by the name of a model that is left out.
    """

    job: Job
    rungs: tuple[Rung, ...]
    refusals: dict[str, str]


def load_ladder(path: str | Path, overrides: Assignments = ()) -> Ladder:
    """Read and validate a job, and return its ladder.

    Parameters
    ----------
    path : str or Path
        A TOML file. Its table [ladder] may have `beside`, one of BESIDE, and `reference`, elastic_belt
        or pushbelt, for the pushbelt with `set`, a table of its further keys.
    overrides : mapping, or sequence of "KEY=VALUE"
        As `load_job` takes them; ladder.KEY replaces a key of the table.

    Raises
    ------
    InputError
        If anything is wrong with the file or an override, or there is no such ladder of the job.
    """
    source, document = str(path), read_document(Path(path))
    where = f"{source}: [{TABLE}]"
    replaced = split_assignments(overrides, source, "--set")
    own, table = take_own(replaced, TABLE), document.pop(TABLE, {})
    if isinstance(table, Mapping):
        table = {**table, **own}
    read = read_table(_KEYS, table, where, ("set",))
    reference, beside = read["reference"], read["beside"]
    settings = read_set(table, where)
    if settings and reference != PUSHBELT:
        raise mismatch(f"{where} set", f'reference = "{PUSHBELT}", for which it is', show(reference))
    job = build_job(document, source, replaced, "--set")
    return Ladder(job, *ladder(job, settings if reference == PUSHBELT else None, beside))


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
