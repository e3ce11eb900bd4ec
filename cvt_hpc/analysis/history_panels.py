"""The panels in a picture of one run: displacement, spectrum, load, and the forces around the belt."""

from dataclasses import dataclass
from itertools import pairwise
from textwrap import fill
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from numpy.typing import NDArray

from cvt_hpc.analysis.figures import axis_label, coordinate_unit, in_words, number
from cvt_hpc.variator import PULLEYS
from cvt_hpc.vibration.settings import SHORTEST_SEGMENT
from cvt_hpc.vibration.signals import amplitude_spectrum, band_amplitude, dominant_frequency

Array = NDArray[np.float64]

_BIN_WIDTH = 5.0  # [Hz]
_CLOSE_UP = 0.01  # [s]: six periods at 600 Hz
_MOST_PEAKS = 3
COLOURS = ("#d55e00", "#0072b2", "#cc79a7", "#009e73", "#333333")  # Okabe and Ito's, of strands and pulleys
LINES = ("-", "--", ":", "-.", (0, (5, 1, 1, 1, 1, 1)))  # one for each probe of a strand, by default
# How the names of histories begin that share a panel
_GROUPS = ("tension_", "speed_", "arm_", "axial_force_")
COURSES = ("driving_speed", "load")  # what a run may change
FEEDS = {
    "flank_feed": ("friction of the flanks", "#d55e00", "-"),
    "stress_feed": ("push and tension", "#0072b2", "--"),
    "damping_feed": ("damping, rings' friction", "#333333", ":"),
}
_OTHER_COLOUR = "#333333"
_PAPER = {"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 1}
_MARGINS = (0.1, 0.9)  # share of the frequencies from which on labels are on the left: first strand, others
_LINEAR = 0.01  # of the largest feed: below it the axis is linear
_FLAT = 0.1  # of the largest spectrum: where another one stays below it the axis is logarithmic
_DEEPEST = 1e-3  # of the largest spectrum, on a logarithmic axis
_APART = (0.15, 0.13)  # of the panel's width and height, between labels of peaks
_HEADROOM = 1.6  # for a legend of one line


@dataclass(frozen=True)
class Strand:
    """Records of the probes on one strand."""

    name: str  # "t1" or "t2"
    probes: tuple[str, ...]  # their labels
    time: Array  # (time,) [s]
    displacement: Array  # (time, probe) [um], mean removed
    first_judged: int  # sample of the part that is judged; the number of samples where nothing is
    band: tuple[float, float]  # where vibrations are looked for [Hz]
    colour: str  # of the strand's lines

    @property
    def rate(self) -> float:
        """Sampling rate [Hz]."""
        return (self.time.size - 1) / (self.time[-1] - self.time[0])

    @property
    def judged(self) -> Array:
        """The judged part of the displacement [um], shape (time, probe)."""
        return self.displacement[self.first_judged :]

    @property
    def has_spectrum(self) -> bool:
        """Whether the judged part is long enough, and sampled fast enough for the band."""
        return len(self.judged) >= SHORTEST_SEGMENT and self.rate > 2 * self.band[1]

    @property
    def strongest(self) -> int:
        """Index of the probe that moves most in the band, or most at all where there is no spectrum."""
        if self.has_spectrum:
            return int(np.argmax(band_amplitude(self.judged, self.rate, self.band)))
        return int(np.argmax(np.ptp(self.displacement, axis=0)))


def read_strands(dataset: xr.Dataset, judged_fraction: float, band: tuple[float, float]) -> list[Strand]:
    """Take the displacement apart by strand, up to the first value that is not finite.

    Parameters
    ----------
    dataset : Dataset
        With `displacement` (time, probe) [m], if anything was recorded; a probe's label begins with its
        strand, as "t1 1/2". Probes on arcs, "driving arc 1/2", are left out.
    judged_fraction : float
        Last part of the time that is judged; 0 of a run that was not judged.
    band : (float, float)
        Where vibrations are looked for [Hz].
    """
    if "displacement" not in dataset:
        return []
    displacement = dataset["displacement"].transpose("time", "probe").values * 1e6
    finite = np.isfinite(displacement).all(axis=1)
    length = displacement.shape[0] if finite.all() else int(np.argmin(finite))
    if length < 2:
        return []
    displacement = displacement[:length] - displacement[:length].mean(axis=0)
    labels = [str(label) for label in dataset["probe"].values]
    time, first_judged = dataset["time"].values[:length], length - round(judged_fraction * length)
    strands = []
    names = dict.fromkeys(label.split()[0] for label in labels if " arc " not in label)
    for k, name in enumerate(names):
        columns = [i for i, label in enumerate(labels) if label.split()[0] == name]
        probes, moved = tuple(labels[i] for i in columns), displacement[:, columns]
        strands.append(Strand(name, probes, time, moved, first_judged, band, COLOURS[k % len(COLOURS)]))
    return strands


def draw_displacement(axes: Axes, strand: Strand) -> None:
    """The strongest probe over the whole run; the judged part is shaded, where there is one."""
    time = 1e3 * strand.time
    title = f"displacement at {strand.probes[strand.strongest]}"
    if len(strand.judged):
        axes.axvspan(time[strand.first_judged], time[-1], color="#f1f1f1", linewidth=0)
        title += ", judged part shaded"
    axes.plot(time, strand.displacement[:, strand.strongest], color=strand.colour, linewidth=0.6)
    # the belt seats itself by hundreds of um at the start, which would hide everything after it
    moved = strand.displacement[:, strand.strongest]
    seated = moved[time.size // 5 :]
    margin = 0.1 * np.ptp(seated) or 1.0
    lowest, highest = seated.min() - margin, seated.max() + margin
    axes.set(xlim=(time[0], time[-1]), ylim=(lowest, highest))
    if moved.min() < lowest or moved.max() > highest:
        text = f"start cut off: {number(moved.min(), '.0f')} to {number(moved.max(), '.0f')} µm"
        place = {"xycoords": "axes fraction", "va": "top", "fontsize": 7, "bbox": _PAPER}
        axes.annotate(text, (0.01, 0.97), **place)
    axes.set(xlabel="time [ms]", ylabel=f"{strand.name} [µm]")
    axes.set_title(title, loc="left", pad=3)


def draw_close_up(axes: Axes, strand: Strand) -> None:
    """All probes of a strand over the last milliseconds, without the mean of these."""
    last = strand.time >= strand.time[-1] - _CLOSE_UP
    time = 1e3 * strand.time[last]
    for i, label in enumerate(strand.probes):
        values = strand.displacement[last, i] - strand.displacement[last, i].mean()
        place = label.removeprefix(strand.name).strip() or label
        axes.plot(time, values, ls=LINES[i % len(LINES)], color=strand.colour, linewidth=1.2, label=place)
    axes.set(xlim=(time[0], time[-1]), xlabel="time [ms]")
    at: dict[str, Any] = {"loc": "lower left", "bbox_to_anchor": (-0.05, 0.97), "alignment": "left"}
    narrow = {"handlelength": 2.2, "handletextpad": 0.2, "columnspacing": 0.4, "fontsize": 7}
    axes.legend(title="probes from the inlet", title_fontsize=7, ncols=3, frameon=False, **at, **narrow)


def draw_spectra(axes: Axes, strands: list[Strand]) -> None:
    """Amplitude spectra of the strongest probes over the judged part, dominant peaks marked."""
    bins = np.arange(0.0, strands[0].band[1] + _BIN_WIDTH / 2, _BIN_WIDTH)
    signals = [strand.judged[:, strand.strongest] for strand in strands]
    spectra = [amplitude_spectrum(x, s.rate, bins) for x, s in zip(signals, strands, strict=True)]
    tops = [float(spectrum.max()) for spectrum in spectra]
    top = max(tops)
    if min(tops) < _FLAT * top:
        axes.set(yscale="log", ylim=(_DEEPEST * top, 3.0 * top))
    else:
        axes.set_ylim(0, 1.1 * top or 1.0)
    axes.set_xlim(0, strands[0].band[1])
    marked = []
    for i, (strand, signal, spectrum) in enumerate(zip(strands, signals, spectra, strict=True)):
        label, line = strand.probes[strand.strongest], LINES[i % len(LINES)]
        axes.plot(bins, spectrum, ls=line, color=strand.colour, linewidth=1.2, label=label)
        for frequency, amplitude in _peaks(signal, strand, bins, spectrum):
            axes.plot(frequency, amplitude, "v", color=strand.colour, markersize=5)
            marked.append((amplitude, frequency, i))
    _label_peaks(axes, strands, marked)
    axes.set(xlabel="frequency [Hz]", ylabel="amplitude [µm]")
    axes.set_title("spectrum of the judged part", loc="left", pad=3 if len(strands) <= 2 else 18)
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.97), "ncols": len(strands)}
    axes.legend(**place, frameon=False, fontsize=9 if len(strands) <= 2 else 8)


