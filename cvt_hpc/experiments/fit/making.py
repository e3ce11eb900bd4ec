"""A fit made: search, confirmation, distances and sensitivities, and the tables that they leave.

Tables are comma-separated values below lines that state their origin.
"""

from collections.abc import Iterator, Sequence
from functools import partial
from itertools import combinations
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.experiments.fit.evaluating import Evaluation, Stopped
from cvt_hpc.experiments.fit.job import REPRODUCED, Course, Fit, areas, verdict
from cvt_hpc.experiments.fit.search import Around, Confirmed, Found, confirm, look_around, reach, search
from cvt_hpc.experiments.outcome import Outcome, Tell
from cvt_hpc.job.definition import digest
from cvt_hpc.job.summary import core_time_in_words
from cvt_hpc.job.units import from_si
from cvt_hpc.simulation import estimate_cost
from cvt_hpc.storage.files import write_rows
from cvt_hpc.storage.netcdf import global_attributes
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.study import process_rank
from cvt_hpc.tables import columns
from cvt_hpc.vibration.classes import OccurrenceClass

_OPEN = (
    OccurrenceClass.UNDECIDED,
    OccurrenceClass.IRREGULAR,
    OccurrenceClass.FAILED,
    OccurrenceClass.SLIPPING,
    OccurrenceClass.NOT_RUN,
)
_SPREAD = ("lowest", "highest")
_ORDERS = ("first", "first_low", "first_high", "total", "total_low", "total_high")
Row = Sequence[str | float]


def make(fit: Fit, out: Path, *, fresh: bool, tell: Tell) -> Outcome:
    """Search for the set of parameters that meets the targets best, and examine it; see `experiment_kinds`.

    Its studies continue where an earlier start has stopped.

    Raises
    ------
    InputError
        If a folder holds another study or cannot be written to, or the model refuses all runs.
    """
    evaluation = Evaluation(fit, out, fresh=fresh)
    try:
        found = search(fit, partial(evaluation.evaluate, settings=fit.coarse, values=fit.thinned), tell)
        confirmed = confirm(fit, evaluation, found)
        looked = look_around(fit, evaluation, confirmed)
    except Stopped as stopped:
        return Outcome(status=stopped.status)
    best = confirmed[0]
    of_set, verdicts = _set_table(fit, found, best, looked[0]), _verdict_table(fit, best)
    tables = (
        of_set,
        verdicts,
        _confirmed_table(fit, confirmed),
        _candidate_table(fit, found),
        conflict_table(fit, found),
        _distance_table(fit, looked),
        _sensitivity_table(fit, looked),
    )
    cost = f"{evaluation.runs} runs, {core_time_in_words(evaluation.core_seconds)}"
    files = [("table", write_table(fit, one, out)) for one in tables] if process_rank() == 0 else []
    return Outcome((*_set_lines(best, of_set, verdicts), cost), files)


def plan_lines(fit: Fit, out: Path) -> Iterator[str]:
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


class Table(NamedTuple):
    """A table: the name of its file, its title, the names of its columns, and its rows."""

    name: str
    what: str
    head: Sequence[str]
    rows: Sequence[Row]


def write_table(fit: Fit, table: Table, folder: Path) -> Path:
    """Write a table with its title and its origin."""
    resolved = fit.resolved()
    made = global_attributes(fit.job, resolved, "fit") | {"job_fingerprint": digest(resolved)}
    rows = ([_cell(cell) for cell in row] for row in table.rows)
    return write_rows(
        folder / f"{table.name}.csv", table.head, rows, [f"# {table.what}\n", *origin_lines(made)]
    )


def _set_table(fit: Fit, found: Found, best: Confirmed, around: Around) -> Table:
    """Tabulate the set: its equals, the distance of each parameter from silence, and its influence."""
    good = found.scenes[found.totals >= fit.accepted * found.totals.max()]
    of_total = {index.parameter: index for index in around.indices if index.score == "total"}
    rows: list[Row] = []
    for k, one in enumerate(fit.free):
        likewise = np.quantile(good[:, k], [0.0, 0.5, 1.0])
        values = [_shown(fit, one.name, float(value)) for value in (best.scene[k], *likewise)]
        index = of_total.get(one.name)
        orders = (index.first, index.total) if index else (np.nan, np.nan)
        rows.append(
            [
                one.name,
                fit.job.schema.unit_in_words(one.name),
                *values,
                *reach(around.moved, one.name),
                *orders,
            ]
        )
    what = (
        f"The best set, found in {best.name}; lowest, median and highest of the {len(good)} candidates "
        f"from {fit.accepted:g} of the best score of the search; nearest of the factors tried at which "
        f"vibration of the first case goes out; Sobol indices of the score within {fit.nearby:g} of the set"
    )
    head = ("parameter", "unit", "value", "lowest", "median", "highest", "out_below", "out_above")
    return Table("set", what, (*head, "first_order", "total_order"), rows)


def _verdict_table(fit: Fit, best: Confirmed) -> Table:
    """Tabulate the results of the best set for each statement."""
    rows = []
    for k, target in enumerate(fit.targets):
        told = "; ".join(dict.fromkeys(in_words(fit, courses[target.case]) for courses in best.courses))
        mean, scores = best.mean[k], best.scores[:, k]
        bounds = scores.min(), scores.max()
        rows.append([target.name, target.case, mean, *bounds, verdict(mean), told, target.statement])
    what = "What the best set does with each statement: mean score of the repeats, lowest and highest"
    head = ("target", "case", "score", *_SPREAD, "verdict", "found", "statement")
    return Table("verdicts", what, head, rows)


