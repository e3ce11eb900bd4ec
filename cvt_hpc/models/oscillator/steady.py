"""Steady sliding of the mass, and small motions about it."""

from typing import NamedTuple

import numpy as np

from cvt_hpc.models.oscillator.constants import Oscillator, normal_load
from cvt_hpc.physics.friction import friction_coefficient

MOST_ROUNDS = 200  # of a table of friction over the load, which the friction itself changes
# Of the load: central differences are exact, N mu being of the second order in N even in a table.
BESIDE = 1e-3


class SteadySliding(NamedTuple):
    """The mass at rest on the belt that slides under it, friction without regularisation.

    Attributes
    ----------
    displacement : float
        x_s [m].
    eigenvalue : complex
        Of the small motions about it the one with the larger imaginary, or else real, part [1/s].
    """

    displacement: float
    eigenvalue: complex


def steady_sliding(o: Oscillator) -> SteadySliding:
    """Steady sliding of an oscillator: x_s = (P + N_0 mu) / (k + n mu)."""
    load, displacement = o.normal_load, np.nan
    for _ in range(MOST_ROUNDS):
        mu, slope = friction_coefficient(o.law, o.belt_speed, load)
        last, displacement = (
            displacement,
            (o.preload + o.normal_load * mu) / (o.stiffness + o.normal_stiffness * mu),
        )
        load = normal_load(o, displacement)
        if displacement == last:
            break
    beside = [load * (1.0 + side) for side in (BESIDE, -BESIDE)]
    forces = [n * friction_coefficient(o.law, o.belt_speed, n)[0] for n in beside]
    by_load = (forces[0] - forces[1]) / (beside[0] - beside[1])
    half = complex(-0.5 * (o.damping + load * slope) / o.mass)
    stiffness = o.stiffness + o.normal_stiffness * by_load
    return SteadySliding(displacement, complex(half + np.sqrt(half * half - stiffness / o.mass)))
