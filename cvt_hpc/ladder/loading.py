"""A job for `cvt-hpc ladder`: an ordinary job of the elastic belt, with a table [ladder] or without."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from cvt_hpc.errors import mismatch, show
from cvt_hpc.job import Job, build_job
from cvt_hpc.job.assignments import Assignments, split_assignments, take_own
from cvt_hpc.job.document import read_document, read_set, read_table
from cvt_hpc.ladder.pushbelt import PUSHBELT
from cvt_hpc.ladder.rungs import BESIDE, MODEL, NONE, Rung, ladder
from cvt_hpc.parameters import Parameter

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
