"""The order that is left where friction turns: a mass that slides to rest, sticks, and is let go again.

Coulomb friction against the exact motion. The error of a single event goes up and down with its place in a
step; its mean over many places falls in first order with every method, whatever the order on smooth motion.
Explicit methods need a width of regularisation that goes with the step, implicit ones take any; Moreau's takes
none.
"""

import numpy as np
import pytest

from cvt_hpc.models.oscillator.exact import exact, phases
from support.small_systems import FACTS, FIXED, finished, order, scene

SLIDING_TO_REST = scene(
    "oscillator",
    static_friction=0.6,
    initial_displacement=2.5,
    initial_speed=0.0,
    duration=15.0,
    sampling_rate=2.0,
    solver_tolerance=1e-11,
)
STICK_SLIP = scene("oscillator", duration=25.0, sampling_rate=2.0)
STEPS = np.geomspace(0.1, 0.001, 25)
SPRINGS = np.linspace(0.93, 1.07, 12)  # [N/m]: events at so many places within a step
STROKE = 2.0 * np.hypot(0.4, 0.2)  # [m], of stick-slip
MARGIN = 1.5  # of the width over the one from which an explicit method chatters


def error(p, stepper):
    run = finished("oscillator", stepper, p)
    return np.sqrt(np.mean((run.displacement - exact(p, run.times)) ** 2))


def width(stepper, step):
    """Regularisation speed [m/s]: as small as the method takes it."""
    limit = FACTS[stepper].rest_limit
    return MARGIN * 0.6 * step / limit if np.isfinite(limit) else 1e-6


def test_the_scene_has_its_events():
    found = phases(SLIDING_TO_REST, 15.0)
    assert [np.sign(piece.centre) for piece in found[:2]] == [1.0, -1.0]
    assert np.isnan(found[2].centre) and found[3].centre > 0.0 and len(found) == 4


@pytest.mark.parametrize(
    ("stepper", "options", "expected"),
    [*((name, {}, FACTS[name].order_at_events) for name in FIXED), ("theta", {"theta": 1.0}, 0.94)],
)
def test_order_left_at_events(stepper, options, expected):
    steps = np.geomspace(0.05, 0.001, 7)
    errors = []
    for step in steps:
        p = SLIDING_TO_REST | options | {"step": step, "friction_speed": width(stepper, step)}
        each = [error(p | {"stiffness": spring}, stepper) for spring in SPRINGS]
        errors.append(np.sqrt(np.mean(np.square(each))))
    # other steps, of 0.002 or 0.0013 at the least, move the slope by up to 0.1
    assert order(steps, errors) == pytest.approx(expected, abs=0.1)
    assert errors[-1] < 0.003  # implicit Euler's; all others have less than 0.001


def test_stick_slip_with_friction_as_it_is():
    errors = [error(STICK_SLIP | {"step": step}, "moreau") for step in STEPS]
    assert order(STEPS, errors) == pytest.approx(1.0, abs=0.2)
    assert errors[-1] < 1e-4


def test_smoothed_stick_slip_tends_to_the_one_as_it_is():
    # widths of 1e-3 to 1e-5 m/s, resolved by an adaptive method: the hump at rest is slowly climbed, and left
    # after a time of the order of width^(2/3), as everywhere where a rest state vanishes in a fold
    widths = np.geomspace(1e-3, 1e-5, 3)
    p = STICK_SLIP | {"tolerance": 1e-8}
    errors = [error(p | {"friction_speed": each}, "scipy_radau") for each in widths]
    assert order(widths, errors) == pytest.approx(2.0 / 3.0, abs=0.02)
    # as measured; the tolerance leaves 1e-4 of it
    assert errors[0] == pytest.approx(0.107, rel=0.01)
    assert errors[-1] / STROKE == pytest.approx(0.0057, rel=0.02)


@pytest.mark.parametrize("stepper", ["dormand_prince", "scipy_lsoda", "scipy_bdf", "scipy_radau"])
def test_adaptive_steps_follow_the_event(stepper):
    # against the exact motion of unsmoothed friction, which the width leaves at 4e-4
    p = SLIDING_TO_REST | {"friction_speed": 1e-3, "tolerance": 1e-7}
    run = finished("oscillator", stepper, p)
    assert np.abs(run.displacement - exact(p, run.times)).max() < 0.01
