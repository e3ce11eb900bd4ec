"""LSODA by SciPy: Adams methods, and backward differences where the motion is stiff (Petzold 1983).

Orders 1 to 12 (Adams) and 1 to 5 (backward differences), chosen as it goes; multistep, adaptive. A yardstick
that people know, not one of the family: called from Python, with a full matrix by difference quotients (which
count as evaluations of the rates; it does not report how many matrices it made).
"""

from dataclasses import replace
from functools import partial

from scipy.integrate import LSODA

from cvt_hpc.steppers.scipy_march import FACTS as COMMON
from cvt_hpc.steppers.scipy_march import PARAMETERS, control, march_by, work

__all__ = ["FACTS", "PARAMETERS", "control", "march", "work"]

FACTS = replace(
    COMMON,
    width_limit=0.1,
    stability="backward differences up to order 2 are A-stable, higher ones not near the imaginary axis",
)
march = partial(march_by, LSODA)
