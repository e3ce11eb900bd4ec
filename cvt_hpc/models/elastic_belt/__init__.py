"""The planar elastic belt with self-induced vibration (Lebrecht et al. 2004, Bullinger et al. 2005).

Importing this package is cheap: kernels are compiled when `belt` is imported.
"""

from cvt_hpc.models.elastic_belt.parameters import PARAMETERS, check, inert

DEFAULT_STEPPER = "imex"
STEPPER_NAMES = ("imex", "explicit")
REFUSED: dict[str, str] = {}

__all__ = ["DEFAULT_STEPPER", "PARAMETERS", "REFUSED", "STEPPER_NAMES", "check", "inert"]
