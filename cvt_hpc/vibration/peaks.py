"""Peaks of a strand's spectrum: the fundamental of its harmonics, and the mode in which it moves at each.

Strands that move at several frequencies have a mode for each; the amplitude of a mode over the whole band
does not show which goes with which. A peak is one of the spectrum of all modes together, the root of the sum
of their squares. Peaks nearer to a higher one than the window's main lobe, or lower than its side lobes, are
that one's own, in the band or beside it.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.vibration.signals import Array, check_band, fine_spectrum, strongest_peak, time_last

COUNT = 3  # peaks of a strand that are recorded
LINES = 12  # largest ones among which harmonics are looked for
_MOST_HARMONIC = 8  # number of the strongest line
NEAR = 0.25  # of the resolution 1/L: how far a line may lie from a harmonic
_LEAST_LINE = 0.1  # of the strongest one
_ABOVE_NOISE = 4.0  # times the median of the band's spectrum, which noise alone stays below
_MAIN_LOBE = 4.0  # of Hann's window, in lines: between its zeros
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
    """Return the largest peaks of each strand and the mode of each, (strand, COUNT).

    They are those of amplitudes of the strands' sine modes (time, strand, half_waves), in any unit, from the
    lowest to the highest frequency of a band [Hz]. Errors are those of `signals.band_amplitude`.
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
    """Fundamental of the periodic part of a signal (time,), and its strongest line in a band [Hz].

    The fundamental is the lowest frequency in the band of which the strongest line is a multiple, up to
    _MOST_HARMONIC, that has a line of its own, or three of its harmonics in a row, the strongest among them.
    A line is a peak of _LEAST_LINE of the strongest or more, and above noise. Two lines alone therefore are
    no harmonics of a common divisor, unless one is a multiple of the other within NEAR/L, L being the length.

    Both are nan where the band holds no peak, and one without harmonics. The accuracy is that of
    `signals.dominant_frequency`, of the fundamental divided by the number of its strongest harmonic; 0.1/L
    where another line lies within 4/L. It raises the errors of `signals.band_amplitude`.
    """
    found = fundamentals(np.asarray(signal, float)[np.newaxis], rate, band)[0]
    return float(found[0]), float(found[1])


def fundamentals(signals: Array, rate: float, band: tuple[float, float]) -> Array:
    """Return `fundamental` and strongest line [Hz] of each of several signals (n, time), shape (n, 2)."""
    check_band(band, rate)
    # each signal a matrix of its own, in one piece: no number depends on the other signals, to the bit
    lines, heights = fine_spectrum(np.ascontiguousarray(signals)[:, np.newaxis], rate)
    heights = heights[:, 0]
    strongest = strongest_peak(lines, heights, band)
    noise = np.median(heights[:, (lines >= band[0]) & (lines <= band[1])], axis=1)
    width = rate / signals.shape[1]
    peaks = np.full((len(signals), LINES), np.nan)
    for k in np.flatnonzero(~np.isnan(strongest)):
        least = max(_LEAST_LINE * heights[k, round(strongest[k] / lines[1])], _ABOVE_NOISE * noise[k])
        for place, line in enumerate(_highest(lines, heights[k], band, width, LINES, least)):
            peaks[k, place] = _vertex(lines, heights[k], line)
    found = np.stack([strongest, strongest], axis=1)
    for number in range(2, _MOST_HARMONIC + 1):  # the larger number counts, where several do
        first = strongest / number
        harmonics = np.arange(1, number + 3) * first[:, np.newaxis]
        has_line = (np.abs(peaks[:, :, np.newaxis] - harmonics[:, np.newaxis]) <= NEAR * width).any(axis=1)
        in_a_row = has_line[:, :-2] & has_line[:, 1:-1] & has_line[:, 2:]
        is_periodic = has_line[:, 0] | in_a_row[:, max(number - 3, 0) :].any(axis=1)
        found[:, 0] = np.where((first >= band[0]) & is_periodic, first, found[:, 0])
    return found


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
    inner = height[1:-1]
    candidates = 1 + np.flatnonzero((inner > height[:-2]) & (inner >= height[2:]) & (inner >= least))
    order = candidates[np.argsort(height[candidates])[::-1]]
    peaks: list[tuple[float, float]] = []  # frequency and height; plain numbers: most spectra have few
    chosen: list[int] = []
    for line, frequency, size in zip(
        order.tolist(), lines[order].tolist(), height[order].tolist(), strict=True
    ):
        if len(chosen) == count:
            break
        if any(_is_part_of(size, higher, abs(place - frequency) / width) for place, higher in peaks):
            continue
        peaks.append((frequency, size))
        if band[0] <= frequency <= band[1] and not (chosen and size < LEAST * height[chosen[0]]):
            chosen.append(line)
    return chosen


def _is_part_of(height: float, higher: float, apart: float) -> bool:
    """Whether a peak is a flank or a side lobe of a higher one, so many lines apart."""
    if apart < _MAIN_LOBE:
        return True
    # side lobes of Hann's window fall as 1 / (pi x (x^2 - 1)), x in lines
    return height < MARGIN * higher / (math.pi * apart * (apart * apart - 1.0))


def _vertex(lines: Array, height: Array, line: int) -> float:
    """Frequency of a peak by a parabola through the logarithms of three lines [Hz]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b, c = np.log(height[line - 1 : line + 2])
        offset = (a - c) / (2.0 * (a - 2.0 * b + c))
    return float(lines[line] + (lines[1] - lines[0]) * (offset if np.isfinite(offset) else 0.0))
