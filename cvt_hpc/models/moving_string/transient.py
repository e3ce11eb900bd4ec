"""A transient run of the moving string."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.marched import MarchedRun, Probe
from cvt_hpc.models.moving_string.exact import probe_positions
from cvt_hpc.models.moving_string.motion import energy, initial_state, system
from cvt_hpc.steppers.marching import Marching

CHANNELS = ("energy",)


class Transient(MarchedRun):
    """One run of the moving string, advanced sample by sample.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    stepper : str
        One of the model's STEPPER_NAMES.
    """

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        march = Marching(
            stepper,
            parameters,
            system(parameters),
            initial_state(parameters),
            1.0 / parameters["sampling_rate"],
        )
        places = probe_positions(parameters)
        nodes = np.round(places / parameters["length"] * parameters["cells"]).astype(int) - 1
        probes = [Probe(f"string {k}", float(x)) for k, x in enumerate(places, start=1)]
        super().__init__(parameters, march, probes, nodes)

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): energy that the string's motion keeps [J]."""
        return {"energy": energy}[name](self.parameters, self.rows[: self.done])