def _label_peaks(axes: Axes, strands: list[Strand], marked: list[tuple[float, float, int]]) -> None:
    """Frequencies beside peaks (height, frequency, strand), the highest first, where none stands yet.

    Of more than two strands each frequency is told once.
    """
    within = axes.transData - axes.transAxes
    taken: list[tuple[float, float, float]] = []
    for amplitude, frequency, i in sorted(marked, reverse=True):
        # strands often vibrate at one frequency: the first is labelled on the left, others right
        is_left = frequency > _MARGINS[i > 0] * strands[i].band[1]
        x, y = within.transform((frequency, amplitude))
        side = x + (-0.5 if is_left else 0.5) * _APART[0]
        told = len(strands) > 2 and any(abs(x - other) < 0.01 for _, _, other in taken)
        if told or any(abs(side - a) < _APART[0] and abs(y - b) < _APART[1] for a, b, _ in taken):
            continue
        taken.append((side, y, x))
        look = {"ha": "right" if is_left else "left", "va": "center", "fontsize": 8}
        off, place = (-5 if is_left else 5, 0), {"textcoords": "offset points", "color": strands[i].colour}
        axes.annotate(f"{frequency:.0f} Hz", (frequency, amplitude), off, **place, **look)


def _peaks(signal: Array, strand: Strand, bins: Array, spectrum: Array) -> list[tuple[float, float]]:
    """Frequency [Hz] and height of the highest peaks in the band that stand out by a fifth of the highest."""
    from scipy.signal import find_peaks  # scipy.signal takes long to load

    inside = np.where(bins >= strand.band[0], spectrum, 0.0)
    indices, _ = find_peaks(inside, prominence=max(0.2 * inside.max(), np.finfo(float).tiny))
    highest = indices[np.argsort(inside[indices])[::-1][:_MOST_PEAKS]]
    peaks = []
    for i in highest:
        around = (max(bins[i] - 2 * _BIN_WIDTH, 0.0), bins[i] + 2 * _BIN_WIDTH)
        peaks.append((float(dominant_frequency(signal, strand.rate, around)), float(spectrum[i])))
    return peaks


