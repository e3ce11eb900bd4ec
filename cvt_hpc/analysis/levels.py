"""Levels in dB, and third-octave bands of signals of kept runs.

A level is 20 log10 of the rms over its reference: 1 um of a displacement, 1 mm/s of a velocity, else the unit
of the quantity. Bands are those of IEC 61260-1:2014 to base ten: centres 1000 Hz 10^(x/10), edges 10^(+-1/20)
times the centre. What a casing radiates is no part of any model here.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from cvt_hpc.analysis import figures
from cvt_hpc.analysis.telling_apart import entitle_runs, named, told_apart
from cvt_hpc.analysis.time_signals import Signal, read_signal
from cvt_hpc.errors import mismatch
from cvt_hpc.variator import STRANDS

Array = NDArray[np.float64]

REFERENCES = {"m": (1e-6, "µm"), "m s-1": (1e-3, "mm/s")}
NOMINAL = (1.0, 1.25, 1.6, 2.0, 2.5, 3.15, 4.0, 5.0, 6.3, 8.0)  # of the ten bands of a decade
LEAST_LINES = 4  # of the spectrum in a band: Hann's main lobe between its zeros
DEEPEST = 80.0  # [dB] below the highest band, that are drawn
LEAST, ROW = 1.5, 2.4  # [inch]: a panel, at least and else


class Bands(NamedTuple):
    """Third octaves of a signal.

    Attributes
    ----------
    numbers : (band,) int array
        x of IEC 61260-1: the centre is 1000 Hz 10^(x/10).
    rms : (band,) array
        In the signal's unit.
    unit : str
        Of the rms.
    """

    numbers: NDArray[np.int64]
    rms: Array
    unit: str


def shown_in(unit: str) -> tuple[float, str]:
    """Reference of a quantity with this SI unit, in which its amplitudes are shown, and its name."""
    return REFERENCES.get(unit, (1.0, "" if unit == "1" else figures.as_fraction(unit)))


def level(rms: ArrayLike, unit: str) -> Array:
    """Level of an rms [dB re the reference of its unit]; -inf of zero."""
    with np.errstate(divide="ignore"):
        return np.asarray(20.0 * np.log10(np.asarray(rms, float) / shown_in(unit)[0]), float)


def level_label(unit: str) -> str:
    """Label of an axis of levels."""
    return f"RMS level [dB re 1{' ' * bool(name := shown_in(unit)[1])}{name}]"


def check_velocity(signal: Signal, source: str) -> None:
    """Raise InputError if a signal is no displacement, of which there is a velocity."""
    if signal.unit != "m":
        raise mismatch(
            f"{source}: {signal.name}", "a displacement [m] for a velocity", f"one in {signal.unit}"
        )


def centre(number: ArrayLike) -> Array:
    """Centre of a third octave [Hz] by its number x."""
    return 1000.0 * 10.0 ** (np.asarray(number, float) / 10.0)


def nominal(number: int) -> str:
    """Nominal centre of a third octave [Hz], as "1250"."""
    return f"{NOMINAL[number % 10] * 10.0 ** (3 + number // 10):g}"


def third_octaves(values: ArrayLike, rate: float, unit: str = "1", *, velocity: bool = False) -> Bands:
    """Sum the power of a signal in third octaves.

    The power density of one Hann window over the whole signal is constant within 1/2 line about each line; a
    band has the parts of lines that lie in it. So all bands together have the power between the outer edges.

    Parameters
    ----------
    values : array, shape (time,)
        Signal, whose mean is taken out.
    rate : float
        Sampling rate [Hz].
    unit : str
        Of the signal.
    velocity : bool
        Of the derivative of a displacement: its density times (2 pi f)^2.

    Returns
    -------
    Bands
        Those of LEAST_LINES lines or more, below half the sampling rate. A steady sine of amplitude A has the
        rms A / sqrt(2) in its band, less what lies beyond an edge within two lines.
    """
    from scipy.signal import periodogram  # scipy.signal takes long to load

    lines, density = periodogram(values, rate, "hann")
    if velocity:
        density = density * (2.0 * np.pi * lines) ** 2
    width, half = lines[1], 10.0**0.05
    first = np.ceil(10.0 * np.log10(LEAST_LINES * width / (half - 1.0 / half) / 1000.0) - 1e-9)
    last = np.floor(10.0 * np.log10(0.5 * rate / half / 1000.0) + 1e-9)
    numbers = np.arange(int(first), int(last) + 1)
    borders = np.append(lines - 0.5 * width, lines[-1] + 0.5 * width)
    power = np.append(0.0, np.cumsum(density) * width)
    edges = centre(np.append(numbers, numbers[-1:] + 1)) / half
    powers = np.diff(np.interp(edges, borders, power))
    return Bands(numbers, np.sqrt(powers), "m s-1" if velocity else unit)


@figures.styled
def third_octaves_figure(
    histories: Sequence[xr.Dataset],
    quantities: Sequence[str] = STRANDS,
    sources: Sequence[str] = (),
    velocity: bool = False,
) -> Figure:
    """Draw third-octave levels of the judged part: a panel for each signal, a line for each run.

    Parameters
    ----------
    histories : sequence of Dataset
        As `simulate` returns them.
    quantities : sequence of str
        Signals, as of `read_signal`.
    sources : sequence of str, optional
        Where the runs are from, for errors and for the legend.
    velocity : bool
        Of displacements: levels of their velocities.

    Raises
    ------
    InputError
        As of `read_signal`; a velocity is wanted of a force; or there are more panels than a page holds.
    """
    names = named(histories, sources)
    grid = figures.on_a_page(len(quantities), (1,), (LEAST, ROW), 1.3, names[0], "name fewer quantities")
    _, labels = told_apart(histories, names)
    figure = Figure((figures.WIDTH, grid.height * len(quantities) + 1.3), layout="constrained")
    panels = figure.subplots(len(quantities), 1, squeeze=False)[:, 0]
    for axes, of in zip(panels, quantities, strict=True):
        signals = [read_signal(one, of, name) for one, name in zip(histories, names, strict=True)]
        found = [_bands_of(signal, name, velocity) for signal, name in zip(signals, names, strict=True)]
        _draw_bands(axes, found, labels if len(histories) > 1 else [""])
        kinds = " and ".join(dict.fromkeys(signal.words for signal in signals))
        axes.set_title(f"velocity of {kinds}".removeprefix("velocity of " * (not velocity)), loc="left")
    panels[-1].set_xlabel("nominal centre of the third octave [Hz]")
    note = "judged part, Hann window; not of radiated sound, since no casing is modelled"
    entitle_runs(figure, histories, "Third octaves", note, width=72)
    return figure


def cut_off(axes: Axes) -> None:
    """Let an axis of levels, or one of amplitudes on decades, end DEEPEST below its upper end."""
    low, high = axes.get_ylim()
    axes.set_ylim(
        max(low, high * 10.0 ** (-DEEPEST / 20.0) if axes.get_yscale() == "log" else high - DEEPEST)
    )


def _bands_of(signal: Signal, source: str, velocity: bool) -> Bands:
    if velocity:
        check_velocity(signal, source)
    found = third_octaves(signal.vibration, signal.rate, signal.unit, velocity=velocity)
    if not found.numbers.size:
        raise mismatch(
            f"{source}: {signal.name}", "a judged part long enough for a third octave", "a shorter one"
        )
    return found


def _draw_bands(axes: Axes, found: Sequence[Bands], labels: Sequence[str]) -> None:
    """Levels of runs as steps over the bands, with the level of all bands together."""
    for k, (bands, label) in enumerate(zip(found, labels, strict=True)):
        style = figures.line_style(k)
        levels, total = level(bands.rms, bands.unit), level(np.hypot.reduce(bands.rms), bands.unit)
        told = f"{label}, " if label else ""
        edges = np.append(bands.numbers, bands.numbers[-1] + 1) - 0.5
        shown = np.where(np.isfinite(levels), levels, np.nan)
        axes.stairs(shown, edges, baseline=None, color=style["color"], ls=style["ls"], lw=1.4,
                    label=f"{told}all bands {figures.number(float(total), '.1f')} dB")  # fmt: skip
    cut_off(axes)
    numbers = np.unique(np.concatenate([bands.numbers for bands in found]))
    figures.put_ticks(axes.xaxis, numbers, [nominal(int(number)) for number in numbers])
    axes.set(xlim=(numbers[0] - 0.5, numbers[-1] + 0.5), ylabel=level_label(found[0].unit))
    axes.grid(lw=0.4, alpha=0.5)
    axes.legend(loc="best")
