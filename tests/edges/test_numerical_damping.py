"""Implicit Euler's damping, which silences a vibration that friction drives: from which step on it does.

The linear law, slid over at one side: growth at the rate s = -(c + N g) / (2 m), frequency w. Implicit Euler
multiplies a motion exp((s + i w) t) by 1 / (1 - (s + i w) step) in each step, and so lets it grow while step < 2
s / (s^2 + w^2). A vibration of 600 Hz that grows at 50 / s dies from 7 us on.
"""

import numpy as np
import pytest

from cvt_hpc.models.oscillator.exact import exact
from cvt_hpc.variables import Status
from support.small_systems import FIXED, begin, bisect, finished, scene

FREQUENCY, GROWTH = 2 * np.pi * 600.0, 50.0
MASS, LOAD = 0.02, 500.0
SQUEAL = scene(
    "oscillator",
    mass=MASS,
    stiffness=MASS * (FREQUENCY**2 + GROWTH**2),
    normal_load=LOAD,
    friction_law="linear",
    friction_gradient=-2 * MASS * GROWTH / LOAD,
    stribeck_velocity=1.0,
    kinetic_friction=0.1,
    belt_speed=0.5,
    duration=0.02,
    sampling_rate=2e4,
    solver_tolerance=1e-13,
)
PULL = LOAD * (0.1 - 2 * MASS * GROWTH / LOAD * (0.5 - 1.0)) / SQUEAL["stiffness"]
SQUEAL |= {"initial_displacement": PULL + 1e-6, "initial_speed": 0.0}
DURATION = SQUEAL["duration"]


def growth(stepper, step, **options):
    """Growth rate of the swing [1/s], from its energy at both ends."""
    interval = step * max(round(5e-5 / step), 1)
    p = SQUEAL | options | {"step": step * (1 + 1e-12), "sampling_rate": 1.0 / interval}
    run = begin("oscillator", stepper, p)
    run.advance(run.samples)
    away, speed = run.displacement[:, 0] - PULL, run.channel("speed")
    # a quadratic form of the motion that exp(2 s t) multiplies without ripple
    energy = (speed - GROWTH * away) ** 2 + (FREQUENCY * away) ** 2
    return np.polyfit(run.times, 0.5 * np.log(energy), 1)[0]


def test_the_vibration_grows_as_predicted():
    assert growth("runge_kutta_4", 2e-6) == pytest.approx(GROWTH, rel=1e-4)
    times = np.array([0.001, 0.002])
    assert exact(SQUEAL, times)[:, 0] - PULL == pytest.approx(
        1e-6 * np.exp(GROWTH * times) * np.cos(FREQUENCY * times), abs=3e-8
    )


def test_the_step_from_which_implicit_euler_silences_it():
    limit = bisect(lambda step: growth("theta", step, theta=1.0) < 0.0, 1e-6, 5e-5, times=10)
    assert limit == pytest.approx(2 * GROWTH / (GROWTH**2 + FREQUENCY**2), rel=0.02)
    assert limit == pytest.approx(7.0e-6, rel=0.02)


@pytest.mark.parametrize(("share", "named"), [(0.97, False), (1.03, True)])
def test_silence_is_named(share, named):
    step = share * 2 * GROWTH / (GROWTH**2 + FREQUENCY**2)
    p = SQUEAL | {"step": step * (1 + 1e-12), "sampling_rate": 1.0 / (7 * step), "theta": 1.0}
    run = begin("oscillator", "theta", p)
    failure = run.advance(1)
    if named:
        assert failure[0] == Status.FAILED_NUMERICS
        assert failure[1].startswith("the step damps, at ")
        assert failure[1].endswith(" 1/s, a vibration that friction drives at 50 1/s")
    else:
        assert failure is None


def test_a_vibration_that_friction_does_not_drive_may_be_damped():
    p = SQUEAL | {"step": 1e-5, "theta": 1.0, "damping": 2 * MASS * 60.0}
    finished("oscillator", "theta", p)


@pytest.mark.parametrize(
    ("stepper", "options"),
    [
        *((name, {}) for name in FIXED),
        ("generalised_alpha", {"spectral_radius": 0.0}),
    ],
)
def test_other_methods_keep_it_at_three_times_that_step(stepper, options):
    assert growth(stepper, 2e-5, **options) == pytest.approx(GROWTH, rel=0.1)
