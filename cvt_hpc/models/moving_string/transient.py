"""A transient run of the moving string."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.marched import MarchedRun, Probe, batches_of_one
from cvt_hpc.models.moving_string.exact import probe_positions
from cvt_hpc.models.moving_string.motion import energy, highest_frequency, initial_state, system

CHANNELS = ("energy",)
# Symplectic Euler keeps a wave, but its energy moves by up to (1 + w step / 2) / (1 - w step / 2): by 2 at
# 9.4 steps for a period
KEPT = 2.0  # share of the energy, up or down


class Transient(MarchedRun):
    """One run of the moving string, advanced sample by sample.

    The string keeps an energy. A run whose energy leaves what bounded errors explain ends as failed, whether
    the method drives waves or damps them.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    stepper : str
        A stepper that the model takes.
    """

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        places = probe_positions(parameters)
        nodes = np.round(places / parameters["length"] * parameters["cells"]).astype(int) - 1
        probes = [Probe(f"string {k}", float(x)) for k, x in enumerate(places, start=1)]
        start = initial_state(parameters)
        frequency = highest_frequency(parameters)
        super().__init__(parameters, stepper, system(parameters), start, probes, nodes, frequency)
        self._energy = float(energy(parameters, start[None])[0])

    def _doubt(self, first: int) -> str | None:
        share = energy(self.parameters, self.rows[first : self.done]) / self._energy
        wrong = share[(share < 1.0 / KEPT) | (share > KEPT)]
        if wrong.size == 0:
            return None
        done = "damps the motion" if wrong[0] < 1.0 else "drives the motion"
        return f"the method {done}: energy that the string keeps is {wrong[0]:.3g} of what it was"

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): energy that the string's motion keeps [J]."""
        return {"energy": energy}[name](self.parameters, self.rows[: self.done])


batch = batches_of_one(Transient)
