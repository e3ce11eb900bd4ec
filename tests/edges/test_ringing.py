"""The trapezoidal rule on a stiff contact: it rings, and so opens a contact that presses.

A mass is pressed on a damped stop by F and given a small speed v into it. The stop, force k d + c v (never
pulling), takes that speed within m / c. With a step far above, the trapezoidal rule turns the speed about in
every step, by (1 - z / 2) / (1 + z / 2), z = c step / m: the mass moves out at nearly v, and the stop lets go
where the force F - c v (z / 2 - 1) / (z / 2 + 1) would be below 0.
"""

import numpy as np
import pytest

from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching
from support.scripted import STOP, Script, system
from support.small_systems import bisect

RATE, SLOW, PRESS, PUSH = 1e4, 1.0, 10.0, 2e-3  # c / m, k / c [1/s], F / m [m/s^2], v [m/s]


def lets_go(stepper, step, **options):
    """Whether the stop is ever without force in the first twenty steps."""
    stiffness = SLOW * RATE
    stop = system(Script(STOP, RATE, stiffness, PRESS), [PRESS / stiffness, PUSH])
    parameters = {"step": step, "theta": 0.5, "spectral_radius": 0.5, "solver_tolerance": 1e-10} | options
    march = Marching(stepper, parameters, stop, np.array([-PRESS / stiffness, -PUSH]), step)
    rows = np.zeros((20, 2))
    assert march.advance(rows) == Result.OK
    return bool(np.any(-stiffness * rows[:, 0] - RATE * rows[:, 1] <= 0.0))


def test_the_step_from_which_the_trapezoidal_rule_opens_the_contact():
    measured = bisect(lambda step: lets_go("theta", step), 1.0 / RATE, 100.0 / RATE)
    share = PRESS / (RATE * PUSH)
    assert measured == pytest.approx(2.0 / RATE * (1 + share) / (1 - share), rel=0.02)


@pytest.mark.parametrize(("stepper", "options"), [("theta", {"theta": 1.0}), ("sdirk", {})])
@pytest.mark.parametrize("step", [1e-5, 1e-4, 1e-3, 1e-2])
def test_l_stable_methods_hold_it(stepper, options, step):
    assert not lets_go(stepper, step, **options)


def test_the_linearly_implicit_method_overshoots_in_its_first_stage():
    # by (z / (1 + g z) - 1), up to 1 / g - 1 = 2.4 times the speed: below F it does no harm
    share, g = PRESS / (RATE * PUSH), 1.0 - np.sqrt(0.5)
    harmless = (1 + share) / (1 - g * (1 + share))
    for part in (0.1, 0.5, 0.99):
        assert not lets_go("rosenbrock_w", part * harmless / RATE)
    measured = bisect(lambda step: lets_go("rosenbrock_w", step), harmless / RATE, 1e-3) * RATE
    assert harmless < measured < 2.0 * harmless
