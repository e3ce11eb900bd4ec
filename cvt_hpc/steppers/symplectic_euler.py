"""Symplectic Euler: velocities by the present forces, then positions by the new velocities.

Order 1, one stage. Unknowns that are neither velocities nor their positions follow last, by their rates at
the new velocities and positions (a second evaluation, in systems that have such unknowns).

It keeps an energy near the true one, without drift, where forces depend on positions only; it then is as good
as a leapfrog whose velocities are read half a step early. It is not symplectic for forces that depend on
velocities: these are taken explicitly, so that damping limits the step, and gyroscopic forces of frequency
w_g feed in energy at a rate of step w_g^2 / 2.
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
    order=1,
    order_at_events=0.94,
    needs=frozenset({"rates", "partition"}),
    rest_limit=2.0,
    vibration_limit=2.0,
    stability="step < 2 / w for a vibration of frequency w, step < 2 / d for a damping rate d (friction: "
    "d = N mu / (m v_reg))",
    damping="none where forces depend on positions only",
)
PARAMETERS = {"numerics": {"step": STEP}}
control = fixed_step


class Work(NamedTuple):
    """Work space: rates (n,); the unknowns that are neither velocities nor their positions (r,)."""

    rates: np.ndarray
    rest: np.ndarray


def work(system: System) -> Work:
    """Work space for a system."""
    known = system.velocities.copy()
    known[system.position_of[system.position_of >= 0]] = True
    return Work(np.zeros_like(system.scale), np.flatnonzero(~known))


@kernel
def _advance(
    system: System, control: FixedStep, step: float, t: float, y: np.ndarray, work: Work, counts: np.ndarray
) -> int:
    if not system.rates(system.constants, t, y, work.rates):
        return NO_VALUE
    counts[RATES] += 1
    for i in range(y.size):
        if system.velocities[i]:
            y[i] += step * work.rates[i]
    for i in range(y.size):
        if system.position_of[i] >= 0:
            y[system.position_of[i]] += step * y[i]
    if work.rest.size > 0:
        if not system.rates(system.constants, t, y, work.rates):
            return NO_VALUE
        counts[RATES] += 1
        for i in work.rest:
            y[i] += step * work.rates[i]
    return OK


march = partial(march_in_equal_steps, _advance)
