"""The classical Runge-Kutta method with a fixed step.

Order 4, four stages, explicit. Its stability region reaches 2.785 along the negative real axis and 2.828
along the imaginary one. It is not for stiff friction, and it damps motion that it cannot resolve: a vibration
of frequency w decays by itself at a rate of (step w)^6 / (144 step).
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.steppers.facts import NO_VALUE, OK, RATES, Facts
from cvt_hpc.steppers.fixed_step import march_in_equal_steps
from cvt_hpc.steppers.settings import STEP, FixedStep, fixed_step
from cvt_hpc.steppers.system import System

FACTS = Facts(
    order=4,
    order_at_events=0.92,
    rest_limit=2.785,
    vibration_limit=2.828,
    stability="step < 2.828 / w for a vibration of frequency w, step < 2.785 / d for a damping rate d "
    "(friction: d = N mu / (m v_reg))",
    damping="a vibration decays at the rate (step w)^6 / (144 step)",
)
PARAMETERS = {"numerics": {"step": STEP}}
control = fixed_step


class Work(NamedTuple):
    """Work space: rates, their weighted sum, and the state of a stage, (n,) each."""

    rates: np.ndarray
    total: np.ndarray
    stage: np.ndarray


def work(system: System) -> Work:
    """Work space for a system."""
    return Work(*(np.zeros_like(system.scale) for _ in range(3)))


@kernel
def _advance(
    system: System, control: FixedStep, step: float, t: float, y: np.ndarray, work: Work, counts: np.ndarray
) -> int:
    work.total[:] = 0.0
    for part, weight in ((0.0, 1.0), (0.5, 2.0), (0.5, 2.0), (1.0, 1.0)):
        for i in range(y.size):
            work.stage[i] = y[i] + part * step * work.rates[i] if part > 0.0 else y[i]
        counts[RATES] += 1
        if not system.rates(system.constants, t + part * step, work.stage, work.rates):
            return NO_VALUE
        for i in range(y.size):
            work.total[i] += weight * work.rates[i]
    for i in range(y.size):
        y[i] += step / 6.0 * work.total[i]
    return OK


march = partial(march_in_equal_steps, _advance)
