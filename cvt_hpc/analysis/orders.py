"""Amplitudes of orders over speed: cuts of a run along its ramp, and of spectra over the speeds of a study.

An order is a multiple of the turns of the driving pulley, of the driven one, or of the elements that pass.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import NDArray

from cvt_hpc.analysis import arrangement as layout
from cvt_hpc.analysis import figures, time_signals
from cvt_hpc.analysis.classes import check_results
from cvt_hpc.analysis.eigenfrequencies import parameters_of
from cvt_hpc.analysis.ramps import THEN, course_of, start_up
from cvt_hpc.analysis.telling_apart import entitle_runs, named, on_axes
from cvt_hpc.analysis.waterfall import ORDERS
from cvt_hpc.errors import few_of, mismatch
from cvt_hpc.vibration.settings import SHORTEST_SEGMENT
from cvt_hpc.vibration.signals import DRIFT_DEGREE

Array = NDArray[np.float64]
# Turns of a pulley (n,) [Hz], how many orders of them one order is, a number or (n,), and by which share this
# may be off
Turning = tuple[Array, Any, float]
Curves = Mapping[str, tuple[Array, Array, Array]]  # by name places, amplitudes [SI], frequencies [Hz]
Order = tuple[float, str]  # the multiple, and of what: "driving" or "driven" pulley, passing "elements"

BANDWIDTH = 1.0  # orders, in which power is summed
LINES = 8  # of a window in this bandwidth: a sine in the middle is 4 lines off the edges
_PASSING_SLIP = 0.01  # of the order of passing elements: half its band at least, since slip shifts it
DEFAULT = (*ORDERS, "driven:1", "elements:1")
UNKNOWN = {
    "driven": "neither the ratio nor the speed of the driven pulley is recorded",
    "elements": "no passing_frequency is recorded, as of a belt without elements",
}


def _read_orders(given: Iterable[float | str], bandwidth: float) -> dict[str, Order]:
    """Read orders such as 8 or "8", of the driving pulley, "driven:2" and "elements:1"; none: the default.

    They are returned by their names for a legend. InputError if a text is none of these, the bandwidth is not
    above zero, or an order is below it.
    """
    if not 0.0 < bandwidth < math.inf:
        raise mismatch("bandwidth", "a bandwidth in orders, above 0", f"{bandwidth:g}")
    given, found = list(given), {}
    if not given and bandwidth > max(ORDERS):
        expected = f"at most {max(ORDERS):g}, the largest of the default orders, or orders beside it"
        raise mismatch("bandwidth", expected, f"{bandwidth:g}")
    for text in map(str, given or DEFAULT):
        of, _, number = text.rpartition(":")
        try:
            order = float(number), of or "driving"
        except ValueError:
            order = math.nan, of
        least = 1.0 if of == "elements" else bandwidth
        if order[1] in ("driving", *UNKNOWN) and least <= order[0] < math.inf:
            found[f"{order[0]:g}× {order[1]}".removesuffix(" driving")] = order
        elif given:
            expected = f"orders of the bandwidth, {bandwidth:g}, or more, as 8, driven:2 or elements:1"
            raise mismatch("orders", expected, text)
    return found


def track(
    values: Array, turned: Array, band: tuple[float, float], length: float
) -> tuple[NDArray[np.intp], Array]:
    """Amplitude of what a signal (n,) has in a band of orders, in windows of equally many turns.

    The signal is multiplied by a Hann window over the angle, freed of a cubic drift, and transformed over the
    angle, not over time, so that a changing speed smears no order; the power of all lines in the band is
    summed. Windows overlap by half.

    Parameters
    ----------
    values, turned : (n,) arrays
        Signal, and turns that the shaft has made [1], ascending.
    band, length
        Lowest and highest order; turns of a window.

    Returns
    -------
    middles, amplitude : (window,) arrays
        Samples in the middle of each window, and sqrt(2) times the Hann-weighted rms, in the signal's unit.
        The error for a steady sine that keeps 4 lines, 4/length, from the edges is below 0.1 %.
    """
    lines = np.arange(math.ceil(band[0] * length - 1e-9), math.floor(band[1] * length + 1e-9) + 1) / length
    starts = np.arange(turned[0], turned[-1] - length + 1e-9, 0.5 * length)
    amplitude = np.empty(starts.size)
    for k, start in enumerate(starts):
        inside = slice(*np.searchsorted(turned, [start, start + length]))
        angle = turned[inside]
        window = 0.5 - 0.5 * np.cos(2.0 * np.pi * (angle - start) / length)
        powers = np.polynomial.legendre.legvander(2.0 * (angle - start) / length - 1.0, DRIFT_DEGREE)
        drift, _ = np.linalg.qr(window[:, np.newaxis] * powers)
        tapered = window * (values[inside] - values[inside].mean())
        tapered = (tapered - drift @ (drift.T @ tapered)) * np.gradient(angle)
        height = np.exp(-2j * np.pi * np.multiply.outer(lines, angle)) @ tapered
        amplitude[k] = np.sqrt(4.0 * np.sum(np.abs(height) ** 2) / (0.375 * length**2))  # of Hann: 3/8
    return np.searchsorted(turned, starts + 0.5 * length), amplitude


@figures.styled
def orders_figure(
    histories: Sequence[xr.Dataset],
    of: str = "t1",
    sources: Sequence[str] = (),
    orders: Sequence[float | str] = (),
    bandwidth: float = BANDWIDTH,
    velocity: bool = False,
    level: bool = False,
) -> Figure:
    """Draw amplitudes of orders over what a run ramps, or over time; each run has a panel.

    Parameters
    ----------
    histories, sources
        As of all pictures of runs (`figures.py`); windows have SHORTEST_SEGMENT samples or more.
    of : str
        Signal, as of `read_signal`.
    orders : sequence of float or str, optional
        As of `_read_orders`; by default those of DEFAULT that the run tells.
    bandwidth : float
        In orders, in which power is summed; windows have LINES / bandwidth turns.
    velocity, level : bool
        Of a displacement its velocity, 2 pi f times the amplitude at the frequency f of the order; levels of
        the rms [dB] in the place of amplitudes.
    """
    names, wanted = named(histories, sources), _read_orders(orders, bandwidth)
    figure, panels = time_signals.in_a_column(len(histories), names[0], THEN)
    _, labels = on_axes(histories, names)
    length, name = LINES / bandwidth, ""
    notes: dict[str, str] = {}
    for axes, history, source, label in zip(panels, histories, names, labels, strict=True):
        signal = time_signals.read_signal(history, of, source, velocity=velocity)
        known, (course, x_label) = _turning_along(history, source), course_of(history)
        first, lines = int(np.searchsorted(signal.times, start_up(history))), {}
        times, values = signal.times[first:], signal.values[first:]
        for words, order in _known_orders(wanted, known, bool(orders), source, notes).items():
            low, high = _band(order, known, bandwidth)
            rate = np.interp(times, history["time"].values, known[order[1]][0])
            turned = np.append(0.0, np.cumsum(0.5 * (rate[1:] + rate[:-1])) / signal.rate)
            if not turned[-1] >= length:
                expected = f"{length:g} turns or more after the start-up"
                raise mismatch(source, expected, f"{turned[-1]:.3g}", "a larger --bandwidth needs fewer")
            most = LINES * signal.rate / (SHORTEST_SEGMENT * rate.max())
            if bandwidth > most:
                expected = f"at most {most:.3g} orders, whose windows have {SHORTEST_SEGMENT} samples"
                raise mismatch(f"{source}: bandwidth", expected, f"{bandwidth:g}")
            middles, amplitude = track(values, turned, (low, high), length)
            amplitude[high * rate[middles] > 0.5 * signal.rate] = np.nan
            at = np.interp(times[middles], history["time"].values, course)
            lines[words] = at, amplitude, 0.5 * (low + high) * rate[middles]
        _draw(axes, lines, signal.unit, velocity, level, notes)
        axes.set(xlabel=x_label)
        axes.set_title(", ".join(label.values()), loc="left")
        name = signal.words
    told = f"power in a band of {_in_words(bandwidth)}, by Hann windows of {length:g} turns"
    entitle_runs(figure, histories, f"Orders of {'the velocity of ' * velocity}{name}", told, *notes.values())
    return figure


@figures.styled
def order_cuts_figure(
    dataset: xr.Dataset,
    at: layout.At = None,
    source: str = "results",
    orders: Sequence[float | str] = (),
    bandwidth: float = BANDWIDTH,
    velocity: bool = False,
    level: bool = False,
) -> Figure:
    """Draw amplitudes of orders over the driving speeds of a study: cuts of a Campbell diagram.

    Arguments as of `waterfall_figure` and `orders_figure`. The amplitude of an order is the largest of the
    spectrum within the bandwidth about it; a steady sine there has its own within 1 %.
    """
    check_results(dataset, source)
    if "spectrum" not in dataset or "driving_speed" not in dataset["status"].dims:
        found = few_of([*map(str, dataset["status"].dims), *map(str, dataset.data_vars)], 6)
        raise mismatch(source, "results over the axis driving_speed with the variable spectrum", found)
    figures.check_known(dataset, ["spectrum"], source)
    shown, fixed = layout.along_x(layout.arrange(dataset, at or {}, source, layout.Sides("driving_speed")))
    wanted, known = _read_orders(orders, bandwidth), _turning_over(shown)
    notes: dict[str, str] = {}
    x, bins = layout.ruler(shown["driving_speed"]), shown["frequency_bin"].values
    strands = shown["strand"].values
    figure, panels = time_signals.in_a_column(len(strands), source, "", sharex=True, sharey=True)
    for axes, strand in zip(panels, strands, strict=True):
        spectra, lines = shown["spectrum"].sel(strand=strand).transpose("driving_speed", ...).values, {}
        for words, order in _known_orders(wanted, known, bool(orders), source, notes).items():
            (low, high), rate = _band(order, known, bandwidth), known[order[1]][0]
            bands = np.broadcast_arrays(low * rate, high * rate)
            amplitude = [_largest(bins, *of_run) for of_run in zip(spectra, *bands, strict=True)]
            lines[words] = x.centres, np.array(amplitude), 0.5 * (low + high) * rate
        _draw(axes, lines, str(dataset["spectrum"].attrs.get("units", "m")), velocity, level, notes)
        axes.set_title(f"strand {strand}", loc="left")
    panels[-1].set_xlabel(x.label)
    x.lay_out(panels[-1].xaxis)
    subject = figures.headline(f"Orders of {'velocity' if velocity else 'displacement'}", dataset.attrs)
    told = f"largest line of the spectrum in a band of {_in_words(bandwidth)}"
    figures.entitle(figure, [subject, ", ".join(fixed), told, *notes.values()])
    return figure


def _in_words(bandwidth: float) -> str:
    return f"{bandwidth:g} order{'s' * (bandwidth != 1.0)}"


def _band(order: Order, known: Mapping[str, Turning], bandwidth: float) -> tuple[Any, Any]:
    """Lowest and highest multiple of the turns of the driving or driven pulley in the band of an order."""
    _, each, slip = known[order[1]]
    half = np.maximum(0.5 * bandwidth, slip * order[0] * each)
    return order[0] * each - half, order[0] * each + half


def _largest(bins: Array, spectrum: Array, low: float, high: float) -> float:
    """Largest line of a spectrum (n,) between two frequencies, or that of the bin in their middle.

    `bins` (n,), `low` and `high` [Hz]; nan beyond the bins.
    """
    if not high <= bins[-1]:
        return math.nan
    inside = (bins >= low) & (bins <= high)
    inside[np.argmin(np.abs(bins - 0.5 * (low + high)))] = True
    return float(spectrum[inside].max())


def _turning_along(history: xr.Dataset, source: str) -> dict[str, Turning]:
    """Return the frequencies of which orders are multiples, over the time of a run."""
    figures.check_known(history, ["driving_speed"], source)
    rate = history["driving_speed"].values / (2.0 * np.pi)
    known: dict[str, Turning] = {"driving": (rate, 1.0, 0.0)}
    if "driven_speed" in history and (history["driven_speed"].values >= 0.0).all():
        known["driven"] = history["driven_speed"].values / (2.0 * np.pi), 1.0, 0.0
    passing = float(history.get("passing_frequency", math.nan))
    if np.isfinite(passing):  # a mean of the judged part
        judged = time_signals.read_signal(history, "driving_speed").judged
        known["elements"] = rate, passing / float(rate[judged:].mean()), _PASSING_SLIP
    return known


def _turning_over(shown: xr.Dataset) -> dict[str, Turning]:
    """Return the frequencies of which orders are multiples, over the speeds of a study."""
    rate = shown["driving_speed"].values / (2.0 * np.pi)
    known: dict[str, Turning] = {"driving": (rate, 1.0, 0.0)}
    ratio = shown.coords.get("ratio", parameters_of(shown).get("ratio"))
    if ratio is not None:
        lost = shown["speed_loss"].values if "speed_loss" in shown else 0.0
        known["driven"] = rate / np.asarray(ratio) * (1.0 - lost), 1.0, 0.0
    if "passing_frequency" in shown:
        known["elements"] = rate, shown["passing_frequency"].values / rate, _PASSING_SLIP
    return known


def _known_orders(
    wanted: dict[str, Order], known: Mapping[str, Turning], must: bool, source: str, notes: dict[str, str]
) -> dict[str, Order]:
    """Orders that are known; why others are not goes to the notes, or is an error where they `must` be."""
    for of in dict.fromkeys(of for _, of in wanted.values() if of not in known):
        if must:
            raise mismatch(f"{source}: orders of {of}", "what they are multiples of", f"none: {UNKNOWN[of]}")
        notes[of] = f"no orders of {of}: {UNKNOWN[of]}"
    return {words: order for words, order in wanted.items() if order[1] in known}


def _draw(
    axes: Axes, curves: Curves, unit: str, velocity: bool, as_level: bool, notes: dict[str, str]
) -> None:
    """Draw lines by their names: places, amplitudes [SI] and frequencies [Hz], (n,) each."""
    unit = "m s-1" if velocity else unit
    reference, shown = time_signals.shown_in(unit)
    for k, (words, (x, amplitude, frequency)) in enumerate(curves.items()):
        if not np.isfinite(amplitude).any():
            notes[words] = f"{words}: beyond the frequencies that are recorded"
            continue
        values = amplitude * (2.0 * np.pi * frequency if velocity else 1.0)
        values = time_signals.level(values / np.sqrt(2.0), unit) if as_level else values / reference
        axes.plot(x, np.where(np.isfinite(values), values, np.nan), label=words, **figures.line_style(k))
    if as_level:
        axes.set_ylabel(time_signals.level_label(unit))
    else:
        axes.set(ylabel=f"amplitude [{shown}]", yscale="log")
    time_signals.cut_off(axes)
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), frameon=False)
