"""A fit made: search, confirmation, distances and sensitivities, and the tables that they leave."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

from cvt_hpc.fit import table
from cvt_hpc.fit.around import look_around
from cvt_hpc.fit.confirming import confirm
from cvt_hpc.fit.evaluating import Evaluation
from cvt_hpc.fit.job import Fit
from cvt_hpc.fit.search import search
from cvt_hpc.job.summary import core_time_in_words
from cvt_hpc.simulation import estimate_cost
from cvt_hpc.study import process_rank
from cvt_hpc.tables import columns


class FitReport(NamedTuple):
    """Results of a fit.

    Attributes
    ----------
    lines : tuple of str
        Text on the best set for people.
    tables : tuple of Path
        The files that hold the results; none on other ranks than the first.
    """

    lines: tuple[str, ...]
    tables: tuple[Path, ...]


def make_fit(
    fit: Fit, out: Path, *, fresh: bool = False, tell: Callable[[str], None] = lambda line: None
) -> FitReport:
    """Search for the set of parameters that meets the targets best, and examine it.

    On all ranks, by studies that continue where an earlier start has stopped.

    Parameters
    ----------
    fit : Fit
        The requested fit.
    out : Path
        Folder of the studies and tables.
    fresh : bool
        Throw earlier studies away.
    tell : callable
        Given a line after each study of the search.

    Raises
    ------
    Stopped
        If a study was stopped early.
    InputError
        If a folder holds another study or cannot be written to, or the model refuses all runs.
    """
    evaluation = Evaluation(fit, out, fresh=fresh)
    found = search(fit, lambda name, scenes: evaluation.evaluate(name, scenes, fit.coarse, fit.thinned), tell)
    confirmed = confirm(fit, evaluation, found)
    best = confirmed[0]
    looked = look_around(fit, evaluation, confirmed)
    of_set, verdicts = table.set_table(fit, found, best, looked[0]), table.verdict_table(fit, best)
    tables = (
        of_set,
        verdicts,
        table.confirmed_table(fit, confirmed),
        table.candidate_table(fit, found),
        table.conflict_table(fit, found),
        table.distance_table(fit, looked),
        table.sensitivity_table(fit, looked),
    )
    cost = f"{evaluation.runs} runs, {core_time_in_words(evaluation.core_seconds)}"
    written = tuple(table.write_table(fit, one, out) for one in tables) if process_rank() == 0 else ()
    return FitReport((*table.set_lines(best, of_set, verdicts), cost), written)


def plan_lines(fit: Fit) -> Iterator[str]:
    """Yield the lines that describe a fit and its expected cost."""
    job, schema, full, thin = fit.job, fit.job.schema, len(fit.values), len(fit.thinned)
    yield f"fit {job.name} ({job.source}): {len(fit.free)} free parameters, {len(fit.targets)} targets"
    if job.description:
        yield job.description
    ends = {one.name: [schema.in_words(one.name, end) for end in (one.low, one.high)] for one in fit.free}
    yield from columns([[name, " to ".join(words)] for name, words in ends.items()])
    yield from columns([[one.name, one.case, one.measure, one.statement] for one in fit.targets])
    candidates = len(fit.starts) + fit.screened + fit.generations * fit.population
    repeats = max((len(values) for values in fit.repeat.values()), default=1)
    coarse, fine = estimate_cost(fit.coarse_job()), estimate_cost(job)
    sets = 1 + len(fit.starts) * (fit.around == "starts")
    runs = {
        "search": (candidates * len(fit.cases) * thin, coarse),
        "confirmation": ((len(fit.starts) + fit.confirmed) * repeats * len(fit.cases) * full, fine),
        "distances": (sets * len(fit.free) * len(fit.distances) * thin, fine),
        "sensitivities": (sets * fit.samples * (len(fit.free) + 2) * len(fit.cases) * thin, coarse),
    }
    yield from columns([[key, f"{n} runs", core_time_in_words(n * each)] for key, (n, each) in runs.items()])
    total = core_time_in_words(sum(n * each for n, each in runs.values()))
    yield f"estimated cost: at most {total} in lanes that are filled"
