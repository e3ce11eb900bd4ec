"""Motion along a ramp of load or speed, as figs 3.1, 3.2, 3.9, 3.13 and 3.14 of Lebrecht et al. 2004."""

import json
from collections.abc import Sequence
from textwrap import fill
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from cvt_hpc.analysis import figures, waterfall
from cvt_hpc.analysis.measured import FREQUENCY, File, Overlay, Side, put_legend
from cvt_hpc.analysis.telling_apart import Histories, entitle_runs, named, on_axes
from cvt_hpc.errors import mismatch
from cvt_hpc.variator import STRANDS
from cvt_hpc.variator.band import strand_frequencies
from cvt_hpc.variator.profiles import multiple
from cvt_hpc.vibration.signals import window_amplitudes

WINDOW = 0.04  # [s]: lines of the spectrogram 50 Hz wide
HIGHEST = 1500.0  # [Hz]
BAND, NOISE = (300.0, 1500.0), (400.0, 800.0)  # [Hz] of strands' vibration, and of the noise
LEAST, ROW = 1.1, 1.5  # [inch]: a row of panels of a ramp, at least and else
_LEAST_HEIGHT, HEIGHT = 1.5, 2.2  # [inch]: the same of spectrograms
LETTERS = 14  # of a label beside a row
THEN = "name fewer histories"  # of more than a page holds
COURSES = ("load", "driving_speed")  # of which a run ramps one at most
STRAIGHT = 0.02  # of its change: how far a ramp may be off a straight line, since pulleys may be free
_LEAST_CHANGE = 0.01  # of a value: free pulleys swing by less
FREQUENCIES = Side(FREQUENCY, np.array([0.0, HIGHEST]))
_LINE_POINTS = 21  # of lines over a spectrogram


class Ramp(NamedTuple):
    """Course of a run along its ramp."""

    values: np.ndarray  # (time,) of what the ramp changes, in display units
    label: str  # its name with the unit
    motion: np.ndarray  # (time,) [um, N m], mean removed
    rate: float  # of samples [Hz]


@figures.styled
def ramp_figure(
    histories: Sequence[xr.Dataset],
    of: str = "t1",
    sources: Sequence[str] = (),
    vmax: float | None = None,
    measured: File = None,
) -> Figure:
    """Draw motion and spectrogram of runs along their ramps, below each other.

    Arguments as of all pictures of runs (`figures.py`), each along a ramp of load or speed. `of` is "t1" or
    "t2": the probe of that strand that moves most; or a variable over `time`.
    """
    names = named(histories, sources)
    ramps = [read_ramp(history, of, name) for history, name in zip(histories, names, strict=True)]
    _, labels = on_axes(histories, names)
    overlays = [Overlay(measured, history, name) for history, name in zip(histories, names, strict=True)]
    page = len(ramps), (1,), (LEAST, ROW), 1.1 + overlays[0].height, names[0], THEN
    width = figures.NARROW
    figure, panels, _ = figures.panels_on_a_page(*page, each=2, width=width, sharex=True, sharey="col")
    spectra = [spectrogram(ramp) for ramp in ramps]
    scale = 1e6 if of in STRANDS else 1.0
    end = None if vmax is None else scale * vmax
    norm = waterfall.spectra_norm([amplitude for *_, amplitude in spectra], end)
    for (left, right), ramp, spectrum, label in zip(panels, ramps, spectra, labels, strict=True):
        left.plot(ramp.values, ramp.motion, color="#0072b2", linewidth=0.3, rasterized=True)
        left.grid(linewidth=0.4, alpha=0.5)
        waterfall.draw_spectra(right, *spectrum, norm)
        for edge in (500.0, 700.0):
            right.axhline(edge, color="#123a6b", linewidth=0.8, linestyle=(0, (4, 4)))
        left.set_title(", ".join(label.values()), loc="left", pad=3)
        right.set_ylabel(fill("frequency [Hz]", LETTERS - 1))
        left.set_xlim(np.sort(ramp.values[[0, -1]]))
    unit = "µm" if of in STRANDS else str(histories[0][of].attrs.get("units", ""))
    name = f"strand {of}" if of in STRANDS else figures.in_words(histories[0][of])
    for left, _ in panels:
        left.set_ylabel(fill(f"{name} [{unit}]", LETTERS))
    for axes in panels[-1]:
        axes.set_xlabel(ramps[0].label)
    amplitudes = [amplitude for *_, amplitude in spectra]
    waterfall.spectra_bar(figure, norm, amplitudes, panels[:, 1], 15 * len(ramps), unit)
    for history, ramp, row, over in zip(histories, ramps, panels, overlays, strict=True):
        motion = Side("", np.array(row[0].get_ylim()))
        for axes, y in zip(row, (motion, FREQUENCIES), strict=True):
            over.draw(axes, _side_of(history, ramp), y, _held(history))
    put_legend(figure, *overlays)
    further = "dashed: 500 and 700 Hz", overlays[0].note
    entitle_runs(figure, histories, f"Along the ramp, {name}", *further, width=80)
    return figure


