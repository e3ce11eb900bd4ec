"""Vibrations that a step drives or damps by itself: from when on, and that the run says so."""

import numpy as np
import pytest

from cvt_hpc.models.moving_string.exact import frequency
from cvt_hpc.variables import Status
from support.small_systems import FACTS, begin, bisect, scene

STRING = scene("moving_string", cells=32, duration=0.05)
SWING = scene(
    "oscillator",
    stiffness=1e6,
    kinetic_friction=0.1,
    static_friction=0.1,
    belt_speed=10.0,
    initial_displacement=1e-3,
    initial_speed=0.0,
)


@pytest.mark.parametrize("stepper", ["symplectic_euler", "runge_kutta_4", "moreau"])
def test_the_step_from_which_a_vibration_grows(stepper):
    def run_at(step):
        return begin(
            "oscillator",
            stepper,
            SWING | {"step": step, "sampling_rate": 1.0 / step, "duration": 2000 * step},
        )

    def grows(step):
        run = run_at(step)
        run.advance(run.samples)
        return not np.abs(run.rows[:, 0]).max() < 0.1

    limit = FACTS[stepper].vibration_limit / 1e3
    assert bisect(grows, 0.5 * limit, 2.0 * limit) == pytest.approx(limit, rel=0.01)
    for share, named in ((0.99, False), (1.01, True)):
        run = run_at(share * limit)
        failure = run.advance(run.samples)
        assert (failure is not None) == named
    assert failure[0] == Status.FAILED_NUMERICS
    assert failure[1] == f"the step is beyond {limit:.3g} s, from where the fastest vibration grows by itself"


def first_failure(stepper, **values):
    """The run at its first failure, and that."""
    run = begin("moving_string", stepper, STRING | values)
    failure = None
    while failure is None and run.done < run.samples:
        failure = run.advance(1)
    return run, failure


def test_the_string_knows_its_fastest_wave():
    for share, named in ((0.99, False), (1.01, True)):
        # 0.99 of 2.828 / w, by a wave between the eyes that hardly drifts: 2 c / h
        wave = np.sqrt(STRING["tension"] / STRING["line_mass"])
        step = share * 2.828 * STRING["length"] / STRING["cells"] / (2.0 * wave)
        _, failure = first_failure("runge_kutta_4", step=step, sampling_rate=1.0 / step, duration=20 * step)
        assert (failure is not None and "fastest vibration" in failure[1]) == named


def test_numerical_damping_is_named_when_half_of_the_energy_is_gone():
    step = 5e-5
    run, (status, reason) = first_failure("theta", step=step, theta=1.0, sampling_rate=1.0 / step)
    assert status == Status.FAILED_NUMERICS
    assert reason.startswith("the method damps the motion: energy that the string keeps is 0.4")
    # the amplitude decays at the rate step w^2 / 2
    predicted = np.log(2.0) / (step * (2.0 * np.pi * frequency(STRING)) ** 2)
    assert run.time == pytest.approx(predicted, rel=0.05)


def test_waves_that_the_method_drives_are_named():
    # gyroscopic forces taken explicitly: the shortest waves grow at step (2 v / h)^2 / 2 from round-off
    step = 2e-5
    fast = STRING | {"belt_speed": 50.0}
    cell = STRING["length"] / STRING["cells"]
    growth = 0.5 * step * (2.0 * fast["belt_speed"] / cell) ** 2
    run, (status, reason) = first_failure("symplectic_euler", belt_speed=50.0, step=step)
    assert status == Status.FAILED_NUMERICS
    assert reason.startswith("the method drives the motion")
    # seen as soon as it is there: round-off of 1e-16 has become of the motion's size
    assert run.time < np.log(1e16) / growth + 5e-4
    # a step for which it takes longer than the run
    assert first_failure("symplectic_euler", belt_speed=9.4, step=5e-6)[1] is None
