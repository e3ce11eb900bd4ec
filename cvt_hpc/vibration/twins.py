"""Modes of a state by three runs: without a kick, with half of it, and with the whole.

Until the kick the runs are equal to the bit, so that the first sample in which they differ tells when it was
given. From then on their differences are a free motion about the run without a kick, as long as it is linear:
the whole difference D is twice the half one. What is left, D - 2 D_half, is the effect of nonlinear terms and
of chatter, which differs in all three runs. The record from the kick to where that is too large is
decomposed, and so are shorter spans of it: early ones for modes that decay fast, late ones for the others.
Each is decomposed several times, by parts of it, numbers of exponentials and both differences. How far these
findings scatter is the uncertainty: it holds what noise, a drifting state and weak modes beside strong ones
do to a rate.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.vibration.damped_modes import LEAST_SAMPLES, Array, Modes, damped_modes, thinned

BLOCKS = 24  # of a record after the kick, each linear or not
MOST_MISFIT = 1.0 / 3.0  # of a linear block: rms of D - 2 D_half over that of D
# Begin and length of the spans of the linear record in which modes are sought, and parts of a span
_SPANS = ((0.0, 1.0), (0.0, 0.5), (0.5, 0.5), (0.0, 0.25), (0.25, 0.25))
PARTS = ((0.0, 1.0), (0.0, 0.7), (0.2, 1.0))
ORDERS = (8, 14, 20)
MOST_MODES = 4  # the strongest
LEAST_SHARE = 0.02  # of the energy of the difference
SEEN = 0.7  # of the decompositions that have to show a mode
NEAR = 0.05  # of its frequency, or a period of the part: so near is the same mode in another decomposition
_MOST_ERROR = 4.0  # of a growth rate, over the span: what is less certain is no finding
APART = 0.1  # of a frequency: its largest error


class Found(NamedTuple):
    """Modes of a state, the strongest first, and how far to trust them."""

    # medians over the decompositions; the share is that of the part in which the mode is strongest
    modes: Modes
    # growth_error, frequency_error, shape (m,): largest deviation of a decomposition from these [1/s], [Hz]
    growth_error: Array
    frequency_error: Array
    window: float  # length of the linear record [s]
    # difference, floor, unrest: rms over it and all sensors, in the signal's unit: of the difference by the
    # whole kick, of what chatter and nonlinear terms leave in it, and of the motion without a kick, apart
    # from its drift
    difference: float
    floor: float
    unrest: float
    reason: str  # why there are no modes, or ""


def nothing(reason: str, window: float = 0.0, *sizes: float) -> Found:
    """No modes, for a reason; of a window and its three sizes, where they are known."""
    none = np.empty(0)
    difference, floor, unrest = sizes or (np.nan,) * 3
    return Found(Modes(none, none, none), none, none, window, difference, floor, unrest, reason)


def found_modes(motions: Array, rate: float, highest: float, *, vibrates: bool) -> Found:
    """Return the modes of a state up to a highest frequency [Hz], by motions (3, time, sensor) [m].

    The three runs, sampled at a rate [Hz], have no kick, half of it and the whole. With `vibrates` the run
    without a kick vibrates, else it settles.
    """
    kicked = np.flatnonzero((motions[2] != motions[0]).any(axis=1))
    if not kicked.size:
        return nothing("the kick moves nothing")
    after = motions[:, kicked[0] :]
    sensors = after.shape[2]
    joined, rate = thinned(np.hstack([after[0], *(after[1:] - after[0])]), rate, highest)
    rest, half, whole = (joined[:, k * sensors : (k + 1) * sensors] for k in range(3))
    block = len(whole) // BLOCKS
    if block * BLOCKS < LEAST_SAMPLES:
        return nothing(f"the record has {len(whole)} samples after the kick, too few for modes")
    left = whole - 2.0 * half
    linear = [
        _rms(left[k : k + block]) <= MOST_MISFIT * _rms(whole[k : k + block])
        for k in range(0, BLOCKS * block, block)
    ]
    end = block * (linear.index(False) if False in linear else BLOCKS)
    measured = slice(0, end or block)
    rest = _without_drift(rest[measured])
    # D - 2 D_half has six times the variance of the chatter of a run, and D twice
    known = end / rate, _rms(whole[measured]), _rms(left[measured]) / np.sqrt(3.0), _rms(rest)
    if 0.7 * end < LEAST_SAMPLES:
        why = f"not linear here: the difference is twice that of half the kick for {end / rate:.2g} s alone"
        return nothing(why, *known)
    if vibrates and known[3] > known[1]:
        return nothing("not quiet here: it vibrates without a kick, by more than by it", *known)
    modes: list[tuple[float, ...]] = []
    for begin, length in _SPANS:
        parts = [[round((begin + length * share) * end) for share in part] for part in PARTS]
        if min(stop - start for start, stop in parts) >= LEAST_SAMPLES:
            decomposed = [
                (one, (stop - start) / rate)
                for start, stop in parts
                for motion in (whole, half)
                for one in damped_modes(motion[start:stop], rate, ORDERS)
            ]
            modes = _merged(modes, _agreed(decomposed, highest))
    if not modes:
        return nothing("no mode that most decompositions show", *known)
    first = sorted(modes, key=lambda mode: -mode[2])[:MOST_MODES]
    growth, frequency, share, growth_error, frequency_error = np.array(first).T
    return Found(Modes(growth, frequency, share), growth_error, frequency_error, *known, "")


def _agreed(decomposed: list[tuple[Modes, float]], highest: float) -> list[tuple[float, ...]]:
    """Modes that most decompositions show: medians, share in the first one, and largest deviations."""
    first, length = decomposed[0]
    agreed = []
    for frequency, share in zip(first.frequency, first.share, strict=True):
        if share < LEAST_SHARE or not 1.0 / length <= frequency <= highest:
            continue
        seen = []
        for modes, seconds in decomposed:
            off = np.abs(modes.frequency - frequency)
            near = np.flatnonzero(off <= max(NEAR * frequency, 1.0 / seconds))
            if near.size:
                best = near[modes.share[near].argmax()]
                seen.append((modes.growth[best], modes.frequency[best]))
        growth_error, frequency_error = np.abs(seen - np.median(seen, axis=0)).max(axis=0)
        certain = growth_error <= _MOST_ERROR / length and frequency_error <= APART * frequency
        if certain and len(seen) >= SEEN * len(decomposed):
            agreed.append((*np.median(seen, axis=0), share, growth_error, frequency_error))
    return agreed


def _merged(found: list[tuple[float, ...]], others: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
    """Modes of both, of those found twice the more certain one."""
    merged = list(found)
    for mode in others:
        same = [one for one in merged if abs(one[1] - mode[1]) <= max(NEAR * mode[1], one[4] + mode[4])]
        if all(mode[3] < one[3] for one in same):
            merged = [one for one in merged if one not in same] + [mode]
    return merged


def _without_drift(motion: Array) -> Array:
    """A motion without the cubic in time that fits it best."""
    powers = np.polynomial.polynomial.polyvander(np.linspace(-1.0, 1.0, len(motion)), 3)
    return motion - powers @ np.linalg.lstsq(powers, motion, rcond=None)[0]


def _rms(values: Array) -> float:
    return float(np.sqrt((values**2).mean()))
