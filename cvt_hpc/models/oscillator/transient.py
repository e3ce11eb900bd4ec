"""A transient run of the oscillator."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from cvt_hpc.models.marched import MarchedRun, Probe, batch_of_one
from cvt_hpc.models.oscillator.motion import V, X, initial_state, oscillator, set_valued_system, system
from cvt_hpc.models.oscillator.rest import peak, rest_missed, wrongly_held
from cvt_hpc.models.oscillator.slide import silenced

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
        One of the model's STEPPER_NAMES.
    """

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        equations = (set_valued_system if stepper == "moreau" else system)(parameters)
        self._constants = o = oscillator(parameters)
        self._peak = peak(o)
        probes = (Probe("mass", 0.0),)
        frequency = np.sqrt(o.stiffness / o.mass)
        start = initial_state(parameters)
        super().__init__(parameters, stepper, equations, start, probes, (X,), frequency)
        self._silenced = None
        if not self.marching.facts.adaptive:
            self._silenced = silenced(o, equations, stepper, parameters, self.interval)
        self._allowed = parameters.get("tolerance", 0.0) * float(equations.scale[V])

    def _doubt(self, first: int) -> str | None:
        seen = self.rows[max(first - 1, 0) : self.done]
        missed = rest_missed(self._constants, self.marching.facts, self.step, self._allowed, seen)
        return missed or self._silenced or wrongly_held(self._constants, self._peak, seen, self.interval)

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): speed of the mass [m/s]."""
        return self.rows[: self.done, {"speed": V}[name]]


batch = partial(batch_of_one, Transient)
