"""The planar elastic belt with self-induced vibration (Lebrecht et al. 2004, Bullinger et al. 2005).

Importing this package is cheap: kernels are compiled when `belt` is imported.
"""

from cvt_hpc.models.elastic_belt.parameters import PARAMETERS, check, inert
from cvt_hpc.models.elastic_belt.step_choice import CHOICE

DEFAULT_STEPPER = "imex"
# Steppers that the belt takes: two of its own, and general ones by `general`
OWN_STEPPERS = ("imex", "explicit")
STEPPER_NAMES = (
    *OWN_STEPPERS,
    "symplectic_euler",
    "runge_kutta_4",
    "dormand_prince",
    "theta",
    "generalised_alpha",
    "sdirk",
    "rosenbrock_w",
    "scipy_lsoda",
    "scipy_bdf",
    "scipy_radau",
)
REFUSED = {
    "moreau": "friction of the belt is regularised and has two directions, its contact is elastic: the belt "
    "has no set-valued forces",
}

GIVES = {"imex": {"step_error": CHOICE}}  # by stepper: what its parameters give for a scene of the model

__all__ = [
    "DEFAULT_STEPPER",
    "GIVES",
    "OWN_STEPPERS",
    "PARAMETERS",
    "REFUSED",
    "STEPPER_NAMES",
    "check",
    "inert",
]
