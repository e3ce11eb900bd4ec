"""First states, without one nearby: by the belt's own transient, with constant friction, from rest.

By the belt's own widths of friction it settles nearly everywhere. At some loads gaps and pushes of a fine
mesh go round for ever: there friction is widened and dampers reach across gaps, which evens out how elements
follow each other there, and both are led back by Newton's iteration. Where that does not settle either, the
way begins at the belt in its grooves without load, or else at another load. There it begins too where the
belt slips through, since constant friction carries less than a falling one.

Why a transient: Newton's iteration finds a steady state from one nearby only: which elements press, which
cells are apart and which way the rings slide on them are a thousand switches. The transient sets them as the
belt itself does. It is dissipative where friction is constant, so that it settles near enough, unless the
load is more than friction carries: then the belt slips through.
"""

import math
from collections.abc import Callable
from contextlib import suppress

import numpy as np

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, initial_state
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.step_choice import SAFE_SHARE, transverse_limit
from cvt_hpc.models.elastic_belt.transient import StateMarch
from cvt_hpc.models.steady_variator.continuation import (
    AT_HOME,
    ON_THE_WAY,
    OWN,
    Continuation,
    NoSteadyState,
    Widths,
    newton,
)
from cvt_hpc.models.steady_variator.equations import Equations
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.capacity import carried_torque, torque_limit
from cvt_hpc.physics.friction import friction_coefficient
from cvt_hpc.physics.sheaves import axial_element_stiffness

LONGEST_STEP = 9e-6  # [s]: the state is Newton's, the march need only come near
_STIFFEST_FLANKS = 5e11  # [N/m^2]: contact stiffer than that would shorten the step; the march is without
_LEAST_DAMPERS = {"transverse_damping": 500.0, "element_damping": 20.0, "ring_damping": 4.0}  # of a march
_RISE = 0.02  # [s]: the load rises, the start-up's damping fades
ROUNDS, ROUNDS_A_LOOK = 6, 0.3  # of the belt: the march ends; between two tries of Newton's iteration


def settled(parameters: Parameters, equations: Equations, tolerance: float) -> np.ndarray | Outcome:
    """Return the steady unknowns, (n,), that a transient comes to, with mesh and start of the run [SI].

    Otherwise the outcome of the march, OK if it has not settled in time. `equations` are those of the belt
    under its load and with the friction that it has; `tolerance` is that of Newton's iteration.
    """
    own = axial_element_stiffness(parameters)
    softened = min(own, _STIFFEST_FLANKS)
    p = {**parameters, "flank_stiffness": softened, "element_factor": 1.0}
    whole = equations.belt
    belt = whole._replace(
        bridging_stiffness=np.inf,
        rise_time=_RISE,
        ramp_end=_RISE,
        load_start=whole.load,
        driving=whole.driving._replace(element_stiffness=softened),
        driven=whole.driven._replace(element_stiffness=softened),
        **{key: max(least, getattr(whole, key)) for key, least in _LEAST_DAMPERS.items()},
    )
    step = min(LONGEST_STEP, SAFE_SHARE * transverse_limit(p))
    around = belt.cell.sum() / belt.belt_speed
    look = max(round(ROUNDS_A_LOOK * around / step), 1)
    force = np.empty(belt.cell.size)
    softer = 1.0 / softened - 1.0 / own
    pressed_in = softer / (2.0 * np.tan(belt.half_wedge_angle))
    run = StateMarch([belt], [initial_state(p, belt)])
    run.advance(round(_RISE / step), step)
    for _ in range(round(ROUNDS / ROUNDS_A_LOOK)):
        run.advance(look, step)
        if run.outcome() is not Outcome.OK:
            return run.outcome()
        state = run.state()
        contact_forces(belt, state, fresh_contacts(belt), force)
        # as far out as flanks of the belt's own stiffness carry the same force
        state.fields[f.W] += np.maximum(force, 0.0) * pressed_in
        found = newton(equations, equations.unknowns(state), tolerance, sided=False)
        if found is not None:
            return found
    return Outcome.OK


_NARROWING = 0.3  # first step of friction and dampers on their way back, of the whole path
# [m/s]: regularisation speeds of flanks and rings where they are widened, at _SLOWEST_MARCH and above
WIDE, RING_WIDE = 0.3, 10.0
_SLOWEST_MARCH = 50.0  # [rad/s]: a slower belt takes too long to settle, and a faster one like it is marched
# Where the way begins if not at the load: shares of a load under which the belt slips through; loads beside
# one under which it does not settle, in shares of the load that friction carries. From which of them Newton's
# iteration comes through on a fine mesh follows no rule: at 240 stations and 100 N m from the last one, not
# from the first four.
LESS, BESIDE = 0.8 ** np.arange(1, 8), (0.1, -0.1, 0.2, -0.2, 0.15, -0.15)
SMALL = 0.1  # of the load that friction carries: a belt settles under it, and others are reached from there
_MOST_FORCE = 2.0  # of the thrust: axial forces on either pulley are below


class SlipsThrough(NoSteadyState):
    """The load is more than friction carries."""


