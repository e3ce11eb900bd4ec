"""Amplitude, spectrum, frequency and growth of recorded vibrations.

All functions take `signal` with time along the first axis and any number of channels behind it, and share
one estimator: a segment is multiplied by a Hann window, freed of its mean and slow drift, and
transformed. Reasons and errors stand below.

A signal that is constant, or a cubic in time, up to rounding has no vibration: amplitude 0, frequency and
growth rate nan. A signal with a value that is not finite yields nan in its channel.

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

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvt_hpc.vibration.settings import SHORTEST_SEGMENT, fitting_window

Array = NDArray[np.float64]

DRIFT_DEGREE = 3

_ZERO_PADDING = 8  # lines per resolved line; Hann's maximum is then met within 0.3 %

_WINDOWS_FOR_GROWTH = 3  # a slope and its standard error need one more point than a line has parameters


class Growth(NamedTuple):
    """Exponential growth rate and its standard error [1/s]; negative for decay."""

    rate: Array
    standard_error: Array


def band_amplitude(signal: ArrayLike, rate: float, band: tuple[float, float]) -> Array:
    """Amplitude of the vibration within a frequency band.

    Parameters
    ----------
    signal : array, shape (time, ...)
        Samples, in any unit.
    rate, band : float, (float, float)
        Sampling rate; lowest and highest frequency [Hz].

    Returns
    -------
    array, shape (...)
        sqrt(2) times the (Hann-weighted) rms of the band-passed signal: the peak amplitude of a sine of
        the same power, in the signal's unit. Two sines of amplitudes a and b give hypot(a, b). Error
        below 0.1 % for a steady sine that keeps 4/L from the band's edges, L being the record's length.

    Raises
    ------
    ValueError
        The record is shorter than 32 samples, or the band does not lie between 0 and half the sampling rate.
    """
    return _segment_amplitude(time_last(signal), rate, band)


def window_amplitudes(
    signal: ArrayLike, rate: float, band: tuple[float, float], length: float
) -> tuple[Array, Array]:
    """Band-limited amplitude in successive windows, each overlapping the one before by half.

    The last window ends with the record; samples at the record's start that do not fill a window are left
    out. Hann windows that overlap by half use every sample and are almost uncorrelated.

    Parameters
    ----------
    signal, rate, band
        As for `band_amplitude`.
    length : float
        Length of a window [s]; two periods of the band's lowest frequency or more keep drift and band apart.

    Returns
    -------
    centres, amplitudes : arrays, shape (window,) and (window, ...)
        Middle of each window [s], counted from the first sample, and `band_amplitude` of each.

    Raises
    ------
    ValueError
        A window is longer than the record or shorter than 32 samples; or the band is no band.
    """
    samples = time_last(signal)
    width = round(length * rate)
    total = samples.shape[-1]
    if width > total:
        raise ValueError(f"a window of {width} samples is longer than the record of {total} samples")
    hop = max(width // 2, 1)
    first = (total - width) % hop
    segments = np.lib.stride_tricks.sliding_window_view(samples, width, axis=-1)[..., first::hop, :]
    starts = np.arange(first, total - width + 1, hop)
    amplitudes = _segment_amplitude(segments, rate, band)
    return (starts + (width - 1) / 2) / rate, np.moveaxis(amplitudes, -1, 0)


def amplitude_spectrum(signal: ArrayLike, rate: float, bins: ArrayLike) -> Array:
    """Amplitude spectrum reduced to given frequency bins.

    Each bin shows the maximum of the Hann-windowed amplitude spectrum over the bin, on lines dense enough
    that a steady sine of amplitude A shows A within 1 % in its bin, wherever between the bins it falls.
    Two consequences: where bins are narrower than Hann's main lobe (4/L), neighbouring bins show the
    lobe's flanks, so amplitudes of bins must not be summed; and broad-band noise reads high by the choice
    of a maximum.

    Parameters
    ----------
    signal, rate
        As of `band_amplitude`.
    bins : array, shape (bin,)
        Centres of the bins [Hz], ascending, two or more; a bin reaches halfway to its neighbours.

    Returns
    -------
    array, shape (bin, ...)
        Amplitude in the signal's unit; mean and drift read 0, not their size.

    Raises
    ------
    ValueError
        The bins are not ascending or reach beyond half the sampling rate; or the record is shorter than
        32 samples.
    """
    centres = np.asarray(bins, dtype=float)
    if centres.ndim != 1 or centres.size < 2 or not np.all(np.diff(centres) > 0) or centres[0] < 0:
        raise ValueError("the bins' centres must be two or more ascending frequencies from 0 Hz")
    middles = (centres[1:] + centres[:-1]) / 2
    edges = np.concatenate(
        ([max(2 * centres[0] - middles[0], 0.0)], middles, [2 * centres[-1] - middles[-1]])
    )
    if edges[-1] > rate / 2 * (1 + 1e-12):
        raise ValueError(f"the bins reach {edges[-1]:g} Hz, beyond half the sampling rate of {rate:g} Hz")
    frequencies, magnitudes = fine_spectrum(time_last(signal), rate, finest=np.diff(edges).min() / 2)
    first = np.searchsorted(frequencies, edges, side="left")
    reduced = np.maximum.reduceat(magnitudes[..., : first[-1]], first[:-1], axis=-1)
    return np.moveaxis(reduced, -1, 0)


def dominant_frequency(signal: ArrayLike, rate: float, band: tuple[float, float]) -> Array:
    """Frequency of the highest peak of the amplitude spectrum within a band [Hz]; nan where it holds no peak.

    The peak is interpolated by a parabola through the logarithms of three zero-padded spectral lines: for a
    steady sine the error is below 0.001/L, L being the record's length (0.02 Hz for 50 ms). Arguments and
    errors are those of `band_amplitude`.
    """
    check_band(band, rate)
    return strongest_peak(*fine_spectrum(time_last(signal), rate), band)


def strongest_peak(frequencies: Array, magnitudes: Array, band: tuple[float, float]) -> Array:
    """Frequency [Hz] of the highest peak in a band of spectra (..., line), shape (...); nan without one."""
    inside = (frequencies[1:-1] >= band[0]) & (frequencies[1:-1] <= band[1])
    left, middle, right = magnitudes[..., :-2], magnitudes[..., 1:-1], magnitudes[..., 2:]
    is_peak = inside & (middle > left) & (middle >= right)
    best = np.argmax(np.where(is_peak, middle, -1.0), axis=-1)[..., np.newaxis]
    with np.errstate(divide="ignore", invalid="ignore"):
        a, b, c = (np.log(np.take_along_axis(side, best, axis=-1)[..., 0]) for side in (left, middle, right))
        offset = (a - c) / (2 * (a - 2 * b + c))
    frequency = frequencies[1] * (best[..., 0] + 1 + offset)
    return np.where(is_peak.any(axis=-1), frequency, np.nan)


def envelope_growth(
    signal: ArrayLike, rate: float, band: tuple[float, float], length: float | None = None
) -> Growth:
    """Exponential growth rate of the band-limited envelope [1/s], and its error (`growth_fit`).

    The envelope is sampled by `window_amplitudes`, so that no value of it comes from beyond the record's
    ends, and a straight line is fitted to its logarithm. For an exponentially growing or decaying sine that
    keeps 4/length from the band's edges the error is below 0.1 % of the rate. The `length` of a window [s] is
    by default `fitting_window` for two periods of the band's lowest frequency; other arguments are those of
    `band_amplitude`.
    """
    samples = np.asarray(signal, dtype=float)
    if length is None:
        length = fitting_window(len(samples) / rate, 2 / band[0] if band[0] > 0 else np.inf)
    return growth_fit(*window_amplitudes(samples, rate, band, length))


def growth_fit(times: ArrayLike, amplitudes: ArrayLike) -> Growth:
    """Straight line through the logarithm of amplitudes, (window, ...), over time [s], (window,).

    Slope and its standard error from the scatter about the line [1/s], shape (...); both nan with fewer than
    three windows, or where an amplitude is zero or not finite. Slow beats count as scatter, but windows
    within one beat are alike, and the standard error is then too small.
    """
    t = np.asarray(times, dtype=float)
    a = np.asarray(amplitudes, dtype=float)
    found = growth_fits(t, a.reshape(1, len(a), -1))
    return Growth(*(each.reshape(a.shape[1:]) for each in found))


def growth_fits(times: Array, amplitudes: Array) -> Growth:
    """Growth of several runs, as of `growth_fit`; amplitudes (run, window, channel), growth (run, channel).

    The numbers of a run do not depend on the others, to the bit: runs are the outermost of all axes.
    """
    t, a = times, np.ascontiguousarray(amplitudes)
    if t.size < _WINDOWS_FOR_GROWTH:
        nothing = np.full((len(a), a.shape[2]), np.nan)
        return Growth(nothing, nothing.copy())
    t = t - t.mean()
    logs = np.log(np.where(a > 0, a, np.nan))
    logs = logs - logs.mean(axis=1, keepdims=True)
    slope = (t @ logs) / (t @ t)
    scatter = logs - t[:, np.newaxis] * slope[:, np.newaxis]
    variance = np.sum(scatter**2, axis=1) / (t.size - 2)
    return Growth(slope, np.sqrt(variance / (t @ t)))


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
    window, drift = _window_and_drift(size)
    # The mean goes first: taken out together with the window it would leave its own rounding behind.
    centred = segments - segments.mean(axis=-1, keepdims=True)
    tapered = window * centred
    vibration = tapered - (tapered @ drift) @ drift.T
    rounding = 16 * np.finfo(float).eps * np.abs(segments).max(axis=-1, keepdims=True)
    is_rounding = np.abs(vibration).max(axis=-1, keepdims=True) <= rounding
    return np.where(is_rounding, 0.0, vibration), window


@lru_cache(maxsize=64)
def _window_and_drift(size: int) -> tuple[Array, Array]:
    """Hann window (size,), and orthonormal shapes of the drift under it (size, DRIFT_DEGREE + 1)."""
    window = 0.5 - 0.5 * np.cos(2 * np.pi * (np.arange(size) + 0.5) / size)
    powers = np.polynomial.legendre.legvander(np.linspace(-1, 1, size), DRIFT_DEGREE)
    drift, _ = np.linalg.qr(window[:, np.newaxis] * powers)
    return window, drift


def _segment_amplitude(segments: Array, rate: float, band: tuple[float, float]) -> Array:
    """Amplitude within the band [Hz] of segments (..., time) sampled at `rate` [Hz]; shape (...)."""
    check_band(band, rate)
    vibration, window = _windowed(segments)
    frequencies = np.fft.rfftfreq(window.size, 1 / rate)
    inside = (frequencies >= band[0]) & (frequencies <= band[1])
    lines = np.abs(np.fft.rfft(vibration)[..., inside]) ** 2
    if lines.ndim > 1 and lines.shape[-2] == 1:
        lines = np.ascontiguousarray(lines)  # else their order of adding up depends on the other signals
    return np.sqrt(4 * lines.sum(axis=-1) / (window.size * np.sum(window**2)))


def fine_spectrum(segments: Array, rate: float, finest: float = np.inf) -> tuple[Array, Array]:
    """Frequencies (line,), no further apart than `finest` [Hz], and amplitudes (..., line) of segments."""
    vibration, window = _windowed(segments)
    padded = max(_ZERO_PADDING * window.size, int(np.ceil(rate / finest)))
    padded = 1 << (padded - 1).bit_length()
    frequencies = np.asarray(np.fft.rfftfreq(padded, 1 / rate), dtype=np.float64)
    return frequencies, 2 * np.abs(np.fft.rfft(vibration, padded)) / window.sum()
