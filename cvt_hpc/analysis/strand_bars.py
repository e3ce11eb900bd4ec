"""Tension and push force of the strands over an axis of a study, as fig. 5 of Bullinger et al. 2005."""

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from cvt_hpc.analysis.arrangement import CHOSEN, At, Sides, arrange, check_sides, ruler
from cvt_hpc.analysis.classes import check_results
from cvt_hpc.analysis.curves import panels_of
from cvt_hpc.analysis.figures import WIDTH, check_known, coordinate_unit, entitle, headline, styled
from cvt_hpc.analysis.ticks import put_ticks, short_numbers
from cvt_hpc.errors import mismatch
from cvt_hpc.variables import Status

HEIGHT = 3.8  # [inch]
SHADES = {"t1": "#8a8a8a", "t2": "#c9c9c9"}
PUSH = "#d55e00"
BAR = 0.36  # of the distance of two runs
NEEDED = ("mean_ring_tension", "mean_push_force")


@styled
def strand_bars_figure(
    dataset: xr.Dataset, at: At = None, source: str = "results", sides: Sides = CHOSEN
) -> Figure:
    """Draw for each run what each strand carries: ring tension above zero, push force below.

    Arguments as of all pictures of results (`figures.py`), with `mean_ring_tension` and `mean_push_force` [N]
    over the job's axes and `strand`. The axis along x of a map, or that of `sides`, does so here; there is a
    panel for each value of the one that runs along y of a map, or of `sides.panel`. Too many are refused.
    """
    check_results(dataset, source)
    for name in NEEDED:
        if name not in dataset:
            raise mismatch(source, f"results with {', '.join(NEEDED)}", f"no {name}")
    check_sides(sides, list(map(str, dataset["status"].dims)), at or {}, source)
    # panels here are what `panels_of` makes of the rows of a map
    arrangement = arrange(dataset, at or {}, source, Sides(sides.x, sides.panel))
    check_known(arrangement.dataset, NEEDED, source)
    panels, notes = panels_of(arrangement, source)
    figure = Figure((WIDTH, HEIGHT), layout="constrained")
    row = figure.subplots(1, len(panels), sharey=True, squeeze=False)[0]
    x = ruler(arrangement.dataset[arrangement.x])
    along = arrangement.dataset[arrangement.x]
    ticks = list(x.tick_labels)
    if len(ticks) != along.size:
        ticks = list(short_numbers(coordinate_unit(along.attrs)[0] * along.values))
    for axes, (title, shown) in zip(row, panels, strict=True):
        _draw_bars(axes, shown.transpose(arrangement.x, ...))
        axes.set_title(title, loc="left", pad=4)
        put_ticks(axes.xaxis, np.arange(float(len(ticks))), ticks)
        axes.set_xlabel(x.label)
    row[0].set_ylabel("push force | ring tension [kN]")
    handles, labels = row[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", frameon=False, ncols=4)
    entitle(figure, [headline("Forces in the strands", dataset.attrs), *notes], 76)
    return figure


def _draw_bars(axes: Axes, shown: xr.Dataset) -> None:
    """A pair of bars for each run, one for each strand."""
    places = np.arange(shown["status"].size)
    done = shown["status"].values == Status.DONE
    for k, strand in enumerate(str(name) for name in shown["strand"].values):
        left = places + (k - 0.5) * (BAR + 0.04)
        tension, push = (
            1e-3 * np.where(done, shown[name].sel(strand=strand).values, np.nan) for name in NEEDED
        )
        label = {"label": f"tension {strand}"}
        axes.bar(left, tension, BAR, color=SHADES[strand], edgecolor="#333333", lw=0.6, **label)
        hatch = {"hatch": "" if k else "///", "label": f"push {strand}"}
        axes.bar(left, -push, BAR, color=PUSH, alpha=0.75, edgecolor="#333333", lw=0.6, **hatch)
    axes.axhline(0.0, color="#333333", linewidth=0.8)
    axes.grid(axis="y", linewidth=0.4, alpha=0.5)
