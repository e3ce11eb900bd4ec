"""The picture of a ladder chart: error against cost of each model, a panel for each question."""

import math
from collections.abc import Sequence
from pathlib import Path

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from cvt_hpc.analysis.error_axes import line_style, set_error_axis
from cvt_hpc.analysis.figures import WIDTH, draw
from cvt_hpc.job import Job
from cvt_hpc.ladder.comparing import Finding
from cvt_hpc.ladder.rungs import QUESTIONS, REFERENCE
from cvt_hpc.ladder.table import in_job_unit

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
