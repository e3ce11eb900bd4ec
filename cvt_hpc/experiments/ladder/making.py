"""A ladder chart made: the same runs done with every model, compared, written and drawn.

The picture shows error against cost of each model, a panel for each question. The table is for people, and
a file that can be kept.
"""

import json
import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cvt_hpc.analysis.figures import WIDTH, coordinate_unit, draw, line_style, set_error_axis
from cvt_hpc.experiments.ladder.comparing import Finding, compare
from cvt_hpc.experiments.ladder.loading import QUESTIONS, REFERENCE, Rung, cost_left
from cvt_hpc.files import refuse_link, write_rows, written_aside
from cvt_hpc.job import Job
from cvt_hpc.job.values import JOB_UNITS
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.netcdf import attributes, global_attributes, write_netcdf
from cvt_hpc.provenance import machine, origin_lines
from cvt_hpc.simulation import simulate
from cvt_hpc.study import RunReport, check_start, open_results, run
from cvt_hpc.study.ranks.launch import detect_launch
from cvt_hpc.study.ranks.progress import show_duration
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

HEIGHT = 7.2  # [inch]
ROOM = 1.15  # length of a linear axis over its largest error
HATCHED = {"facecolor": "#f3f3f3", "edgecolor": "#d0d0d0", "hatch": "////", "lw": 0}
# Title of a panel, label and factor of its errors; errors that may well be 0 stand on a linear axis.
PANELS = {
    "occurrence": ("does it vibrate", "cells of the wrong class [%]", 100.0),
    "onset": ("at which load it sets in or ends", "error of the load [{unit}]", 1.0),
    "frequency": ("at which frequency", "relative error [%]", 100.0),
    "amplitude": ("how far", "relative error [%]", 100.0),
    "forces": ("mean forces", "error of the largest force [%]", 100.0),
}
LINEAR = ("occurrence", "onset")


class LadderReport(NamedTuple):
    """Results of a ladder chart.

    Attributes
    ----------
    findings : tuple of Finding
        Each model's answer to each question, compared.
    table, dataset, picture : Path
        The files that hold them.
    """

    findings: tuple[Finding, ...]
    table: Path
    dataset: Path
    picture: Path


def run_ladder(
    rungs: Sequence[Rung],
    out: Path,
    *,
    fresh: bool = False,
    tell: Callable[[Rung, RunReport], None],
    announce: Callable[[str], None] = lambda line: None,
) -> int:
    """Do the runs of each model, a study in a folder of its own; on all ranks.

    Parameters
    ----------
    rungs : sequence of Rung
        The ladder of a job.
    out : Path
        The folder of these folders.
    fresh : bool
        Throw earlier results away.
    tell : callable
        Called with each model whose runs have ended, and how.
    announce : callable
        Called with a line before each model that has runs left, with the time to go.

    Returns
    -------
    int
        The largest exit status of a model; later ones do not start after one that stopped early.

    Raises
    ------
    InputError
        If the folder of a model holds another job or cannot be written to; before anything is computed.
    """
    status = 0
    begins = {rung.name: fresh or not (out / rung.name).exists() for rung in rungs}
    for rung in rungs:
        refuse_link(out / rung.name)
        check_start(rung.job, out / rung.name, fresh=fresh)
    left = {rung.name: cost_left(rung, None if fresh else out) for rung in rungs}
    done, spent = 0.0, 0.0
    predicted = sum(cost for _, cost in left.values())
    for place, rung in enumerate(rungs, 1):
        runs, cost = left[rung.name]
        if runs:
            to_go = sum(left[later.name][1] for later in rungs[place - 1 :])
            # by the time of earlier models, as far as they count beside all; at first by prediction alone
            to_go *= (spent + predicted / detect_launch().size) / (done + predicted)
            expected = f"{runs} runs, {show_duration(to_go)} to go in all"
            announce(f"model {place}/{len(rungs)} {rung.name}: {expected}")
        started = time.monotonic()
        # threads of the linear algebra wait for each other in loops, which would count as a model's own time
        with one_thread():
            if rung.job.stepper is None and begins[rung.name]:
                simulate(rung.job)  # libraries loaded and kernels compiled would count as time of a first run
            report = run(rung.job, out / rung.name, fresh=fresh, raises=False)
        tell(rung, report)
        done, spent = done + cost, spent + (time.monotonic() - started if runs else 0.0)
        status = max(status, report.status_of_more or report.exit_status)
        if report.status_of_more:
            break
    return status


def report_ladder(job: Job, rungs: Sequence[Rung], out: Path) -> LadderReport:
    """Compare the results of the models, and write table, dataset and picture; on one rank.

    Parameters
    ----------
    job : Job
        The job of the ladder.
    rungs, out
        As of `run_ladder`, which has come to its end.

    Raises
    ------
    InputError
        If the system refuses to read or write a file.
    """
    results = {}
    for rung in rungs:
        with open_results(out / rung.name) as dataset:
            results[rung.name] = dataset.load()
    findings = tuple(compare(rungs, results))
    report = LadderReport(findings, *(out / f"ladder.{suffix}" for suffix in ("csv", "nc", "png")))
    makers = [
        {"versions": json.loads(found.attrs["versions"]), "git_revision": found.attrs["git_revision"]}
        for found in results.values()
    ]
    dataset = ladder_dataset(job, rungs, findings, makers)
    write_ladder(job, findings, dataset.attrs | {"job_fingerprint": job.fingerprint()}, report.table)
    with written_aside(report.dataset) as aside:
        write_netcdf(dataset, aside)
    draw_ladder(job, findings, report.picture)
    return report


def draw_ladder(job: Job, findings: Sequence[Finding], out: Path) -> Path:
    """Draw error against cost.

    Parameters
    ----------
    job : Job
        The job of the ladder.
    findings : sequence of Finding
        Its results.
    out : Path
        Result and errors are those of `save_figure`.
    """
    return draw(lambda: ladder_figure(job, findings), out)


def ladder_figure(job: Job, findings: Sequence[Finding]) -> Figure:
    """Compose the picture of `draw_ladder`; to be called within STYLE."""
    findings, unit = in_job_unit(job, findings)
    costs = {f.rung: f.core_seconds for f in findings if f.rung != REFERENCE}
    styles = {
        rung: {**line_style(k), "ls": "", "ms": 6.5}
        for k, rung in enumerate(sorted(costs, key=lambda rung: costs[rung]))
    }
    styles[REFERENCE] = {"color": "black", "marker": "*", "ls": "", "ms": 8}
    figure = Figure((WIDTH, HEIGHT), layout="constrained")
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
    title, label, factor = PANELS[question]
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
            axes.axvspan(left, low, **HATCHED, zorder=0, gid="hatched")
    axes.set_title(f"{question}: {title}", loc="left", pad=3)
    axes.set_xlabel(label.format(unit=unit))
    axes.grid(which="major", color="#e4e4e4", lw=0.6)
    axes.set_axisbelow(True)


def _span(finding: Finding) -> tuple[float, float]:
    """The marked error, and the end of its line: the bound that 95 % keep, or with all undecided."""
    score = finding.score
    if finding.question == "occurrence":
        return score.wrong, score.wrong + score.undecided
    return score.median, score.high


def _scale(axes: Axes, question: str, errors: Sequence[float]) -> float:
    """Make room on the error's axis, and return its left end."""
    if question in LINEAR:
        largest = max(errors, default=0.0) or 1.0
        axes.set_xlim(-0.04 * largest, ROOM * largest)
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
        Patch(**HATCHED, label="below the reference's own error"),
    ]


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