def draw_course(axes: Axes, course: xr.DataArray) -> None:
    """One of COURSES over time."""
    time = 1e3 * course["time"].values
    factor, unit = coordinate_unit(course.attrs)
    axes.plot(time, factor * course.values, color=_OTHER_COLOUR, linewidth=1.2)
    label = fill(axis_label(course, unit), 14)  # what the height of the panel holds
    axes.set(xlabel="time [ms]", ylabel=label, xlim=time[[0, -1]])


def groups(dataset: xr.Dataset) -> list[list[xr.DataArray]]:
    """Histories that belong into one panel: those whose names begin alike, as _GROUPS has them."""
    courses = {str(name): values for name, values in dataset.items() if values.dims == ("time",)}
    found = ([values for name, values in courses.items() if name.startswith(prefix)] for prefix in _GROUPS)
    return [group for group in found if group]


def draw_group(axes: Axes, group: list[xr.DataArray]) -> None:
    """Histories of one kind over time: forces of the strands, speeds of the pulleys, angles of the arms."""
    for k, course in enumerate(group):
        factor, unit = coordinate_unit(course.attrs)
        prefix = next(prefix for prefix in _GROUPS if str(course.name).startswith(prefix))
        kind, label = prefix.strip("_").replace("_", " "), str(course.name).removeprefix(prefix)
        style = {"ls": LINES[k % len(LINES)], "color": COLOURS[k % len(COLOURS)]}
        width = 0.8 + 0.5 * (len(group) - 1 - k)  # of two alike the upper one lets the lower one be seen
        axes.plot(1e3 * course["time"].values, factor * course.values, label=label, linewidth=width, **style)
    axes.set(xlabel="time [ms]", ylabel=f"{kind} [{unit}]", xlim=1e3 * course["time"].values[[0, -1]])
    axes.legend(loc="lower right", bbox_to_anchor=(1.0, 0.97), ncols=len(group), frameon=False, fontsize=8)


