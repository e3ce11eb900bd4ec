"""A transient run of the oscillator."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.marched import MarchedRun, Probe, batches_of_one
from cvt_hpc.models.oscillator.constants import normal_load, oscillator
from cvt_hpc.models.oscillator.motion import (
    HUMP,
    V,
    X,
    initial_state,
    regularised_frictions,
    set_valued_system,
    system,
)
from cvt_hpc.models.oscillator.rest import REST, peak, rest_missed, wrongly_held, wrongly_stuck
from cvt_hpc.models.oscillator.slide import silenced
from cvt_hpc.physics.friction import friction_coefficients

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
        equations = (set_valued_system if self.is_set_valued else system)(parameters)
        self.constants = o = oscillator(parameters)
        self._peak = peak(o)
        probes = (Probe("mass", 0.0),)
        frequency = np.sqrt(o.stiffness / o.mass)
        start = initial_state(parameters)
        super().__init__(parameters, stepper, equations, start, probes, (X,), frequency)
        self._silenced = None
        if not self.marching.facts.adaptive:
            self._silenced = silenced(o, equations, stepper, parameters, self.interval)
        self._typical_speed = float(equations.scale[V])
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
        return HUMP * self.constants.width

    def friction(self) -> np.ndarray:
        """Friction force on the mass at each sample so far, (done,) [N]."""
        o, x, v = self.constants, self.displacement[:, 0], self.channel("speed")
        sliding, load = o.belt_speed - v, normal_load(o, x)
        if not self.is_set_valued:
            return regularised_frictions(o, sliding, load)
        holding = o.stiffness * x + o.damping * v - o.preload
        level = load * friction_coefficients(o.law, np.abs(sliding), load)
        return np.where(self.is_stuck, holding, np.copysign(level, sliding))

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): speed of the mass [m/s]."""
        return self.rows[: self.done, {"speed": V}[name]]


batch = batches_of_one(Transient)