def _confirmed_table(fit: Fit, confirmed: Sequence[Confirmed]) -> Table:
    """Tabulate the sets that were run in full, the best one first."""
    rows = [
        [one.name, *_in_units(fit, one.scene), one.coarse, one.total, *one.spread, *one.mean]
        for one in confirmed
    ]
    what = "Sets run in full: score in the search, then mean, lowest and highest of the repeats"
    return Table(
        "confirmed", what, ("found_in", *_free(fit), "coarse", "score", *_SPREAD, *_names(fit)), rows
    )


def _candidate_table(fit: Fit, found: Found) -> Table:
    """Tabulate all candidates of the search, in their order."""
    rows = [
        [stage, *_in_units(fit, scene), *scores, total]
        for stage, scene, scores, total in zip(*found, strict=True)
    ]
    return Table(
        "candidates", "The candidates of the search", ("stage", *_free(fit), *_names(fit), "score"), rows
    )


def conflict_table(fit: Fit, found: Found) -> Table:
    """Tabulate pairs of targets that no candidate of the search meets together, the worst first.

    The score of a pair is the best that a candidate reaches in the one of the two that it meets less.
    """
    alone = found.scores.max(axis=0)
    rows: list[Row] = []
    for j, k in combinations(range(len(fit.targets)), 2):
        together = float(found.scores[:, [j, k]].min(axis=1).max())
        if together < REPRODUCED:
            rows.append([fit.targets[j].name, fit.targets[k].name, alone[j], alone[k], together])
    what = "Targets that no candidate of the search meets together: best score of each, and of the lesser one"
    head = ("target", "other", "target_alone", "other_alone", "together")
    return Table("conflicts", what, head, sorted(rows, key=lambda row: row[-1]))


def _distance_table(fit: Fit, looked: Sequence[Around]) -> Table:
    """Tabulate the first case of each set with one parameter moved alone."""
    rows = [
        [
            around.name,
            one.parameter,
            one.factor,
            _shown(fit, one.parameter, one.value),
            float(one.course.vibrates.sum()),
            "yes" if one.is_out else "no",
            in_words(fit, one.course),
        ]
        for around in looked
        for one in around.moved
    ]
    what = "The first case of a set with one parameter moved alone, in full"
    head = ("around", "parameter", "factor", "value", "vibrating", "out", "found")
    return Table("distances", what, head, rows)


def _sensitivity_table(fit: Fit, looked: Sequence[Around]) -> Table:
    """Tabulate Sobol indices of each score around each set."""
    what = (
        f"Sobol indices with their 95 % bounds, all parameters within {fit.nearby:g} of a set; "
        f"{fit.samples} base samples"
    )
    rows = [(around.name, *index) for around in looked for index in around.indices]
    return Table("sensitivities", what, ("around", "score", "parameter", *_ORDERS), rows)


def _set_lines(best: Confirmed, of_set: Table, verdicts: Table) -> Iterator[str]:
    """Yield the description of the best set for people."""
    low, high = best.spread
    scores = f"{best.total:.3f} ({low:.3f} to {high:.3f}), {best.coarse:.3f} in the search"
    yield f"best set: {best.name}, score {scores}"
    yield from columns([[str(name), f"{value:.4g} {unit}"] for name, unit, value, *_ in of_set.rows])
    yield from columns(
        [[str(row[0]), f"{row[2]:.2f}", str(row[5]), f"{row[1]}: {row[6]}"] for row in verdicts.rows]
    )


def in_words(fit: Fit, course: Course) -> str:
    """Return in words where a course vibrates, and where the result is open."""

    def span(low: float, high: float) -> str:
        low, high = (_shown(fit, fit.along, end) for end in (low, high))
        return f"{low:g}" if low == high else f"{low:g}-{high:g}"

    told = [f"vibrates {', '.join(span(*area) for area in areas(course))}"] if course.vibrates.any() else []
    of_others = {kind.label: course.classes == kind for kind in _OPEN}
    of_others["not counted"] = (course.classes == OccurrenceClass.VIBRATING) & ~course.counted
    for words, chosen in of_others.items():
        if chosen.any():
            told.append(f"{words} {', '.join(span(value, value) for value in course.values[chosen])}")
    return ", ".join(told) or "quiet"


def _free(fit: Fit) -> list[str]:
    """Return the names of the free parameters with their units for people."""
    units = {one.name: fit.job.schema.unit_in_words(one.name) for one in fit.free}
    return [f"{name} [{unit}]" if unit else name for name, unit in units.items()]


def _names(fit: Fit) -> list[str]:
    return [target.name for target in fit.targets]


def _in_units(fit: Fit, scene: NDArray[np.float64]) -> list[float]:
    return [_shown(fit, one.name, float(value)) for one, value in zip(fit.free, scene, strict=True)]


def _shown(fit: Fit, name: str, value: float) -> float:
    """Return a value [SI] in its unit for people."""
    schema = fit.job.schema
    return from_si(value, schema.parameters[name].unit, schema.unit_in_words(name))


def _cell(cell: str | float) -> str:
    if isinstance(cell, str):
        return cell
    return "" if np.isnan(cell) else f"{cell:.6g}"
