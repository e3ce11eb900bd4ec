"""The rubber belt drive of Cepon and Boltezar: ANCF elements on two pulleys, with contact and friction.

Importing this package is cheap: kernels are compiled when `transient` is imported.
"""

from cvt_hpc.models.belt_drive.parameters import PARAMETERS, check, inert
from cvt_hpc.steppers import STEPPERS as GENERAL

DEFAULT_STEPPER = "cyclic_alpha"
REFUSED = dict.fromkeys(
    GENERAL,
    "the belt's contacts are stiff and open and close: it is marched by its own step, cyclic_alpha",
)
STEPPERS = {"cyclic_alpha": "cvt_hpc.models.belt_drive.step_settings"}
COMPARED = ("speed_loss", "efficiency", "strand_tension", "tension_ripple")

__all__ = ["COMPARED", "DEFAULT_STEPPER", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]
