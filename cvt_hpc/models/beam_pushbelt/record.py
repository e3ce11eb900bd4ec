"""The record of a run: that of a run of `pushbelt`, by the same judge."""

from dataclasses import replace

import numpy as np

from cvt_hpc.models.pushbelt import record as pushbelt
from cvt_hpc.models.pushbelt.record import coordinates, histories, judge
from cvt_hpc.parameters import Parameters

# Measured on one core of an EPYC (Zen 5): core-seconds per beam, element and pair of elements that rub, and
# step, and per sample
_BEAM_COST, _ELEMENT_COST, _RUB_COST, _SAMPLE_COST = 3e-6, 6e-7, 2e-7, 3e-4

_OTHERWISE = {
    "iterations": "sweeps over all contacts in a step, mean",
    "element_loss": "0: contacts between elements have no dampers",
    "stretch_loss": "0: the ring has no damper",
    "lag_loss": "0: the sheaves are rigid",
    "numerical_damping": "0: power that time steps damp is not separated, but left in power_residual",
}
VARIABLES = tuple(replace(v, comment=_OTHERWISE.get(v.name, v.comment)) for v in pushbelt.VARIABLES)


def cost(parameters: Parameters, stepper: str) -> float | np.ndarray:
    """Core-seconds of a run; of parameters that are arrays, an array."""
    p, n = parameters, parameters["elements"]
    rubs = (np.asarray(p["kinetic_friction"]) > 0.0) | (np.asarray(p["ring_friction"]) > 0.0)
    each = _BEAM_COST * p["ring_beams"] + _ELEMENT_COST * n + np.where(rubs, _RUB_COST * n**2, 0.0)[()]
    return p["duration"] * (each / p["step"] + _SAMPLE_COST * p["sampling_rate"])


__all__ = ["VARIABLES", "coordinates", "cost", "histories", "judge"]
