"""Answers of each model of the ladder to a question, compared with the reference.

Cells count that the reference decides, or in which it vibrates. A model that gives no answer in a
cell is not in error there: such cells are counted by themselves.

An audit finds how often a cheap model errs: it repeats a sample of the runs that the model answered in full.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.classes import at_strongest_strand, occurrence_classes
from cvt_hpc.errors import mismatch
from cvt_hpc.experiments.ladder.loading import REFERENCE, Rung
from cvt_hpc.files import write_rows
from cvt_hpc.job import Job
from cvt_hpc.job.definition import handed_to
from cvt_hpc.job.values import heading, shown_number
from cvt_hpc.models.auto.rules import Rung as AutoRung
from cvt_hpc.models.linear_stability.modes import DECAY
from cvt_hpc.study.description import Study, describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.repeats import AUDIT, AUDITED, FULL_MODEL, Repeat, built, interval
from cvt_hpc.study.simulator import default_simulator
from cvt_hpc.study.status import expected_cost
from cvt_hpc.variables import Status
from cvt_hpc.vibration.classes import DECIDED, OccurrenceClass, classify_runs, levels, onsets, paired_errors

TABLE = "audit.csv"  # in the folder of the audit
LOWER = (AutoRung.PASSIVE, AutoRung.COARSE)
OPPOSITE = (OccurrenceClass.QUIET, OccurrenceClass.VIBRATING)
FORCES = (("mean_ring_tension", "mean_push_force"), ("axial_force",))  # each group over its largest

Array = NDArray[np.float64]


class Score(NamedTuple):
    """How well a model answers a question.

    Attributes
    ----------
    cells : int
        Cells behind the errors; of onsets, pairs of them.
    median, high : float
        Median of the errors and the bound that 95 % of them keep: of onsets [N m], of all else relative. Not
        a number of occurrence, and where there is nothing to compare.
    wrong : float
        Of occurrence, the share of cells that are decided here and there, but of another class.
    undecided : float
        Share of the reference's cells that the model leaves undecided, fails at or does not answer; of
        onsets the share that it misses.
    additional : int
        Onsets that the reference does not have, though it decides below and above them.
    """

    cells: int
    median: float = math.nan
    high: float = math.nan
    wrong: float = math.nan
    undecided: float = math.nan
    additional: int = 0


class Finding(NamedTuple):
    """A row of the table.

    Attributes
    ----------
    question, rung : str
        The question, and the model that answered.
    score : Score
        How well; of the reference its estimated error.
    core_seconds : float
        Of a run of the model, mean [s].
    """

    question: str
    rung: str
    score: Score
    core_seconds: float


def compare(rungs: Sequence[Rung], results: Mapping[str, xr.Dataset]) -> Iterator[Finding]:
    """Yield the score of each model for each question that it answers, the reference last.

    The reference's own error is taken as large as the distance of the model before it, which is a
    refined one. Of the elastic belt it would be 0.8 of that if all errors were of second order in mesh and
    step, and twice as much if of the first; of the pushbelt a third, and as much. No onset is known more
    closely than half a step of the load.

    Parameters
    ----------
    rungs : sequence of Rung
        As `ladder` returns them, the reference last.
    results : mapping
        Results of each model, by its name.
    """
    reference = results[REFERENCE]
    costs = {name: float(dataset["core_seconds"].mean()) for name, dataset in results.items()}
    for question, score in SCORES.items():
        for rung in rungs:
            if question in rung.answers:
                found = score(_beside(results[rung.name], reference), reference)
                yield Finding(question, rung.name, found, costs[rung.name])
        # the model before the reference answers all questions, and stands last
        yield Finding(question, REFERENCE, _own(question, found, reference), costs[REFERENCE])


def _own(question: str, coarser: Score, reference: xr.Dataset) -> Score:
    """Estimated error of the reference, by the score of the model that it refines."""
    if question == "onset":
        spacing = np.diff(np.sort(reference["load"].values)).max(initial=0.0)
        return Score(coarser.cells, median=float(np.fmax(coarser.median, 0.5 * spacing)))
    return Score(coarser.cells, median=coarser.median, wrong=coarser.wrong)


def _beside(dataset: xr.Dataset, reference: xr.Dataset) -> xr.Dataset:
    """A model's results over all axes of the reference: the same along axes that it does not know."""
    order = reference["status"].dims
    missing = {name: reference[name] for name in order if name not in dataset["status"].dims}
    return dataset.expand_dims(missing).transpose(*order, ...)


def _occurrence(found: xr.Dataset, true: xr.Dataset) -> Score:
    one, other = (occurrence_classes(each).values for each in (found, true))
    asked = np.isin(other, DECIDED)
    cells = int(asked.sum())
    if not cells:
        return Score(0)
    is_told = np.isin(one[asked], DECIDED)
    wrong = (is_told & (one != other)[asked]).mean()
    return Score(cells, wrong=float(wrong), undecided=float((~is_told).mean()))


