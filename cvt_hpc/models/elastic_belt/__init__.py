"""The planar elastic belt with self-induced vibration (Lebrecht et al. 2004, Bullinger et al. 2005).

Importing this package is cheap: kernels are compiled when `belt` is imported.
"""

from cvt_hpc.models.elastic_belt.parameters import PARAMETERS, check, inert
from cvt_hpc.models.elastic_belt.step_choice import CHOICE
from cvt_hpc.steppers import taken

DEFAULT_STEPPER = "imex"
REFUSED = {
    "moreau": "friction of the belt is regularised and has two directions, its contact is elastic: the belt "
    "has no set-valued forces"
}
OWN_STEPPERS = {
    "imex": "cvt_hpc.models.elastic_belt.imex_settings",
    "explicit": "cvt_hpc.models.elastic_belt.explicit_settings",
}
STEPPERS = OWN_STEPPERS | taken(REFUSED)

GIVES = {"imex": {"step_error": CHOICE}}  # by stepper: values of its parameters for a scene

KICK = "disturbance", 1e-5  # [m]

__all__ = [
    "DEFAULT_STEPPER",
    "GIVES",
    "KICK",
    "OWN_STEPPERS",
    "PARAMETERS",
    "REFUSED",
    "STEPPERS",
    "check",
    "inert",
]
