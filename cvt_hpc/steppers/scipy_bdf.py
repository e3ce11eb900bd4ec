"""Backward differences by SciPy, with a quasi-constant step (Shampine and Reichelt 1997).

Orders 1 to 5, chosen as it goes; multistep, implicit, adaptive. A yardstick that people know, not one of the
family: called from Python, with a full matrix by difference quotients. Orders above 2 are unstable for
lightly damped vibrations at some steps, which the control answers by short ones.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import BDF

from cvt_hpc.steppers.facts import Facts
from cvt_hpc.steppers.numerics import MOST_STEPS, TOLERANCE, Tolerance, tolerance
from cvt_hpc.steppers.scipy_march import Work, march_by
from cvt_hpc.steppers.system import System

FACTS = Facts(
    order=5,
    order_at_events=None,
    adaptive=True,
    needs=frozenset({"rates"}),
    implicit=True,
    l_stable=False,
    damping_limit=np.inf,
    stability="orders up to 2 are A-stable, higher ones not near the imaginary axis",
    damping="below the tolerance",
)
PARAMETERS = {"numerics": {"tolerance": TOLERANCE, "most_steps": MOST_STEPS}}
control = tolerance


def work(system: System) -> Work:
    """Where the integrator is kept."""
    return Work()


def march(
    system: System,
    control: Tolerance,
    interval: float,
    rows: np.ndarray,
    clock: np.ndarray,
    y: np.ndarray,
    work: Work,
    counts: np.ndarray,
) -> int:
    """March; see `cvt_hpc.steppers`."""
    return march_by(BDF, system, control, interval, rows, clock, y, work, counts)
