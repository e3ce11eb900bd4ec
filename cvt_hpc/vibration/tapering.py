"""The estimator behind all amplitudes: a segment times a Hann window, without drift, and its spectrum.

Why a window and a spectral mask, and no recursive filter: a zero-phase filter with a corner at 100 Hz
needs 10-20 ms to forget its start at either end, which is most of a 50 ms record, and its start-up
answers to drift. A windowed segment has no start-up: every value comes from inside the segment, and equal
windows along an exponentially growing vibration read amplitudes in exactly the ratio of the growth.

Why the drift cannot leak: the cubic polynomial that fits the windowed segment best is taken out *after*
windowing, so that mean, slope, curvature and twist vanish to rounding, while a vibration of more than
three periods in the segment is orthogonal to them. The remainder of a belt that settles by 100 um: under
0.06 um for a 50 ms record and under 0.04 um for a 20 ms window, for settling times of 10 ms and more.

The price is stated in terms of the segment's length L: band edges are soft over 2/L (Hann's main lobe; a
sine on an edge counts with 0.91 of its amplitude), sines below 3.5/L lose amplitude to the polynomial,
and where the amplitude changes within the segment, its middle counts most.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvt_hpc.vibration.settings import SHORTEST_SEGMENT

Array = NDArray[np.float64]

DRIFT_DEGREE = 3

ZERO_PADDING = 8  # lines per resolved line; Hann's maximum is then met within 0.3 %


def time_last(signal: ArrayLike) -> Array:
    """Signal (time, ...) as floats of shape (..., time)."""
    samples = np.asarray(signal, dtype=float)
    return np.moveaxis(samples, 0, -1)


def check_band(band: tuple[float, float], rate: float) -> None:
    """Raise ValueError unless the band [Hz] lies between 0 and half the sampling rate [Hz]."""
    if not 0 <= band[0] < band[1] <= rate / 2:
        raise ValueError(f"expected a band within 0 .. {rate / 2:g} Hz, lowest frequency first; found {band}")


def _windowed(segments: Array) -> tuple[Array, Array]:
    """Segments (..., time) times the Hann window and without drift, and the window."""
    size = segments.shape[-1]
    if size < SHORTEST_SEGMENT:
        raise ValueError(f"expected {SHORTEST_SEGMENT} samples or more; found {size}")
    window = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(size) + 0.5) / size)
    powers = np.polynomial.legendre.legvander(np.linspace(-1, 1, size), DRIFT_DEGREE)
    drift, _ = np.linalg.qr(window[:, np.newaxis] * powers)
    # The mean goes first: taken out together with the window it would leave its own rounding behind.
    centred = segments - segments.mean(axis=-1, keepdims=True)
    tapered = window * centred
    vibration = tapered - (tapered @ drift) @ drift.T
    rounding = 16 * np.finfo(float).eps * np.abs(segments).max(axis=-1, keepdims=True)
    is_rounding = np.abs(vibration).max(axis=-1, keepdims=True) <= rounding
    return np.where(is_rounding, 0.0, vibration), window


def segment_amplitude(segments: Array, rate: float, band: tuple[float, float]) -> Array:
    """Amplitude within the band [Hz] of segments (..., time) sampled at `rate` [Hz]; shape (...)."""
    check_band(band, rate)
    vibration, window = _windowed(segments)
    frequencies = np.fft.rfftfreq(window.size, 1 / rate)
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    power = np.sum(np.abs(np.fft.rfft(vibration)[..., inside]) ** 2, axis=-1)
    return np.sqrt(4 * power / (window.size * np.sum(window**2)))


def fine_spectrum(segments: Array, rate: float, finest: float = np.inf) -> tuple[Array, Array]:
    """Frequencies (line,), no further apart than `finest` [Hz], and amplitudes (..., line) of segments."""
    vibration, window = _windowed(segments)
    padded = max(ZERO_PADDING * window.size, int(np.ceil(rate / finest)))
    padded = 1 << (padded - 1).bit_length()
    frequencies = np.asarray(np.fft.rfftfreq(padded, 1 / rate), dtype=np.float64)
    return frequencies, 2 * np.abs(np.fft.rfft(vibration, padded)) / window.sum()
