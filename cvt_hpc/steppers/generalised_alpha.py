"""Generalised alpha for first-order equations (Jansen, Whiting and Hulbert 2000).

Order 2, one implicit stage, A-stable. The rates of a step are balanced between its ends so that motions much
faster than the step shrink by the factor `spectral_radius` per step (0: gone after one, as L-stable methods;
1: kept, as by the midpoint rule), while slow ones are damped in third order only.

The rule is one for all unknowns, so that equations of first order (friction memory, sheave position) need no
treatment of their own. For masses and springs it differs from the classical method (Chung and Hulbert 1993)
in that displacements and velocities are treated alike, which spares it the overshoot of that method (Kadapa,
Dettmer and Peric 2017). The rates are carried from step to step; a state changed from outside restarts them.
"""

from functools import partial
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.parameters import Parameter
from cvt_hpc.solvers.generalised_alpha import generalised_alpha, stage_length
from cvt_hpc.steppers.facts import NO_VALUE, RATES, Facts
from cvt_hpc.steppers.fixed_step import march_in_equal_steps
from cvt_hpc.steppers.newton import Frozen, frozen, solve_stage
from cvt_hpc.steppers.settings import SOLVER_TOLERANCE, STEP, from_parameters
from cvt_hpc.steppers.system import System

FACTS = Facts(
    order=2,
    order_at_events=0.98,
    implicit=True,
    stability="no limit; solvable in one way only while step times the steepest growth rate (falling "
    "friction: N |mu'| / m) is below (1 + r) (3 - r) / 2, r the spectral radius",
    damping="a vibration decays at the rate ((1 - r) / (1 + r))^3 step^3 w^4 / 4, what is too fast for the "
    "step by the factor r per step",
)
PARAMETERS = {
    "numerics": {
        "step": STEP,
        "spectral_radius": Parameter(
            0.5,
            "",
            "factor per step of motions much faster than the step: 0 gone at once, 1 undamped",
            minimum=0.0,
            maximum=1.0,
        ),
        "solver_tolerance": SOLVER_TOLERANCE,
    }
}


class Control(NamedTuple):
    """Step [s], spectral radius [1], tolerance of the equations [1]."""

    step: float
    spectral_radius: float
    solver_tolerance: float


control = partial(from_parameters, Control)


class Work(NamedTuple):
    """Matrix; known part, intermediate state, carried rates and the state they belong to, (n,) each."""

    frozen: Frozen
    base: np.ndarray
    stage: np.ndarray
    rates: np.ndarray
    last: np.ndarray


def work(system: System) -> Work:
    """Work space for a system."""
    spaces = [np.full_like(system.scale, np.nan) for _ in range(4)]
    return Work(frozen(system), *spaces)


@kernel
def _advance(
    system: System, control: Control, step: float, t: float, y: np.ndarray, work: Work, counts: np.ndarray
) -> int:
    changed = False
    for i in range(y.size):
        changed |= work.last[i] != y[i]
    if changed:
        counts[RATES] += 1
        if not system.rates(system.constants, t, y, work.rates):
            return NO_VALUE
    scheme = generalised_alpha(control.spectral_radius)
    shift = stage_length(scheme, step)
    for i in range(y.size):
        work.base[i] = y[i] + (scheme.alpha_f * step - shift) * work.rates[i]
        work.stage[i] = y[i]
    outcome = solve_stage(
        system,
        work.frozen,
        t + scheme.alpha_f * step,
        work.base,
        shift,
        control.solver_tolerance,
        work.stage,
        counts,
    )
    for i in range(y.size):
        y[i] += (work.stage[i] - y[i]) / scheme.alpha_f
        work.rates[i] += ((work.stage[i] - work.base[i]) / shift - work.rates[i]) / scheme.alpha_m
        work.last[i] = y[i]
    return outcome


march = partial(march_in_equal_steps, _advance)
