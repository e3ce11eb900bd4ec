"""Whether a run has the model's friction at rest: limits of step and tolerance, and checks of the samples.

Smoothed friction N mu over the sliding speed s = v_belt - x' rises to a peak and falls beyond. With the pull
p = k x + c x' - P of the spring, m s' = p - N mu(s): a mass that slides slower than at the peak passes it
only while the pull exceeds friction there, and has to once it does. With N = N_0 - n x that is p + n
mu_peak x against N_0 mu_peak. It holds for the model's own motion whatever the stepper; a run that breaks
it shows a stick-slip that friction does not make.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.models.oscillator.constants import Oscillator
from cvt_hpc.models.oscillator.motion import (
    HUMP,
    V,
    X,
    friction_at_rest,
    largest_rate,
    regularised_frictions,
)
from cvt_hpc.steppers.facts import Facts

REACH, POINTS = 2.0 * HUMP, 2401  # of the search for the peak, in units of v_reg; it is found within 1e-6


class Peak(NamedTuple):
    """Largest friction: where over the sliding speed [m/s], and its coefficient [1]."""

    sliding: float
    mu: float


def rest_missed(o: Oscillator, facts: Facts, step: float, allowed: float, rows: np.ndarray) -> str | None:
    """Decide whether the mass comes within a step of rest, by a step or tolerance too coarse to find it.

    Beyond the limit of the step, friction chatters instead of bringing the mass to rest: the speed jumps
    over the belt's in every step, by up to step N mu / m. Beyond that of the tolerance, errors of the speed
    hide the width over which friction changes its sign.

    Parameters
    ----------
    o : Oscillator
        Constants.
    facts : Facts
        Of the method.
    step : float
        Mean step [s].
    allowed : float
        Error of the speed that the tolerance of an adaptive method allows [m/s].
    rows : (n, 2) array
        Displacement [m] and speed [m/s] at samples.

    Returns
    -------
    str or None
        The reason, where it does.
    """
    longest = facts.rest_limit / largest_rate(o)
    coarse = allowed / (facts.width_limit * o.width)
    if (coarse <= 1.0 if facts.adaptive else step <= longest) or not np.any(
        np.abs(o.belt_speed - rows[:, V]) < step * friction_at_rest(o) / o.mass
    ):
        return None
    if facts.adaptive:
        return (
            f"the tolerance is {coarse:.3g} times that with which smoothed friction brings the mass to rest"
        )
    chatter = "from where friction chatters instead of letting the mass stick"
    return f"the step is beyond {longest:.3g} s, {chatter}"


def peak(o: Oscillator) -> Peak | None:
    """Find the peak of smoothed friction; None where there is none or it moves with the load."""
    if o.normal_stiffness != 0.0 and o.law.table_force.size > 1:
        return None
    sliding = np.linspace(0.0, REACH * o.width, POINTS)
    mu = regularised_frictions(o, sliding, np.full(POINTS, o.normal_load)) / o.normal_load
    top = int(mu.argmax())
    return Peak(float(sliding[top]), float(mu[top])) if top < POINTS - 1 else None


def wrongly_held(o: Oscillator, peak: Peak | None, rows: np.ndarray, interval: float) -> str | None:
    """Decide whether the mass was released by a pull that friction holds, or held against a larger one.

    Parameters
    ----------
    o : Oscillator
        Constants.
    peak : Peak or None
        Its largest friction.
    rows : (n, 2) array
        Displacement [m] and speed [m/s] at samples that follow each other.
    interval : float
        Sampling interval [s].

    Returns
    -------
    str or None
        The reason, where it was.
    """
    if peak is None or len(rows) < 2:
        return None
    x, sliding = rows[:, X], o.belt_speed - rows[:, V]
    pull = o.stiffness * x + o.damping * rows[:, V] - o.preload
    slow = (sliding >= 0.0) & (sliding < peak.sliding) & (pull >= 0.0)
    pull, holds = pull + o.normal_stiffness * peak.mu * x, o.normal_load * peak.mu
    # as long as it slides slowly it goes no faster than the belt, and so does the pull
    rise = max(o.stiffness + o.normal_stiffness * peak.mu, 0.0) * o.belt_speed
    largest = pull[:-1] + o.damping * sliding[:-1] + rise * interval
    if np.any(slow[:-1] & (sliding[1:] > peak.sliding) & (largest < holds)):
        return "the mass was let go while friction at rest still holds it"
    # Pulled by more than the peak for so long, it has gained the difference in speed: over the peak
    excess = np.maximum(pull[1:] - holds, 0.0)
    since = np.minimum(excess / rise, interval) if rise > 0.0 else np.full(excess.size, interval)
    gained = (excess - 0.5 * rise * since) * since / o.mass
    if np.any(slow[:-1] & slow[1:] & (gained > peak.sliding)):
        return "the mass was held against a pull beyond friction at rest"
    return None
