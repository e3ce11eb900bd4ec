"""Rest as the methods see it: creep where friction is smoothed, a closing gap that takes infinitely many
bounces, the depth to which a gap is overrun, and numbers too short for a small step.
"""

from typing import NamedTuple

import numpy as np
import pytest

from cvt_hpc.kernels import kernel
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import SetValuedSystem
from support.scripted import ENDS, Script, system
from support.small_systems import finished, order, scene

# A mass on a belt at rest, held by a spring so soft that its pull does not change: friction of 0.6 N holds it.
PULL = 0.3
HELD = scene(
    "oscillator",
    belt_speed=0.0,
    static_friction=0.6,
    stiffness=1e-3,
    initial_displacement=-PULL / 1e-3,
    initial_speed=0.0,
    friction_speed=1e-3,
    duration=2.0,
    sampling_rate=10.0,
    step=1e-3,
    # this spring's typical displacement is 600 m
    tolerance=1e-12,
    solver_tolerance=1e-14,
)


@pytest.mark.parametrize("stepper", ["runge_kutta_4", "theta", "sdirk", "rosenbrock_w", "dormand_prince"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.99])
def test_smoothed_friction_creeps(stepper, share):
    p = HELD | {"initial_displacement": -share * 0.6 / 1e-3}
    run = finished("oscillator", stepper, p)
    creep = np.diff(run.displacement[-2:, 0])[0] / run.interval
    # the spring has let go a little by the way that the mass has crept
    pull = -1e-3 * (run.displacement[-1, 0] - 0.5 * creep * run.interval)
    assert creep == pytest.approx(1e-3 * np.arctanh(pull / 0.6), rel=1e-5)


def test_friction_as_it_is_does_not():
    run = finished("oscillator", "moreau", HELD)
    assert np.all(run.displacement == -PULL / 1e-3)
    assert np.all(run.channel("speed") == 0.0)


class Ball(NamedTuple):
    """Gravity [m/s^2] and coefficient of restitution [1]."""

    gravity: float
    restitution: float


@kernel
def falling(ball, t, y, out):
    out[0], out[1] = y[1], -ball.gravity
    return True


@kernel
def floor(ball, t, y, held, speed, low, high, restitution):
    speed[0], low[0], restitution[0] = y[1], 0.0, ball.restitution
    high[0] = np.inf if y[0] <= 0.0 else 0.0
    return True


BALL = Ball(9.81, 0.9)
# h 1 m, g 9.81, e 0.9: t_n = t_1 (1 + 2 (e + ... + e^(n-1))), t_1 = sqrt(2 h / g)
BOUNCES, END = (0.4515236, 1.2642662, 1.9957345), 8.578949


def dropped(step, duration):
    """Heights and speeds after each step of a ball dropped from 1 m."""
    equations = SetValuedSystem(
        falling,
        BALL,
        np.array([False, True]),
        np.array([-1, 0]),
        np.ones(2),
        floor,
        np.array([[0.0, 1.0]]),
        np.array([[0.0], [1.0]]),
    )
    march = Marching("moreau", {"step": step}, equations, np.array([1.0, 0.0]), step)
    rows = np.zeros((int(duration / step), 2))
    assert march.advance(rows) == Result.OK
    return rows.T


def test_bounces_come_when_they_should():
    steps, errors = np.geomspace(1e-2, 1e-4, 9), []
    for step in steps:
        _, speed = dropped(step, 2.2)
        times = step * (1 + np.flatnonzero(np.diff(speed) > 0.0))
        assert times.size == 3
        errors.append(np.abs(times - BOUNCES).max())
    assert errors[-1] < 5e-4
    assert order(steps, errors) == pytest.approx(1.0, abs=0.3)


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4])
def test_infinitely_many_bounces_end(step):
    height, speed = dropped(step, 10.0)
    rest = np.flatnonzero(np.abs(speed) > 2.0 * step * BALL.gravity)[-1] * step
    # a bounce of two steps' fall lasts four steps, and 1 / (1 - e) times as long is left when it comes
    assert (END - rest) / step == pytest.approx(40.0, abs=15.0)
    # from then on the speed is turned about by e in every step
    assert np.abs(speed[-2:]).max() < 1e-8


@pytest.mark.parametrize("step", [1e-2, 1e-3, 1e-4])
def test_gaps_are_overrun_by_less_than_a_step(step):
    height, speed = dropped(step, 10.0)
    fastest = np.sqrt(2.0 * BALL.gravity)
    assert -fastest * step < height.min() < 0.0
    # at rest by what a bounce of the last few steps can overrun, and no drift
    assert -5.0 * step**2 < height[-1] <= 0.0
    assert height[-1] == pytest.approx(height[-100], abs=1e-7)


@pytest.mark.parametrize("stepper", ["runge_kutta_4", "symplectic_euler"])
def test_single_precision_loses_small_steps(stepper):
    # a position of 1 m, in numbers 1.2e-7 apart, at 1 m/s: less than half a gap per step does not move it
    limit = 0.5 * np.finfo(np.float32).eps
    drifting = system(Script(ENDS, np.inf, np.inf, 0.0), [1.0])
    for share, moved in ((0.98, 0.0), (1.02, 2.0 / 1.02)):
        step = share * limit
        for precision, expected in ((np.float32, moved), (np.float64, 1.0)):
            equations = drifting._replace(scale=np.ones(1, dtype=precision))
            march = Marching(stepper, {"step": step}, equations, np.ones(1, dtype=precision), 1000 * step)
            rows = np.zeros((1, 1), dtype=precision)
            assert march.advance(rows) == Result.OK
            assert (rows[0, 0] - 1.0) / (1000 * step) == pytest.approx(expected, abs=0.01)
