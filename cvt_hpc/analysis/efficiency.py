"""The picture of a forecast: parallel efficiency and makespan over the number of ranks."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, PercentFormatter

from cvt_hpc.analysis.figures import WIDTH, draw

if TYPE_CHECKING:
    from cvt_hpc.study.forecast.cost_model import Forecast

_COLOUR = "#0072b2"


def draw_efficiency(forecasts: Sequence[Forecast], title: str, basis: str, out: Path) -> Path:
    """Write the figure of `efficiency_figure` as `save_figure` does."""
    return draw(lambda: efficiency_figure(forecasts, title, basis), out)


def efficiency_figure(forecasts: Sequence[Forecast], title: str, basis: str) -> Figure:
    """Draw what a sweep is expected to take on several numbers of ranks; to be called within STYLE.

    There is a forecast for each number of ranks, in ascending order. `title` says what is run, `basis` what
    the times of batches are known by.
    """
    ranks = [forecast.ranks for forecast in forecasts]
    figure = Figure((WIDTH, 5.0), layout="constrained")
    figure.suptitle(f"{title}\nforecast by {basis}")
    upper, lower = figure.subplots(2, 1, sharex=True)
    panels = ((upper, [f.efficiency for f in forecasts]), (lower, [f.makespan for f in forecasts]))
    for axes, values in panels:
        median, low, high = np.transpose(values)
        axes.fill_between(ranks, low, high, color=_COLOUR, alpha=0.25, lw=0, label="95 % of simulated sweeps")
        axes.plot(ranks, median, color=_COLOUR, marker="o", ms=3, lw=1.3, label="median")
        axes.grid(color="#ececec", lw=0.6)
        axes.set_axisbelow(True)
    bounds = [f.bound for f in forecasts]
    lower.plot(ranks, bounds, color="black", ls="--", lw=0.9, label="bound: all work / ranks, longest batch")
    upper.set_ylim(0, 1.05)
    upper.yaxis.set_major_formatter(PercentFormatter(1.0))
    upper.set_ylabel("parallel efficiency")
    upper.legend(loc="lower left", frameon=False)
    lower.set_xscale("log")
    lower.xaxis.set_major_formatter(FuncFormatter(lambda ranks, _: f"{ranks:,.0f}".replace(",", " ")))
    lower.set_yscale("log")
    lower.set_ylim(top=3 * max(f.makespan[2] for f in forecasts))  # room for the legend
    lower.set_xlabel("ranks")
    lower.set_ylabel("makespan [s]")
    lower.legend(loc="upper right", frameon=False)
    return figure
