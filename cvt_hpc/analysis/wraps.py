"""Forces between belt and pulleys over the wrap, as figs 9 and 10 of Cepon and Boltezar 2011."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cvt_hpc.analysis.error_axes import COLOURS
from cvt_hpc.analysis.figures import WIDTH, balanced, draw, styled
from cvt_hpc.analysis.histories import place_of
from cvt_hpc.errors import InputError, mismatch, one_line

# rows: variable, label with unit, factor, and what stands beside it
ROWS = (
    ("normal_force", "normal [N/mm]", 1e-3, None),
    ("friction_force", "friction [N/mm]", 1e-3, None),
    ("tension", "tension [N]", 1.0, "sliding_tension"),
)
LINES = ("-", "--", "-.", ":")
THEORY = "#333333"


def draw_wrap(histories: Sequence[xr.Dataset], out: Path, sources: Sequence[str] = ()) -> Path:
    """Write the figure of `wrap_figure`, with its arguments and errors, as `save_figure` does."""
    return draw(lambda: wrap_figure(histories, sources), out)


@styled
def wrap_figure(histories: Sequence[xr.Dataset], sources: Sequence[str] = ()) -> Figure:
    """Draw the mean forces of one or several runs over the wrap of each pulley.

    Parameters
    ----------
    histories : sequence of Dataset
        As `simulate` returns them: `normal_force` and `friction_force` [N/m] and `tension` [N] over
        `position`, with `wrap_angle` [rad], nan on strands, and `region`; `sliding_tension` [N] is drawn
        beside the tension.
    sources : sequence of str, optional
        Where they are from, for the errors and, of several, for the legend.

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
    names = list(sources) or [f"history {k + 1}" for k in range(len(histories))]
    for dataset, name in zip(histories, names, strict=True):
        missing = [key for key in ("normal_force", "friction_force", "wrap_angle") if key not in dataset]
        if missing:
            raise mismatch(name, "the history of a run with normal_force and wrap_angle", f"no {missing[0]}")
    pulleys = list(dict.fromkeys(_regions(histories[0])[np.isfinite(histories[0]["wrap_angle"].values)]))
    rows = [row for row in ROWS if row[0] in histories[0]]
    figure = Figure((WIDTH, 1.6 * len(rows) + 1.1), layout="constrained")
    grid = figure.subplots(len(rows), len(pulleys), sharex="col", sharey="row", squeeze=False)
    for (name, label, factor, beside), line_of_axes in zip(rows, grid, strict=True):
        for axes, pulley in zip(line_of_axes, pulleys, strict=True):
            for k, (dataset, source) in enumerate(zip(histories, names, strict=True)):
                _draw(axes, dataset, pulley, name, factor, k, source)
            if beside is not None and beside in histories[0]:
                _draw(axes, histories[0], pulley, beside, factor, None, "Euler and Eytelwein")
            axes.grid(linewidth=0.4, alpha=0.5)
        line_of_axes[0].set_ylabel(label)
    for axes, pulley in zip(grid[0], pulleys, strict=True):
        axes.set_title(f"{pulley} pulley", loc="left", pad=3)
    for axes in grid[-1]:
        axes.set_xlabel("wrap angle from inlet [°]")
    handles, labels = grid[-1, 0].get_legend_handles_labels()
    if len(labels) > 1:
        figure.legend(handles, labels, loc="outside lower center", frameon=False, ncols=min(len(labels), 3))
    figure.suptitle(_title(histories))
    return figure


def _regions(dataset: xr.Dataset) -> np.ndarray:
    return dataset["region"].values.astype(str)


def _draw(
    axes: Axes, dataset: xr.Dataset, pulley: str, name: str, factor: float, number: int | None, label: str
) -> None:
    """A quantity over the wrap of a pulley; without a number it is theory."""
    inside = (_regions(dataset) == pulley) & np.isfinite(dataset["wrap_angle"].values)
    angle = np.degrees(dataset["wrap_angle"].values[inside])
    style = {"color": THEORY, "ls": ":", "lw": 1.6, "zorder": 3}
    if number is not None:
        style = {"color": COLOURS[number % len(COLOURS)], "ls": LINES[number % len(LINES)], "lw": 1.3}
    axes.plot(angle, factor * dataset[name].values[inside], label=label, **style)


def _title(histories: Sequence[xr.Dataset]) -> str:
    attributes = histories[0].attrs
    lines = [f"Forces over the wrap: {one_line(attributes.get('job_name', ''))}".rstrip(": ")]
    if len(histories) == 1 and (place := place_of(attributes)):
        lines.append(place)
    return "\n".join(balanced(line, 76) for line in lines)
