"""A transient run of the oscillator."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.marched import MarchedRun, Probe
from cvt_hpc.models.oscillator.motion import V, X, initial_state, set_valued_system, system
from cvt_hpc.steppers.marching import Marching

CHANNELS = ("speed",)


class Transient(MarchedRun):
    """One run of the oscillator, advanced sample by sample.

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

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): speed of the mass [m/s]."""
        return self.rows[: self.done, {"speed": V}[name]]
