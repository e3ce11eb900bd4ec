"""Eigenfrequencies of the strands over an axis of a study, as fig. 3.7 of Lebrecht et al. 2004."""

import json

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cvt_hpc.analysis.arrangement import CHOSEN, Fixed, Sides, along_x, arrange, ruler
from cvt_hpc.analysis.figures import WIDTH, axis_label, entitle, headline
from cvt_hpc.analysis.measured import FREQUENCY, File, Overlay, Side, put_legend, side_of
from cvt_hpc.job.values import Point
from cvt_hpc.variator import STRANDS
from cvt_hpc.variator.band import MODES, strand_frequencies

_COLOUR = "#1f4e8c"
HEIGHT = 3.6  # [inch]


def along_axis(shown: xr.Dataset, x: str) -> xr.DataArray | None:
    """Eigenfrequencies over `strand`, `half_waves` and x [Hz]; None where nothing is known of them.

    They are those of the results over x alone, or of the mean forces of their strands: `eigenfrequency` [Hz],
    or `mean_ring_tension` and `mean_push_force` [N].
    """
    if "eigenfrequency" in shown:
        return shown["eigenfrequency"].transpose("strand", "half_waves", x)
    if not {"mean_ring_tension", "mean_push_force"} <= {*map(str, shown.data_vars)}:
        return None
    fixed = parameters_of(shown)
    force = (shown["mean_ring_tension"] - shown["mean_push_force"]).transpose(x, "strand")
    if force.sizes["strand"] != len(STRANDS):
        return None
    along = {str(key): values.values for key, values in shown.coords.items() if values.dims == (x,)}
    points = (fixed | {key: values[k] for key, values in along.items()} for k in range(len(force)))
    found = [strand_frequencies(at, tuple(pair)) for at, pair in zip(points, force.values, strict=True)]
    if not np.isfinite(found).any():
        return None
    coordinates = {x: shown[x], "strand": shown["strand"], "half_waves": np.arange(1, MODES + 1)}
    return xr.DataArray(found, coordinates, (x, "strand", "half_waves")).transpose("strand", "half_waves", x)


def parameters_of(shown: xr.Dataset) -> Point:
    """Parameters by name [SI] that all runs of results have, by their job and fixed axes."""
    try:
        job = json.loads(shown.attrs.get("job", "{}"))
    except ValueError:
        return {}
    tables = (table for table in job.values() if isinstance(table, dict))
    fixed = {key: value for table in tables for key, value in table.items()}
    return fixed | {str(key): value.values.item() for key, value in shown.coords.items() if value.ndim == 0}


def eigenfrequency_figure(
    dataset: xr.Dataset, at: Fixed, source: str, sides: Sides = CHOSEN, measured: File = None
) -> Figure:
    """Compose the picture: a panel for each strand, a line for each number of half waves.

    Arguments as of all pictures of results (`figures.py`), with `eigenfrequency` [Hz] over the axes, `strand`
    and `half_waves`. Axes beyond x are fixed at their first value. Where a strand holds no shape its lines
    have gaps.
    """
    over = Overlay(measured, dataset, source)
    arrangement = arrange(dataset, at, source, sides)
    shown, notes = along_x(arrangement)
    along = ruler(shown[arrangement.x])
    figure = Figure((WIDTH, HEIGHT + over.height), layout="constrained")
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
    frequencies = Side(FREQUENCY, np.array(panels[0].get_ylim()))
    for axes in panels:
        over.draw(axes, side_of(shown, arrangement.x), frequencies, shown)
    put_legend(figure, over)
    first = headline("Eigenfrequencies", dataset.attrs)
    entitle(figure, [first, *notes, "beside the lines: half waves along the strand", over.note])
    return figure


def _draw_strand(axes: Axes, x: np.ndarray, frequency: xr.DataArray) -> None:
    """Lines over x, each with the number of its half waves beside its last point."""
    for number, line in zip(frequency["half_waves"].values, frequency.values.T, strict=True):
        axes.plot(x, line, color=_COLOUR, marker=".", markersize=4, linewidth=1.2)
        axes.annotate(str(number), (x[-1], line[-1]), (4, 0), textcoords="offset points", va="center")
    axes.margins(x=0.09)  # room for the numbers
    axes.grid(linewidth=0.4, alpha=0.5)
