"""Forces between belt and pulleys over the wrap, as figs 9 and 10 of Cepon and Boltezar 2011."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from cvt_hpc.analysis.figures import COLOURS, STYLE, WIDTH, check_known, styled
from cvt_hpc.analysis.profiles import inside
from cvt_hpc.analysis.telling_apart import entitle_jobs, named, told_apart
from cvt_hpc.errors import InputError, mismatch

# rows: variable, label with unit, factor, and what stands beside it
ROWS = (
    ("normal_force", "normal [N/mm]", 1e-3, None),
    ("friction_force", "friction [N/mm]", 1e-3, None),
    ("tension", "tension [N]", 1.0, "sliding_tension"),
)
LINES = ("-", "--", "-.")  # dotted is theory
THEORY = "Euler and Eytelwein"
INK = "#333333"
MOST_PANELS = 3  # side by side; of more pulleys only those that carry torque have one
LEAST_PULL = 0.05  # of the largest sum of friction forces, from which on a pulley carries torque
FEW = 10  # places on an arc, each of which has a mark


@styled
def wrap_figure(histories: Sequence[xr.Dataset], sources: Sequence[str] = ()) -> Figure:
    """Draw the mean forces of one or several runs over the wrap of each pulley.

    Parameters
    ----------
    histories : sequence of Dataset
        As `simulate` returns them: `normal_force` and `friction_force` [N/m] and `tension` [N] over
        `position`, with `wrap_angle` [rad], nan on strands, and `region`; `sliding_tension` [N] is drawn
        beside the tension. Of more than MOST_PANELS pulleys those without torque are left out.
    sources : sequence of str, optional
        Where they are from, for the errors, and for the legend where the runs' points are alike.

    Returns
    -------
    matplotlib.figure.Figure
        Unknown to pyplot; `figure.savefig(path)` writes it.

    Raises
    ------
    InputError
        There is no history, or one without these forces.
    """
    if not histories:
        raise InputError("wrap: expected one history or more, found none")
    names = named(histories, sources)
    for dataset, name in zip(histories, names, strict=True):
        missing = [key for key in ("normal_force", "friction_force", "wrap_angle") if key not in dataset]
        if missing:
            raise mismatch(name, "the history of a run with normal_force and wrap_angle", f"no {missing[0]}")
        check_known(dataset, ["normal_force"], name)
    pulleys, without_torque = _pulleys(histories)
    common, labels = told_apart(histories, names)
    rows = [row for row in ROWS if row[0] in histories[0]]
    figure = Figure((WIDTH, 1.6 * len(rows) + 1.1), layout="constrained")
    panels = figure.subfigures()  # the label common to them keeps clear of the figure's legend
    grid = panels.subplots(len(rows), len(pulleys), sharex="col", sharey="row", squeeze=False)
    for (name, label, factor, beside), line_of_axes in zip(rows, grid, strict=True):
        for axes, pulley in zip(line_of_axes, pulleys, strict=True):
            for k, (dataset, of_run) in enumerate(zip(histories, labels, strict=True)):
                style = {"ls": LINES[k % len(LINES)], "lw": 1.3, "color": COLOURS[k % len(COLOURS)]}
                _draw(axes, dataset, pulley, name, factor, label=of_run, **style)
            for k, dataset in enumerate(histories):
                if beside is not None and beside in dataset:
                    colour = COLOURS[k % len(COLOURS)] if len(histories) > 1 else INK
                    _draw(axes, dataset, pulley, beside, factor, ls=":", lw=1.6, color=colour, zorder=3)
            axes.grid(linewidth=0.4, alpha=0.5)
        line_of_axes[0].set_ylabel(label)
    for axes, pulley in zip(grid[0], pulleys, strict=True):
        axes.set_title(f"{pulley.removesuffix(' arc')} pulley", loc="left", pad=3)
    panels.supxlabel("wrap angle from inlet [°]", fontsize=STYLE["axes.labelsize"])
    _add_legend(figure, grid[-1, 0], [THEORY] if "sliding_tension" in histories[0] else [])
    further = [f"without torque, not drawn: {', '.join(without_torque)}"] if without_torque else []
    entitle_jobs(figure, histories, ["Forces over the wrap", common, *further])
    return figure


def _pulleys(histories: Sequence[xr.Dataset]) -> tuple[list[str], list[str]]:
    """Pulleys that have panels, and those that have none because no run has torque there."""
    region, angle = _regions(histories[0]), histories[0]["wrap_angle"].values
    # the first station of a strand may be the end of the arc before it
    pulleys = [name for name in dict.fromkeys(region) if np.isfinite(angle[region == name]).all()]
    if len(pulleys) <= MOST_PANELS:
        return pulleys, []
    pulls = [[np.nansum(h["friction_force"].values[_regions(h) == p]) for p in pulleys] for h in histories]
    largest = np.abs(pulls).max(axis=0)
    carries = dict(zip(pulleys, largest >= LEAST_PULL * largest.max(), strict=True))
    return [p for p in pulleys if carries[p]], [p for p in pulleys if not carries[p]]


def _regions(dataset: xr.Dataset) -> np.ndarray:
    return dataset["region"].values.astype(str)


def _draw(axes: Axes, dataset: xr.Dataset, pulley: str, name: str, factor: float, **style: Any) -> None:
    """A quantity over the wrap of a pulley."""
    here = inside(dataset, pulley.removesuffix(" arc"))
    angle = np.degrees(dataset["wrap_angle"].values[here])
    marker = "." if angle.size < FEW else ""
    axes.plot(angle, factor * dataset[name].values[here], marker=marker, ms=5, **style)


def _add_legend(figure: Figure, axes: Axes, theory: Sequence[str]) -> None:
    handles, labels = axes.get_legend_handles_labels()
    handles += [Line2D([], [], ls=":", lw=1.6, color=INK) for _ in theory]
    if len(labels := [*labels, *theory]) > 1:
        figure.legend(handles, labels, loc="outside lower center", frameon=False, ncols=min(len(labels), 3))
