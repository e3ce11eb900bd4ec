"""One element on its way through the path: what it meets over time, in Lagrange's coordinates.

A history has speeds and forces at places s of the reference path, in Euler's coordinates (Bullinger et al.
2005, eq. 11). An element at s moves along the belt at its speed v_0. Where the belt runs off the path by w it
is 1 + kappa w times as long, so that the element's path coordinate goes by

    ds/dt = v_0(s, t) / (1 + kappa w(s, t)),

the `momentary_element_speed` of a history. Heun's method takes it from sample to sample, the speed linear
between samples and stations.
"""

import numpy as np
import xarray as xr

from cvt_hpc.analysis.profiles import regions
from cvt_hpc.errors import mismatch
from cvt_hpc.netcdf import attributes

PREFIX = "momentary_"
SPEED = PREFIX + "element_speed"


def follow_element(history: xr.Dataset, start: float, source: str = "history") -> xr.Dataset:
    """Follow an element from a place of the path, at the first time that has profiles, to the last one.

    Parameters
    ----------
    history : Dataset
        As `simulate` returns it, with profiles over `profile_time` (`[record] profile_duration`).
    start : float
        Path coordinate [m].
    source : str, optional
        Where the history is from, for the error.

    Returns
    -------
    Dataset
        Over `time`: `travelled` [m], `position` on the path [m], `region`, and every quantity that the
        history has over `profile_time`; nan where it has none.

    Raises
    ------
    InputError
        The history has no profiles over time.
    """
    if SPEED not in history or history.sizes["profile_time"] < 2:
        raise mismatch(source, "a history with profiles over time ([record] profile_duration)", "none")
    time = history["profile_time"].values
    travelled = path_of(time, around(history), history[SPEED].values.astype(float), start)
    length = around(history)[-1]
    position = np.mod(travelled, length)
    names = [str(name) for name in history.data_vars if str(name).startswith(PREFIX)]
    variables = {
        name.removeprefix(PREFIX): ("time", _met(history, name, position), history[name].attrs)
        for name in names
    }
    spans = regions(history)
    starts = np.array([first for first, _, _ in spans])
    here = np.array([name for _, _, name in spans], object)[np.searchsorted(starts, position, "right") - 1]
    words = "position", "m", "path coordinate, from the inlet of the driving arc"
    places = {
        "travelled": ("time", travelled, attributes("travelled", "m", "path coordinate, counted on")),
        "position": ("time", position, attributes(*words)),
        "region": ("time", here, attributes("region", comment="of the path")),
    }
    return xr.Dataset(variables | places, {"time": ("time", time, attributes("time", "s"))}, history.attrs)


def around(history: xr.Dataset) -> np.ndarray:
    """Path coordinates of all stations and of the path's end [m], (N + 1,)."""
    position = history["position"].values
    # cells of a region are alike, and the last station is not the first one of its region
    return np.append(position, 2.0 * position[-1] - position[-2])


def lengths_of(history: xr.Dataset) -> np.ndarray:
    """Length of the path that each station stands for, half of either cell beside it [m], (N,)."""
    cells = np.diff(around(history))
    return 0.5 * (cells + np.roll(cells, 1))


def path_of(time: np.ndarray, places: np.ndarray, speed: np.ndarray, start: float) -> np.ndarray:
    """Path coordinate of an element at each time [m], counted on round by round.

    Parameters
    ----------
    time : (T,) array
        [s]
    places : (N + 1,) array
        Path coordinates, the path's length the last one [m].
    speed : (T, N) array
        ds/dt at the places but for the last, which is the first one again [m/s].
    start : float
        At the first time [m].
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


def _met(history: xr.Dataset, name: str, position: np.ndarray) -> np.ndarray:
    """A quantity at the place of an element at each time (time,), linear between stations."""
    places, values = around(history), history[name].values
    left = np.clip(np.searchsorted(places, position, "right") - 1, 0, values.shape[1] - 1)
    share = (position - places[left]) / (places[left + 1] - places[left])
    rows = np.arange(position.size)
    ahead = (left + 1) % values.shape[1]
    return (1.0 - share) * values[rows, left] + share * values[rows, ahead]


def passages(followed: xr.Dataset, pulley: str) -> list[slice]:
    """Samples of each whole passage of a followed element through the arc of a pulley."""
    on = np.isfinite(followed["sliding_speed"].values)
    on &= followed["region"].values.astype(str) == f"{pulley} arc"
    edges = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    spans = [slice(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return [span for span in spans if span.start > 0 and span.stop < on.size]
