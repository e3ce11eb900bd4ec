"""A diagonally implicit Runge-Kutta method with one coefficient on its diagonal (Alexander 1977).

Order 3, three stages of one matrix, L-stable and stiffly accurate: the last stage is the new state, so that
motion much faster than the step is in balance after it. A vibration of frequency w is damped in third order,
at the rate 0.0259 step^3 w^4. A motion that grows by exp(z) in a step grows by

    R = (1 + (1 - 3 g) z + (1/2 - 3 g + 3 g^2) z^2) / (1 - g z)^3,

which falls below 1 at z = 1.455, long before its pole: from there on growth is turned into decay. It is of
stage order 1: where a stiff force moves the motion along, as friction that nearly sticks does, expect order 1
to 2.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers.facts import OK, Facts
from cvt_hpc.steppers.fixed_step import march_in_equal_steps
from cvt_hpc.steppers.newton import Frozen, frozen, solve_stage
from cvt_hpc.steppers.settings import SOLVER_TOLERANCE, STEP, ImplicitStep, implicit_step
from cvt_hpc.steppers.system import System

FACTS = Facts(
    order=3,
    order_at_events=1.05,
    implicit=True,
    l_stable=True,
    stability="no limit; growth is growth only while step times the steepest growth rate (falling friction: "
    "N |mu'| / m) is below 1.455",
    damping="a vibration decays at the rate 0.0259 step^3 w^4",
)
PARAMETERS = {"numerics": {"step": STEP, "solver_tolerance": SOLVER_TOLERANCE}}
control = implicit_step

# root of g^3 - 3 g^2 + 3 g / 2 = 1/6 for which the method is L-stable
G = 0.43586652150845899942
# largest z that grows: the least positive root of R = 1
GROWTH = 1.4554
NODES = np.array([G, 0.5 * (1.0 + G), 1.0])
WEIGHTS = np.array(
    [
        [0.0, 0.0],
        [0.5 * (1.0 - G), 0.0],
        [-(6.0 * G * G - 16.0 * G + 1.0) / 4.0, (6.0 * G * G - 20.0 * G + 5.0) / 4.0],
    ]
)


class Work(NamedTuple):
    """Matrix; known part (n,) and rates of the stages (3, n)."""

    frozen: Frozen
    base: np.ndarray
    start: np.ndarray
    rates: np.ndarray


def work(system: System) -> Work:
    """Work space for a system."""
    n = system.scale.size
    return Work(frozen(system, reach=1.0 / (G * GROWTH)), np.zeros(n), np.zeros(n), np.zeros((3, n)))


@kernel
def _advance(
    system: System,
    control: ImplicitStep,
    step: float,
    t: float,
    y: np.ndarray,
    work: Work,
    counts: np.ndarray,
) -> int:
    copy(y, work.start)
    for s in range(3):
        copy(work.start, work.base)
        for r in range(s):
            for i in range(y.size):
                work.base[i] += step * WEIGHTS[s, r] * work.rates[r, i]
        outcome = solve_stage(
            system, work.frozen, t + NODES[s] * step, work.base, G * step, control.solver_tolerance, y, counts
        )
        if outcome != OK:
            return outcome
        for i in range(y.size):
            work.rates[s, i] = (y[i] - work.base[i]) / (G * step)
    return OK


march = partial(march_in_equal_steps, _advance)
