"""A transient run of the oscillator."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from cvt_hpc.models.alone import Alone
from cvt_hpc.models.marched import MarchedRun, Probe
from cvt_hpc.models.oscillator.constants import normal_load, oscillator
from cvt_hpc.models.oscillator.motion import (
    HUMP,
    V,
    X,
    friction_at_rest,
    initial_state,
    largest_rate,
    regularised_frictions,
    set_valued_system,
    system,
)
from cvt_hpc.physics.friction import friction_coefficients
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.variables import Status

CHANNELS = ("speed",)
REST = 1e-9  # of the mass' largest speed: what rounding may leave of sliding while friction holds


class Transient(MarchedRun):
    """One run of the oscillator, advanced sample by sample.

    A step beyond what the stepper can take of the damping rate of smoothed friction at rest makes friction
    chatter where the mass should stick: its speed jumps over the belt's in every step, by up to
    step N mu / m. The run ends as failed at the first sample that lies within that band.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    stepper : str
        One of the model's STEPPER_NAMES.

    Attributes
    ----------
    constants : Oscillator
        Of the equations.
    is_set_valued : bool
        Whether friction jumps at rest; else the jump is smoothed, and sticking is creep.
    """

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        equations = set_valued_system if stepper == "moreau" else system
        march = Marching(
            stepper,
            parameters,
            equations(parameters),
            initial_state(parameters),
            1.0 / parameters["sampling_rate"],
        )
        super().__init__(parameters, march, (Probe("mass", 0.0),), (X,))
        self.constants = constants = oscillator(parameters)
        self.is_set_valued = stepper == "moreau"
        self._largest_step = march.facts.damping_limit / largest_rate(constants)
        self._jump = friction_at_rest(constants) / constants.mass

    def advance(self, samples: int) -> tuple[Status, str] | None:
        """March on; see `MarchedRun.advance`."""
        first = self.done
        failure = super().advance(samples)
        if failure is None and self.step > self._largest_step:
            sliding = np.abs(self.parameters["belt_speed"] - self.channel("speed")[first:])
            if np.any(sliding < self.step * self._jump):
                return Status.FAILED_NUMERICS, (
                    f"the step is beyond {self._largest_step:.3g} s, from where friction chatters instead of "
                    "letting the mass stick"
                )
        return failure

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
        speed = self.channel("speed")
        width = REST * np.abs(speed).max(initial=0.0)
        if not self.is_set_valued:
            width = HUMP * self.constants.width
        return np.abs(self.constants.belt_speed - speed) <= width

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


def batch(points: Sequence[Mapping[str, Any]], stepper: str) -> Alone:
    """One run in the form of a batch.

    Parameters
    ----------
    points : sequence of mapping
        Resolved parameters of the one run [SI].
    stepper : str
        One of the model's STEPPER_NAMES.
    """
    (parameters,) = points
    return Alone(Transient(parameters, stepper))
