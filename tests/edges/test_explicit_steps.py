"""Explicit steps against smoothed friction: from where a mass that should stick chatters, and how it shows."""

import numpy as np
import pytest

from cvt_hpc.variables import Status
from support.small_systems import FACTS, begin, bisect, finished
from support.sticking import LOAD, MASS, MU, RATE, STUCK, WIDTH


def sliding(stepper, **changes):
    """Sliding speed at the samples of a mass that should stick, whatever the program says of it."""
    run = begin("oscillator", stepper, STUCK | changes)
    run.advance(run.samples)
    return np.abs(run.rows[:, 1])


@pytest.mark.parametrize("stepper", ["symplectic_euler", "runge_kutta_4"])
def test_the_step_from_which_friction_chatters(stepper):
    limit = bisect(
        lambda step: sliding(stepper, step=step, sampling_rate=0.1 / step)[-1] > 0.01 * WIDTH,
        0.2 / RATE,
        20.0 / RATE,
    )
    assert limit == pytest.approx(FACTS[stepper].rest_limit / RATE, rel=0.02)


@pytest.mark.parametrize("stepper", ["symplectic_euler", "runge_kutta_4"])
def test_chatter_is_named_and_its_size_is_a_step_of_friction(stepper):
    step = 4.0 / RATE
    p = STUCK | {"step": step, "sampling_rate": 1.0 / step, "duration": 400 * step}
    run = begin("oscillator", stepper, p)
    status, reason = run.advance(run.samples)
    assert status == Status.FAILED_NUMERICS
    assert f"the step is beyond {FACTS[stepper].rest_limit / RATE:.3g} s" in reason
    # half of a step's change of speed to either side by Euler's method, an eighth of that by the other
    chatter = np.abs(run.rows[-50:, 1]).max()
    assert 0.05 * step * LOAD * MU / MASS < chatter < step * LOAD * MU / MASS
    sound = finished("oscillator", stepper, p | {"step": 0.25 * step})
    assert np.abs(sound.channel("speed")[-50:]).max() < 1e-9


def test_a_long_step_is_no_failure_where_the_mass_only_slides():
    # the same step, on a mass that the belt never catches up
    p = STUCK | {"step": 4.0 / RATE, "belt_speed": 1.0, "initial_displacement": 0.6}
    p |= {"kinetic_friction": 0.3, "static_friction": 0.3, "duration": 4.0}
    run = finished("oscillator", "runge_kutta_4", p)
    assert run.done == run.samples


def test_adaptive_explicit_steps_hover_at_the_limit():
    run = finished("oscillator", "dormand_prince", STUCK | {"tolerance": 1e-6, "sampling_rate": 10.0})
    assert run.step == pytest.approx(3.3 / RATE, rel=0.1)


@pytest.mark.parametrize("stepper", ["theta", "generalised_alpha", "sdirk", "moreau"])
def test_other_steps_are_not_limited_by_the_width(stepper):
    p = STUCK | {"step": 100.0 / RATE, "theta": 1.0, "spectral_radius": 0.0}
    run = finished("oscillator", stepper, p)
    assert np.abs(run.channel("speed")).max() < 1e-9
