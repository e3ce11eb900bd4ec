"""A ladder chart made: the same runs done with every model, compared, written and drawn.

The picture shows error against cost of each model, a panel for each question. The table is for people, and
a file that can be kept.
"""

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cvt_hpc.analysis.figures import WIDTH, coordinate_unit, draw, line_style, set_error_axis
from cvt_hpc.experiments.ladder.comparing import Finding, compare
from cvt_hpc.experiments.ladder.loading import QUESTIONS, REFERENCE, Ladder
from cvt_hpc.experiments.outcome import Outcome, Tell
from cvt_hpc.experiments.sweeps import Sweep, load_sweep, maker_of, run_sweeps
from cvt_hpc.job import Job
from cvt_hpc.job.values import JOB_UNITS
from cvt_hpc.storage.files import write_rows
from cvt_hpc.storage.netcdf import attributes, global_attributes, store
from cvt_hpc.storage.provenance import machine, origin_lines
from cvt_hpc.study import process_rank
from cvt_hpc.study.status import STALLED
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

_HEIGHT = 7.2  # [inch]
_CLOCK = 1e-6  # [s] of processor time that are told apart: no less stands on the logarithmic axis of costs
_ROOM = 1.15  # length of a linear axis over its largest error
_HATCHED = {"facecolor": "#f3f3f3", "edgecolor": "#d0d0d0", "hatch": "////", "lw": 0}
# Title of a panel, label and factor of its errors; errors that may well be 0 stand on a linear axis.
_PANELS = {
    "occurrence": ("does it vibrate", "cells of the wrong class [%]", 100.0),
    "onset": ("at which load it sets in or ends", "error of the load [{unit}]", 1.0),
    "frequency": ("at which frequency", "relative error [%]", 100.0),
    "amplitude": ("how far", "relative error [%]", 100.0),
    "forces": ("mean forces", "error of the largest force [%]", 100.0),
}
_LINEAR = ("occurrence", "onset")


def make(asked: Ladder, out: Path, *, fresh: bool, tell: Tell) -> Outcome:
    """Do the runs of each model, compare them, and write table, dataset and picture; see `experiment_kinds`.

    Raises
    ------
    InputError
        If the folder of a model holds another job, or the system refuses to read or write a file.
    """
    job, rungs = asked.job, asked.rungs
    status = run_sweeps(rungs, asked.refusals, out, fresh=fresh, tell=tell)
    if status >= STALLED or process_rank() != 0:
        return Outcome(status=status)
    results = {rung.name: load_sweep(rung.name, out) for rung in rungs}
    findings = tuple(compare(rungs, results))
    table, picture = out / "ladder.csv", out / "ladder.png"
    dataset = _ladder_dataset(job, rungs, findings, [maker_of(found) for found in results.values()])
    write_ladder(job, findings, dataset.attrs | {"job_fingerprint": job.fingerprint()}, table)
    draw(lambda: ladder_figure(job, findings), picture)
    files = ("table", table), ("dataset", store(dataset, out / "ladder.nc")), ("picture", picture)
    return Outcome(tuple(ladder_lines(job, findings)), files, status)


def ladder_figure(job: Job, findings: Sequence[Finding]) -> Figure:
    """Compose the picture: error of each model against its cost; to be called within STYLE."""
    findings, unit = _in_job_unit(job, findings)
    findings = [f._replace(core_seconds=max(f.core_seconds, _CLOCK)) for f in findings]
    costs = {f.rung: f.core_seconds for f in findings if f.rung != REFERENCE}
    styles = {
        rung: {**line_style(k), "ls": "", "ms": 6.5}
        for k, rung in enumerate(sorted(costs, key=lambda rung: costs[rung]))
    }
    styles[REFERENCE] = {"color": "black", "marker": "*", "ls": "", "ms": 8}
    figure = Figure((WIDTH, _HEIGHT), layout="constrained")
    figure.suptitle(f"{job.name}: error of each model against its cost, lower left is better")
    panels = figure.subplots(3, 2, sharey=True).flat
    for axes, question in zip(panels, QUESTIONS, strict=False):
        _draw_panel(axes, question, [f for f in findings if f.question == question], styles, unit)
    panels[0].set_yscale("log")
    for axes in figure.axes[::2]:
        axes.set_ylabel("core-seconds per run")
    last = figure.axes[-1]
    last.set_axis_off()
    last.legend(handles=_legend(styles), loc="center", frameon=False, fontsize=8.5)
    return figure


