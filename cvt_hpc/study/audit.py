"""Audits: how often the cheap models of `auto` err, by a sample of their runs done again in full."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from cvt_hpc.errors import mismatch
from cvt_hpc.job import Job
from cvt_hpc.job.definition import handed_to
from cvt_hpc.job.values import heading, shown_number
from cvt_hpc.models.auto.rules import Rung
from cvt_hpc.storage.files import write_rows
from cvt_hpc.study.description import Study, describe
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.intervals import interval
from cvt_hpc.study.record.index import Records
from cvt_hpc.study.repeats import AUDIT, AUDITED, FULL_MODEL, Repeat, built
from cvt_hpc.study.simulator import default_simulator
from cvt_hpc.study.status import expected_cost
from cvt_hpc.variables import Status
from cvt_hpc.vibration.classes import DECIDED, OccurrenceClass, classify_runs

TABLE = "audit.csv"  # in the folder of the audit
LOWER = (Rung.PASSIVE, Rung.COARSE)
_OPPOSITE = (OccurrenceClass.QUIET, OccurrenceClass.VIBRATING)
FORCES = (("mean_ring_tension", "mean_push_force"), ("axial_force",))  # each group over its largest


class RungAudit(NamedTuple):
    """Result of the audit of one model of the ladder."""

    rung: Rung  # the model that had answered
    runs: int  # runs done again, to their end
    failed: int  # further runs, which failed in full or took too long
    differing: int  # number of `runs` with another class by the model
    contrary: int  # of these, the number with quiet by one and vibrating by the other
    interval: tuple[float, float]  # the share of differing runs lies within it, see `interval`
    # deviation that the mean forces of strands and of sheaves, over the largest of either, keep in 95 % of
    # the runs; not a number where the model gives no forces
    force_deviation: float


class AuditReport(NamedTuple):
    """Result of an audit."""

    answered: int  # runs that the cheaper models have answered, of which a sample was repeated
    rungs: tuple[RungAudit, ...]  # by model
    table: Path  # all runs that differ or failed, one by one


def audit_of(job: Job, out: Path, fraction: float) -> Repeat:
    """Return the audit of a study in a folder: a share of the runs of cheaper models, done again in full.

    Raises
    ------
    InputError
        If the job is not of model auto, which has a ladder.
    """
    if job.model != AUDITED:
        expected = f"a job of model {AUDITED}, whose cheaper models can err"
        raise mismatch("--audit", expected, f"model {job.model}")
    full = built(job, handed_to(job, FULL_MODEL, "done in full, to audit the cheaper models"))
    place = out / AUDIT
    return Repeat(
        "audit", "in full", job, out, AUDIT, full, fraction, _answered, lambda: expected_cost(full, place)[0]
    )


def report_audit(audit: Repeat) -> AuditReport:
    """Compare the runs of an audit, all done, with the cheaper models, and write the table; on one rank."""
    low = audit.records
    full = StudyFolder(audit.place).read_records(describe(audit.job, default_simulator()))
    audited = np.flatnonzero(audit.sample & full.recorded)
    rungs, ended = low.read(audited, "rung"), full.status[audited] == Status.DONE
    classes = [classify_runs(r.status[audited], r.read(audited, "vibrates")) for r in (low, full)]
    differs = ended & (classes[0] != classes[1]) & np.isin(classes[0], DECIDED)
    contrary = differs & np.isin(classes[0], _OPPOSITE) & np.isin(classes[1], _OPPOSITE)
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
        rung, margin = Rung(int(low[k]["rung"])).name.lower(), f"{low[k]['margin']:.3g}"
        rows.append([index, *place, rung, *words, margin, *reasons])
    head = ["run", *heads, "rung", "class", "class in full", "margin", "reason", "reason in full"]
    write_rows(table, head, rows)
