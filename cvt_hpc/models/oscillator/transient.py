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

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.marched import MarchedRun, Probe, batches_of_one
from cvt_hpc.models.oscillator import motion
from cvt_hpc.models.oscillator.lanes import ENDED, Lane, Lanes, march
from cvt_hpc.physics.friction import friction_coefficient
from cvt_hpc.recording import sample_count, steps_per_sample
from cvt_hpc.steppers.facts import OK, STEPS, Facts, Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import SetValuedSystem, System
from cvt_hpc.variables import Status

LET_GO = "the mass was let go while friction at rest still holds it"
HELD = "the mass was held against a pull beyond friction at rest"
REASONS = None, LET_GO, HELD
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
        self._peak = None if self.is_set_valued else peak(o)
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
        return wrongly_stuck(o, seen, self.interval, self.step, self.slowest)

    @cached_property
    def steady(self) -> motion.SteadySliding:
        """Steady sliding of the mass."""
        return motion.steady_sliding(self.constants)

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
        return np.abs(self.constants.belt_speed - self.channel("speed")) <= self.slowest

    @property
    def slowest(self) -> float:
        """Sliding [m/s] up to which the mass sticks or creeps."""
        if self.is_set_valued:
            return REST * float(np.abs(self.channel("speed")).max(initial=self._typical_speed))
        return motion.HUMP * self.constants.width

    def friction(self) -> np.ndarray:
        """Friction force on the mass at each sample so far, (done,) [N]."""
        several, rows = motion.together([self.constants]), self.rows[np.newaxis, : self.done]
        return motion.friction_forces(several, rows, np.array([self.slowest]), self.is_set_valued)[0]

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): speed of the mass [m/s]."""
        return self.rows[: self.done, {"speed": motion.V}[name]]


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
    swing = Swing(*swing_of(o, isinstance(system, SetValuedSystem)))
    if not swing.is_driven:
        return None
    rows = np.empty((swing.samples(interval), 2))
    if Marching(stepper, parameters, system, swing.start(o.belt_speed), interval).advance(rows) != Result.OK:
        return None  # the run itself will report it
    return swing.silenced(rows[0], rows[-1], interval)


class Swing(NamedTuple):
    """Small swings about steady sliding.

    Attributes
    ----------
    growth, frequency : float
        Growth rate [1/s] and frequency [rad/s]; of a belt at rest no numbers.
    rest : float
        Displacement in steady sliding [m].
    """

    growth: float
    frequency: float
    rest: float

    @property
    def is_driven(self) -> bool:
        """Whether friction drives them."""
        return 0.0 < self.growth < self.frequency

    def samples(self, interval: float) -> int:
        """Return how many samples are a period and more."""
        return int(np.ceil(2.0 * np.pi / self.frequency / interval)) + 1

    def start(self, belt_speed: float) -> np.ndarray:
        """Return a state from which such a swing begins, displacement [m] and speed [m/s]."""
        return np.array([self.rest + SMALL * belt_speed / self.frequency, 0.0])

    def silenced(self, first: np.ndarray, last: np.ndarray, interval: float) -> str | None:
        """Return the reason, where the swing does not grow from the first to the last of its samples."""
        true = self.growth
        away, speed = np.array([first, last]).T - [[self.rest], [0.0]]
        # exp(2 s t) without ripple, for swings that grow at the rate s
        energy = (speed - true * away) ** 2 + (self.frequency**2 - true**2) * away**2
        found = 0.5 * np.log(energy[1] / energy[0]) / (interval * (self.samples(interval) - 1))
        if found > 0.0:
            return None
        return f"the step damps, at {-found:.3g} 1/s, a vibration that friction drives at {true:.3g} 1/s"


@kernel
def swing_of(o: motion.Oscillator, is_set_valued: bool) -> tuple[float, float, float]:
    """Numbers of a `Swing`."""
    load, v = motion.normal_load(o, motion.about_sliding(o)[0]), o.belt_speed
    if is_set_valued:
        slower = friction_coefficient(o.law, v * (1.0 - SMALL), load)[0]
        mu = friction_coefficient(o.law, v, load)[0]
        faster = friction_coefficient(o.law, v * (1.0 + SMALL), load)[0]
    else:
        slower = motion.regularised_friction(o, v * (1.0 - SMALL), load) / load
        mu = motion.regularised_friction(o, v, load) / load
        faster = motion.regularised_friction(o, v * (1.0 + SMALL), load) / load
    growth = -0.5 * (o.damping + load * (faster - slower) / (2.0 * SMALL * v)) / o.mass
    stiffness = o.stiffness + o.normal_stiffness * mu
    return growth, np.sqrt(max(stiffness, 0.0) / o.mass), (o.preload + o.normal_load * mu) / stiffness


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


class LaneRun(Transient):
    """A run of a `Batch`: a `Transient` by `moreau`, whose steps the batch takes."""

    def __init__(
        self, parameters: Mapping[str, Any], constants: motion.Oscillator, steady: motion.SteadySliding
    ) -> None:
        self.is_set_valued, self.constants, self.probes = True, constants, (Probe("mass", 0.0),)
        self.interval, self.done, self.steady = 1.0 / parameters["sampling_rate"], 0, steady
        self.marching: Lane = Lane(parameters, self.interval)
        self._displacements, self._silenced = [motion.X], None
        self._longest = self.marching.facts.vibration_limit / np.sqrt(constants.stiffness / constants.mass)

    def extend(self, parameters: Mapping[str, Any], rows: np.ndarray) -> None:
        """Record in other rows from now on, (samples, 2), of a run over another duration."""
        if self.done:
            rows[: self.done] = self.rows[: self.done]
        self.parameters, self.samples, self.rows = parameters, len(rows), rows

    def end(self, outcome: Result, stuck: str | None) -> None:
        """Fail, by the outcome of the march, or by what it did with the mass."""
        wrong = self._too_long()
        if outcome == Result.OK:
            wrong = wrong or self._silenced or stuck
        else:
            wrong = wrong or self.marching.explain(outcome)
        self.failure = Status.FAILED_NUMERICS, str(wrong)

    @property
    def slowest(self) -> float:
        """Sliding [m/s] up to which the mass sticks."""
        return REST * float(self.marching.lanes.fastest[self.marching.place])


class Batch:
    """Runs of the oscillator that advance together, by `moreau`.

    They are looked at after 1, 3, 7, 15, ... samples of the batch, whatever runs there are and however long
    these take, and so end with the numbers that they have alone.

    Parameters
    ----------
    points : sequence of dict
        Resolved parameters of the runs [SI], all of one `lane_key`.
    paused : sequence of LaneRun
        Shorter runs of the same points, from which they continue.

    Attributes
    ----------
    runs, samples, done, interval
        As in every batch.
    """

    def __init__(self, points: Sequence[Mapping[str, Any]], paused: Sequence[LaneRun] = ()) -> None:
        count, p = len(points), points[0]
        self.interval, self.samples, self.done = 1.0 / p["sampling_rate"], sample_count(p), 0
        self._steps = steps_per_sample(self.interval, p["step"])
        each = [run.constants for run in paused] or [motion.oscillator(point) for point in points]
        self._several = several = motion.together(each)
        self._rows, self._lanes = np.full((count, self.samples, 2), np.nan), Lanes.at(np.zeros((count, 2)))
        if paused:
            self.runs, self.done = tuple(paused), paused[0].done
            for place, run in enumerate(self.runs):
                run.marching.go_over(self._lanes, place)
        else:
            known = np.empty((count, 7))
            _know(several, known)
            self._lanes.fastest[:] = known[:, 3]
            steady = [motion.sliding_with(*numbers[:3]) for numbers in known.tolist()]
            self.runs = tuple(map(LaneRun, points, each, steady))
            for place, (point, run) in enumerate(zip(points, self.runs, strict=True)):
                self._lanes.state[place] = motion.initial_state(point, run.steady)
                run.marching.enter(self._lanes, place)
            self._find_silenced([Swing(*numbers[4:]) for numbers in known.tolist()])
        for point, run, rows in zip(points, self.runs, self._rows, strict=True):
            run.extend(point, rows)
        self._longest = np.array([run._longest for run in self.runs])
        self._seen, self._border = self.done, self.done + 1

    def _find_silenced(self, swings: Sequence[Swing]) -> None:
        """Note of which runs the step damps a vibration that friction drives."""
        driven = [(run, swing) for run, swing in zip(self.runs, swings, strict=True) if swing.is_driven]
        if not driven:
            return
        lengths = [swing.samples(self.interval) for _, swing in driven]
        rows = np.full((len(driven), max(lengths), 2), np.nan)
        lanes = Lanes.at(np.array([swing.start(run.constants.belt_speed) for run, swing in driven]))
        march(motion.together([run.constants for run, _ in driven]), lanes, self.interval, self._steps, rows)
        for (run, swing), own, length in zip(driven, rows, lengths, strict=True):
            if not np.isnan(own[length - 1, 0]):  # else the run itself will report it
                run._silenced = swing.silenced(own[0], own[length - 1], self.interval)

    @property
    def running(self) -> bool:
        """Whether any run has not ended."""
        return self.done < self.samples and bool((self._lanes.outcome == OK).any())

    def advance(self, samples: int) -> None:
        """March on.

        Parameters
        ----------
        samples : int
            How many samples at most; 0 compiles only.
        """
        last = min(self.done + samples, self.samples)
        while True:
            piece = self._rows[:, self.done : min(last, self._border)]
            march(self._several, self._lanes, self.interval, self._steps, piece)
            self.done += piece.shape[1]
            if self.done in (self._border, self.samples) or not self.running:
                self._look()
            if self.done == last or not self.running:
                return

    def _look(self) -> None:
        """Take the samples since the last look into the runs, and end those that cannot continue."""
        lanes, found = self._lanes, np.zeros(len(self.runs), np.int64)
        _look_at(self._several, lanes, self._rows, self._seen, self.done, self.interval, found)
        steps = lanes.clock / np.maximum(lanes.counts[:, STEPS], 1)
        doubtful = (lanes.outcome != OK) | (found != 0) | (steps > self._longest)
        for place, run in enumerate(self.runs):
            if run.failure is None:
                if lanes.outcome[place] == OK:
                    run.done = self.done
                if doubtful[place] or run._silenced:
                    run.end(Result(lanes.outcome[place]), REASONS[found[place]])
                    lanes.outcome[place] = ENDED
        self._seen, self._border = self.done, self.done + 2 * (self.done - self._seen)


@kernel
def _know(several: Any, known: np.ndarray) -> None:
    """Write the numbers of `about_sliding`, the typical speed, and those of `swing_of`, (run, 7)."""
    for k in range(len(known)):
        o = motion.one_of(several, k)
        known[k, 0], known[k, 1], known[k, 2] = motion.about_sliding(o)
        known[k, 3] = motion.typical_sizes(o)[1]
        known[k, 4], known[k, 5], known[k, 6] = swing_of(o, True)


@kernel
def _look_at(
    several: Any,
    lanes: Lanes,
    rows: np.ndarray,
    first: int,
    last: int,
    interval: float,
    found: np.ndarray,
) -> None:
    """Write the places in REASONS of runs (run,), by the samples from `first` on and the one before."""
    for k in range(len(found)):
        if lanes.outcome[k] == OK:
            for i in range(first, last):
                lanes.fastest[k] = max(lanes.fastest[k], abs(rows[k, i, motion.V]))
            step, rounding = lanes.clock[k] / lanes.counts[k, STEPS], REST * lanes.fastest[k]
            seen = rows[k, max(first - 1, 0) : last]
            found[k] = stuck_wrongly(motion.one_of(several, k), seen, interval, step, rounding)


def batch(points: Sequence[Mapping[str, Any]], stepper: str, paused: Sequence[Any] = ()) -> Any:
    """Runs that advance together: several by `moreau`, one by the others."""
    if stepper == "moreau":
        return Batch(points, paused)
    return batches_of_one(Transient)(points, stepper, paused)
