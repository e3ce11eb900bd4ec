"""A transient run of the oscillator.

Whether a method silences a vibration that friction drives: small swings about steady sliding.

At the belt's speed v the mass can slide steadily. There a friction that falls by (N mu)' < 0 drives small
swings at the rate s = -(c + (N mu)') / (2 m). A method whose damping is stronger turns their growth into
decay, whatever the order, and a run by it is silent where the model vibrates.

Whether a run has the model's friction at rest: limits of step and tolerance, and checks of the samples.

Smoothed friction N mu over the sliding speed s = v_belt - x' rises to a peak and falls beyond. With the pull
p = k x + c x' - P of the spring, m s' = p - N mu(s): a mass that slides slower than at the peak passes it
only while the pull exceeds friction there, and has to once it does. With N = N_0 - n x that is p + n
mu_peak x against N_0 mu_peak. It holds for the model's own motion whatever the stepper; a run that breaks
it shows a stick-slip that friction does not make.

Friction as it is has no peak and no width: the mass sticks, s = 0, as long as |p| <= N mu at rest, and not
longer. Moreau's steps compare the two in their middle, so a mass that sticks over an interval is held rightly
if it is in the middle of the first step and of the last.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.models.marched import MarchedRun, Probe, batches_of_one
from cvt_hpc.models.oscillator import motion
from cvt_hpc.physics.friction import friction_coefficient, friction_coefficients
from cvt_hpc.steppers.facts import Facts, Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import SetValuedSystem, System

LET_GO = "the mass was let go while friction at rest still holds it"
HELD = "the mass was held against a pull beyond friction at rest"
REST = 1e-9  # of the mass' largest speed: sliding that rounding may leave while friction holds
# Of the search for the peak, in units of v_reg; it is found within 1e-6
REACH, POINTS = 2.0 * motion.HUMP, 2401

SMALL = 1e-3  # of the belt's speed: the swing, within which friction is a straight line

CHANNELS = ("speed",)


class Transient(MarchedRun):
    """One run of the oscillator, advanced sample by sample.

    A run ends as failed where its friction at rest is not that of the model (`rest`): at the first sample
    within a step of rest, should step or tolerance be too coarse to find rest; and wherever the mass was let
    go by less, or held against more, than friction can do. So does a run whose step damps a vibration about
    steady sliding that friction drives (`slide`), at its first sample.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    stepper : str
        A stepper that the model takes.

    Attributes
    ----------
    constants : Oscillator
        Of the equations.
    is_set_valued : bool
        Whether friction jumps at rest; else the jump is smoothed, and sticking is creep.
    """

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        self.is_set_valued = stepper == "moreau"
        equations = (motion.set_valued_system if self.is_set_valued else motion.system)(parameters)
        self.constants = o = motion.oscillator(parameters)
        self._peak = peak(o)
        probes = (Probe("mass", 0.0),)
        frequency = np.sqrt(o.stiffness / o.mass)
        start = motion.initial_state(parameters)
        super().__init__(parameters, stepper, equations, start, probes, (motion.X,), frequency)
        self._silenced = None
        if not self.marching.facts.adaptive:
            self._silenced = silenced(o, equations, stepper, parameters, self.interval)
        self._typical_speed = float(equations.scale[motion.V])
        self._allowed = parameters.get("tolerance", 0.0) * self._typical_speed

    def _doubt(self, first: int) -> str | None:
        seen = self.rows[max(first - 1, 0) : self.done]
        o = self.constants
        missed = rest_missed(o, self.marching.facts, self.step, self._allowed, seen) or self._silenced
        if missed or not self.is_set_valued:
            return missed or wrongly_held(o, self._peak, seen, self.interval)
        return wrongly_stuck(o, seen, self.interval, self.step, self._slowest)

    @property
    def contact_solves(self) -> int:
        """Solves of the contact with the belt so far; none where friction is smoothed."""
        return self.counters()["solves"] if self.is_set_valued else 0

    @property
    def first_judged(self) -> int:
        """Samples before the judged part."""
        return self.samples - round(self.parameters["judged_fraction"] * self.samples)

    @property
    def is_stuck(self) -> np.ndarray:
        """Whether the mass sticks, or with smoothed friction creeps, at each sample so far, (done,) bool."""
        return np.abs(self.constants.belt_speed - self.channel("speed")) <= self._slowest

    @property
    def _slowest(self) -> float:
        """Sliding [m/s] up to which the mass sticks or creeps."""
        if self.is_set_valued:
            return REST * float(np.abs(self.channel("speed")).max(initial=self._typical_speed))
        return motion.HUMP * self.constants.width

    def friction(self) -> np.ndarray:
        """Friction force on the mass at each sample so far, (done,) [N]."""
        o, x, v = self.constants, self.displacement[:, 0], self.channel("speed")
        sliding, load = o.belt_speed - v, motion.normal_load(o, x)
        if not self.is_set_valued:
            return motion.regularised_frictions(o, sliding, load)
        holding = o.stiffness * x + o.damping * v - o.preload
        level = load * friction_coefficients(o.law, np.abs(sliding), load)
        return np.where(self.is_stuck, holding, np.copysign(level, sliding))

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): speed of the mass [m/s]."""
        return self.rows[: self.done, {"speed": motion.V}[name]]


