"""The spatial pushbelt of rigid elements on two flexible ring packages (Schindler 2008).

Importing this package is cheap: kernels are compiled when `transient` is imported.
"""

from cvt_hpc.models.pushbelt import DEFAULT_STEPPER, KICK, REFUSED
from cvt_hpc.models.spatial_pushbelt.parameters import PARAMETERS, check, inert

STEPPERS = {"newton": "cvt_hpc.models.spatial_pushbelt.newton_settings"}
COMPARED = ("speed_loss", "efficiency", "loss", "net_axial_force")

__all__ = ["COMPARED", "DEFAULT_STEPPER", "KICK", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]
