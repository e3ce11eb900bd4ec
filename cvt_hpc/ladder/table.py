"""The results of a ladder chart as a table, for people and as files that can be kept."""

import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from cvt_hpc.analysis.figures import coordinate_unit
from cvt_hpc.files import write_rows
from cvt_hpc.job import Job
from cvt_hpc.job.shown import JOB_UNITS
from cvt_hpc.ladder.comparing import Finding
from cvt_hpc.ladder.rungs import QUESTIONS, Rung
from cvt_hpc.netcdf import attributes, global_attributes
from cvt_hpc.provenance import machine, origin_lines
from cvt_hpc.tables import columns, number, short

UNITS = dict.fromkeys(QUESTIONS, "1") | {"onset": "N m"}
# Column -> its name and meaning; `error_unit` gives the unit of error columns
NUMBERS = {
    "cells": ("cells", "cells behind the errors; of onsets, pairs of them"),
    "error_median": ("median error", "in the unit error_unit"),
    "error_95": ("error of 95 %", "error that 95 % of the cells keep, in the unit error_unit"),
    "wrong_share": (
        "wrong cells",
        "share of cells that are quiet here and vibrate in the reference, or the other way round",
    ),
    "undecided_share": (
        "undecided cells",
        "share of cells, or of the reference's onsets, of which the model says nothing",
    ),
    "additional": (
        "additional onsets",
        "onsets that the reference does not have, though it decides below and above them",
    ),
    "core_seconds": ("processor time", "of a run, mean"),
}


def in_job_unit(job: Job, findings: Sequence[Finding]) -> tuple[list[Finding], str]:
    """Return findings with errors of onsets in the unit in which the job gives the load, and that unit."""
    scale, unit = coordinate_unit({"units": UNITS["onset"], JOB_UNITS: job.units.get("load", "")})
    shown = []
    for finding in findings:
        if finding.question == "onset":
            score = finding.score
            score = score._replace(median=scale * score.median, high=scale * score.high)
            finding = finding._replace(score=score)
        shown.append(finding)
    return shown, unit


def write_ladder(job: Job, findings: Sequence[Finding], made: Mapping[str, Any], path: Path) -> None:
    """Write the findings as comma-separated values, a row for each model and question, below their origin."""
    findings, unit = in_job_unit(job, findings)
    units = UNITS | {"onset": unit}
    rows = (
        [one.question, one.rung, units[one.question]]
        + [number(value, 3) if isinstance(value, float) else value for value in _numbers(one)]
        for one in findings
    )
    write_rows(path, ["question", "rung", "error_unit", *NUMBERS], rows, origin_lines(made))


def ladder_lines(job: Job, findings: Sequence[Finding]) -> Iterator[str]:
    """Yield the lines that show the findings to people."""
    findings, of_onsets = in_job_unit(job, findings)
    heads = ["", "cells", "median", "95 %", "wrong", "silent", "more", "core-s/run", ""]
    for question in QUESTIONS:
        found = [finding for finding in findings if finding.question == question]
        unit = f" [{of_onsets}]" if question == "onset" else ""
        yield f"{question}: error{unit}; that of the reference is estimated"
        yield from columns([heads, *([f.rung, *_cells(f), ""] for f in found)])


def ladder_dataset(
    job: Job, rungs: Sequence[Rung], findings: Sequence[Finding], makers: Sequence[Mapping[str, Any]] = ()
) -> xr.Dataset:
    """Return the findings as a dataset over `question` and `rung`, with all that is needed to repeat it.

    Parameters
    ----------
    job : Job
        The job of the ladder.
    rungs : sequence of Rung
        Its models.
    findings : sequence of Finding
        The results.
    makers : sequence of mapping
        By whom the runs were made, as of `netcdf.global_attributes`.
    """
    names = list(dict.fromkeys(finding.rung for finding in findings))
    values = np.full((len(NUMBERS), len(QUESTIONS), len(names)), np.nan)
    for finding in findings:
        values[:, QUESTIONS.index(finding.question), names.index(finding.rung)] = _numbers(finding)
    units = {"error_median": "", "error_95": "", "core_seconds": "s"}
    variables = {
        name: (("question", "rung"), array, attributes(words, units.get(name, "1"), text))
        for (name, (words, text)), array in zip(NUMBERS.items(), values, strict=True)
    }
    texts = {"question": np.array(QUESTIONS, object), "rung": np.array(names, object)}
    coordinates = {name: (name, labels, attributes(name)) for name, labels in texts.items()}
    of_errors = ("question", np.array(list(UNITS.values()), object), attributes("unit of errors"))
    subject = "accuracy against cost of the ladder of models"
    told = {
        **global_attributes(job, job.resolved(), subject, makers=makers),
        "rungs": json.dumps({rung.name: rung.job.resolved() for rung in rungs}),
        "machine": json.dumps(machine()),
    }
    return xr.Dataset({"error_unit": of_errors, **variables}, coordinates, told)


def _numbers(finding: Finding) -> tuple[float, ...]:
    """Values of NUMBERS, in their order."""
    return (*finding.score, finding.core_seconds)


def _cells(finding: Finding) -> list[str]:
    s = finding.score
    more = str(s.additional) if finding.question == "onset" else ""
    return [str(s.cells), *map(short, s[1:5]), more, short(finding.core_seconds)]
