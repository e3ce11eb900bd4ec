"""Runs that march."""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.marched import MarchedRun, Probe, batches_of_one
from cvt_hpc.steppers.system import System

CHANNELS = ()


class Constants(NamedTuple):
    """e, w [rad/s] and s [m]."""

    excitation: float
    frequency: float
    size: float


@kernel
def rates(c, t, y, out):
    """Rates of displacement y[0] and speed y[1]; see `System`."""
    out[0] = y[1]
    out[1] = c.excitation * c.frequency * (1.0 - (y[0] / c.size) ** 2) * y[1] - c.frequency**2 * y[0]
    return True


class Transient(MarchedRun):
    """One run, advanced sample by sample."""

    def __init__(self, parameters, stepper):
        p = parameters
        c = Constants(p["excitation"], 2.0 * np.pi * p["own_frequency"], p["size"])
        scale = c.size * np.array([1.0, c.frequency])
        system = System(rates, c, np.array([False, True]), np.array([-1, 0]), scale)
        start = np.array([p["start"], 0.0])
        super().__init__(p, stepper, system, start, [Probe("mass", 0.0)], [0], c.frequency)


batch = batches_of_one(Transient)
