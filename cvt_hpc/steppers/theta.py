"""The theta method: a share theta of the rates from the end of the step, the rest from its start.

One implicit stage. Order 2 at theta = 1/2 (trapezoidal rule), order 1 else; theta = 1 is implicit Euler.
A-stable for theta >= 1/2, L-stable for theta = 1 alone: the trapezoidal rule turns a motion that is much
faster than the step about in every step, undamped (ringing). theta = 1 damps every vibration, at the rate
step w^2 / 2, those that grow by themselves included: a growth rate below that is turned into decay.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.parameters import Parameter
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers.facts import NO_VALUE, RATES, Facts
from cvt_hpc.steppers.fixed_step import march_in_equal_steps
from cvt_hpc.steppers.newton import Frozen, frozen, solve_stage
from cvt_hpc.steppers.settings import SOLVER_TOLERANCE, STEP, from_parameters
from cvt_hpc.steppers.system import System

FACTS = Facts(
    order=2,
    order_at_events=0.97,
    implicit=True,
    stability="no limit; solvable in one way only while theta step times the steepest growth rate (falling "
    "friction: N |mu'| / m) is below 1",
    damping="theta = 1/2: none, and none of what is too fast for the step; else at the rate "
    "(theta - 1/2) step w^2",
)
PARAMETERS = {
    "numerics": {
        "step": STEP,
        "theta": Parameter(
            0.5,
            "",
            "share of the rates at the end of a step: 0.5 trapezoidal rule, 1 implicit Euler",
            minimum=0.5,
            maximum=1.0,
        ),
        "solver_tolerance": SOLVER_TOLERANCE,
    }
}


class Control(NamedTuple):
    """Step [s], theta [1], tolerance of the equations [1]."""

    step: float
    theta: float
    solver_tolerance: float


control = partial(from_parameters, Control)


class Work(NamedTuple):
    """Matrix; known part of the equations and rates at the start, (n,) each."""

    frozen: Frozen
    base: np.ndarray
    rates: np.ndarray


def work(system: System) -> Work:
    """Work space for a system."""
    return Work(frozen(system), np.zeros_like(system.scale), np.zeros_like(system.scale))


@kernel
def _advance(
    system: System, control: Control, step: float, t: float, y: np.ndarray, work: Work, counts: np.ndarray
) -> int:
    copy(y, work.base)
    if control.theta < 1.0:
        counts[RATES] += 1
        if not system.rates(system.constants, t, y, work.rates):
            return NO_VALUE
        for i in range(y.size):
            work.base[i] += (1.0 - control.theta) * step * work.rates[i]
    shift = control.theta * step
    return solve_stage(system, work.frozen, t + step, work.base, shift, control.solver_tolerance, y, counts)


march = partial(march_in_equal_steps, _advance)
