"""Sliding of one element over time, as figs 3.10 and 4.2 of Lebrecht et al. 2004.

An element is followed on its way through the path, in Lagrange's coordinates. A history has speeds and forces
at places s of the reference path, in Euler's coordinates (Bullinger et al. 2005, eq. 11). An element at s
moves along the belt at its speed v_0. Where the belt runs off the path by w it is 1 + kappa w times as long,
so that the element's path coordinate goes by

    ds/dt = v_0(s, t) / (1 + kappa w(s, t)),

the `momentary_element_speed` of a history. Heun's method takes it from sample to sample, the speed linear
between samples and stations.
"""

from collections.abc import Mapping, Sequence

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis import figures
from cvt_hpc.analysis.profiles import ARC, regions
from cvt_hpc.analysis.telling_apart import entitle_runs
from cvt_hpc.errors import mismatch
from cvt_hpc.storage.netcdf import attributes

PREFIX = "momentary_"
SPEED = PREFIX + "element_speed"

COLOURS = {"radial_sliding": "#0072b2", "tangential_sliding": "#009e73", "sliding_speed": "#d55e00"}
LINES = {"radial_sliding": "-", "tangential_sliding": ":", "sliding_speed": "--"}
HIGHEST = 1500.0  # [Hz]
LABELS = {"radial_sliding": "radial", "tangential_sliding": "tangential", "sliding_speed": "resulting"}


@figures.styled
def element_figure(
    history: xr.Dataset, region: str | None = None, source: str = "history", parts: Sequence[str] = (*LABELS,)
) -> Figure:
    """Draw the sliding of an element on the sheaves over time.

    Arguments as of all pictures of runs (`figures.py`), with what `follow_element` takes. `region` is
    "driving" or "driven": one passage through that arc, with the means at the same places; else the element
    is followed as far as the profiles reach. What is drawn are `parts` of `LABELS`.
    """
    followed = followed_of(history, region, source)
    figures.check_known(followed, parts, source)
    time = 1e3 * (followed["time"].values - (followed["time"].values[0] if region else 0.0))
    figure = Figure((figures.WIDTH, 3.6), layout="constrained")
    axes = figure.subplots()
    for name in parts:
        style = {"color": COLOURS[name], "ls": LINES[name], "lw": 1.1, "label": LABELS[name]}
        axes.plot(time, 1e3 * followed[name].values, **style)
        if region and name in history:
            mean = 1e3 * mean_there(history, followed, name)
            told = "mean at the same place" if name == parts[-1] else None
            axes.plot(time, mean, color="#8a8a8a", lw=0.9, ls="-", zorder=1.5, label=told)
    if region is None:
        for name in ("driving", "driven"):
            for span in passages(followed, name):
                axes.axvspan(time[span][0], time[span][-1], color=ARC, lw=0, zorder=0)
                above = axes.get_xaxis_transform()
                axes.text(time[span].mean(), 1.01, name, transform=above, ha="center", fontsize=9)
    axes.axhline(0.0, color="#333333", linewidth=0.7, zorder=1)
    axes.grid(linewidth=0.4, alpha=0.5)
    begin = f"time since the element entered the {region} arc [ms]" if region else "time [ms]"
    axes.set(xlabel=begin, ylabel="sliding on the sheaves [mm/s]", xlim=time[[0, -1]])
    figures.legend_below(figure, figures.entries_of([axes]), 4)
    entitle_runs(figure, [history], "One element along its path")
    return figure