@figures.styled
def spectrogram_figure(
    histories: Histories, sources: Sequence[str] = (), vmax: float | None = None, measured: File = None
) -> Figure:
    """Draw spectrograms of the strands side by side, over the ramp of a run or else over time.

    Eigenfrequencies by belt formulas are drawn where the run's parameters tell them, and orders of the
    driving pulley along a ramp of speed.

    Arguments as of all pictures of runs (`figures.py`), with `displacement` [m] over `time` [s] and `probe`.
    """
    names = named(histories, sources)
    for history, name in zip(histories, names, strict=True):
        if "displacement" not in history or "probe" not in history["displacement"].dims:
            raise mismatch(name, "the history of a run with the displacement of strands", "none")
        if float(np.ptp(history["time"].values)) < start_up(history) + 2.0 * WINDOW:
            raise mismatch(name, f"a run of {2.0 * WINDOW:g} s or more after its start-up", "a shorter one")
    probes = (str(probe) for history in histories for probe in history["probe"].values)
    strands = [name for name in dict.fromkeys(probe.split()[0] for probe in probes) if name in STRANDS]
    if not strands:
        raise mismatch(names[0], "probes on the strands t1 and t2", "none")
    _, labels = on_axes(histories, names)
    each = list(zip(histories, names, strict=True))
    ramps = [[read_ramp(run, strand, name, is_ramp=False) for strand in strands] for run, name in each]
    spectra = [[spectrogram(ramp) for ramp in row] for row in ramps]
    drawn = [amplitude for row in spectra for *_, amplitude in row]
    norm = waterfall.spectra_norm(drawn, None if vmax is None else 1e6 * vmax)
    overlays = [Overlay(measured, history, name) for history, name in zip(histories, names, strict=True)]
    page = len(ramps), (1, 2), (_LEAST_HEIGHT, HEIGHT), 1.4 + overlays[0].height, names[0], THEN
    figure, panels, height = figures.panels_on_a_page(*page, each=len(strands), sharey=True)
    count, beside = panels.shape
    size, told, each = (0.8 * figures.WIDTH / beside, height - 0.7), set(), iter(panels.flat)
    pads = np.zeros(panels.shape)
    for history, row, of_row, label, over in zip(histories, ramps, spectra, labels, overlays, strict=True):
        turns, known = _lines_along(history, row[0])
        for strand, ramp, spectrum in zip(strands, row, of_row, strict=True):
            axes, lines = next(each), []
            waterfall.draw_spectra(axes, *spectrum, norm)
            axes.set(xlim=np.sort(spectrum[0][[0, -1]]), ylim=(0.0, HIGHEST))
            over.draw(axes, _side_of(history, ramp), FREQUENCIES, _held(history))
            if known is not None:
                places, waves = known
                of_strand = waves[STRANDS.index(strand)]
                numbers = np.arange(1, len(of_strand) + 1)
                lines += waterfall.draw_eigenfrequencies(axes, places, of_strand, numbers)
                told.add("dashed: eigenfrequencies by belt formulas, with their half waves")
            if turns is not None:
                lines += waterfall.draw_orders(axes, *turns, waterfall.ORDERS)
                told.add(waterfall.orders_in_words(waterfall.ORDERS))
            pads[panels == axes] = waterfall.name_lines(axes, lines, size)
            axes.set_title(fill(", ".join([f"strand {strand}", *label.values()]), 72 // beside), loc="left")
            axes.set_xlabel(ramp.label)
    for axes, pad in zip(panels.flat, np.repeat(pads.max(axis=1), beside), strict=True):
        axes.set_title(axes.get_title(loc="left"), loc="left", pad=pad)  # alike in a row
    if count == 1:
        panels[0, 0].set_ylabel("frequency [Hz]")
    else:
        figure.supylabel("frequency [Hz]")
    waterfall.spectra_bar(figure, norm, drawn, panels, 20 * count)
    put_legend(figure, *overlays)
    entitle_runs(figure, histories, "Spectrogram", *sorted(told), overlays[0].note, width=72)
    return figure


_Lines = tuple[np.ndarray, np.ndarray]


def _lines_along(history: xr.Dataset, ramp: Ramp) -> tuple[_Lines | None, _Lines | None]:
    """Turns (n,) [Hz] along a ramp of speed, and eigenfrequencies (strand, half waves, n) [Hz], at places."""
    half = int(0.5 * WINDOW * ramp.rate)  # the panel reaches from the middle of the first window on
    at = np.linspace(half, ramp.values.size - 1 - half, _LINE_POINTS).astype(int)
    point = json.loads(history.attrs.get("point", "{}"))
    courses = {}
    if changing_of(history) is not None:
        named = (name for name in COURSES if name in history)
        courses = {name: history[name].values[-ramp.values.size :][at] for name in named}
        if "thrust" in point:
            times = history["time"].values[-ramp.values.size :][at]
            courses["thrust"] = np.broadcast_to(point["thrust"] * multiple(point, "thrust", times), at.shape)
    turns, speed = None, courses.get("driving_speed")
    if speed is not None and np.ptp(speed) > _LEAST_CHANGE * speed.max():
        turns = ramp.values[at], speed / (2.0 * np.pi)
    points = (point | {key: float(values[k]) for key, values in courses.items()} for k in range(_LINE_POINTS))
    known = np.stack([strand_frequencies(at) for at in points], -1)
    return turns, (ramp.values[at], known) if np.isfinite(known).any() else None


@figures.styled
def course_figure(history: xr.Dataset, of: str) -> Figure:
    """Draw a variable over the time of a ramp, and below how far it swings, beside strand t1."""
    unit = str(history[of].attrs.get("units", ""))
    name = figures.in_words(history[of])
    time, values = history["time"].values, history[of].values
    figure = Figure((figures.WIDTH, 4.6), layout="constrained")
    upper, lower = figure.subplots(2, 1, sharex=True)
    upper.plot(time, values, color="#0072b2", lw=0.3, rasterized=True)
    upper.set_ylabel(f"{name} [{unit}]")
    begun = float(time[np.searchsorted(time, start_up(history))])
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
    first, last = loads.values[[0, -1]]
    rate = (last - first) / (time[-1] - begun)
    ways = lambda at: first + rate * (at - begun), lambda load: begun + (load - first) / rate
    upper.secondary_xaxis("top", functions=ways).set_xlabel(loads.label)
    lower.set(xlabel="time [s]", xlim=(begun, time[-1]))
    along = values[time >= begun]
    margin = 0.05 * float(np.ptp(along))
    upper.set_ylim(along.min() - margin, along.max() + margin)
    for axes in (upper, lower):
        axes.grid(lw=0.4, alpha=0.5)
    moment, strand = (f"{low:g} to {high:g} Hz" for low, high in (NOISE, BAND))
    bands = f"amplitudes: the moment's at {moment}, the strand's at {strand}"
    entitle_runs(figure, [history], f"{name[0].upper()}{name[1:]} over time", bands)
    return figure


def read_ramp(history: xr.Dataset, of: str, source: str = "history", *, is_ramp: bool = True) -> Ramp:
    """Read the course of a run along its ramp, without the start-up before it; arguments as of `ramp_figure`.

    Along another course, and at constant load and speed unless it has to be a ramp, that is the time [s].
    """
    if changing_of(history) is None and is_ramp:
        raise mismatch(source, "a run along a ramp of load or speed", "constant ones")
    time, (course, label) = history["time"].values, course_of(history)
    first = int(np.searchsorted(time, start_up(history)))
    rate = 1.0 / (time[1] - time[0])
    if time.size - first < WINDOW * rate:
        raise mismatch(source, f"a run of {WINDOW:g} s or more after its start-up", "a shorter one")
    if rate < 2.0 * BAND[1]:
        raise mismatch(source, f"a history of {2.0 * BAND[1]:g} samples per second or more", f"{rate:.4g}")
    if of in STRANDS:
        figures.check_known(history, ["displacement"], source)
        probes = [str(name).split()[0] == of for name in history["probe"].values]
        moved = 1e6 * history["displacement"].values[first:, probes]
        _, amplitude = window_amplitudes(moved, rate, BAND, WINDOW)
        motion = moved[:, int(np.argmax(amplitude.max(axis=0)))]
    elif of in history and history[of].dims == ("time",):
        figures.check_known(history, [of], source)
        motion = history[of].values[first:]
    else:
        raise mismatch(source, "t1, t2 or a variable over time", of)
    return Ramp(course[first:], label, _without_drift(motion, rate), rate)


def course_of(history: xr.Dataset) -> tuple[np.ndarray, str]:
    """Return the quantity that a run ramps, in display units, with its name and unit; else the time [s]."""
    changing = changing_of(history) or "time"
    course = history[changing]
    factor, unit = (1.0, "s") if changing == "time" else figures.coordinate_unit(course.attrs)
    return factor * course.values, f"{figures.in_words(course)} [{unit}]"


def changing_of(history: xr.Dataset) -> str | None:
    """The quantity that a run ramps, "time" of another course of load or speed, None of constant ones."""
    first = int(np.searchsorted(history["time"].values, start_up(history)))
    courses = {name: history[name].values[first:] for name in COURSES if name in history}
    ramped = (name for name, values in courses.items() if _is_ramp(values))
    has_profiles = bool(json.loads(history.attrs.get("point", "{}")).get("profile_time"))
    other = "time" if has_profiles or any(_change(v) > _LEAST_CHANGE for v in courses.values()) else None
    return next(ramped, other)


def _side_of(history: xr.Dataset, ramp: Ramp) -> Side:
    """Return the quantity along x, in display units."""
    changing = changing_of(history) or "time"
    factor = 1.0 if changing == "time" else figures.coordinate_unit(history[changing].attrs)[0]
    return Side(changing, np.sort(ramp.values[[0, -1]]), factor)


def _held(history: xr.Dataset) -> xr.Dataset:
    """Load and speed of a run, as coordinates, where they do not change."""
    changing = changing_of(history)
    names = [name for name in COURSES if name in history and changing not in (name, "time")]
    return xr.Dataset(coords={name: float(history[name].values[-1]) for name in names})


def _is_ramp(values: np.ndarray) -> bool:
    """Whether a quantity changes along a straight line."""
    line = np.linspace(values[0], values[-1], values.size)
    return _change(values) > 1e-6 and bool(np.abs(values - line).max() < STRAIGHT * np.ptp(values))


def _change(values: np.ndarray) -> float:
    """Change in the last half of a run, over the largest value there."""
    half = values[values.size // 2 :]
    return float(np.ptp(half) / max(np.abs(half).max(), np.finfo(float).tiny))


def start_up(history: xr.Dataset) -> float:
    """When the ramp begins [s]."""
    return float(json.loads(history.attrs.get("point", "{}")).get("rise_time", 0.0))


def _without_drift(motion: np.ndarray, rate: float) -> np.ndarray:
    """Motion less its mean over 10 ms around."""
    width = max(int(round(0.01 * rate)), 1)
    padded = np.pad(motion, (width // 2, width - 1 - width // 2), mode="edge")
    return motion - np.convolve(padded, np.ones(width) / width, mode="valid")


def spectrogram(ramp: Ramp) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values of the ramp (window,), frequencies (line,) [Hz], amplitudes (line, window) by Hann windows."""
    width = int(round(WINDOW * ramp.rate))
    cut = np.lib.stride_tricks.sliding_window_view(ramp.motion, width)[:: width // 4]
    window = np.hanning(width)
    lines = np.fft.rfftfreq(2 * width, 1.0 / ramp.rate)
    inside = lines <= HIGHEST
    amplitude = 2.0 * np.abs(np.fft.rfft(cut * window, 2 * width)) / window.sum()
    return ramp.values[width // 2 :: width // 4][: len(cut)], lines[inside], amplitude[:, inside].T


def envelope(ramp: Ramp, band: tuple[float, float] = BAND) -> tuple[np.ndarray, np.ndarray]:
    """Values of the ramp and amplitude of the motion in a band, in windows."""
    centres, amplitude = window_amplitudes(ramp.motion, ramp.rate, band, WINDOW)
    return ramp.values[np.minimum((centres * ramp.rate).astype(int), ramp.values.size - 1)], amplitude
