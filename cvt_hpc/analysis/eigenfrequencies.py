"""Eigenfrequencies of the strands over an axis of a study, as fig. 3.7 of Lebrecht et al. 2004."""

from __future__ import annotations

from collections.abc import Mapping
from textwrap import fill
from typing import Any

import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cvt_hpc.analysis.arrangement import CHOSEN, Sides, along_x, arrange, ruler
from cvt_hpc.analysis.figures import WIDTH, axis_label
from cvt_hpc.errors import one_line

COLOUR = "#1f4e8c"
HEIGHT = 3.6  # [inch]


def eigenfrequency_figure(
    dataset: xr.Dataset, at: Mapping[str, Any], source: str, sides: Sides = CHOSEN
) -> Figure:
    """Compose the picture: a panel for each strand, a line for each number of half waves.

    Parameters
    ----------
    dataset : Dataset
        Results of a study with `eigenfrequency` [Hz] over its axes, `strand` and `half_waves`.
    at : mapping
        Axes to fix: name -> value, as a number [SI] or a text; further ones are fixed at their first value.
    source : str
        Where the results are from, for the errors.
    sides : Sides
        Which axis runs along x.

    Returns
    -------
    Figure
        Where a strand holds no shape its lines have gaps.
    """
    arrangement = arrange(dataset, at, source, sides)
    shown, notes = along_x(arrangement)
    along = ruler(shown[arrangement.x])
    figure = Figure((WIDTH, HEIGHT), layout="constrained")
    strands = shown["strand"].values
    panels = figure.subplots(1, strands.size, sharex=True, sharey=True, squeeze=False)[0]
    for axes, strand in zip(panels, strands, strict=True):
        frequency = shown["eigenfrequency"].sel(strand=strand).transpose(arrangement.x, "half_waves")
        _draw_strand(axes, along.centres, frequency)
        axes.set_title(f"strand {strand}", loc="left", pad=3)
        axes.set_xlabel(along.label)
        along.lay_out(axes.xaxis)
    panels[0].set_ylabel(axis_label(dataset["eigenfrequency"], "Hz"))
    panels[0].set_ylim(bottom=0.0)
    headline = f"Eigenfrequencies: {one_line(dataset.attrs.get('job_name', ''))}".rstrip(": ")
    lines = [headline, *notes, "beside the lines: half waves along the strand"]
    figure.suptitle("\n".join(fill(line, 72) for line in lines))
    return figure


def _draw_strand(axes: Axes, x: Any, frequency: xr.DataArray) -> None:
    """Lines over x, each with the number of its half waves beside its last point."""
    for number, line in zip(frequency["half_waves"].values, frequency.values.T, strict=True):
        axes.plot(x, line, color=COLOUR, marker=".", markersize=4, linewidth=1.2)
        axes.annotate(str(number), (x[-1], line[-1]), (4, 0), textcoords="offset points", va="center")
    axes.margins(x=0.09)  # room for the numbers
    axes.grid(linewidth=0.4, alpha=0.5)