class FirstStates:
    """First states of one belt, from its resolved parameters [SI] and its continuation."""

    def __init__(self, parameters: Parameters, continuation: Continuation) -> None:
        self._parameters, self._course = parameters, continuation
        belt = continuation.whole
        slow = min(belt.driving_speed / _SLOWEST_MARCH, 1.0)
        self._wide = (
            max(slow * WIDE / belt.friction_speed, 1.0),
            max(slow * RING_WIDE / belt.ring_friction_speed, 1.0),
        )

    def under(self, load: float, rise: Callable[[np.ndarray, float, float], np.ndarray]) -> np.ndarray:
        """Return the unknowns under a load at the driving pulley [N m].

        rise(x, start, load) gives the unknowns under a load from those under another one.

        Raises
        ------
        SlipsThrough
            Where the belt itself slips through from rest, and states under less load do not reach so far.
        NoSteadyState
            Where no way comes through.
        """
        self._refuse_creep(load)
        missed: NoSteadyState
        try:
            return self._settled(load)
        except SlipsThrough as error:
            missed, others = error, [share * load for share in LESS]
        except NoSteadyState as error:
            most = carried_torque(self._parameters)
            missed, others = error, [load + part * most for part in BESIDE]
            others.append(math.copysign(SMALL * most, load))
            with suppress(NoSteadyState):
                x = self._unmarched()
                return rise(x, 0.0, load) if load != 0.0 else x
        slips = isinstance(missed, SlipsThrough)
        for other in others:
            try:
                x = self._settled(other)
            except NoSteadyState:
                continue
            try:
                return rise(x, other, load)
            except NoSteadyState as error:
                missed = error
                if slips:  # loads below begin on the same curve
                    break
        if not slips:
            raise missed
        try:  # falling friction may carry more
            return self._settle(load, OWN, 1.0)
        except SlipsThrough as error:
            raise SlipsThrough(str(error), missed.reach) from None
        except NoSteadyState:
            raise missed from None

    def _refuse_creep(self, load: float) -> None:
        """Refuse a load that friction carries by sliding faster alone than the belt runs."""
        belt = self._course.whole
        least = least_sliding(belt, load)
        if least > belt.belt_speed:
            raise NoSteadyState(
                f"no steady state under {load:g} N m: friction, regularised over {belt.friction_speed:g} m/s,"
                f" carries that from {least:.2g} m/s of sliding on, and the belt runs at"
                f" {belt.belt_speed:.2g} m/s"
            )

    def _settled(self, load: float) -> np.ndarray:
        """Unknowns by a transient with friction over its own widths, else over wide ones."""
        try:
            return self._settle(load, OWN)
        except SlipsThrough:
            raise
        except NoSteadyState:
            return self._settle(load, self._wide)

    def _settle(self, load: float, wide: Widths, falling: float = 0.0) -> np.ndarray:
        """Unknowns by a transient with friction that is constant (falling: 0) or the belt's own (1)."""
        course = self._course
        whole = course.whole
        course.load(load)
        course.bridge(float(wide == OWN))
        faster = max(_SLOWEST_MARCH / whole.driving_speed, 1.0)
        course.friction(falling, wide)
        course.faster(faster, 0.0, wide)
        x = settled(self._parameters, course.equations, ON_THE_WAY)
        if isinstance(x, Outcome):
            # a load that the driven pulley takes can only slow it; a march that diverges may end at either
            if x is (Outcome.SLIPPED_THROUGH if load > 0.0 else Outcome.RAN_AWAY):
                raise SlipsThrough(f"no steady state: the belt slips through under {load:g} N m")
            raise NoSteadyState(f"no steady state found: the belt does not settle under {load:g} N m")
        if faster > 1.0:
            name = f"belt slowed down at {load:g} N m"
            x = course.follow(lambda share: course.faster(faster, share, wide), x, 1.0, name)
            for speeds in (course.equations.memories, slice(-4, -1)):  # all others are no speeds
                x[speeds] /= faster
            course.faster(1.0, 1.0, wide)
        return self._narrowed(x, load, wide)

    def _unmarched(self) -> np.ndarray:
        """Unknowns without load, from the belt in its grooves: near where elements do not press."""
        course = self._course
        course.own()
        course.load(0.0)
        course.friction(0.0, self._wide)
        course.bridge(0.0)
        x = course.equations.unknowns(initial_state(self._parameters, course.whole))
        if (found := newton(course.equations, x, ON_THE_WAY, sided=False)) is None:
            raise NoSteadyState("no steady state found without load and with widened friction")
        return self._narrowed(found, 0.0, self._wide)

    def _narrowed(self, x: np.ndarray, load: float, wide: Widths) -> np.ndarray:
        """Unknowns with the belt's own friction and dampers."""
        course, step = self._course, 1.0 if wide == OWN else _NARROWING
        name = f"friction narrowed at {load:g} N m"
        x = course.follow(lambda share: course.friction(share, wide), x, step, name)
        return course.follow(course.bridge, x, step, f"dampers drawn back at {load:g} N m", AT_HOME)


def least_sliding(belt: Belt, load: float) -> float:
    """Sliding [m/s] that a load takes at the least, by the regularisation; 0 beyond the limit of friction."""
    coefficient, _ = friction_coefficient(belt.law, 0.0, 0.0)
    most = torque_limit(coefficient, _MOST_FORCE * belt.thrust, belt.driving_radius, belt.half_wedge_angle)
    share = abs(load) / most
    return float(belt.friction_speed * math.atanh(share)) if share < 1.0 else 0.0
