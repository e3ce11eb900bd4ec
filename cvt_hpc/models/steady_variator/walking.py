"""Steady states of a belt: a first one by the transient, further ones along the load or along their curve.

Corners of the push force are sharp: each state begins at the one before, and a step that fails is made again
in quarters. Where the load does not separate states, the arc of their curve does (`curve.py`).

Steady states of free pulleys begin at that of the same belt between pulleys that are not. The hold on the
pulleys is released little by little: the residual that the free equations have in the held state is taken
down along a path (Newton's homotopy), r(x) = (1 - share) r(x_held). Only the pulleys' equations have one to
begin with.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq, minimize_scalar
from scipy.sparse import csc_array

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, State, belt_constants
from cvt_hpc.models.elastic_belt.one_system import pulled_by
from cvt_hpc.models.elastic_belt.pulley_settings import DRIVEN_INERTIA, PULLEY_DEFAULTS, are_free
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts
from cvt_hpc.models.elastic_belt.transient import sampled
from cvt_hpc.models.elastic_belt.validity import reach_doubt
from cvt_hpc.models.steady_variator import OF_THE_COURSE
from cvt_hpc.models.steady_variator.continuation import AT_HOME, Continuation, NoSteadyState, PathEnds
from cvt_hpc.models.steady_variator.curve import Curve
from cvt_hpc.models.steady_variator.equations import Equations
from cvt_hpc.models.steady_variator.first_states import FirstStates
from cvt_hpc.parameters import Parameters
from cvt_hpc.variator import GROSS_SLIP, PULLEYS
from cvt_hpc.variator.scene import measures

# Keys that free a pulley, each with a value that does not
_OF_DRIVING = ("driving_inertia", "driving_axial")
_OF_BOTH = ("clamping", "tilt_lag", "collar_clearance", "bearing_clearance")
_OF_EACH = tuple(f"{pulley}_{key}" for pulley in PULLEYS for key in ("piston", "spring_rate"))
HELD = {key: PULLEY_DEFAULTS[key] for key in (*_OF_DRIVING, *_OF_BOTH, *_OF_EACH)}
# [s], in the default scene: of a tilt that has clearance and no lag; a steady state does not know it
_ANY_LAG = 1e-3


def held(parameters: Parameters) -> dict[str, Any]:
    """Parameters of the same belt between pulleys that turn by a given speed under a constant thrust."""
    found = dict(parameters) | HELD
    if np.isinf(found["driven_inertia"]):
        found["driven_inertia"] = DRIVEN_INERTIA.default
    return found


def freed(parameters: Parameters) -> dict[str, Any] | None:
    """Parameters under which a steady state knows of clearances; None where no pulley is free."""
    p = PULLEY_DEFAULTS | dict(parameters)
    if p["tilt_lag"] == 0.0 and (p["collar_clearance"] or p["bearing_clearance"]):
        p["tilt_lag"] = _ANY_LAG * measures(p).time
    return p if are_free(p) else None


def nearest(whole: Belt, free: Belt, state: State) -> State:
    """Return the state of free pulleys nearest to `state`, one of the `whole` belt, whose pulleys are not."""
    found, force = state.copy(), np.zeros(whole.cell.size)
    contact_forces(whole, state, fresh_contacts(whole), force)
    pull, laws = pulled_by(whole, force, np.zeros_like(force)), free.pulleys.laws[0]
    for wrap, (tilted, give) in enumerate(((f.DRIVING_COS, f.DRIVING_TILT), (f.DRIVEN_COS, f.DRIVEN_TILT))):
        place = f.FIRST_STATE + tilted
        found.scalars[place : place + 2] = laws[give] * pull[4 + 2 * wrap : 6 + 2 * wrap]
    if laws[f.RATIO_RATE] > 0.0:
        found.scalars[f.FIRST_STATE + f.RATIO_SUM] = pull[2]  # the thrust that the held sheave needs
    return found


class Released:
    """The equations of free pulleys on their way from a held state; in the form that `newton` takes.

    `x`, (n,), are the free pulleys' unknowns nearest to the held state; `share` is that of the way, 0 to 1.
    """

    def __init__(self, equations: Equations, x: np.ndarray) -> None:
        self._equations = equations
        self.sizes, self.share = equations.sizes, 0.0
        self._start = equations.residual(x)

    def residual(self, x: np.ndarray) -> np.ndarray | None:
        """Remaining share of the residual of the held state."""
        left = self._equations.residual(x)
        if left is None or self._start is None:
            return None
        return left - (1.0 - self.share) * self._start

    def jacobian(self, x: np.ndarray, sided: bool) -> csc_array:
        """Return the Jacobian, in the form of `Equations`."""
        return self._equations.jacobian(x, sided)


# A load rises no more that has fallen to this share of the largest, while slip has grown by a share of gross
# slip: single cells that open turn the curve back without slip.
FALLEN, GROWN = 0.9, 0.2
SLIDING = 0.5  # slip of a pulley beyond which no state under a load is looked for
WITHIN = 1e-3  # of a step: how closely its largest load is met, which changes the load by the square


class Steady(NamedTuple):
    """A steady state."""

    load: float  # torque at the driving pulley [N m]
    belt: Belt  # constants under that load
    state: State  # of the belt, its time after any start-up
    unknowns: np.ndarray  # those of the `Equations`, (n,)

    @property
    def largest_slip(self) -> float:
        """Tangential sliding over belt speed, of the pulley that slips more [1]."""
        seen = sampled(self.belt, self.state).channels()
        return max(abs(seen[f"slip {pulley}"]) for pulley in PULLEYS)


class Between(NamedTuple):
    """Two neighbours on the curve of states, and those between them."""

    low: Steady
    high: Steady
    # at(share): the state at a share of the step from low to high; NoSteadyState where none is found
    at: Callable[[float], Steady]

    def where(self, value: Callable[[Steady], float], wanted: float) -> Steady | None:
        """State with a value that lies between those of the neighbours; None if not found between them."""

        def beyond(share: float) -> float:
            state = self.low if share == 0.0 else self.high if share == 1.0 else self.at(share)
            return value(state) - wanted

        try:
            return self.at(brentq(beyond, 0.0, 1.0))
        except NoSteadyState:
            return None

    def most(self, direction: float) -> Steady:
        """State of the largest load in a direction."""
        tried = [self.low, self.high]

        def less(share: float) -> float:
            try:
                tried.append(self.at(share))
            except NoSteadyState:
                return math.inf
            return -direction * tried[-1].load

        minimize_scalar(less, bounds=(0.0, 1.0), method="bounded", options={"xatol": WITHIN})
        return max(tried, key=lambda one: direction * one.load)


class SteadyBelt:
    """Steady states of one belt along its load; the course in its resolved parameters [SI] does not count."""

    def __init__(self, parameters: Parameters) -> None:
        given = {**parameters, **OF_THE_COURSE, "load": 0.0}
        free = freed(given)
        self._free = None if free is None else Equations(free, belt_constants(free))
        p = given if free is None else held(given)
        self._course = Continuation(p)
        self._equations = self._course.equations
        self._own = self._equations if self._free is None else self._free
        self._first = FirstStates(p, self._course)

    def at(self, load: float, near: Steady | None = None) -> Steady:
        """Return the state under a load at the driving pulley [N m].

        The continuation begins at `near`, a state of this belt; without it, or where that fails, a first
        state is made.

        Raises
        ------
        SlipsThrough
            Where the belt slips through.
        NoSteadyState
            Where no continuation succeeds.
        """
        load = float(load)  # kernels would be compiled anew for whole numbers
        if self._free is not None:
            return self._released(self._free, load, near)
        if near is not None:
            try:
                return self._found(self._rise(near.unknowns, near.load, load), load)
            except NoSteadyState:
                pass
        return self._found(self._first.under(load, self._rise), load)

    def _released(self, free: Equations, load: float, near: Steady | None) -> Steady:
        """State of free pulleys: from one nearby, or else from that of the belt between held ones."""
        if near is not None:

            def loaded(share: float) -> None:
                changed = near.load + share * (load - near.load)
                free.under(load=changed, load_start=changed)

            try:
                x = self._course.follow(loaded, near.unknowns, 1.0, "load", AT_HOME, free)
                return self._state_of(free, x, load)
            except NoSteadyState:
                pass
        start = self._found(self._first.under(load, self._rise), load)
        free.under(load=load, load_start=load)
        x = free.unknowns(nearest(start.belt, free.belt, start.state))
        way = Released(free, x)

        def release(share: float) -> None:
            way.share = share

        x = self._course.follow(release, x, 1.0, f"pulleys let go at {load:g} N m", AT_HOME, way)
        return self._state_of(free, x, load)

    @staticmethod
    def _state_of(equations: Equations, x: np.ndarray, load: float) -> Steady:
        equations.under(load=load, load_start=load)
        belt, state = equations.belt._replace(bridging_stiffness=np.inf), equations.state(x)
        force = np.empty(belt.cell.size)
        contact_forces(belt, state, fresh_contacts(belt), force)
        if doubt := reach_doubt(force, (belt.driving_stations, belt.driven_stations)):
            raise NoSteadyState(doubt[1])
        return Steady(load, belt, state, x)

    def known(self, load: float, unknowns: np.ndarray) -> Steady:
        """State under a load, by unknowns that were found before; ValueError if they are not of this belt."""
        if unknowns.shape != self._own.sizes.shape:
            raise ValueError(f"{unknowns.shape} unknowns of a belt that has {self._own.sizes.shape}")
        load = float(load)
        if self._free is not None:
            return self._state_of(self._free, unknowns, load)
        self._course.own()
        self._course.load(load)
        return self._found(unknowns, load)

    def along(self, loads: Sequence[float]) -> Iterator[Steady]:
        """States under several loads in their order, each from the one before."""
        near = None
        for load in loads:
            near = self.at(load, near)
            yield near

    def along_curve(self, near: Steady, sign: float) -> Iterator[Steady]:
        """States along their curve; the driven pulley turns slower (sign -1) or faster (1) at first.

        As far as they are found; in the direction in which the load's size grows they continue past the
        largest torque that friction carries. Not of a driven pulley whose speed is given.
        """
        for step in self._steps(self._own, near, sign):
            yield step.high

    def _steps(self, equations: Equations, near: Steady, sign: float) -> Iterator[Between]:
        """Yield steps as `along_curve`, of free pulleys or of held ones, with the states in between."""
        curve = Curve(equations, AT_HOME)

        def alone() -> None:
            self._course.own()
            equations.under(load=0.0, load_start=0.0)

        def at(within: Callable[[float], tuple[np.ndarray, float] | None], share: float) -> Steady:
            alone()
            if (found := within(share)) is None:
                raise NoSteadyState("no steady state found within a step of their curve")
            return self._state_of(equations, *found)

        alone()
        for found, load in curve.along(near.unknowns, sign):
            state = self._state_of(equations, found, load)
            yield Between(near, state, partial(at, curve.within))
            near = state
            alone()

    def carried(self, near: Steady) -> Steady:
        """Return the state at the largest load that friction carries while neither pulley slips grossly.

        The load of `near`, where it begins, gives the direction in which power flows.

        Raises
        ------
        NoSteadyState
            Where states end before the load falls or a pulley slips grossly.
        """
        direction = -1.0 if near.load < 0.0 else 1.0
        if near.largest_slip > GROSS_SLIP:
            raise NoSteadyState(f"no largest load found: at {near.load:.4g} N m a pulley slips grossly")
        most, last, beside = near, near, list[Between]()
        for step in self._steps(self._own, near, -direction):
            state = step.high
            if slips := state.largest_slip > GROSS_SLIP:
                state = step.where(lambda one: one.largest_slip, GROSS_SLIP) or last
            if direction * state.load > direction * most.load:
                most, beside = state, [step]
            elif most is last:
                beside.append(step)
            last = state
            fallen = direction * state.load < FALLEN * direction * most.load
            if slips or (fallen and state.largest_slip > most.largest_slip + GROWN * GROSS_SLIP):
                turns = [one.most(direction) for one in beside]
                sound = [one for one in turns if one.largest_slip <= GROSS_SLIP]
                return max([most, *sound], key=lambda one: direction * one.load)
        raise NoSteadyState(
            f"no largest load found: from {near.load:.4g} N m states reach to {last.load:.4g} N m"
        )

    def _found(self, x: np.ndarray, load: float) -> Steady:
        return self._state_of(self._equations, x, load)

    def _rise(self, x: np.ndarray, start: float, load: float) -> np.ndarray:
        """Unknowns under more load; near the limit of friction along the curve of states."""
        try:
            return self._walk(x, start, load)
        except PathEnds as ended:
            x, reached = ended.x, start + ended.share * (load - start)
        farthest, sign = reached, 1.0 if load < reached else -1.0  # a larger load slows the driven pulley
        for step in self._steps(self._equations, self._found(x, reached), sign):
            before, state = step.low, step.high
            if (before.load - load) * (state.load - load) <= 0.0:
                if (found := step.where(lambda one: one.load, load)) is not None:
                    return found.unknowns
            farthest = min(farthest, state.load) if load < reached else max(farthest, state.load)
            if state.largest_slip > SLIDING:
                break
        reach = f"from {start:.4g} N m they reach to {farthest:.4g} N m"
        raise NoSteadyState(f"no steady state found at {load:g} N m", reach)

    def _walk(self, x: np.ndarray, start: float, end: float) -> np.ndarray:
        """Unknowns under another load."""
        self._course.own()

        def loaded(share: float) -> None:
            self._course.load(start + share * (end - start))

        return self._course.follow(loaded, x, 1.0, f"load from {start:g} to {end:g} N m", AT_HOME)
