"""The spatial pushbelt of rigid elements on two flexible ring packages (Schindler 2008).

Importing this package is cheap: kernels are compiled when `transient` is imported.
"""

from cvt_hpc.models.spatial_pushbelt.parameters import PARAMETERS, check, inert
from cvt_hpc.steppers import STEPPERS as GENERAL

DEFAULT_STEPPER = "newton"
REFUSED = dict.fromkeys(
    GENERAL,
    "the pushbelt's contacts open, close and stick by the hundred: it is marched by its own step, newton",
)
STEPPERS = {"newton": "cvt_hpc.models.spatial_pushbelt.newton_settings"}
COMPARED = ("speed_loss", "efficiency", "loss", "net_axial_force")
KICK = "kick", 0.02  # [m/s]

__all__ = ["COMPARED", "DEFAULT_STEPPER", "KICK", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]
