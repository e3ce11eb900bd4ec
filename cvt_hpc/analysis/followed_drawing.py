"""Sliding of one element over time, as figs 3.10 and 4.2 of Lebrecht et al. 2004."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis.figures import WIDTH, balanced, draw, styled
from cvt_hpc.analysis.followed import around, follow_element, passages
from cvt_hpc.analysis.profiles import ARC, regions
from cvt_hpc.analysis.telling_apart import on_axes, titles
from cvt_hpc.errors import mismatch

COLOURS = {"radial_sliding": "#0072b2", "tangential_sliding": "#009e73", "sliding_speed": "#d55e00"}
LINES = {"radial_sliding": "-", "tangential_sliding": ":", "sliding_speed": "--"}
LABELS = {"radial_sliding": "radial", "tangential_sliding": "tangential", "sliding_speed": "resulting"}


def draw_element(history: xr.Dataset, out: Path, region: str | None = None, source: str = "history") -> Path:
    """Write the figure of `element_figure`, with its arguments and errors, as `save_figure` does."""
    return draw(lambda: element_figure(history, region, source), out)


@styled
def element_figure(history: xr.Dataset, region: str | None = None, source: str = "history") -> Figure:
    """Draw the sliding of an element on the sheaves over time.

    Parameters
    ----------
    history : Dataset
        As `follow_element` takes it.
    region : str, optional
        "driving" or "driven": one passage through that arc; else as far as the profiles reach.
    source : str, optional
        Where the history is from, for the errors.

    Returns
    -------
    matplotlib.figure.Figure
        Unknown to pyplot; `figure.savefig(path)` writes it.

    Raises
    ------
    InputError
        There are no profiles over time, or too few for a whole passage.
    """
    followed = followed_of(history, region, source)
    time = 1e3 * (followed["time"].values - (followed["time"].values[0] if region else 0.0))
    figure = Figure((WIDTH, 3.6), layout="constrained")
    axes = figure.subplots()
    for name, label in LABELS.items():
        style = {"color": COLOURS[name], "ls": LINES[name], "lw": 1.1, "label": label}
        axes.plot(time, 1e3 * followed[name].values, **style)
    if region is None:
        for name in ("driving", "driven"):
            for span in passages(followed, name):
                axes.axvspan(time[span][0], time[span][-1], color=ARC, lw=0, zorder=0)
                axes.text(
                    time[span].mean(),
                    1.01,
                    name,
                    transform=axes.get_xaxis_transform(),
                    ha="center",
                    fontsize=9,
                )
    axes.axhline(0.0, color="#333333", linewidth=0.7, zorder=1)
    axes.grid(linewidth=0.4, alpha=0.5)
    begin = f"time since the element entered the {region} arc [ms]" if region else "time [ms]"
    axes.set(xlabel=begin, ylabel="sliding on the sheaves [mm/s]", xlim=time[[0, -1]])
    figure.legend(loc="outside lower center", frameon=False, ncols=3)
    common, _ = on_axes([history], [source])
    lines = titles([history], "One element along its path", common)
    figure.suptitle("\n".join(balanced(line, 76) for line in lines))
    return figure


def followed_of(history: xr.Dataset, region: str | None, source: str = "history") -> xr.Dataset:
    """An element followed through one passage of an arc, or from the driving inlet on; arguments as above."""
    return one_passage(history, region, source) if region else follow_element(history, 0.0, source)


def one_passage(history: xr.Dataset, pulley: str, source: str = "history") -> xr.Dataset:
    """An element followed through the arc of a pulley, the last whole passage before the profiles' end."""
    start = next(first for first, _, name in regions(history) if name == f"{pulley} arc")
    length = around(history)[-1]
    # elements that set out one after the other: the first of them is at the arc's inlet at once
    for behind in np.linspace(0.0, 1.0, 9):
        followed = follow_element(history, start - behind * length - 1e-6, source)
        if spans := passages(followed, pulley):
            return followed.isel(time=spans[-1])
    raise mismatch(source, f"profiles over a whole passage of the {pulley} arc", "a shorter profile_duration")
