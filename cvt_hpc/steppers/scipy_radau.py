"""Radau IIA by SciPy (Hairer and Wanner 1996, sec. IV.8).

Order 5, three stages that are solved together, implicit, L-stable, adaptive. A yardstick that people know,
not one of the family: called from Python, with full matrices, one real and one complex, by difference
quotients.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import Radau

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
    l_stable=True,
    damping_limit=np.inf,
    stability="no limit",
    damping="below the tolerance; what is too fast for the step is gone after it",
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
    return march_by(Radau, system, control, interval, rows, clock, y, work, counts)
