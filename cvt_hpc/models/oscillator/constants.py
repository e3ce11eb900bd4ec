"""The constants of an oscillator, as its kernels take them."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from cvt_hpc.kernels import kernel
from cvt_hpc.physics.friction import FrictionLaw, given_law

_MECHANICS = (
    "mass",
    "stiffness",
    "damping",
    "belt_speed",
    "normal_load",
    "normal_stiffness",
    "preload",
)


class Oscillator(NamedTuple):
    """Constants of the oscillator.

    Attributes
    ----------
    mass, stiffness, damping : float
        [kg], [N/m], [N s/m].
    belt_speed : float
        [m/s].
    normal_load, normal_stiffness, preload : float
        N_0 [N], n [N/m], P [N].
    law : FrictionLaw
        Friction in steady sliding.
    excess : float
        Level at rest above that of the law [1].
    width : float
        Regularisation speed [m/s].
    """

    mass: float
    stiffness: float
    damping: float
    belt_speed: float
    normal_load: float
    normal_stiffness: float
    preload: float
    law: FrictionLaw
    excess: float
    width: float


def oscillator(parameters: Mapping[str, Any]) -> Oscillator:
    """Constants from flat parameters [SI]."""
    p = parameters
    at_rest = p["static_friction"] - p["kinetic_friction"] if p["friction_law"] == "coulomb" else 0.0
    mechanics = {key: float(p[key]) for key in _MECHANICS}
    return Oscillator(**mechanics, law=given_law(p), excess=float(at_rest), width=float(p["friction_speed"]))


@kernel
def normal_load(o: Oscillator, x: float) -> float:
    """Normal load [N] at a displacement [m]."""
    return o.normal_load - o.normal_stiffness * x