def _onset(found: xr.Dataset, true: xr.Dataset) -> Score:
    loads, axis = true["load"].values, true["status"].dims.index("load")
    is_linear = "growth_rate" in found and found["growth_rate"].dims == found["status"].dims
    level = _growth(found) if is_linear else _levels(found)
    lines = [np.moveaxis(values, axis, -1).reshape(-1, loads.size) for values in (level, _levels(true))]
    errors: list[float] = []
    missed = additional = 0
    for one, other in zip(*lines, strict=True):
        decided = loads[np.isfinite(other)]
        known = (decided.min(initial=np.inf), decided.max(initial=-np.inf))
        pairs, less, more = paired_errors(onsets(loads, one), onsets(loads, other), known)
        errors, missed, additional = errors + pairs, missed + less, additional + more
    number = len(errors) + missed
    score = _score(np.array(errors), number)
    return score._replace(additional=additional)


def _levels(dataset: xr.Dataset) -> Array:
    """1 where a run vibrates, -1 where it is quiet, nan elsewhere."""
    return levels(occurrence_classes(dataset).values)


def _growth(dataset: xr.Dataset) -> Array:
    """Growth rate of the fastest mode [1/s]; where all decay faster than is looked for, that limit."""
    rate = dataset["growth_rate"].values
    return np.where(dataset["status"] == Status.DONE, np.where(np.isnan(rate), -DECAY, rate), np.nan)


def _frequency(found: xr.Dataset, true: xr.Dataset) -> Score:
    own = at_strongest_strand(true, "frequency")
    if "eigenfrequency" in found:  # a strand alone has no strongest mode: the nearest one of the same strand
        known = found["eigenfrequency"]
        nearest = known.isel(half_waves=abs(known - own).fillna(np.inf).argmin("half_waves"))
        said = at_strongest_strand(true.assign(nearest=nearest.reset_coords(drop=True)), "nearest").values
    elif "amplitude" in found:
        said = _where_vibrating(found, at_strongest_strand(found, "frequency"))
    else:
        said = _where_vibrating(found, found["frequency"])
    return _relative(said, _where_vibrating(true, own))


def _amplitude(found: xr.Dataset, true: xr.Dataset) -> Score:
    said, own = (_where_vibrating(each, at_strongest_strand(each, "amplitude")) for each in (found, true))
    return _relative(said, own)


def _where_vibrating(dataset: xr.Dataset, values: xr.DataArray) -> Array:
    return np.where(_levels(dataset) > 0.0, values.values, np.nan)


def _relative(said: Array, own: Array) -> Score:
    asked = np.isfinite(own)
    return _score(np.abs(said[asked] / own[asked] - 1.0), int(asked.sum()))


def _forces(found: xr.Dataset, true: xr.Dataset) -> Score:
    """Of each cell the larger of two deviations: of strand forces and of axial forces, over the largest."""
    largest = np.zeros(true["status"].shape)
    for names in FORCES:
        one, other = (
            np.concatenate([_where_done(each, name) for name in names], axis=-1) for each in (found, true)
        )
        largest = np.maximum(largest, np.abs(one - other).max(axis=-1) / np.abs(other).max(axis=-1))
    return _score(largest, int((true["status"] == Status.DONE).sum()))


def _where_done(dataset: xr.Dataset, name: str) -> Array:
    status = dataset["status"]
    return dataset[name].where(status == Status.DONE).transpose(*status.dims, ...).values


def _score(errors: Array, asked: int) -> Score:
    """Score of errors, nan where the model gives no answer, for the number of requested cells."""
    known = errors[np.isfinite(errors)]
    undecided = 1.0 - known.size / asked if asked else math.nan
    if not known.size:
        return Score(0, undecided=undecided)
    median, high = (float(np.quantile(known, q)) for q in (0.5, 0.95))
    return Score(known.size, median, high, undecided=undecided)


SCORES: dict[str, Callable[[xr.Dataset, xr.Dataset], Score]] = {
    "occurrence": _occurrence,
    "onset": _onset,
    "frequency": _frequency,
    "amplitude": _amplitude,
    "forces": _forces,
}


class RungAudit(NamedTuple):
    """Result of the audit of one model of the ladder.

    Attributes
    ----------
    rung : AutoRung
        The model that had answered.
    runs : int
        Runs done again, to their end.
    failed : int
        Further runs, which failed in full or took too long.
    differing : int
        Number of `runs` with another class by the model.
    contrary : int
        Of these, the number with quiet by one and vibrating by the other.
    interval : (float, float)
        The share of differing runs lies within it, see `interval`.
    force_deviation : float
        Deviation that the mean forces of strands and of sheaves, over the largest of either, keep in 95 % of
        the runs; not a number where the model gives no forces.
    """

    rung: AutoRung
    runs: int
    failed: int
    differing: int
    contrary: int
    interval: tuple[float, float]
    force_deviation: float


