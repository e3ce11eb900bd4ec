"""Heun's Runge-Kutta method of order 3 with a fixed step: three stages, explicit.

Its stability region reaches 2.513 along the negative real axis and sqrt(3) along the imaginary one.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers.facts import RATES, Facts, Result
from cvt_hpc.steppers.fixed_step import march_in_equal_steps
from cvt_hpc.steppers.settings import STEP, fixed_step

FACTS = Facts(
    order=3,
    order_at_events=0.93,
    adaptive=False,
    needs=frozenset({"rates"}),
    implicit=False,
    l_stable=False,
    rest_limit=2.513,
    vibration_limit=1.732,
    stability="step < 1.732 / w for a vibration of frequency w, step < 2.513 / d for a damping rate d",
    damping="a vibration decays at the rate step^3 w^4 / 24",
)
PARAMETERS = {"numerics": {"step": STEP}}
OK, NO_VALUE = int(Result.OK), int(Result.NO_VALUE)
control = fixed_step


class Work(NamedTuple):
    """Work space: rates at the start and of a stage, and the state of that stage, (n,) each."""

    first: np.ndarray
    rates: np.ndarray
    stage: np.ndarray


def work(system):
    """Work space for a system."""
    return Work(*(np.zeros_like(system.scale) for _ in range(3)))


@kernel
def _advance(system, control, step, t, y, work, counts):
    counts[RATES] += 3
    if not system.rates(system.constants, t, y, work.first):
        return NO_VALUE
    copy(work.first, work.rates)
    for share in (1.0 / 3.0, 2.0 / 3.0):
        for i in range(y.size):
            work.stage[i] = y[i] + share * step * work.rates[i]
        if not system.rates(system.constants, t + share * step, work.stage, work.rates):
            return NO_VALUE
    for i in range(y.size):
        y[i] += step * (0.25 * work.first[i] + 0.75 * work.rates[i])
    return OK


march = partial(march_in_equal_steps, _advance)
