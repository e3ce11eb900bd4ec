"""Damped modes of histories: growth rates and frequencies of a free motion seen by several sensors.

A free motion is a sum of modes exp((growth + 2 pi i frequency) t), each with a shape over the sensors. ESPRIT
(Roy and Kailath 1989) finds them without a spectrum: all pieces of the histories span a space, of which each
mode is one direction, and a shift by a sample multiplies each direction by exp of its rate. So growth is no
slope of an amplitude, and modes that beat are told apart.

Histories are thinned before by a filter of finite length. Where it lies within the record it multiplies each
mode by a number and leaves its rate as it is, decaying or growing.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SAMPLES_PER_PERIOD = 4.0  # of the highest frequency, that are left
_TAPS = 8  # of the filter on either side, in samples that are left
_MOST_SENSORS = 5  # combinations of sensors: those that move most
_LAGS, _MOST_LAGS = 0.4, 80  # length of the pieces over that of the record, and in samples
LEAST_SAMPLES = 24
_RANK = 1e-10  # of the largest singular value: what is less is rounding
LEAST_FACTOR = 1e-6  # factor from sample to sample; what decays faster than that is none of a mode


class Modes(NamedTuple):
    """Modes of a free motion, the strongest first."""

    growth: Array  # shape (m,): growth rates; negative: decay [1/s]
    frequency: Array  # shape (m,): [Hz]; 0 of a motion that does not oscillate
    share: Array  # shape (m,): energy of the mode in the record, over the sum of all [1]


def thinned(signal: Array, rate: float, highest: float) -> tuple[Array, float]:
    """Return histories without what is faster than `highest` [Hz], and the lowest rate that resolves it [Hz].

    Of a signal (time, sensor) in any unit only the samples that the filter reaches in full are left.
    """
    every = max(int(rate / (_SAMPLES_PER_PERIOD * highest) + 1e-9), 1)
    if every == 1:
        return signal, rate
    from scipy.signal import firwin

    weights = firwin(2 * _TAPS * every + 1, 1.2 * highest, fs=rate)
    if len(signal) < weights.size:
        return signal[:0], rate / every
    pieces = np.lib.stride_tricks.sliding_window_view(signal, weights.size, axis=0)[::every]
    return pieces @ weights, rate / every


def damped_modes(signal: Array, rate: float, orders: Sequence[int]) -> list[Modes]:
    """Decompose a free motion into damped modes, for each order each pair of exponentials once.

    The signal (time, sensor), in any unit, sampled at a rate [Hz], has nothing that is faster than the modes.
    Orders are numbers of complex exponentials, two for each mode; what noise leaves of them, weak modes take.

    Raises
    ------
    ValueError
        If there are fewer samples than LEAST_SAMPLES.
    """
    samples = len(signal)
    if samples < LEAST_SAMPLES:
        raise ValueError(f"{samples} samples are too few for modes: {LEAST_SAMPLES} are needed")
    weights, sizes, _ = np.linalg.svd(signal, full_matrices=False)
    main = (weights * sizes)[:, :_MOST_SENSORS]
    sensors = main.shape[1]
    lags = min(int(_LAGS * samples), _MOST_LAGS)
    pieces = np.lib.stride_tricks.sliding_window_view(main, lags, axis=0)  # (start, sensor, lag)
    pieces = pieces.transpose(2, 1, 0).reshape(lags * sensors, -1)
    directions, sizes, _ = np.linalg.svd(pieces, full_matrices=False)
    most = min(int((sizes > _RANK * sizes[0]).sum()), (lags - 1) * sensors)
    spaces = [directions[:, : min(order, most)] for order in orders]
    return [_modes(space[:-sensors], space[sensors:], main, rate) for space in spaces]


def _modes(before: Array, after: Array, motion: Array, rate: float) -> Modes:
    """Modes of a motion (time, sensor) that span a space, without its last sample and without its first."""
    factors = np.linalg.eigvals(np.linalg.lstsq(before, after, rcond=None)[0])
    factors = factors[np.abs(factors) > LEAST_FACTOR]
    powers = factors ** np.arange(len(motion))[:, None]
    scale = np.linalg.norm(powers, axis=0)
    shapes = np.linalg.lstsq(powers / scale, motion, rcond=None)[0]
    energy = (np.abs(shapes) ** 2).sum(axis=1)
    rates = np.log(factors) * rate
    once = rates.imag >= 0.0
    rates, energy = rates[once], energy[once] / energy[once].sum()
    first = np.argsort(-energy)
    return Modes(rates.real[first], rates.imag[first] / (2.0 * np.pi), energy[first])
