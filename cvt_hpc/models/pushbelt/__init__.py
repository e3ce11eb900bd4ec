"""The planar pushbelt of rigid elements on flexible rings (Geier and Schindler 2007).

Importing this package is cheap: kernels are compiled when `transient` is imported.
"""

from cvt_hpc.models.pushbelt.parameters import PARAMETERS, check, inert
from cvt_hpc.steppers import STEPPERS as GENERAL

DEFAULT_STEPPER = "newton"
REFUSED = dict.fromkeys(
    GENERAL,
    "the pushbelt's contacts open, close and stick by the hundred: it is marched by its own step, newton",
)
STEPPERS = {"newton": "cvt_hpc.models.pushbelt.newton_settings"}
COMPARED = ("speed_loss", "efficiency", "loss")
KICK = "kick", 0.02  # [m/s]

__all__ = ["COMPARED", "DEFAULT_STEPPER", "KICK", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]