@figures.styled
def swinging_figure(history: xr.Dataset, marks: Mapping[str, Sequence[float]]) -> Figure:
    """Draw the sliding speed of an element through the driven arc over time, and the spectrum of its swings.

    `marks` are frequencies [Hz] that are marked in the spectrum, by the strand whose peaks they are.
    """
    passed = one_passage(history, "driven")
    time = 1e3 * (passed["time"].values - passed["time"].values[0])
    figure = Figure((figures.WIDTH * 1.2, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    style = {"color": COLOURS["sliding_speed"], "lw": 1.1}
    left.plot(time, 1e3 * passed["sliding_speed"].values, label="of an element", **style)
    mean = 1e3 * mean_there(history, passed, "sliding_speed")
    left.plot(time, mean, color="#8a8a8a", lw=0.9, label="mean at the same place")
    left.set(xlabel="time in the driven arc [ms]", ylabel="sliding on the sheaves [mm/s]", xlim=time[[0, -1]])
    left.legend(frameon=False, loc="best")
    lines, amplitude = sliding_spectrum(history)
    shown = lines <= HIGHEST
    right.plot(lines[shown], 1e3 * amplitude[shown], **style)
    for (strand, frequencies), dash in zip(marks.items(), ("--", ":"), strict=True):
        for k, frequency in enumerate(frequencies):
            told = f"peaks of {strand}" if k == 0 else None
            right.axvline(frequency, color="#333333", lw=0.9, ls=dash, label=told)
    right.set(xlabel="frequency [Hz]", ylabel="swing of the sliding speed [mm/s]", xlim=(0.0, HIGHEST))
    right.set_ylim(bottom=0.0)
    right.legend(frameon=False)
    for axes in (left, right):
        axes.grid(linewidth=0.4, alpha=0.5)
    entitle_runs(figure, [history], "Sliding in the driven arc", width=84)
    return figure


def sliding_spectrum(history: xr.Dataset) -> tuple[np.ndarray, np.ndarray]:
    """Lines [Hz] and amplitude [m/s] of the sliding speed's swings, rms over the length of the driven arc.

    By a Hann window over all of the profiles' time: lines that are 2 over that time apart are told apart.
    """
    speed = history["momentary_sliding_speed"].values
    inner = np.flatnonzero(history["region"].values.astype(str) == "driven arc")[5:-5]
    motion = speed[:, inner] - speed[:, inner].mean(axis=0)
    window = np.hanning(len(motion))
    lines = np.fft.rfft(motion * window[:, None], 8 * len(motion), axis=0)
    interval = float(np.diff(history["profile_time"].values).mean())
    lengths = np.gradient(history["position"].values[inner])
    amplitude = 2.0 * np.sqrt(np.average(np.abs(lines) ** 2, axis=1, weights=lengths)) / window.sum()
    return np.fft.rfftfreq(8 * len(motion), interval), amplitude


def mean_there(history: xr.Dataset, followed: xr.Dataset, name: str) -> np.ndarray:
    """The mean of a quantity of the history at the places of a followed element, (time,)."""
    known = history[name].notnull().values
    positions = history["position"].values[known]
    return np.interp(followed["position"].values, positions, history[name].values[known])


def followed_of(history: xr.Dataset, region: str | None = None, source: str = "history") -> xr.Dataset:
    """An element followed through one passage of an arc, or from the driving inlet on; arguments as above."""
    return one_passage(history, region, source) if region else follow_element(history, 0.0, source)


def one_passage(history: xr.Dataset, pulley: str, source: str = "history") -> xr.Dataset:
    """An element followed through the arc of a pulley, the last whole passage before the profiles' end."""
    starts = [first for first, _, name in regions(history) if name == f"{pulley} arc"]
    start = starts[0] if starts else 0.0  # models with other names of regions keep no profiles over time
    length = around(history)[-1]
    # elements that set out one after the other: the first of them is at the arc's inlet at once
    for behind in np.linspace(0.0, 1.0, 9):
        followed = follow_element(history, start - behind * length - 1e-6, source)
        if spans := passages(followed, pulley):
            return followed.isel(time=spans[-1])
    raise mismatch(source, f"profiles over a whole passage of the {pulley} arc", "a shorter profile_duration")


def follow_element(history: xr.Dataset, start: float, source: str = "history") -> xr.Dataset:
    """Follow an element from a place of the path, at the first time that has profiles, to the last one.

    Parameters
    ----------
    history, source
        As of all pictures of runs (`figures.py`); InputError unless there are profiles over `profile_time`
        (`[record] profile_duration`).
    start : float
        Path coordinate [m].

    Returns
    -------
    Dataset
        Over `time`: `travelled` [m], `position` on the path [m], `region`, and every quantity that the
        history has over `profile_time`; nan where it has none.
    """
    if SPEED not in history or history.sizes["profile_time"] < 2:
        raise mismatch(source, "a history with profiles over time ([record] profile_duration)", "none")
    time = history["profile_time"].values
    places = around(history)
    travelled = path_of(time, places, history[SPEED].values.astype(float), start)
    position = np.mod(travelled, places[-1])
    quantities = {
        str(name).removeprefix(PREFIX): ("time", _met(places, array.values, position), array.attrs)
        for name, array in history.data_vars.items()
        if str(name).startswith(PREFIX)
    }
    spans = regions(history)
    starts = np.array([first for first, _, _ in spans])
    here = np.array([name for _, _, name in spans], object)[np.searchsorted(starts, position, "right") - 1]
    words = "position", "m", "path coordinate, from the inlet of the driving arc"
    way = {
        "travelled": ("time", travelled, attributes("travelled", "m", "path coordinate, counted on")),
        "position": ("time", position, attributes(*words)),
        "region": ("time", here, attributes("region", comment="of the path")),
    }
    return xr.Dataset(quantities | way, {"time": ("time", time, attributes("time", "s"))}, history.attrs)


def around(history: xr.Dataset) -> np.ndarray:
    """Path coordinates of all stations and of the path's end [m], (N + 1,)."""
    position = history["position"].values
    # a strand, which is the last region, is cut alike from both of its ends
    first = np.flatnonzero(history["region"].values == history["region"].values[-1])[0]
    return np.append(position, position[-1] + position[first + 1] - position[first])


def lengths_of(history: xr.Dataset) -> np.ndarray:
    """Length of the path that each station stands for, half of either cell beside it [m], (N,)."""
    cells = np.diff(around(history))
    return 0.5 * (cells + np.roll(cells, 1))


def path_of(time: np.ndarray, places: np.ndarray, speed: np.ndarray, start: float) -> np.ndarray:
    """Path coordinate of an element at each time (T,) [s], counted on round by round from its start [m].

    `places` (N + 1,) are path coordinates, the path's length the last one [m]; `speed` (T, N) is ds/dt there
    but for the last, which is the first one again [m/s].
    """
    closed = np.concatenate([speed, speed[:, :1]], axis=1)
    found = np.empty(time.size)
    found[0] = start
    for k in range(time.size - 1):
        step, here = time[k + 1] - time[k], found[k]
        first = np.interp(np.mod(here, places[-1]), places, closed[k])
        then = np.interp(np.mod(here + step * first, places[-1]), places, closed[k + 1])
        found[k + 1] = here + 0.5 * step * (first + then)
    return found


def _met(places: np.ndarray, values: np.ndarray, position: np.ndarray) -> np.ndarray:
    """A quantity (time, station) at the place of an element at each time (time,), linear between stations."""
    left = np.clip(np.searchsorted(places, position, "right") - 1, 0, values.shape[1] - 1)
    share = (position - places[left]) / (places[left + 1] - places[left])
    rows = np.arange(position.size)
    return (1.0 - share) * values[rows, left] + share * values[rows, ((left + 1) % values.shape[1])]


def passages(followed: xr.Dataset, pulley: str) -> list[slice]:
    """Samples of each whole passage of a followed element through the arc of a pulley."""
    on = np.isfinite(followed["sliding_speed"].values)
    on &= followed["region"].values.astype(str) == f"{pulley} arc"
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    spans = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [span for span in spans if span.start > 0 and span.stop < on.size]
