"""Whether a run has the model's friction at rest: limits of step and tolerance, and checks of the samples.

Smoothed friction N mu over the sliding speed s = v_belt - x' rises to a peak and falls beyond. With the pull
p = k x + c x' - P of the spring, m s' = p - N mu(s): a mass that slides slower than at the peak passes it
only while the pull exceeds friction there, and has to once it does. With N = N_0 - n x that is p + n
mu_peak x against N_0 mu_peak. It holds for the model's own motion whatever the stepper; a run that breaks
it shows a stick-slip that friction does not make.

Friction as it is has no peak and no width: the mass sticks, s = 0, as long as |p| <= N mu at rest, and not
longer. Moreau's steps compare the two in their middle, so a mass that sticks over an interval is held rightly
if it is in the middle of the first step and of the last.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.oscillator import motion
from cvt_hpc.physics.friction import friction_coefficient
from cvt_hpc.steppers.facts import Facts

LET_GO = "the mass was let go while friction at rest still holds it"
HELD = "the mass was held against a pull beyond friction at rest"
REASONS = None, LET_GO, HELD
REST = 1e-9  # of the mass' largest speed: sliding that rounding may leave while friction holds
# Of the search for the peak, in units of v_reg; it is found within 1e-6
REACH, POINTS = 2.0 * motion.HUMP, 2401


class Peak(NamedTuple):
    """Largest friction: where over the sliding speed [m/s], and its coefficient [1]."""

    sliding: float
    mu: float


def rest_missed(
    o: motion.Oscillator, facts: Facts, step: float, allowed: float, rows: np.ndarray
) -> str | None:
    """Reason why a step or tolerance is too coarse for the mass that comes near rest; None where it is not.

    The mass comes within a step of rest. Beyond the limit of the mean step [s], friction chatters instead of
    bringing it to rest: the speed jumps over the belt's in every step, by up to step N mu / m. Beyond that of
    the tolerance, errors of the speed, which an adaptive method allows up to `allowed` [m/s], hide the width
    over which friction changes its sign. Rows are displacement [m] and speed [m/s] at samples.
    """
    longest = facts.rest_limit / motion.largest_rate(o)
    coarse = allowed / (facts.width_limit * o.width)
    if (coarse <= 1.0 if facts.adaptive else step <= longest) or not np.any(
        np.abs(o.belt_speed - rows[:, motion.V]) < step * motion.friction_at_rest(o) / o.mass
    ):
        return None
    if facts.adaptive:
        return (
            f"the tolerance is {coarse:.3g} times that with which smoothed friction brings the mass to rest"
        )
    chatter = "from where friction chatters instead of letting the mass stick"
    return f"the step is beyond {longest:.3g} s, {chatter}"


def peak(o: motion.Oscillator) -> Peak | None:
    """Find the peak of smoothed friction; None where there is none or it moves with the load."""
    if _moves_with_load(o):
        return None
    sliding = np.linspace(0.0, REACH * o.width, POINTS)
    mu = motion.regularised_frictions(o, sliding, np.full(POINTS, o.normal_load)) / o.normal_load
    top = int(mu.argmax())
    return Peak(float(sliding[top]), float(mu[top])) if top < POINTS - 1 else None


def wrongly_held(o: motion.Oscillator, peak: Peak | None, rows: np.ndarray, interval: float) -> str | None:
    """Reason why smoothed friction let the mass go where it holds, or held it against a larger pull; or None.

    `peak` is that of the largest friction, if it has one. Rows are displacement [m] and speed [m/s] at
    samples that follow each other by `interval` [s].
    """
    if peak is None or len(rows) < 2:
        return None
    x, sliding = rows[:, motion.X], o.belt_speed - rows[:, motion.V]
    pull = o.stiffness * x + o.damping * rows[:, motion.V] - o.preload
    slow = (sliding >= 0.0) & (sliding < peak.sliding) & (pull >= 0.0)
    pull, holds = pull + o.normal_stiffness * peak.mu * x, o.normal_load * peak.mu
    # as long as it slides slowly it goes no faster than the belt, and so does the pull
    rise = max(o.stiffness + o.normal_stiffness * peak.mu, 0.0) * o.belt_speed
    largest = pull[:-1] + o.damping * sliding[:-1] + rise * interval
    if np.any(slow[:-1] & (sliding[1:] > peak.sliding) & (largest < holds)):
        return LET_GO
    # Pulled by more than the peak for so long, it has gained the difference in speed: over the peak
    excess = np.maximum(pull[1:] - holds, 0.0)
    since = np.minimum(excess / rise, interval) if rise > 0.0 else np.full(excess.size, interval)
    gained = (excess - 0.5 * rise * since) * since / o.mass
    if np.any(slow[:-1] & slow[1:] & (gained > peak.sliding)):
        return HELD
    return None


def wrongly_stuck(
    o: motion.Oscillator, rows: np.ndarray, interval: float, step: float, rounding: float
) -> str | None:
    """Reason why friction as it is let the mass go where it holds, or held it against a larger pull; or None.

    Rows are those of `wrongly_held`. `step` is that of Moreau's method, a part of the interval [s],
    `rounding` the sliding up to which the mass counts as sticking [m/s].
    """
    return REASONS[stuck_wrongly(o, rows, interval, step, rounding)]


@kernel
def stuck_wrongly(
    o: motion.Oscillator, rows: np.ndarray, interval: float, step: float, rounding: float
) -> int:
    """Place in REASONS of what `wrongly_stuck` returns."""
    any_stuck, farthest = False, 0.0
    for i in range(len(rows)):
        farthest = max(farthest, abs(rows[i, motion.X]))
        any_stuck |= i + 1 < len(rows) and abs(o.belt_speed - rows[i, motion.V]) <= rounding
    if not any_stuck:
        return 0
    way, half = o.belt_speed * interval, 0.5 * o.belt_speed * step
    # sliding counts as sticking, by which friction differs, and a mass let go, until it is faster
    slope = friction_coefficient(o.law, 0.0, o.normal_load)[1]
    unseen = np.sqrt(2.0 * o.mass * o.stiffness * o.belt_speed * rounding)
    unseen += REST * (o.stiffness * farthest + motion.friction_at_rest(o))
    unseen += 2.0 * (o.damping + o.normal_load * abs(slope)) * rounding
    # Carried by the belt through the whole interval it would be held at its end, too. Where a table's
    # friction moves with the load, it could be let go between.
    moves = _moves_with_load(o)
    reason = 0
    for i in range(len(rows) - 1):
        if not abs(o.belt_speed - rows[i, motion.V]) <= rounding:
            continue
        x, later = rows[i, motion.X], rows[i + 1, motion.X]
        if abs(o.belt_speed - rows[i + 1, motion.V]) <= rounding:
            carried = abs(later - x - way) <= REST * (farthest + way)
            if carried and max(_beyond_rest(o, x + half), _beyond_rest(o, later - half)) > unseen:
                return 2
        elif not moves and max(_beyond_rest(o, x), _beyond_rest(o, x + way)) < -unseen:
            reason = 1
    return reason


@kernel
def _beyond_rest(o: motion.Oscillator, x: float) -> float:
    """Pull of the spring less the friction that holds the mass where it sticks [N]."""
    load = motion.normal_load(o, x)
    mu = friction_coefficient(o.law, 0.0, load)[0]
    return abs(o.stiffness * x + o.damping * o.belt_speed - o.preload) - load * (mu + o.excess)


@kernel
def _moves_with_load(o: motion.Oscillator) -> bool:
    """Whether the coefficient of friction changes with the displacement."""
    return o.normal_stiffness != 0.0 and o.law.table_force.size > 1
