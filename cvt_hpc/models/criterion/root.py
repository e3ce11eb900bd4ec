"""Brent's search for a root, as SciPy's `brentq` does it, of functions that are evaluated elsewhere."""

from collections.abc import Generator
from typing import Any

Search = Generator[float, Any, float]  # yields where the function is asked for, is sent its value


def brent(low: float, high: float, at_low: float, at_high: float, xtol: float, rtol: float) -> Search:
    """Find a root between two points, at which a function has values of opposite signs.

    Many searches can so go on side by side, with one evaluation of the function for all of them. Each is that
    of `scipy.optimize.brentq` to the bit.

    Parameters
    ----------
    low, high, at_low, at_high : float
        The points, and the function there.
    xtol, rtol : float
        Largest error of the root, absolute, and relative to it.
    """
    before, here, at_before, at_here = low, high, at_low, at_high
    other, at_other, step_before, step = 0.0, 0.0, 0.0, 0.0
    while True:
        if at_before != 0.0 and at_here != 0.0 and (at_before < 0.0) != (at_here < 0.0):
            other, at_other = before, at_before
            step_before = step = here - before
        if abs(at_other) < abs(at_here):
            before, here, other = here, other, here
            at_before, at_here, at_other = at_here, at_other, at_here
        tolerance = (xtol + rtol * abs(here)) / 2.0
        half = (other - here) / 2.0
        if at_here == 0.0 or abs(half) < tolerance:
            return here
        step_before, step, last = half, half, (step_before, step)
        if abs(last[0]) > tolerance and abs(at_here) < abs(at_before):
            if before == other:  # by the chord
                trial = -at_here * (here - before) / (at_here - at_before)
            else:  # by a hyperbola through three points
                one = (at_before - at_here) / (before - here)
                two = (at_other - at_here) / (other - here)
                trial = -at_here * (at_other * two - at_before * one) / (two * one * (at_other - at_before))
            if 2.0 * abs(trial) < min(abs(last[0]), 3.0 * abs(half) - tolerance):
                step_before, step = last[1], trial
        before, at_before = here, at_here
        here += step if abs(step) > tolerance else (tolerance if half > 0.0 else -tolerance)
        at_here = yield here
