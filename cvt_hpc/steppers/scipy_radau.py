"""Radau IIA by SciPy (Hairer and Wanner 1996, sec. IV.8).

Order 5, three stages that are solved together, implicit, L-stable, adaptive. A yardstick that people know,
not one of the family: called from Python, with full matrices, one real and one complex, by difference
quotients.
"""

from dataclasses import replace
from functools import partial

from scipy.integrate import Radau

from cvt_hpc.steppers.scipy_march import FACTS as COMMON
from cvt_hpc.steppers.scipy_march import PARAMETERS, control, march_by, work

__all__ = ["FACTS", "PARAMETERS", "control", "march", "work"]

FACTS = replace(
    COMMON,
    width_limit=0.3,
    l_stable=True,
    stability="no limit",
    damping="below the tolerance; what is too fast for the step is gone after it",
)
march = partial(march_by, Radau)
