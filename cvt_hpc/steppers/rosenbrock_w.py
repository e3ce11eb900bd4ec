"""A linearly implicit method of two stages that keeps its order with any matrix (ROS2, Verwer et al. 1999).

Order 2 whatever stands for the Jacobian (a W-method), two evaluations and two solves per step, no iteration;
L-stable with the true Jacobian. With A for the Jacobian and g = 1 - 1/sqrt(2):

    (I - g step A) k1 = f(t, y)
    (I - g step A) k2 = f(t + step, y + step k1) - 2 k1
    y + step (3 k1 + k2) / 2

Since any matrix serves the order, the inverse is frozen. How far it is off shows for free: the change of the
rates over the first stage, against A step k1 = (k1 - f) / g. Where the part that A missed moves the state by
more than a quarter of the stage itself, stability is at risk: A is taken anew and the step repeated.

It solves nothing to the end: a step across the sharp bend of regularised friction follows the tangent, where
an implicit method would find the bend. From step d = 4.0 on, d = N mu / (m v_reg), 3 k1 + k2 = 0 has
solutions beside rest, at which a mass slides on.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers.facts import NO_VALUE, NOT_UNIQUE, OK, RATES, REJECTED, SOLVES, Facts
from cvt_hpc.steppers.fixed_step import march_in_equal_steps
from cvt_hpc.steppers.newton import SHIFT, SIGN, Frozen, frozen, renew
from cvt_hpc.steppers.settings import STEP, FixedStep, fixed_step
from cvt_hpc.steppers.system import System, size

FACTS = Facts(
    order=2,
    order_at_events=0.98,
    implicit=True,
    l_stable=True,
    rest_limit=4.0,
    stability="no limit from what the frozen Jacobian holds; sound only while 0.293 step times the steepest "
    "growth rate (falling friction: N |mu'| / m) is below 1, and rest under friction is found while step < "
    "4.0 / d, d = N mu / (m v_reg)",
    damping="a vibration decays at the rate 0.0037 step^3 w^4",
)
PARAMETERS = {"numerics": {"step": STEP}}
control = fixed_step

G = 1.0 - np.sqrt(0.5)
_LARGEST_MISS = 0.25


class Work(NamedTuple):
    """Matrix; rates at both stages, both k, the matrix' error, state of the second stage, (n,) each."""

    frozen: Frozen
    first: np.ndarray
    second: np.ndarray
    k1: np.ndarray
    k2: np.ndarray
    missed: np.ndarray
    stage: np.ndarray


def work(system: System) -> Work:
    """Work space for a system."""
    return Work(frozen(system), *(np.zeros_like(system.scale) for _ in range(6)))


@kernel
def _matrix(
    system: System, t: float, y: np.ndarray, shift: float, anew: bool, work: Work, counts: np.ndarray
) -> int:
    frozen, outcome = work.frozen, OK
    anew = anew or frozen.memory[SIGN] == 0.0
    if anew or frozen.memory[SHIFT] != shift:
        copy(work.first, frozen.rates)
        outcome = renew(system, frozen, t, y, shift, anew, counts)
    return NOT_UNIQUE if outcome == OK and frozen.memory[SIGN] < 0.0 else outcome


@kernel
def _first_stage(
    system: System, step: float, t: float, y: np.ndarray, work: Work, counts: np.ndarray
) -> tuple[bool, float]:
    """k1, the rates after it, and how far the matrix was off, against the stage's own change."""
    np.dot(work.frozen.inverse, work.first, work.k1)
    counts[SOLVES] += 1
    for i in range(y.size):
        work.stage[i] = y[i] + step * work.k1[i]
    counts[RATES] += 1
    if not system.rates(system.constants, t + step, work.stage, work.second):
        return False, np.inf
    for i in range(y.size):
        work.missed[i] = G * (work.second[i] - work.first[i]) - (work.k1[i] - work.first[i])
    return True, size(work.missed, system.scale) / (size(work.k1, system.scale) + 1e-300)


@kernel
def _advance(
    system: System, control: FixedStep, step: float, t: float, y: np.ndarray, work: Work, counts: np.ndarray
) -> int:
    counts[RATES] += 1
    if not system.rates(system.constants, t, y, work.first):
        return NO_VALUE
    for attempt in range(2):
        outcome = _matrix(system, t, y, G * step, attempt > 0, work, counts)
        if outcome != OK:
            return outcome
        known, miss = _first_stage(system, step, t, y, work, counts)
        if known and miss <= _LARGEST_MISS:
            break
        counts[REJECTED] += 1 - attempt
    if not known:
        return NO_VALUE
    for i in range(y.size):
        work.stage[i] = work.second[i] - 2.0 * work.k1[i]
    np.dot(work.frozen.inverse, work.stage, work.k2)
    counts[SOLVES] += 1
    for i in range(y.size):
        y[i] += 0.5 * step * (3.0 * work.k1[i] + work.k2[i])
    return OK


march = partial(march_in_equal_steps, _advance)
