"""Peaks of a strand's spectrum: the fundamental of its harmonics, and the mode in which it moves at each.

Strands that move at several frequencies have a mode for each; the amplitude of a mode over the whole band
does not show which goes with which. A peak is one of the spectrum of all modes together, the root of the sum
of their squares. Peaks nearer to a higher one than the window's main lobe, or lower than its side lobes, are
that one's own, in the band or beside it.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.vibration.signals import Array, check_band, dominant_frequency, fine_spectrum, time_last

COUNT = 3  # peaks of a strand that are recorded
LINES = 12  # largest ones among which harmonics are looked for
MOST_HARMONIC = 8  # number of the strongest line
NEAR = 0.25  # of the resolution 1/L: how far a line may lie from a harmonic
LEAST_LINE = 0.1  # of the strongest one
ABOVE_NOISE = 4.0  # times the median of the band's spectrum, which noise alone stays below
MAIN_LOBE = 4.0  # of Hann's window, in lines: between its zeros
MARGIN = 2.0  # above side lobes
LEAST = 0.05  # of a strand's highest peak in the band

VARIABLES = (
    Variable("peak_frequency", "Hz", "of the largest peaks of the strand's motion", dims=("strand", "peak")),
    Variable(
        "peak_amplitude", "m", "amplitude of the largest mode at that frequency", dims=("strand", "peak")
    ),
    Variable(
        "peak_mode",
        "1",
        "its half waves along the strand; 0: no such peak",
        dims=("strand", "peak"),
        dtype="i1",
    ),
    Variable(
        "frequency_ratio", "1", "frequency of each peak of t2 over that of the first of t1", dims=("peak",)
    ),
)


class Peaks(NamedTuple):
    """Largest peaks of each strand, largest first, (strand, COUNT) each; nan and mode 0 for want of more."""

    # frequency, amplitude: [Hz], and of the mode that is largest there, in the signal's unit
    frequency: Array
    amplitude: Array
    mode: np.ndarray  # its half waves

    @property
    def frequency_ratio(self) -> Array:
        """Frequency of each peak of t2 over that of the first of t1, (COUNT,)."""
        return self.frequency[1] / self.frequency[0, 0]


def coordinate() -> Coordinate:
    """The dimension `peak`."""
    return Coordinate(np.arange(1, COUNT + 1), "1", "peak", "of the strand's spectrum, the largest first")


def modal_peaks(modes: ArrayLike, rate: float, band: tuple[float, float]) -> Peaks:
    """Find the largest peaks of each strand and the mode of each.

    Parameters
    ----------
    modes : array, shape (time, strand, half_waves)
        Amplitudes of the strands' sine modes, in any unit.
    rate : float
        Sampling rate [Hz].
    band : (float, float)
        Lowest and highest frequency [Hz].

    Raises
    ------
    ValueError
        As of `signals.band_amplitude`.
    """
    check_band(band, rate)
    samples = np.asarray(modes, float)
    lines, magnitudes = fine_spectrum(time_last(samples), rate)  # (strand, half_waves, line)
    total = np.sqrt((magnitudes**2).sum(axis=1))
    strands = total.shape[0]
    found = Peaks(
        np.full((strands, COUNT), np.nan), np.full((strands, COUNT), np.nan), np.zeros((strands, COUNT), int)
    )
    for strand, height in enumerate(total):
        for k, line in enumerate(_highest(lines, height, band, rate / len(samples))):
            own = magnitudes[strand, :, line]
            found.frequency[strand, k] = _vertex(lines, height, line)
            found.mode[strand, k] = 1 + np.argmax(own)
            found.amplitude[strand, k] = own.max()
    return found


def fundamental(signal: ArrayLike, rate: float, band: tuple[float, float]) -> tuple[float, float]:
    """Fundamental of the periodic part of a signal, and its strongest line in a band.

    The fundamental is the lowest frequency in the band of which the strongest line is a multiple, up to
    MOST_HARMONIC, that has a line of its own, or three of its harmonics in a row, the strongest among them. A
    line is a peak of LEAST_LINE of the strongest or more, and above noise. Two lines alone therefore are no
    harmonics of a common divisor, unless one is a multiple of the other within NEAR/L, L being the length.

    Parameters
    ----------
    signal : array, shape (time,)
        Samples, in any unit.
    rate, band
        As of `modal_peaks`.

    Returns
    -------
    fundamental, strongest : float
        [Hz], both nan where the band holds no peak. Without harmonics both are one. The error is that of
        `signals.dominant_frequency`, of the fundamental divided by the number of its strongest harmonic;
        0.1/L where another line lies within 4/L.

    Raises
    ------
    ValueError
        As of `signals.band_amplitude`.
    """
    strongest = float(dominant_frequency(signal, rate, band))
    if np.isnan(strongest):
        return strongest, strongest
    lines, height = fine_spectrum(time_last(signal), rate)
    noise = np.median(height[(lines >= band[0]) & (lines <= band[1])])
    least = max(LEAST_LINE * height[round(strongest / lines[1])], ABOVE_NOISE * noise)
    width = rate / len(np.asarray(signal))
    found = _highest(lines, height, band, width, LINES, least)
    peaks = np.array([_vertex(lines, height, line) for line in found])
    for number in range(MOST_HARMONIC, 1, -1):
        first = strongest / number
        orders = np.arange(1, number + 3)
        has_line = (np.abs(peaks[:, np.newaxis] - orders * first) <= NEAR * width).any(axis=0)
        in_a_row = has_line[:-2] & has_line[1:-1] & has_line[2:]
        if first >= band[0] and (has_line[0] or in_a_row[max(number - 3, 0) :].any()):
            return first, strongest
    return strongest, strongest


def _highest(
    lines: Array,
    height: Array,
    band: tuple[float, float],
    width: float,
    count: int = COUNT,
    least: float = 0.0,
) -> list[int]:
    """Lines of the highest peaks in a band, none of them a flank or a side lobe of a higher peak anywhere.

    `width` is the distance of two lines of a transform without padding [Hz]; `count` and `least` are the
    largest number of them, and the least height.
    """
    is_peak = (height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])
    candidates = 1 + np.flatnonzero(is_peak)
    peaks: list[int] = []
    chosen: list[int] = []
    for line in candidates[np.argsort(height[candidates])[::-1]]:
        if len(chosen) == count or height[line] < least:
            break
        apart = np.abs(lines[peaks] - lines[line]) / width
        if (apart < MAIN_LOBE).any():
            continue
        # side lobes of Hann's window fall as 1 / (pi x (x^2 - 1)), x in lines
        if (height[line] < MARGIN * height[peaks] / (np.pi * apart * (apart**2 - 1.0))).any():
            continue
        peaks.append(int(line))
        if band[0] <= lines[line] <= band[1] and not (chosen and height[line] < LEAST * height[chosen[0]]):
            chosen.append(int(line))
    return chosen


def _vertex(lines: Array, height: Array, line: int) -> float:
    """Frequency of a peak by a parabola through the logarithms of three lines [Hz]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b, c = np.log(height[line - 1 : line + 2])
        offset = (a - c) / (2.0 * (a - 2.0 * b + c))
    return float(lines[line] + (lines[1] - lines[0]) * (offset if np.isfinite(offset) else 0.0))
