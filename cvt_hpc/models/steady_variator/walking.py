"""Steady states: a first one by the transient, narrowed to the belt's own friction; further ones by load.

The march is one with constant friction over wide ranges of sliding. Until friction is narrowed, dampers reach
across gaps, which evens out how elements follow each other there; then they are drawn back. Corners are sharp
from then on: each state begins at the one before, and a step that fails is made again in quarters. Where a
march does not settle, the belt in its grooves without load is the start, the corner of the push force rounded
off first, then less and less.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.models.elastic_belt.belt import Belt, State, belt_constants
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.steady_variator.braked import Braked
from cvt_hpc.models.steady_variator.equations import SPEED, Equations
from cvt_hpc.models.steady_variator.newton import Solvable, newton
from cvt_hpc.models.steady_variator.parameters import OF_THE_COURSE
from cvt_hpc.models.steady_variator.released import Released, freed, held, nearest
from cvt_hpc.models.steady_variator.sampled import largest_slip
from cvt_hpc.models.steady_variator.settling import settled
from cvt_hpc.physics.capacity import carried_torque
from cvt_hpc.physics.friction import softened
from cvt_hpc.variator import GROSS_SLIP

BRIDGING = 10.0  # [N]: dampers push by 100 N or so, which a gap's strain times this does not reach
ON_THE_WAY, AT_HOME = 1e-4, 1e-7  # of the unknowns' sizes: 10 nm and 10 pm of w
SHORTEST = 1e-3  # of a path: shorter steps are not tried
NARROWING, LOADING = 0.3, 0.5  # first steps, of the whole path
ROUNDINGS = (1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 0.0)  # strains; rings' are 1e-3
# [m/s]: regularisation speeds of flanks and rings to begin with. In a march by the belt's own, gaps and
# pushes of a fine mesh can go round for ever
WIDE, RING_WIDE = 0.3, 10.0
NEAR_LOAD, HALVINGS = 1e-6, 40  # [N m]: how closely a load is met along the driven speed; tries
FALLEN = 0.9  # of the largest load: a load that has fallen so far rises no more
SLIDING = 0.5  # slip of a pulley beyond which no state under a load is looked for
DAMPERS = ("element_damping", "ring_damping", "transverse_damping")
# What is marched under where a march under a load does not lead to a state: shares of a load under which the
# belt slips through; loads beside one under which it does not settle, in shares of what friction carries.
LESS, BESIDE = 0.8 ** np.arange(1, 8), (0.1, -0.1, 0.2, -0.2)
SLOWEST_MARCH = 100.0  # [rad/s]: a slower belt takes too long to settle, and a faster one like it is marched


class NoSteadyState(ValueError):
    """None was found; the text says where the walk ended."""


class _PathEnds(NoSteadyState):
    """A path could not be followed to its end: the last solution, and the share of the path where it is."""

    def __init__(self, name: str, x: np.ndarray, share: float) -> None:
        super().__init__(f"no steady state found: {name}, the walk ends at {share:.3g} of it")
        self.x, self.share = x, share


class _SlipsThrough(NoSteadyState):
    """The load is more than constant friction carries."""


class Steady(NamedTuple):
    """A steady state.

    Attributes
    ----------
    load : float
        Torque at the driving pulley [N m].
    belt : Belt
        Constants, under that load.
    state : State
        Of the belt, its time after any start-up.
    unknowns : (n,) array
        Of the `Equations`.
    """

    load: float
    belt: Belt
    state: State
    unknowns: np.ndarray


class SteadyBelt:
    """Steady states of one belt along its load.

    Parameters
    ----------
    parameters : dict
        Resolved parameters of the run [SI]; those of its course are not used, the load among them.
    """

    def __init__(self, parameters: Mapping[str, Any]) -> None:
        given = {**parameters, **OF_THE_COURSE, "load": 0.0}
        free = freed(given)
        self._free = None if free is None else Equations(free, belt_constants(free))
        self._parameters = given if free is None else held(given)
        self._whole = belt = belt_constants(self._parameters)
        # of both regularisation speeds, over the belt's own
        self._wide = max(WIDE / belt.friction_speed, 1.0), max(RING_WIDE / belt.ring_friction_speed, 1.0)
        self._equations = Equations(self._parameters, belt)

    def at(self, load: float, near: Steady | None = None) -> Steady:
        """State under a load.

        Parameters
        ----------
        load : float
            Torque at the driving pulley [N m].
        near : Steady, optional
            A state of this belt where the walk begins; without it, or where that walk does not come through,
            a first state is made.

        Raises
        ------
        NoSteadyState
            Where no walk comes through.
        """
        if self._free is not None:
            return self._released(self._free, load, near)
        if near is not None:
            try:
                return self._found(self._rise(near.unknowns, near.load, load), load)
            except NoSteadyState:
                pass
        return self._found(self._first(load), load)

    def _released(self, free: Equations, load: float, near: Steady | None) -> Steady:
        """State of free pulleys: from one nearby, or else from that of the belt between held ones."""
        if near is not None:

            def loaded(share: float) -> None:
                changed = near.load + share * (load - near.load)
                free.under(load=changed, load_start=changed)

            try:
                x = self._follow(loaded, near.unknowns, 1.0, "load", AT_HOME, free)
                return self._state_of(free, x, load)
            except NoSteadyState:
                pass
        start = self._found(self._first(load), load)
        free.under(load=load, load_start=load)
        x = free.unknowns(nearest(start.belt, free.belt, start.state))
        way = Released(free, x)

        def release(share: float) -> None:
            way.share = share

        x = self._follow(release, x, 1.0, f"pulleys let go at {load:g} N m", AT_HOME, way)
        return self._state_of(free, x, load)

    @staticmethod
    def _state_of(equations: Equations, x: np.ndarray, load: float) -> Steady:
        equations.under(load=load, load_start=load)
        belt = equations.belt._replace(bridging_stiffness=np.inf)
        return Steady(load, belt, equations.state(x), x)

    def known(self, load: float, unknowns: np.ndarray) -> Steady:
        """State under a load, by unknowns that were found before; ValueError if they are not of this belt."""
        equations = self._equations if self._free is None else self._free
        if unknowns.shape != equations.sizes.shape:
            raise ValueError(f"{unknowns.shape} unknowns of a belt that has {equations.sizes.shape}")
        if self._free is not None:
            return self._state_of(self._free, unknowns, load)
        self._own()
        self._load(load)
        return self._found(unknowns, load)

    def along(self, loads: Sequence[float]) -> Iterator[Steady]:
        """States under several loads in their order, each from the one before."""
        near = None
        for load in loads:
            near = self.at(load, near)
            yield near

    def braked(self, near: Steady, sign: float) -> Iterator[Steady]:
        """States from one on as the driven pulley is held at lower (sign -1) or higher (1) speeds.

        As far as they are found; in the direction in which the load's size grows they go on past the largest
        torque that friction carries.
        """
        self._own()
        self._load(0.0)
        for x, load in Braked(self._equations).along(near.unknowns, sign, AT_HOME):
            yield self._found(x, load)
            self._load(0.0)

    def carried(self, near: Steady) -> Steady:
        """State at the largest load that friction carries while neither pulley slips grossly.

        Parameters
        ----------
        near : Steady
            Where to begin; its load says in which direction power flows.

        Raises
        ------
        NoSteadyState
            Where states end before the load falls or a pulley slips grossly.
        """
        direction = -1.0 if near.load < 0.0 else 1.0
        most = last = near
        for state in self.braked(near, -direction):
            if largest_slip(state.belt, state.state) > GROSS_SLIP:
                state = self._at_slip(last, state)
                return state if direction * state.load > direction * most.load else most
            last = state
            if direction * state.load > direction * most.load:
                most = state
            elif direction * state.load < FALLEN * direction * most.load:
                return most
        raise NoSteadyState(
            f"no largest load found: from {near.load:.4g} N m states reach to {last.load:.4g} N m"
        )

    def _at_slip(self, below: Steady, beyond: Steady) -> Steady:
        """State at which a pulley just does not slip grossly, between two states."""
        self._load(0.0)
        slips = [largest_slip(state.belt, state.state) for state in (below, beyond)]
        share = (GROSS_SLIP - slips[0]) / (slips[1] - slips[0])
        x = below.unknowns + share * (beyond.unknowns - below.unknowns)
        found = Braked(self._equations).at(x[SPEED], x, AT_HOME)
        return below if found is None else self._found(*found)

    def _found(self, x: np.ndarray, load: float) -> Steady:
        return self._state_of(self._equations, x, load)

    def _first(self, load: float) -> np.ndarray:
        """Unknowns without a state nearby: marched under the load, or walked from another one."""
        missed: NoSteadyState
        try:
            return self._settle(load)
        except _SlipsThrough as error:
            missed, others = error, [share * load for share in LESS]
        except NoSteadyState as error:
            missed, others = error, [load + part * carried_torque(self._parameters) for part in BESIDE]
        for other in others:
            try:
                x = self._settle(other)
            except NoSteadyState:
                continue
            try:
                return self._rise(x, other, load)
            except NoSteadyState as error:
                slips, missed = isinstance(missed, _SlipsThrough), error
                if slips:  # loads below begin on the same curve
                    break
        if isinstance(missed, _SlipsThrough):
            raise missed
        try:
            return self._widened(load)
        except NoSteadyState:
            raise missed from None

    def _settle(self, load: float) -> np.ndarray:
        """Unknowns by the transient with constant friction over wide ranges of sliding, and by what it is."""
        self._load(load)
        self._bridge(0.0)
        faster = max(SLOWEST_MARCH / self._whole.driving_speed, 1.0)
        self._friction(0.0, self._wide)
        self._faster(faster, 0.0, self._wide)
        x = settled(self._parameters, self._equations, ON_THE_WAY)
        if isinstance(x, Outcome):
            # a load that the driven pulley takes can only slow it; a march that diverges may end at either
            if x is (Outcome.SLIPPED_THROUGH if load > 0.0 else Outcome.RAN_AWAY):
                raise _SlipsThrough(f"no steady state found: the belt slips through under {load:g} N m")
            raise NoSteadyState(f"no steady state found: the belt does not settle under {load:g} N m")
        if faster > 1.0:
            name = f"belt slowed down at {load:g} N m"
            x = self._follow(lambda share: self._faster(faster, share, self._wide), x, 1.0, name)
            n = self._whole.cell.size
            x[3 * n : -1] /= faster
            self._faster(1.0, 1.0, self._wide)
        return self._narrowed(x, load)

    def _widened(self, load: float) -> np.ndarray:
        """Unknowns without a march: without load and with rounded corners first, then under the load."""
        self._own()
        self._friction(0.0, self._wide)
        self._bridge(0.0)
        self._load(0.0)
        x = self._equations.initial()
        for rounding in ROUNDINGS:
            self._equations.rounding = rounding
            found = newton(self._equations, x, ON_THE_WAY)
            if found is None and rounding > 0.0:
                found = newton(self._equations, x, ON_THE_WAY, damped=True)
            if found is None:
                self._equations.rounding = 0.0
                raise NoSteadyState("no steady state found without load and with widened friction")
            x = found
        if load != 0.0:
            x = self._follow(lambda share: self._load(share * load), x, LOADING, f"load of {load:g} N m")
        return self._narrowed(x, load)

    def _narrowed(self, x: np.ndarray, load: float) -> np.ndarray:
        """Unknowns with the belt's own friction and dampers, from those with widened ones."""
        name = f"friction narrowed at {load:g} N m"
        x = self._follow(lambda share: self._friction(share, self._wide), x, NARROWING, name)
        return self._follow(self._bridge, x, NARROWING, f"dampers drawn back at {load:g} N m", AT_HOME)

    def _rise(self, x: np.ndarray, start: float, load: float) -> np.ndarray:
        """Unknowns under more load; near what friction carries along the curve of states."""
        try:
            return self._walk(x, start, load)
        except _PathEnds as ended:
            x, reached = ended.x, start + ended.share * (load - start)
        before = self._found(x, reached)
        farthest, sign = reached, 1.0 if load < reached else -1.0  # a larger load slows the driven pulley
        for state in self.braked(before, sign):
            if (before.load - load) * (state.load - load) <= 0.0:
                return self._between(before, state, load)
            before = state
            farthest = min(farthest, state.load) if load < reached else max(farthest, state.load)
            if largest_slip(state.belt, state.state) > SLIDING:
                break
        raise NoSteadyState(
            f"no steady state found at {load:g} N m: from {start:.4g} N m they reach to {farthest:.4g} N m"
        )

    def _between(self, low: Steady, high: Steady, load: float) -> np.ndarray:
        """Unknowns under a load between two states, by regula falsi (Illinois) over the driven speed."""
        braked, ends = Braked(self._equations), [low.unknowns, high.unknowns]
        left = [low.load - load, high.load - load]
        self._load(0.0)
        for _ in range(HALVINGS):
            x = ends[0] + left[0] / (left[0] - left[1]) * (ends[1] - ends[0])
            found = braked.at(x[SPEED], x, AT_HOME)
            if found is None:
                break
            x, off = found[0], found[1] - load
            if abs(off) < NEAR_LOAD:
                self._load(load)
                return found[0] if (own := newton(self._equations, x, AT_HOME)) is None else own
            side = 0 if off * left[0] > 0.0 else 1
            ends[side], left[side] = x, off
            left[1 - side] *= 0.5
        raise NoSteadyState(
            f"no steady state found at {load:g} N m: they jump from {low.load:.4g} to {high.load:.4g} N m"
        )

    def _walk(self, x: np.ndarray, start: float, end: float) -> np.ndarray:
        """Unknowns under another load."""
        self._own()

        def loaded(share: float) -> None:
            self._load(start + share * (end - start))

        return self._follow(loaded, x, 1.0, f"load from {start:g} to {end:g} N m", AT_HOME)

    def _follow(
        self,
        change: Callable[[float], None],
        x: np.ndarray,
        step: float,
        name: str,
        tolerance: float = ON_THE_WAY,
        equations: Solvable | None = None,
    ) -> np.ndarray:
        """Solution at the end of a path, from that at its beginning.

        Its steps double where they succeed and are quartered where they fail.

        Parameters
        ----------
        change : callable
            change(share) sets the equations at a share of the path.
        x : (n,) array
            Solution at 0.
        step : float
            The first step, a share of the path.
        name : str
            Of the path, for the error.
        tolerance : float
            Of each solution.
        equations : Solvable, optional
            Those that are changed; by default the belt's.
        """
        solved = equations or self._equations
        share = 0.0
        while share < 1.0:
            tried = min(1.0, share + step)
            change(tried)
            found = newton(solved, x, tolerance)
            if found is not None:
                x, share, step = found, tried, 2.0 * step
            else:
                step *= 0.25
                if step < SHORTEST:
                    raise _PathEnds(name, x, share)
        return x

    def _load(self, load: float) -> None:
        self._equations.under(load=load, load_start=load)

    def _own(self) -> None:
        """Back to the belt's own constants, but for the load."""
        self._faster(1.0, 1.0, (1.0, 1.0))
        self._friction(1.0)
        self._bridge(1.0)

    def _faster(self, factor: float, slowed: float, wide: tuple[float, float]) -> None:
        """A belt with all speeds times a factor, those too over which its widened friction is regularised.

        With its inertia over the factor's square and its dampers over the factor (slowed: 1) it has the same
        forces as the belt itself; with those of the belt (0) nearly so.
        """
        belt, heavy = self._whole, factor ** (-2.0 * slowed)
        self._equations.under(
            belt_speed=factor * belt.belt_speed,
            driving_speed=factor * belt.driving_speed,
            speed_start=factor * belt.speed_start,
            friction_speed=factor * wide[0] * belt.friction_speed,
            ring_friction_speed=factor * wide[1] * belt.ring_friction_speed,
            friction_memory=belt.friction_memory / factor,
            ring_relief=factor**2 * heavy * belt.ring_relief,
            mass=heavy * belt.mass,
            element_mass=heavy * belt.element_mass,
            ring_mass=heavy * belt.ring_mass,
            **{key: factor**-slowed * getattr(belt, key) for key in DAMPERS},
        )

    def _bridge(self, share: float) -> None:
        """Dampers that reach across all gaps (0), or as far as the elements' own stiffness lets them (1)."""
        whole = self._equations.belt.element_stiffness
        self._equations.under(bridging_stiffness=BRIDGING * (whole / BRIDGING) ** share)

    def _friction(self, share: float, wide: tuple[float, float] = (1.0, 1.0)) -> None:
        """Friction between widened and constant (0) and its own (1); it falls with the square."""
        belt = self._whole
        self._equations.under(
            friction_speed=wide[0] ** (1.0 - share) * belt.friction_speed,
            ring_friction_speed=wide[1] ** (1.0 - share) * belt.ring_friction_speed,
            law=softened(belt.law, share * share),
        )