def _draw_panel(
    axes: Axes, question: str, findings: Sequence[Finding], styles: dict[str, dict], unit: str
) -> None:
    title, label, factor = _PANELS[question]
    spans = {finding: [factor * error for error in _span(finding)] for finding in findings}
    left = _scale(
        axes, question, [error for span in spans.values() for error in span if math.isfinite(error)]
    )
    for finding, (low, high) in spans.items():
        style = styles[finding.rung]
        low = max(low, left)  # on a logarithmic axis an error of 0 stands at its end
        axes.plot([low, high], [finding.core_seconds] * 2, color=style["color"], lw=1.0, gid="span")
        axes.plot(low, finding.core_seconds, **style, gid=finding.rung, clip_on=False)
        if finding.rung == REFERENCE and low > left:
            axes.axvspan(left, low, **_HATCHED, zorder=0, gid="hatched")
    axes.set_title(f"{question}: {title}", loc="left", pad=3)
    axes.set_xlabel(label.format(unit=unit))
    axes.grid(which="major", color="#e4e4e4", lw=0.6)
    axes.set_axisbelow(True)


def _span(finding: Finding) -> tuple[float, float]:
    """Return the marked error and the end of its line: the bound that 95 % keep, or with undecided."""
    score = finding.score
    if finding.question == "occurrence":
        return score.wrong, score.wrong + score.undecided
    return score.median, score.high


def _scale(axes: Axes, question: str, errors: Sequence[float]) -> float:
    """Make room on the error's axis, and return its left end."""
    if question in _LINEAR:
        largest = max(errors, default=0.0) or 1.0
        axes.set_xlim(-0.04 * largest, _ROOM * largest)
        return axes.get_xlim()[0]
    axes.set_xscale("log")
    left = set_error_axis(axes, [error for error in errors if error > 0.0])
    axes.xaxis.set_major_formatter("{x:g}")
    return left


def _legend(styles: dict[str, dict]) -> list[Line2D | Patch]:
    span = "to the error that 95 % keep;\noccurrence: with the undecided"
    rungs = [Line2D([], [], **style, label=rung.replace("_", " ")) for rung, style in styles.items()]
    return [
        *rungs,
        Line2D([], [], color="black", lw=1.0, label=span),
        Patch(**_HATCHED, label="below the reference's own error"),
    ]


def _in_job_unit(job: Job, findings: Sequence[Finding]) -> tuple[list[Finding], str]:
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
    findings, unit = _in_job_unit(job, findings)
    units = UNITS | {"onset": unit}
    rows = (
        [one.question, one.rung, units[one.question]]
        + [number(value, 3) if isinstance(value, float) else value for value in _numbers(one)]
        for one in findings
    )
    write_rows(path, ["question", "rung", "error_unit", *NUMBERS], rows, origin_lines(made))


def ladder_lines(job: Job, findings: Sequence[Finding]) -> Iterator[str]:
    """Yield the lines that show the findings to people."""
    findings, of_onsets = _in_job_unit(job, findings)
    heads = ["", "cells", "median", "95 %", "wrong", "silent", "more", "core-s/run", ""]
    for question in QUESTIONS:
        found = [finding for finding in findings if finding.question == question]
        unit = f" [{of_onsets}]" if question == "onset" else ""
        yield f"{question}: error{unit}; that of the reference is estimated"
        yield from columns([heads, *([f.rung, *_cells(f), ""] for f in found)])


def _ladder_dataset(
    job: Job, rungs: Sequence[Sweep], findings: Sequence[Finding], makers: Sequence[Mapping[str, Any]] = ()
) -> xr.Dataset:
    """Return the findings over `question` and `rung`, with all that is needed to repeat them."""
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
    """Return the values of NUMBERS, in their order."""
    return (*finding.score, finding.core_seconds)


def _cells(finding: Finding) -> list[str]:
    s = finding.score
    more = str(s.additional) if finding.question == "onset" else ""
    return [str(s.cells), *map(short, s[1:5]), more, short(finding.core_seconds)]