batch = batches_of_one(Transient)


def silenced(
    o: motion.Oscillator,
    system: System | SetValuedSystem,
    stepper: str,
    parameters: Mapping[str, Any],
    interval: float,
) -> str | None:
    """Decide whether a method damps small swings about steady sliding that friction drives.

    Parameters
    ----------
    o : Oscillator
        Constants.
    system : System or SetValuedSystem
        Its equations, as the stepper needs them.
    stepper : str
        One with a fixed step.
    parameters : mapping
        Resolved parameters of the run [SI].
    interval : float
        Sampling interval [s].

    Returns
    -------
    str or None
        The reason, where it does.
    """
    if o.belt_speed == 0.0:
        return None
    load = motion.normal_load(o, motion.steady_sliding(o).displacement)
    speeds = [o.belt_speed * part for part in (1.0 - SMALL, 1.0, 1.0 + SMALL)]
    if isinstance(system, SetValuedSystem):
        slower, mu, faster = (friction_coefficient(o.law, speed, load)[0] for speed in speeds)
    else:
        slower, mu, faster = (motion.regularised_friction(o, speed, load) / load for speed in speeds)
    true = -0.5 * (o.damping + load * (faster - slower) / (2.0 * SMALL * o.belt_speed)) / o.mass
    stiffness = o.stiffness + o.normal_stiffness * mu
    frequency = np.sqrt(max(stiffness, 0.0) / o.mass)
    if not 0.0 < true < frequency:
        return None
    rest = (o.preload + o.normal_load * mu) / stiffness
    start = np.array([rest + SMALL * o.belt_speed / frequency, 0.0])
    rows = np.empty((int(np.ceil(2.0 * np.pi / frequency / interval)) + 1, 2))
    if Marching(stepper, parameters, system, start, interval).advance(rows) != Result.OK:
        return None  # the run itself will report it
    away, speed = rows[:, 0] - rest, rows[:, 1]
    # exp(2 s t) without ripple, for swings that grow at the rate s
    energy = (speed - true * away) ** 2 + (frequency**2 - true**2) * away**2
    found = 0.5 * np.log(energy[-1] / energy[0]) / (interval * (len(rows) - 1))
    if found > 0.0:
        return None
    return f"the step damps, at {-found:.3g} 1/s, a vibration that friction drives at {true:.3g} 1/s"


class Peak(NamedTuple):
    """Largest friction: where over the sliding speed [m/s], and its coefficient [1]."""

    sliding: float
    mu: float


def rest_missed(
    o: motion.Oscillator, facts: Facts, step: float, allowed: float, rows: np.ndarray
) -> str | None:
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
    """Decide whether smoothed friction released the mass where it holds, or held it against a larger pull.

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
    """Decide whether friction as it is released the mass where it holds, or held it against a larger pull.

    Parameters
    ----------
    o : Oscillator
        Constants.
    rows : (n, 2) array
        Displacement [m] and speed [m/s] at samples that follow each other.
    interval, step : float
        Sampling interval, and the step of Moreau's method, a part of it [s].
    rounding : float
        Sliding up to which the mass counts as sticking [m/s].

    Returns
    -------
    str or None
        The reason, where it was.
    """
    x, stuck = rows[:, motion.X], np.abs(o.belt_speed - rows[:, motion.V]) <= rounding
    if not np.any(stuck[:-1]):
        return None
    way, half, farthest = o.belt_speed * interval, 0.5 * o.belt_speed * step, np.abs(x).max()
    # sliding counts as sticking, by which friction differs, and a mass let go, until it is faster
    slope = friction_coefficient(o.law, 0.0, o.normal_load)[1]
    unseen = np.sqrt(2.0 * o.mass * o.stiffness * o.belt_speed * rounding)
    unseen += REST * (o.stiffness * farthest + motion.friction_at_rest(o))
    unseen += 2.0 * (o.damping + o.normal_load * abs(slope)) * rounding
    whole = stuck[:-1] & stuck[1:] & (np.abs(np.diff(x) - way) <= REST * (farthest + way))
    if np.any(whole & (_beyond_rest(o, x[:-1] + half, x[1:] - half) > unseen)):
        return HELD
    # Carried by the belt through the whole interval it would be held at its end, too. Where a table's
    # friction moves with the load, it could be let go between.
    let_go = stuck[:-1] & ~stuck[1:] & (not _moves_with_load(o))
    return LET_GO if np.any(let_go & (_beyond_rest(o, x[:-1], x[:-1] + way) < -unseen)) else None


def _beyond_rest(o: motion.Oscillator, *places: np.ndarray) -> np.ndarray:
    """Pull of the spring less the friction that holds the mass where it sticks: the largest of places [m]."""
    beyond = []
    for x in places:
        load = motion.normal_load(o, x)
        mu = friction_coefficients(o.law, np.zeros_like(x), load) + o.excess
        beyond.append(np.abs(o.stiffness * x + o.damping * o.belt_speed - o.preload) - load * mu)
    return np.max(beyond, axis=0)


def _moves_with_load(o: motion.Oscillator) -> bool:
    """Whether the coefficient of friction changes with the displacement."""
    return o.normal_stiffness != 0.0 and o.law.table_force.size > 1
