"""The planar pushbelt on a ring of beams (Geier and Schindler 2007): the slow reference of `pushbelt`.

Importing this package is cheap: kernels are compiled when `transient` is imported.
"""

from cvt_hpc.models.beam_pushbelt.parameters import PARAMETERS, check, inert
from cvt_hpc.steppers import STEPPERS as GENERAL

DEFAULT_STEPPER = "proximal"
REFUSED = dict.fromkeys(
    GENERAL,
    "its set-valued laws are coupled by the ring: it is marched by its own step, proximal",
)
STEPPERS = {"proximal": "cvt_hpc.models.beam_pushbelt.proximal_settings"}
KICK = "kick", 0.02  # [m/s]

__all__ = ["DEFAULT_STEPPER", "KICK", "PARAMETERS", "REFUSED", "STEPPERS", "check", "inert"]
