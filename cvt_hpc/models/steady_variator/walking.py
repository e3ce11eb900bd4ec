"""Steady states by walking: a first one with friction widened, then narrowed; further ones along load.

Where friction is regularised over a wide range of sliding, the equations are all but linear without load, and
the belt in its grooves is a start from which Newton's iteration finds the state: with the corner of the push
force rounded off first, then less and less. Until friction is narrowed, dampers reach across gaps, which
evens out how elements follow each other there; then they are drawn back. But for the first state corners
are sharp; each state begins at the one before, and a step that fails is made again in quarters.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.models.elastic_belt.belt import Belt, State, belt_constants
from cvt_hpc.models.steady_variator.arclength import largest_load
from cvt_hpc.models.steady_variator.equations import Equations
from cvt_hpc.models.steady_variator.newton import newton
from cvt_hpc.models.steady_variator.parameters import OF_THE_COURSE

WIDE, RING_WIDE = 0.3, 10.0  # [m/s]: regularisation speeds of flanks and rings to begin with
BRIDGING = 10.0  # [N]: dampers push by 100 N or so, which a gap's strain times this does not reach
ROUNDINGS = (1e-4, 3e-5, 1e-5, 3e-6, 1e-6, 0.0)  # strains; rings' are 1e-3
ON_THE_WAY, AT_HOME = 1e-4, 1e-7  # of the unknowns' sizes: 10 nm and 10 pm of w
SHORTEST = 1e-3  # of a path: shorter steps are not tried

NARROWING, LOADING = 0.3, 0.5  # first steps, of the whole path
NEAR_FOLD = 1.0  # [N m]: where so short a step along the load fails, a fold is near


class NoSteadyState(ValueError):
    """None was found; the text says where the walk ended."""


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
        p = {**parameters, **OF_THE_COURSE, "load": 0.0}
        belt = belt_constants(p)
        self._law, self._widths = belt.law, (belt.friction_speed, belt.ring_friction_speed)
        self._equations = Equations(p, belt)

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
        ways = [] if near is None else [lambda: self._walk(near.unknowns, near.load, load)]
        # loaded while friction is widened: past loads at which gaps move from one strand to the other
        ways += [lambda: self._first(load), lambda: self._walk(self._first(0.0), 0.0, load)]
        for way in ways:
            try:
                x = way()
            except NoSteadyState as error:
                missed = error
            else:
                return self._found(x, load)
        raise missed

    def known(self, load: float, unknowns: np.ndarray) -> Steady:
        """State under a load, by unknowns that were found before; ValueError if they are not of this belt."""
        if unknowns.shape != self._equations.sizes.shape:
            raise ValueError(f"{unknowns.shape} unknowns of a belt that has {self._equations.sizes.shape}")
        self._friction(1.0)
        self._bridge(1.0)
        self._load(load)
        return self._found(unknowns, load)

    def along(self, loads: Sequence[float]) -> Iterator[Steady]:
        """States under several loads in their order, each from the one before."""
        near = None
        for load in loads:
            near = self.at(load, near)
            yield near

    def carried(self, near: Steady, within: float = 0.1) -> Steady:
        """State at the largest load that friction carries, as far as a walk upwards finds it.

        A walk along the load goes past most of the small folds at which single cells open; from where it ends
        the curve of states is followed round its fold.

        Parameters
        ----------
        near : Steady
            Where the walk begins.
        within : float
            How closely the load is found [N m].

        Raises
        ------
        NoSteadyState
            Where the curve of states cannot be followed to a fold.
        """
        step = max(0.1 * abs(near.load), NEAR_FOLD)
        while step >= NEAR_FOLD:
            try:
                load = near.load + step
                x = self._walk(near.unknowns, near.load, load)
            except NoSteadyState:
                step *= 0.5
            else:
                near = self._found(x, load)
        self._load(near.load)
        found = largest_load(self._equations, self._load, near.unknowns, near.load, AT_HOME, within)
        if found is None:
            raise NoSteadyState(f"no largest load found above {near.load:g} N m")
        self._load(found[1])
        return self._found(*found)

    def _found(self, x: np.ndarray, load: float) -> Steady:
        belt = self._equations.belt._replace(bridging_stiffness=np.inf)
        return Steady(load, belt, self._equations.state(x), x)

    def _first(self, load: float) -> np.ndarray:
        """Unknowns by widened friction: without load, under the load, then with the true friction."""
        self._friction(0.0)
        self._bridge(0.0)
        self._load(0.0)
        x = self._equations.initial()
        for rounding in ROUNDINGS:
            self._equations.rounding = rounding
            found = newton(self._equations, x, ON_THE_WAY)
            if found is None and rounding > 0.0:
                found = newton(self._equations, x, ON_THE_WAY, damped=True)
            if found is None:
                raise NoSteadyState("no steady state found without load and with widened friction")
            x = found
        if load != 0.0:
            x = self._follow(lambda share: self._load(share * load), x, LOADING, f"load of {load:g} N m")
        x = self._follow(self._friction, x, NARROWING, f"friction narrowed at {load:g} N m")
        return self._follow(self._bridge, x, NARROWING, f"dampers drawn back at {load:g} N m", AT_HOME)

    def _walk(self, x: np.ndarray, start: float, end: float) -> np.ndarray:
        """Unknowns under another load."""
        self._friction(1.0)
        self._bridge(1.0)

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
        """
        share = 0.0
        while share < 1.0:
            tried = min(1.0, share + step)
            change(tried)
            found = newton(self._equations, x, tolerance)
            if found is not None:
                x, share, step = found, tried, 2.0 * step
            else:
                step *= 0.25
                if step < SHORTEST:
                    raise NoSteadyState(f"no steady state found: {name}, the walk ends at {share:.3g} of it")
        return x

    def _load(self, load: float) -> None:
        self._equations.under(load=load, load_start=load)

    def _bridge(self, share: float) -> None:
        """Dampers that reach across all gaps (0), or as far as the elements' own stiffness lets them (1)."""
        whole = self._equations.belt.element_stiffness
        self._equations.under(bridging_stiffness=BRIDGING * (whole / BRIDGING) ** share)

    def _friction(self, share: float) -> None:
        """Flanks' and rings' friction between widened (0) and true (1); it falls with the square."""
        flanks, rings = (
            wide * (true / wide) ** share for wide, true in zip((WIDE, RING_WIDE), self._widths, strict=True)
        )
        law = self._law._replace(gradient=share * share * self._law.gradient)
        self._equations.under(friction_speed=flanks, ring_friction_speed=rings, law=law)
