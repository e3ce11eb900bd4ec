"""Runge-Kutta pair of Dormand and Prince (1980), 5(4), with a step that follows from a tolerance.

Order 5, seven stages, the last of which is the first of the next step; explicit. The step is controlled by
the difference to the embedded method of order 4, with a proportional and an integral part (Hairer, Norsett
and Wanner 1993, sec. II.4: exponents 0.17 and 0.04). Steps end at the sampling instants, so that many samples
make it take more steps than the tolerance needs. It is not for stiff friction: there its step hovers about
3.3 / d, d the rate of the fastest decay, as long as the tolerance allows errors of a speed below a tenth of
the width of smoothed friction; with coarser tolerances it leaps over rest.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers import facts
from cvt_hpc.steppers.settings import MOST_STEPS, TOLERANCE, Tolerance, tolerance
from cvt_hpc.steppers.system import System, all_finite, size

FACTS = facts.Facts(
    order=5,
    adaptive=True,
    width_limit=0.1,
    stability="the control keeps the step below 3.3 / d for a damping rate d (friction: "
    "d = N mu / (m v_reg), while errors allowed in a speed are below 0.1 v_reg) and 1.0 / w for a vibration "
    "of frequency w",
    damping="below the tolerance",
)
PARAMETERS = {"numerics": {"tolerance": TOLERANCE, "most_steps": MOST_STEPS}}
control = tolerance

STAGES = 7
_SAFETY, LEAST_FACTOR, _LARGEST_FACTOR = 0.9, 0.2, 10.0
_PROPORTIONAL, _INTEGRAL = 0.04, 0.17
_LEAST_STEP = 1e-14  # of the time since the start: beyond, t + step is t
NODES = np.array([0.0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1.0, 1.0])
WEIGHTS = np.array(
    [
        [0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
        [1 / 5, 0.0, 0.0, 0.0, 0.0, 0.0],
        [3 / 40, 9 / 40, 0.0, 0.0, 0.0, 0.0],
        [44 / 45, -56 / 15, 32 / 9, 0.0, 0.0, 0.0],
        [19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729, 0.0, 0.0],
        [9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656, 0.0],
        [35 / 384, 0.0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84],
    ]
)
_ERROR_WEIGHTS = np.array([71 / 57600, 0.0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


class Work(NamedTuple):
    """Work space: rates of the stages (7, n), state of a stage (n,), next step [s] and last error (2,)."""

    rates: np.ndarray
    stage: np.ndarray
    memory: np.ndarray


def work(system: System) -> Work:
    """Work space for a system."""
    n = system.scale.size
    return Work(np.zeros((STAGES, n)), np.zeros(n), np.array([0.0, 1e-4]))


@kernel
def _stages(system: System, t: float, step: float, y: np.ndarray, work: Work, counts: np.ndarray) -> bool:
    """Rates of the stages after the first; the state of the last one is the new state."""
    for s in range(1, STAGES):
        for i in range(y.size):
            total = 0.0
            for r in range(s):
                total += WEIGHTS[s, r] * work.rates[r, i]
            work.stage[i] = y[i] + step * total
        counts[facts.RATES] += 1
        if not system.rates(system.constants, t + NODES[s] * step, work.stage, work.rates[s]):
            return False
    return True


@kernel
def _error(system: System, step: float, tolerance: float, y: np.ndarray, work: Work) -> float:
    """Root mean square of the step's error over the allowed error, [1]."""
    total = 0.0
    for i in range(y.size):
        error = 0.0
        for s in range(STAGES):
            error += _ERROR_WEIGHTS[s] * work.rates[s, i]
        allowed = tolerance * max(abs(y[i]), abs(work.stage[i]), system.scale[i])
        total += (step * error / allowed) ** 2
    return np.sqrt(total / y.size)


@kernel
def _sample(
    system: System,
    control: Tolerance,
    end: float,
    clock: np.ndarray,
    y: np.ndarray,
    work: Work,
    counts: np.ndarray,
) -> int:
    """March to `end`."""
    for _ in range(control.most_steps):
        left = end - clock[0]
        step = min(work.memory[0], left)
        if step < _LEAST_STEP * abs(end):
            return facts.STEP_TOO_SMALL
        known = _stages(system, clock[0], step, y, work, counts)
        error = _error(system, step, control.tolerance, y, work) if known else np.inf
        if not error <= 1.0:  # written so that an error that is not a number is refused too
            counts[facts.REJECTED] += 1
            factor = _SAFETY * error**-_INTEGRAL if np.isfinite(error) else LEAST_FACTOR
            work.memory[0] = step * max(factor, LEAST_FACTOR)
            continue
        counts[facts.STEPS] += 1
        error = max(error, 1e-10)
        factor = _SAFETY * error**-_INTEGRAL * work.memory[1] ** _PROPORTIONAL
        # a step that was cut at the end is no reason against a longer one
        proposed = step * min(max(factor, LEAST_FACTOR), _LARGEST_FACTOR)
        work.memory[0] = max(proposed, work.memory[0]) if step == left else proposed
        work.memory[1] = error
        copy(work.stage, y)
        copy(work.rates[STAGES - 1], work.rates[0])
        if step == left:
            clock[0] = end
            return facts.OK
        clock[0] += step
    return facts.TOO_MANY_STEPS


@kernel
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
    for k in range(rows.shape[0]):
        # anew for each sample: the state may have been changed from outside
        counts[facts.RATES] += 1
        if not system.rates(system.constants, clock[0], y, work.rates[0]):
            return facts.NO_VALUE
        if not all_finite(work.rates[0]):
            return facts.NOT_FINITE
        if work.memory[0] <= 0.0:
            work.memory[0] = min(0.01 / (size(work.rates[0], system.scale) + 1e-300), interval)
        outcome = _sample(system, control, clock[0] + interval, clock, y, work, counts)
        if outcome != facts.OK:
            return outcome
        copy(y, rows[k])
    return facts.OK
