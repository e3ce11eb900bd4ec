"""Texts of the command line: reports, states and outcomes in words."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.job import Job
from cvt_hpc.job.summary import cost_in_words
from cvt_hpc.job.template import CUSTOMARY
from cvt_hpc.job.values import JOB_UNITS, Point, shown_number
from cvt_hpc.tables import columns
from cvt_hpc.variables import Outcome, Status, flag_in_words
from cvt_hpc.vibration.classes import NEAR, NEAR_CONTRADICTIONS

if TYPE_CHECKING:
    from cvt_hpc.analysis.comparison import Cell, Comparison
    from cvt_hpc.study import RunReport, StudyStatus
    from cvt_hpc.study.audit import AuditReport
    from cvt_hpc.study.forecast.cost_model import Forecast
    from cvt_hpc.study.forecast.resources import Disk, Needs
    from cvt_hpc.study.repeats import Repeat

_MOST_FAILURES_NAMED = 10
_MOST_CONTRADICTIONS_NAMED = 20
_KNOWN_OF_FAILURES = (
    *("status", "reason", "core_seconds", "simulated_seconds", "time_step", "refinements", "steps"),
    "contact_solves",
)
_AGAIN = {
    "failed_numerics": "does them again, at half the step where they take steps",
    "timed_out": "and a longer --run-limit does them again",
}
# of one run, the first lines of all
_FIRST = (
    *("status", "vibrates", "reason", "amplitude", "frequency", "growth_rate", "thrust_ratio"),
    *("slip_margin", "speed_loss", "loss", "efficiency"),
)
MOST_OUTCOMES = len(_FIRST)
_LEAST, _MOST = (1.0, 0.1), 1e4  # between these numbers are readable, above the first least best
_ALWAYS_SHOWN = {"strand", "pulley"}
_LARGEST_LINE = 4  # values along other dimensions: no spectrum and no history


def report_lines(report: RunReport) -> Iterator[str]:
    """Yield the lines that say how a sweep ended."""
    yield f"{report.total} runs: {report.done} done, {len(report.failed)} failed, {report.remaining} left"
    if words := _special_in_words(report):
        yield f"of those done {words}"
    if report.unneeded:
        cells = report.total + report.unneeded
        yield f"{report.unneeded} of {cells} runs of the whole grid not needed"
    yield f"results: {report.results or 'gathered by the part that ends last'}"


def next_lines(report: RunReport) -> Iterator[str]:
    """Yield the line that says what to do with a sweep that has ended, if it has results."""
    if report.results and report.done and not report.remaining:
        yield f"next: cvt-hpc map {report.out}; cvt-hpc report {report.out}"


def _special_in_words(counted: RunReport | StudyStatus) -> str:
    """Return how many runs are no plain yes or no, in words; empty if none."""
    counts = {"undecided": counted.undecided, "slip": counted.slipping, "irregular": counted.irregular}
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count)


def repeat_line(repeat: Repeat) -> str:
    """Return what doing a sample of the runs again is expected to cost."""
    runs = max(round(repeat.fraction * repeat.first.size), 1)
    at_most = "at most" if repeat.first.design else "about"
    cost = cost_in_words(repeat.core_seconds(), runs)
    return f"{repeat.label}: {at_most} {runs} runs again {repeat.way}, estimated cost: {cost}"


def audit_lines(report: AuditReport) -> Iterator[str]:
    """Yield the lines that say how often the cheaper models of a study erred."""
    runs = sum(rung.runs + rung.failed for rung in report.rungs)
    yield f"audit: {runs} of {report.answered} runs that cheaper models decided done again in full"
    for rung in report.rungs:
        low, high = rung.interval
        share = f"{rung.differing / rung.runs:.2%}, " if rung.runs else ""
        line = f"  {rung.rung.name.lower()}: {rung.differing} of {rung.runs} runs of another class "
        line += f"({share}95 % interval {low:.2%} to {high:.2%}), "
        line += f"{rung.contrary} of them quiet against vibrating"
        if not math.isnan(rung.force_deviation):
            line += f"; mean forces within {rung.force_deviation:.2%} in 95 % of the runs"
        yield line + (f"; {rung.failed} more failed in full" if rung.failed else "")
    yield f"runs that differ: {report.table}"


def step_check_lines(check: Repeat, found: Comparison) -> Iterator[str]:
    """Yield the lines that say how far a sample of runs depends on the time step."""
    from cvt_hpc.analysis.comparison import contradictions, deviations

    drawn, eligible = int(check.sample.sum()), int(check.may_be_drawn.sum())
    yield f"step check: {drawn} of {eligible} runs that took steps done again {check.way}"
    yield f"  {contradictions(found, check.way)}"
    yield from islice(map(_cell_line, found.rows(found.contradicts)), _MOST_CONTRADICTIONS_NAMED)
    yield from (f"  {line}" for line in deviations(found))


def comparison_lines(found: Comparison, sources: tuple[str, str]) -> Iterator[str]:
    """Yield the lines that say in what two studies agree: A, B, their jobs, classes, and amplitudes."""
    from cvt_hpc.analysis.comparison import deviations

    for label, source, left_out in zip("AB", sources, found.left_out, strict=True):
        yield f"{label}: {source}" + (f"; {left_out} of its runs left out, unknown there" if left_out else "")
    yield from found.notes
    yield from (f"differs: {line}" for line in found.differences or ("nothing that the datasets tell",))
    yield f"{found.pairs.size} cells, by class in A (rows) and in B (columns):"
    counts = found.counts()
    first = sorted({kind for (kind, _), count in counts.items() if count})
    second = sorted({kind for (_, kind), count in counts.items() if count})
    rows = [[kind.label, *(str(counts[kind, other]) for other in second)] for kind in first]
    yield from columns([["", *(kind.label for kind in second)], *rows])
    yield from _design_lines(found) if found.are_designs else _contradiction_lines(found)
    yield from deviations(found)


def _contradiction_lines(found: Comparison) -> Iterator[str]:
    """Yield in what two methods contradict each other, and where."""
    beyond = int(found.contradicts_beyond.sum())
    yield (
        f"{int(found.contradicts.sum())} of {int(found.answered.sum())} cells contradict (quiet against "
        f"vibrating), {beyond} of them beyond the threshold (larger amplitude not within {NEAR:.0%} of it)"
    )
    yield from _cell_lines(found, found.contradicts)


def _design_lines(found: Comparison) -> Iterator[str]:
    """Yield in what the second of two designs is better, in what worse, and where it is worse."""
    better, worse = int(found.better.sum()), int(found.worse.sum())
    yield (
        f"two designs: of {int(found.answered.sum())} cells B is better in {better} (quiet where A vibrates) "
        f"and worse in {worse} (vibrates where A is quiet)"
    )
    if not math.isnan(ratio := found.amplitude_ratio()):
        word = "better" if ratio < 1.0 else "worse" if ratio > 1.0 else "alike"
        yield f"amplitude where both vibrate: in B {ratio:.3g} times that in A (median), {word}"
    if worse:
        yield "worse in B:"
        yield from _cell_lines(found, found.worse)


def _cell_lines(found: Comparison, chosen: NDArray[np.bool_]) -> Iterator[str]:
    """Yield a line for each of the first cells that are chosen, and the number of the others."""
    yield from map(_cell_line, islice(found.rows(chosen), _MOST_CONTRADICTIONS_NAMED))
    if (left := int(chosen.sum()) - _MOST_CONTRADICTIONS_NAMED) > 0:
        yield f"  {left} more in the table"


def _cell_line(cell: Cell) -> str:
    words = (
        kind.label
        + ("" if math.isnan(size) else f" {size * 1e6:.3g} um")
        + ("" if math.isnan(frequency) else f" {frequency:.4g} Hz")
        for kind, size, frequency in zip(cell.classes, cell.amplitude, cell.frequency, strict=True)
    )
    near = ", near the threshold" if cell.pair in NEAR_CONTRADICTIONS else ""
    return f"  {cell.place}: {' | '.join(words)}{near}"


def trouble_lines(report: RunReport) -> Iterator[str]:
    """Yield the lines that name the failed runs of a sweep, ten at most, and say why it stopped early."""
    for run in report.failed[:_MOST_FAILURES_NAMED]:
        place = f" ({run.place})" if run.place else ""
        yield f"run {run.index}{place}: {run.status}: {run.reason}"
    unnamed = len(report.failed) - _MOST_FAILURES_NAMED
    if unnamed > 0:
        yield f"{unnamed} more runs failed; `status` and `reason` in the results tell which"
    failed = {run.status for run in report.failed}
    for status in filter(failed.__contains__, _AGAIN):
        yield f"the same command with --retry {status} {_AGAIN[status]}"
    if report.remaining:
        if report.gained:
            yield f"stopped early ({report.stopped}); the same command goes on from here"
        else:
            more = "; give it more time" * (report.stopped == "time limit")
            yield f"stopped early ({report.stopped}) before any run had ended{more}"


def status_rows(status: StudyStatus) -> list[tuple[str, str]]:
    """Return how far a study is, names and values."""
    from cvt_hpc.study.ranks.progress import show_duration

    state = "running" if status.running else "not running"
    if status.finished is not None:
        when = time.strftime("%Y-%m-%d %H:%M UTC", time.gmtime(status.finished))
        state = f"finished {when}, after {show_duration(status.time_at_work)} at work"
    rows = [("job", f"{status.name} ({state})"), ("runs", f"{status.total}")]
    if status.unneeded:
        cells = status.total + status.unneeded
        rows.append(("grid", f"{cells} runs, {status.unneeded} not needed so far"))
    words = _special_in_words(status)
    done = f"{status.done} ({status.done / status.total:.1%})"
    rows += [("done", f"{done}, of these {words}" if words else done), ("failed", f"{status.failed}")]
    rows.append(("left", f"{status.left}"))
    if status.rate is not None:
        rows.append(("rate", f"{status.rate:.3g} runs/s"))
    if status.left and status.time_to_go is not None:
        rows.append(("to go", show_duration(status.time_to_go)))
    if status.left and not status.running:
        rows.append(("next", "the same `cvt-hpc run` goes on with what is left"))
    return rows


def forecast_lines(forecasts: Sequence[Forecast], job: Job, basis: str) -> Iterator[str]:
    """Yield the lines that say what a sweep will take on several numbers of ranks, a row each."""
    from cvt_hpc.study.forecast.resources import slurm_time, suggested_time
    from cvt_hpc.study.ranks.progress import show_duration

    at_most = ", if all cells of the grid are run" if job.in_rounds else ""
    yield f"forecast of all {job.size} runs by {basis}{at_most}:"
    rows = [("ranks", "makespan", "95 % of sweeps", "efficiency", "core-hours", "--time")]
    for forecast in forecasts:
        median, low, high = map(show_duration, forecast.makespan)
        efficiency, hours = f"{forecast.efficiency[0]:.0%}", f"{forecast.core_seconds / 3600:.3g}"
        limit = slurm_time(suggested_time(forecast, job.size))
        rows.append((str(forecast.ranks), median, f"{low} to {high}", efficiency, hours, limit))
    yield from columns(rows)


def needs_line(needed: Needs, histories: int) -> str:
    """Return the line that says what memory and disk a sweep needs."""
    from cvt_hpc.study.forecast.resources import size_in_words

    memory, disk = size_in_words(needed.memory), disk_line(needed.disk, histories)
    line = f"needed: {memory} of memory for the plan; {disk}"
    if not needed.profiles:
        return line
    each = size_in_words(needed.profiles)
    return f"{line}; each history at most {each} of profiles over time, as much memory"


def disk_line(disk: Disk, histories: int) -> str:
    """Return the line that says what space a study takes on the disk."""
    from cvt_hpc.study.forecast.resources import size_in_words

    records, results = size_in_words(disk.records), size_in_words(disk.results)
    line = f"disk: {records} of records, at most {results} of results.nc"
    if not histories:
        return line
    is_known = not math.isnan(disk.histories)
    size = size_in_words(disk.histories) if is_known else "of unknown size (--ranks with --pilots tells)"
    return f"{line}, {histories} histor{'y' if histories == 1 else 'ies'} {size}"


def point_lines(job: Job, at: Point) -> Iterator[str]:
    """Yield the line that says where on the axes of its job a run stands."""
    point = job.point_at(at)
    # a load that is given leaves no share of which it would follow
    keys = dict.fromkeys([*(axis.name for axis in job.axes), *(value.name for value in job.derived), *at])
    schema = job.schema
    words = [f"{key.replace('_', ' ')} {schema.in_words(key, point[key])}" for key in keys if key in point]
    if words:
        yield f"at      {', '.join(words)}"


def units_of(job: Job) -> dict[str, list[str]]:
    """Return by SI unit, as datasets write it, the units in which a job gives values of it."""
    units: dict[str, list[str]] = {}
    for key, unit in job.units.items():
        if key in job.schema.parameters:
            units.setdefault(_with_powers(job.schema.parameters[key].unit), []).append(unit)
    return units


def _with_powers(unit: str) -> str:
    """Return "m/s" as "m s-1"."""
    above, divided, below = unit.partition("/")
    return f"{above} {below}-1" if divided else unit


_CUSTOMARY = {_with_powers(unit): [wanted for _, wanted in known] for unit, known in CUSTOMARY.items()}


def outcome_lines(
    outcomes: Sequence[Outcome], units: Mapping[str, Sequence[str]] | None = None, most: int | None = None
) -> Iterator[str]:
    """Yield the lines that say what one run gave: its scalars, and what is per strand or pulley.

    No number that is none; of a run that failed only what is known, without a verdict.

    Parameters
    ----------
    outcomes : sequence of Outcome
        Of a run, its status among them.
    units : mapping, optional
        By SI unit those that are preferred, as of `units_of`; without it all numbers are in SI units.
    most : int, optional
        Number of lines, with what matters first; all by default, and where one line alone would be left out.
    """
    few = (one for one in outcomes if set(one.dims) <= _ALWAYS_SHOWN or one.values.size <= _LARGEST_LINE)
    told = [one for one in few if _known(one.values).any()]
    if any(one.name == "status" and one.values != Status.DONE for one in outcomes):
        told = [one for one in told if one.name in _KNOWN_OF_FAILURES]
    told.sort(key=lambda one: _FIRST.index(one.name) if one.name in _FIRST else len(_FIRST))
    shown = told[: None if most is None or len(told) <= most + 1 else most]
    yield from columns([(one.name.replace("_", " "), _in_words(one, units)) for one in shown], indent="")
    if left := len(told) - len(shown):
        yield f"{left} more by --all"


def _known(values: np.ndarray) -> np.ndarray:
    """Return which values are no nan, and no empty text."""
    return ~np.isnan(values) if values.dtype.kind == "f" else np.asarray(values != "")


def _in_words(outcome: Outcome, units: Mapping[str, Sequence[str]] | None) -> str:
    """Return the values of an outcome, each with its place where there are several, and the unit."""
    values, attributes = outcome.values, outcome.attributes
    if "flag_meanings" in attributes:
        return flag_in_words(values.item(), attributes)
    known = _known(values)
    unit = attributes.get("units", "")
    unit = "" if unit == "1" else unit
    told = {"units": unit, JOB_UNITS: _readable_unit(values[known], unit, units)}
    found = (shown_number(value, told) for value in values[known].ravel().tolist())
    texts = [f"{value:.6g}" if isinstance(value, float) else str(value) for value in found]
    if outcome.dims:
        named = zip(np.asarray(outcome.places)[known], texts, strict=True)
        texts = [f"{place} {text}" for place, text in named]
    return f"{', '.join(texts)} {told[JOB_UNITS] or unit}".rstrip()


def _readable_unit(values: np.ndarray, unit: str, units: Mapping[str, Sequence[str]] | None) -> str:
    """Return the first unit, of the job and then of engineers, in which the largest value is readable.

    It is "" for the SI unit, which comes last.
    """
    if units is None or values.dtype.kind != "f":
        return ""
    largest = float(abs(values).max())
    for least in _LEAST:
        for wanted in dict.fromkeys([*units.get(unit, ()), *_CUSTOMARY.get(unit, ()), ""]):
            if least <= shown_number(largest, {"units": unit, JOB_UNITS: wanted}) < _MOST:
                return wanted
    return ""
