"""Motion along a ramp of load or speed, as figs 3.1, 3.2, 3.9, 3.13 and 3.14 of Lebrecht et al. 2004."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.cm import ScalarMappable
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from cvt_hpc.analysis.cells import colours_of
from cvt_hpc.analysis.eigenfrequencies import strand_frequencies
from cvt_hpc.analysis.figures import WIDTH, balanced, coordinate_unit, in_words, styled
from cvt_hpc.analysis.telling_apart import on_axes, titles
from cvt_hpc.analysis.waterfall import ORDERS, draw_eigenfrequencies, draw_orders
from cvt_hpc.errors import mismatch
from cvt_hpc.variator import STRANDS
from cvt_hpc.vibration.signals import window_amplitudes

COLOURS = colours_of("inferno_r", 0.0, 0.95)
DEEPEST = 1e-2  # of the largest amplitude
WINDOW = 0.04  # [s]: lines of the spectrogram 50 Hz wide
HIGHEST = 1500.0  # [Hz]
BAND, NOISE = (300.0, 1500.0), (400.0, 800.0)  # [Hz] of strands' vibration, and of the noise
ROW = 1.5  # [inch]
LINE_POINTS = 21  # of lines over a spectrogram


class Ramp(NamedTuple):
    """What a run does along its ramp.

    Attributes
    ----------
    values : (time,) array
        Of what the ramp changes, in display units.
    label : str
        Its name with the unit.
    motion : (time,) array
        [um, N m], mean removed.
    rate : float
        Of samples [Hz].
    """

    values: np.ndarray
    label: str
    motion: np.ndarray
    rate: float


@styled
def ramp_figure(histories: Sequence[xr.Dataset], of: str = "t1", sources: Sequence[str] = ()) -> Figure:
    """Draw motion and spectrogram of runs along their ramps, below each other.

    Parameters
    ----------
    histories : sequence of Dataset
        As `simulate` returns them, of runs along a ramp of load or speed.
    of : str
        "t1" or "t2": the probe of that strand that moves most; or a variable over `time`.
    sources : sequence of str, optional
        Where the runs are from, for errors, and for titles where their axes do not tell them apart.

    Raises
    ------
    InputError
        A history has no ramp, no such strand or variable.
    """
    names = list(sources) or [f"history {k + 1}" for k in range(len(histories))]
    ramps = [read_ramp(history, of, name) for history, name in zip(histories, names, strict=True)]
    common, labels = on_axes(histories, names)
    figure = Figure((WIDTH * 1.25, ROW * len(ramps) + 1.1), layout="constrained")
    panels = figure.subplots(len(ramps), 2, sharex=True, sharey="col", squeeze=False)
    spectra = [spectrogram(ramp) for ramp in ramps]
    largest = max(float(amplitude.max()) for _, _, amplitude in spectra)
    norm = LogNorm(DEEPEST * largest, largest)
    for (left, right), ramp, (values, frequency, amplitude), label in zip(
        panels, ramps, spectra, labels, strict=True
    ):
        left.plot(ramp.values, ramp.motion, color="#0072b2", linewidth=0.3, rasterized=True)
        left.grid(linewidth=0.4, alpha=0.5)
        right.pcolormesh(
            values, frequency, np.maximum(amplitude, norm.vmin).T, norm=norm, cmap=COLOURS, rasterized=True
        )
        for edge in (500.0, 700.0):
            right.axhline(edge, color="#123a6b", linewidth=0.8, linestyle=(0, (4, 4)))
        left.set_title(", ".join(label.values()), loc="left", pad=3)
        right.set_ylabel("frequency [Hz]")
        left.set_xlim(np.sort(ramp.values[[0, -1]]))
    unit = "µm" if of in ("t1", "t2") else str(histories[0][of].attrs.get("units", ""))
    name = f"strand {of}" if of in ("t1", "t2") else in_words(histories[0][of])
    for left, _ in panels:
        left.set_ylabel(f"{name} [{unit}]")
    for axes in panels[-1]:
        axes.set_xlabel(ramps[0].label)
    bar = figure.colorbar(ScalarMappable(norm, COLOURS), ax=list(panels[:, 1]), pad=0.02, extend="min")
    bar.set_label(f"amplitude [{unit}]")
    lines = [*titles(histories, f"Along the ramp, {name}", common), "dashed: 500 and 700 Hz"]
    figure.suptitle("\n".join(balanced(line, 80) for line in lines))
    return figure


@styled
def spectrogram_figure(histories: Sequence[xr.Dataset], sources: Sequence[str] = ()) -> Figure:
    """Draw spectrograms of the strands side by side, over the ramp of a run or else over time.

    Eigenfrequencies by belt formulas are drawn where the run's parameters tell them, and orders of the
    driving pulley along a ramp of speed.

    Parameters
    ----------
    histories : sequence of Dataset
        As `simulate` returns them: `displacement` [m] over `time` [s] and `probe`; each has a row.
    sources : sequence of str, optional
        Where the runs are from, for errors, and for titles where their axes do not tell them apart.

    Raises
    ------
    InputError
        A history has no motion of strands, or is too short.
    """
    names = list(sources) or [f"history {k + 1}" for k in range(len(histories))]
    for history, name in zip(histories, names, strict=True):
        if "displacement" not in history or "probe" not in history["displacement"].dims:
            raise mismatch(name, "the history of a run with the displacement of strands", "none")
        if float(np.ptp(history["time"].values)) < _start_up(history) + 2.0 * WINDOW:
            raise mismatch(name, f"a run of {2.0 * WINDOW:g} s or more after its start-up", "a shorter one")
    probes = (str(probe) for history in histories for probe in history["probe"].values)
    strands = [name for name in dict.fromkeys(probe.split()[0] for probe in probes) if name in STRANDS]
    if not strands:
        raise mismatch(names[0], "probes on the strands t1 and t2", "none")
    common, labels = on_axes(histories, names)
    ramps = [
        [read_ramp(history, strand, name, is_ramp=False) for strand in strands]
        for history, name in zip(histories, names, strict=True)
    ]
    spectra = [[spectrogram(ramp) for ramp in row] for row in ramps]
    largest = max(float(amplitude.max()) for row in spectra for _, _, amplitude in row) or 1.0
    norm = LogNorm(DEEPEST * largest, largest)
    figure = Figure((WIDTH, 2.2 * len(ramps) + 1.4), layout="constrained")
    panels = figure.subplots(len(ramps), len(strands), sharex="row", sharey=True, squeeze=False)
    told = set()
    for history, row, of_row, row_of_axes, label in zip(
        histories, ramps, spectra, panels, labels, strict=True
    ):
        turns, known = _lines_along(history, row[0])
        for strand, ramp, (values, frequency, amplitude), axes in zip(
            strands, row, of_row, row_of_axes, strict=True
        ):
            cells = np.maximum(amplitude, norm.vmin).T
            axes.pcolormesh(values, frequency, cells, norm=norm, cmap=COLOURS, rasterized=True)
            k = STRANDS.index(strand)
            if known is not None:
                places, waves = known
                draw_eigenfrequencies(axes, places, waves[k], np.arange(1, len(waves[k]) + 1))
                told.add("dashed: eigenfrequencies by belt formulas, with their half waves")
            if turns is not None:
                draw_orders(axes, *turns, ORDERS, HIGHEST)
                told.add("dotted: orders of the driving pulley's turns")
            axes.set_title(", ".join([f"strand {strand}", *label.values()]), loc="left", pad=3)
            axes.set_xlabel(ramp.label)
            axes.set(xlim=np.sort(values[[0, -1]]), ylim=(0.0, HIGHEST))
        row_of_axes[0].set_ylabel("frequency [Hz]")
    bar = figure.colorbar(ScalarMappable(norm, COLOURS), ax=panels, pad=0.02, extend="min")
    bar.set_label("amplitude [µm]")
    lines = [*titles(histories, "Spectrogram", common), *sorted(told)]
    figure.suptitle("\n".join(balanced(line, 72) for line in lines))
    return figure


_Lines = tuple[np.ndarray, np.ndarray]


def _lines_along(history: xr.Dataset, ramp: Ramp) -> tuple[_Lines | None, _Lines | None]:
    """Turns (n,) [Hz] along a ramp of speed, and eigenfrequencies (strand, half waves, n) [Hz], at places."""
    half = int(0.5 * WINDOW * ramp.rate)  # the panel reaches from the middle of the first window on
    at = np.linspace(half, ramp.values.size - 1 - half, LINE_POINTS).astype(int)
    changing = _changing(history)
    point = json.loads(history.attrs.get("point", "{}"))
    courses = {}
    if changing is not None:
        courses[changing] = history[changing].values[-ramp.values.size :][at]
    turns = None
    if changing == "driving_speed":
        turns = ramp.values[at], courses["driving_speed"] / (2.0 * np.pi)
    found = [
        strand_frequencies(point | {key: float(values[k]) for key, values in courses.items()})
        for k in range(LINE_POINTS)
    ]
    known = np.stack(found, -1)
    return turns, (ramp.values[at], known) if np.isfinite(known).any() else None


@styled
def course_figure(history: xr.Dataset, of: str) -> Figure:
    """Draw a quantity over the time of a ramp, and below how far it swings, beside strand t1.

    Parameters
    ----------
    history : Dataset
        As of `ramp_figure`.
    of : str
        A variable over `time`.
    """
    unit = str(history[of].attrs.get("units", ""))
    name = in_words(history[of])
    time, values = history["time"].values, history[of].values
    figure = Figure((WIDTH, 4.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(time, values, color="#0072b2", lw=0.3, rasterized=True)
    upper.set_ylabel(f"{name} [{unit}]")
    begun = float(time[np.searchsorted(time, _start_up(history))])
    beside = lower.twinx()
    panels = ((lower, of, NOISE, "#0072b2", "-", unit), (beside, "t1", BAND, "#d55e00", "--", "µm"))
    for axes, what, band, colour, line, scale in panels:
        ramp = read_ramp(history, what)
        centres, amplitude = window_amplitudes(ramp.motion, ramp.rate, band, WINDOW)
        label = name if what == of else "strand t1"
        axes.plot(begun + centres, amplitude, color=colour, ls=line, lw=1.3, label=label)
        axes.set_ylabel(f"{label},\namplitude [{scale}]", color=colour)
        axes.set_ylim(bottom=0.0)
    loads = read_ramp(history, of)
    # the ramp is linear, so that its values can be read beside the time
    rate = (loads.values[-1] - loads.values[0]) / (time[-1] - begun)
    scale = upper.secondary_xaxis(
        "top",
        functions=(
            lambda at: loads.values[0] + rate * (at - begun),
            lambda load: begun + (load - loads.values[0]) / rate,
        ),
    )
    scale.set_xlabel(loads.label)
    lower.set(xlabel="time [s]", xlim=(begun, time[-1]))
    upper.set_ylim(*_limits(values[time >= begun]))
    for axes in (upper, lower):
        axes.grid(lw=0.4, alpha=0.5)
    common, _ = on_axes([history], ["history"])
    lines = titles([history], f"{name[0].upper()}{name[1:]} over time", common)
    lines.append("amplitudes: the moment's at 400 to 800 Hz, the strand's at 300 to 1500 Hz")
    figure.suptitle("\n".join(balanced(line, 76) for line in lines))
    return figure


def _limits(values: np.ndarray) -> tuple[float, float]:
    margin = 0.05 * float(np.ptp(values))
    return float(values.min()) - margin, float(values.max()) + margin


def read_ramp(
    history: xr.Dataset,
    of: str,
    source: str = "history",
    band: tuple[float, float] = BAND,
    *,
    is_ramp: bool = True,
) -> Ramp:
    """What a run does along its ramp, without the start-up before it; arguments as of `ramp_figure`.

    Unless it has to be a ramp, a run at constant load and speed has its time [s] in the place of that.
    """
    changing = _changing(history)
    if changing is None and is_ramp:
        raise mismatch(source, "a run along a ramp of load or speed", "constant ones")
    time = history["time"].values
    course = history["time"] if changing is None else history[changing]
    first = int(np.searchsorted(time, _start_up(history)))
    factor, unit = coordinate_unit(course.attrs) if changing else (1.0, "s")
    rate = 1.0 / (time[1] - time[0])
    if time.size - first < WINDOW * rate:
        raise mismatch(source, f"a run of {WINDOW:g} s or more after its start-up", "a shorter one")
    if rate < 2.0 * band[1]:
        raise mismatch(source, f"a history of {2.0 * band[1]:g} samples per second or more", f"{rate:.4g}")
    if of in ("t1", "t2"):
        probes = [str(name).split()[0] == of for name in history["probe"].values]
        moved = 1e6 * history["displacement"].values[first:, probes]
        _, amplitude = window_amplitudes(moved, rate, band, WINDOW)
        motion = moved[:, int(np.argmax(amplitude.max(axis=0)))]
    elif of in history and history[of].dims == ("time",):
        motion = history[of].values[first:]
    else:
        raise mismatch(source, "t1, t2 or a variable over time", of)
    return Ramp(
        factor * course.values[first:], f"{in_words(course)} [{unit}]", _without_drift(motion, rate), rate
    )


def _changing(history: xr.Dataset) -> str | None:
    """The quantity that a run ramps."""
    courses = [name for name in ("load", "driving_speed") if name in history]
    return next((name for name in courses if _is_ramp(history[name].values)), None)


def _is_ramp(values: np.ndarray) -> bool:
    """Whether a quantity still changes in the last half of a run."""
    half = values[values.size // 2 :]
    return bool(np.ptp(half) > 1e-6 * np.abs(half).max())


def _start_up(history: xr.Dataset) -> float:
    """When the ramp begins [s]."""
    return float(json.loads(history.attrs.get("point", "{}")).get("rise_time", 0.0))


def _without_drift(motion: np.ndarray, rate: float) -> np.ndarray:
    """Motion less its mean over 10 ms around."""
    width = max(int(round(0.01 * rate)), 1)
    padded = np.pad(motion, (width // 2, width - 1 - width // 2), mode="edge")
    return motion - np.convolve(padded, np.ones(width) / width, mode="valid")


def spectrogram(ramp: Ramp) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values of the ramp (window,), frequencies (line,) [Hz], amplitudes (window, line) by Hann windows."""
    width = int(round(WINDOW * ramp.rate))
    cut = np.lib.stride_tricks.sliding_window_view(ramp.motion, width)[:: width // 4]
    window = np.hanning(width)
    lines = np.fft.rfftfreq(2 * width, 1.0 / ramp.rate)
    inside = lines <= HIGHEST
    amplitude = 2.0 * np.abs(np.fft.rfft(cut * window, 2 * width)) / window.sum()
    middles = ramp.values[width // 2 :: width // 4][: len(cut)]
    return middles, lines[inside], amplitude[:, inside]


def envelope(ramp: Ramp, band: tuple[float, float] = BAND) -> tuple[np.ndarray, np.ndarray]:
    """Values of the ramp and amplitude of the motion in a band, in windows."""
    centres, amplitude = window_amplitudes(ramp.motion, ramp.rate, band, WINDOW)
    return ramp.values[np.minimum((centres * ramp.rate).astype(int), ramp.values.size - 1)], amplitude