class AuditReport(NamedTuple):
    """Result of an audit.

    Attributes
    ----------
    answered : int
        Runs that the cheaper models have answered, of which a sample was repeated.
    rungs : tuple of RungAudit
        By model.
    table : Path
        All runs that differ or failed, one by one.
    """

    answered: int
    rungs: tuple[RungAudit, ...]
    table: Path


def audit_of(job: Job, out: Path, fraction: float) -> Repeat:
    """Return the audit of a study: a sample of the runs that cheaper models have answered, in full.

    Parameters
    ----------
    job : Job
        Of model auto.
    out : Path
        Its folder.
    fraction : float
        Share of the runs that is done again.

    Raises
    ------
    InputError
        If the job has no ladder.
    """
    if job.model != AUDITED:
        raise mismatch(
            "--audit", f"a job of model {AUDITED}, whose cheaper models can err", f"model {job.model}"
        )
    full = built(job, handed_to(job, FULL_MODEL, "done in full, to audit the cheaper models"))

    def cost() -> float:
        return expected_cost(full, out / AUDIT)[0]

    return Repeat("audit", "in full", job, out, AUDIT, full, fraction, _answered, core_seconds=cost)


def report_audit(audit: Repeat) -> AuditReport:
    """Compare the runs of an audit with the answers of the cheaper models, and write the table; on one rank.

    Parameters
    ----------
    audit : Repeat
        As returned by `audit_of`, with all runs done.
    """
    low = audit.records
    full = StudyFolder(audit.place).read_records(describe(audit.job, default_simulator()))
    audited = np.flatnonzero(audit.sample & full.recorded)
    rungs, ended = low.read(audited, "rung"), full.status[audited] == Status.DONE
    classes = [classify_runs(r.status[audited], r.read(audited, "vibrates")) for r in (low, full)]
    differs = ended & (classes[0] != classes[1]) & np.isin(classes[0], DECIDED)
    contrary = differs & np.isin(classes[0], OPPOSITE) & np.isin(classes[1], OPPOSITE)
    table = audit.place / TABLE
    shown = differs | ~ended
    _write(table, audit.study, audited[shown], (low, full), [found[shown] for found in classes])
    found = []
    for rung in LOWER:
        of_rung = rungs == rung
        runs, differing = int((of_rung & ended).sum()), int(differs[of_rung].sum())
        if of_rung.any():
            deviation = _force_deviation(low, full, audited[of_rung & ended])
            counts = runs, int((of_rung & ~ended).sum()), differing, int(contrary[of_rung].sum())
            found.append(RungAudit(rung, *counts, interval(differing, runs), deviation))
    return AuditReport(int(audit.may_be_drawn.sum()), tuple(found), table)


def _answered(records: Records) -> np.ndarray:
    """Whether a cheaper model has answered a run, shape (runs,)."""
    answered = records.recorded.copy()
    places = np.flatnonzero(answered)
    answered[places] = np.isin(records.read(places, "rung"), LOWER)
    return answered


def _force_deviation(low: Records, full: Records, runs: np.ndarray) -> float:
    largest = np.zeros(runs.size)
    for names in FORCES:
        one, other = (np.hstack([records.read(runs, name) for name in names]) for records in (low, full))
        deviation = np.abs(one - other).max(axis=1) / np.abs(other).max(axis=1)
        largest = np.maximum(largest, deviation)  # not a number where either run has no forces
    known = largest[np.isfinite(largest)]
    return float(np.quantile(known, 0.95)) if known.size else math.nan


def _write(
    table: Path, study: Study, runs: np.ndarray, both: Sequence[Records], classes: Sequence[np.ndarray]
) -> None:
    """Write the answers of both models for some runs."""
    axes = {axis.name: axis.attributes for axis in study.axes}
    heads = [heading(name, attributes) for name, attributes in axes.items()]
    low, full = (records.read(runs) for records in both)
    rows = []
    for k, index in enumerate(runs):
        place = [shown_number(value, axes[name]) for name, value in study.place(int(index)).items()]
        words = [OccurrenceClass(int(found[k])).label for found in classes]
        reasons = [records[k]["reason"].decode(errors="replace") for records in (low, full)]
        rung, margin = AutoRung(int(low[k]["rung"])).name.lower(), f"{low[k]['margin']:.3g}"
        rows.append([index, *place, rung, *words, margin, *reasons])
    head = ["run", *heads, "rung", "class", "class in full", "margin", "reason", "reason in full"]
    write_rows(table, head, rows)
