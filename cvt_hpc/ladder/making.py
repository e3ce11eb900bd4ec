"""A ladder chart made: the same runs done with every model, compared, written and drawn.

The picture of a ladder chart: error against cost of each model, a panel for each question.
"""

import json
import math
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cvt_hpc.analysis.error_axes import line_style, set_error_axis
from cvt_hpc.analysis.figures import WIDTH, draw
from cvt_hpc.files import refuse_link, written_aside
from cvt_hpc.job import Job
from cvt_hpc.ladder.comparing import Finding, compare
from cvt_hpc.ladder.costs import cost_left
from cvt_hpc.ladder.rungs import QUESTIONS, REFERENCE, Rung
from cvt_hpc.ladder.table import in_job_unit, ladder_dataset, write_ladder
from cvt_hpc.linear_algebra import one_thread
from cvt_hpc.netcdf import write_netcdf
from cvt_hpc.simulation import simulate
from cvt_hpc.study import RunReport, check_start, open_results, run
from cvt_hpc.study.ranks.launch import detect_launch
from cvt_hpc.study.ranks.progress import show_duration

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
    for number, rung in enumerate(rungs, 1):
        runs, cost = left[rung.name]
        if runs:
            to_go = sum(left[later.name][1] for later in rungs[number - 1 :])
            # by the time of earlier models, as far as they count beside all; at first by prediction alone
            to_go *= (spent + predicted / detect_launch().size) / (done + predicted)
            expected = f"{runs} runs, {show_duration(to_go)} to go in all"
            announce(f"model {number}/{len(rungs)} {rung.name}: {expected}")
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
