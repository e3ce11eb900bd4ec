"""What each peak of a strand's spectrum is made of: the mode in which the strand moves at that frequency.

Strands that move at several frequencies have a mode for each; the amplitude of a mode over the whole band
does not tell which goes with which. A peak is one of the spectrum of all modes together, the root of the sum
of their squares. Peaks nearer to a higher one than the window's main lobe, or lower than its side lobes, are
that one's own flanks.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.vibration.tapering import Array, check_band, fine_spectrum, time_last

COUNT = 3  # peaks of a strand that are recorded
MAIN_LOBE = 4.0  # of Hann's window, over 1 / length: between its zeros
LEAST = 0.05  # of a strand's highest peak; the side lobes of Hann's window reach 0.027

VARIABLES = (
    Variable("peak_frequency", ("strand", "peak"), "f8", "Hz", "of the largest peaks of the strand's motion"),
    Variable(
        "peak_amplitude", ("strand", "peak"), "f8", "m", "amplitude of the largest mode at that frequency"
    ),
    Variable("peak_mode", ("strand", "peak"), "i1", "1", "its half waves along the strand; 0: no such peak"),
    Variable(
        "frequency_ratio", ("peak",), "f8", "1", "frequency of each peak of t2 over that of the first of t1"
    ),
)


class Peaks(NamedTuple):
    """Largest peaks of each strand, largest first, (strand, COUNT) each; nan and mode 0 for want of more.

    Attributes
    ----------
    frequency, amplitude : arrays
        [Hz], and of the mode that is largest there, in the signal's unit.
    mode : int array
        Its half waves.
    """

    frequency: Array
    amplitude: Array
    mode: np.ndarray

    def record(self) -> dict[str, Array]:
        """Values of VARIABLES."""
        ratio = self.frequency[1] / self.frequency[0, 0]
        return {f"peak_{name}": values for name, values in self._asdict().items()} | {
            "frequency_ratio": ratio
        }


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
        for k, line in enumerate(_highest(lines, height, band, MAIN_LOBE * rate / len(samples))):
            own = magnitudes[strand, :, line]
            found.frequency[strand, k] = _vertex(lines, height, line)
            found.mode[strand, k] = 1 + np.argmax(own)
            found.amplitude[strand, k] = own.max()
    return found


def _highest(lines: Array, height: Array, band: tuple[float, float], lobe: float) -> list[int]:
    """Lines of the highest peaks in a band, each no nearer to a higher one than a lobe [Hz]."""
    inside = (lines[1:-1] >= band[0]) & (lines[1:-1] <= band[1])
    is_peak = inside & (height[1:-1] > height[:-2]) & (height[1:-1] >= height[2:])
    candidates = 1 + np.flatnonzero(is_peak)
    chosen: list[int] = []
    for line in candidates[np.argsort(height[candidates])[::-1]]:
        if len(chosen) == COUNT or (chosen and height[line] < LEAST * height[chosen[0]]):
            break
        if all(abs(lines[line] - lines[other]) >= lobe for other in chosen):
            chosen.append(int(line))
    return chosen


def _vertex(lines: Array, height: Array, line: int) -> float:
    """Frequency of a peak by a parabola through the logarithms of three lines [Hz]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b, c = np.log(height[line - 1 : line + 2])
        offset = (a - c) / (2.0 * (a - 2.0 * b + c))
    return float(lines[line] + (lines[1] - lines[0]) * (offset if np.isfinite(offset) else 0.0))
