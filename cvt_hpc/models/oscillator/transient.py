"""A transient run of the oscillator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.marched import MarchedRun, Probe
from cvt_hpc.models.oscillator.motion import (
    V,
    X,
    friction_at_rest,
    initial_state,
    largest_rate,
    oscillator,
    set_valued_system,
    system,
)
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.variables import Status

CHANNELS = ("speed",)


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
        constants = oscillator(parameters)
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

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): speed of the mass [m/s]."""
        return self.rows[: self.done, {"speed": V}[name]]