def draw_forces(axes: Axes, dataset: xr.Dataset) -> None:
    """Ring tension and push force around the belt."""
    position = 1e3 * dataset["position"].values
    styles = {"ring_tension": ("-", "#0072b2"), "push_force": ("--", "#d55e00")}
    for name, (line, colour) in styles.items():
        if name in dataset:
            label = in_words(dataset[name])
            axes.plot(position, 1e-3 * dataset[name].values, line, color=colour, linewidth=1.4, label=label)
    axes.set(ylabel="force [kN]", ylim=(0, _HEADROOM * axes.dataLim.ymax))
    axes.legend(loc="upper right", ncols=2, frameon=False)
    _lay_out_positions(axes, dataset)


def draw_contact(axes: Axes, dataset: xr.Dataset) -> None:
    """Contact force of the flanks around the belt."""
    position = 1e3 * dataset["position"].values
    axes.plot(position, 1e-3 * dataset["contact_force"].values, color=_OTHER_COLOUR, linewidth=1.2)
    axes.set(ylabel="contact [kN/m]", ylim=(0, None))
    _lay_out_positions(axes, dataset)


def draw_feed(axes: Axes, dataset: xr.Dataset) -> None:
    """Power that feeds the fluctuations along the belt, above zero, and what is taken from them, below.

    Linear near zero and logarithmic beyond: gaps that open and close at the front of the push trade ten times
    what friction feeds into the strands' vibration.
    """
    position = 1e3 * dataset["position"].values
    feeds = {name: dataset[name].values for name in FEEDS if name in dataset}
    largest = max(np.abs(feed).max() for feed in feeds.values()) or 1.0
    axes.set_yscale("symlog", linthresh=_LINEAR * largest)
    for name, feed in feeds.items():
        label, colour, line = FEEDS[name]
        axes.fill_between(position, feed, color=colour, alpha=0.25, linewidth=0)
        axes.plot(position, feed, line, color=colour, linewidth=1.2, label=label)
    axes.axhline(0.0, color=_OTHER_COLOUR, linewidth=0.6)
    decade = 10.0 ** np.floor(np.log10(largest))
    axes.set(ylabel="fed [W/m]", ylim=(-3.0 * largest, 80.0 * largest), yticks=[-decade, 0.0, decade])
    axes.legend(loc="upper right", ncols=len(FEEDS), frameon=False)
    _lay_out_positions(axes, dataset)


def _lay_out_positions(axes: Axes, dataset: xr.Dataset) -> None:
    """Axis of positions around the belt, arcs shaded and regions named along the top."""
    position = 1e3 * dataset["position"].values
    axes.set(xlabel="position along the belt's path [mm]", xlim=position[[0, -1]])
    if "region" not in dataset:
        return
    region = dataset["region"].values.astype(str)
    middles = (position[1:] + position[:-1]) / 2
    borders = [position[0], *middles[region[1:] != region[:-1]], position[-1]]
    for start, stop in pairwise(borders):
        name = region[np.searchsorted(position, (start + stop) / 2)]
        if "arc" in name or name in PULLEYS:  # as pushbelts name them
            axes.axvspan(start, stop, color="#e6e6e6", linewidth=0, zorder=0)
        top = axes.get_xaxis_transform()
        axes.text((start + stop) / 2, 1.03, name, transform=top, ha="center", fontsize=9)
