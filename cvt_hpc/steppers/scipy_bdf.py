"""Backward differences by SciPy, with a quasi-constant step (Shampine and Reichelt 1997).

Orders 1 to 5, chosen as it goes; multistep, implicit, adaptive. A yardstick that people know, not one of the
family: called from Python, with a full matrix by difference quotients. Orders above 2 are unstable for
lightly damped vibrations at some steps, which the control answers by short ones.
"""

from dataclasses import replace
from functools import partial

from scipy.integrate import BDF

from cvt_hpc.steppers.scipy_march import FACTS as COMMON
from cvt_hpc.steppers.scipy_march import PARAMETERS, control, march_by, work

__all__ = ["FACTS", "PARAMETERS", "control", "march", "work"]

FACTS = replace(
    COMMON,
    width_limit=1.0,
    stability="orders up to 2 are A-stable, higher ones not near the imaginary axis",
)
march = partial(march_by, BDF)
