"""What each method returns where it cannot go on, and where it leaves the state: never an exception."""

import numpy as np
import pytest

from cvt_hpc.kernels import kernel
from cvt_hpc.steppers.facts import MESSAGES, Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import SetValuedSystem
from support.scripted import ENDS, Script, system
from support.small_systems import ADAPTIVE, FACTS, METHODS, scene


@kernel
def no_contact(script, t, y, held, speed, low, high, restitution):
    speed[0] = low[0] = high[0] = restitution[0] = 0.0
    return True


def march(stepper, fate, **changes):
    """A march through 1 s, its outcome and rows."""
    equations = system(Script(ENDS, *fate), [1.0])
    if "friction" in FACTS[stepper].needs:
        equations = SetValuedSystem(*equations, no_contact, np.ones((1, 1)), np.ones((1, 1)))
    parameters = scene("oscillator", step=0.01, tolerance=1e-4, **changes)
    marching = Marching(stepper, parameters, equations, np.zeros(1), 0.1)
    rows = np.full((10, 1), np.nan)
    return marching, marching.advance(rows), rows


NEVER = np.inf


@pytest.mark.parametrize("stepper", METHODS)
def test_a_sound_march(stepper):
    marching, outcome, rows = march(stepper, (NEVER, NEVER, 0.0))
    assert outcome == Result.OK
    assert rows[:, 0] == pytest.approx(0.1 * np.arange(1, 11), abs=1e-6)
    assert marching.time == pytest.approx(1.0)
    assert marching.counters()["rates"] >= marching.steps > 0


@pytest.mark.parametrize("stepper", METHODS)
@pytest.mark.parametrize(
    ("fate", "expected"), [((0.55, NEVER, 0.0), Result.NO_VALUE), ((NEVER, 0.55, 0.0), Result.NOT_FINITE)]
)
def test_rates_that_end(stepper, fate, expected):
    marching, outcome, rows = march(stepper, fate)
    # an adaptive method may try ever shorter steps before it gives up
    allowed = {expected, Result.STEP_TOO_SMALL} if FACTS[stepper].adaptive else {expected}
    assert outcome in allowed
    assert np.all(np.isnan(rows[5:]))
    # SciPy's methods run into it with a long step, and lose the samples that it would have given
    if not stepper.startswith("scipy"):
        assert rows[:5, 0] == pytest.approx(0.1 * np.arange(1, 6), abs=1e-6)
        assert 0.5 <= marching.time < 0.6
    assert MESSAGES[outcome] in marching.explain(outcome)


@pytest.mark.parametrize("stepper", METHODS)
def test_a_motion_that_leaves_all_bounds(stepper):
    # y' = 1 + 9 y^2 is infinite at pi / 6 s
    marching, outcome, rows = march(stepper, (NEVER, NEVER, 9.0), most_steps=2000)
    assert outcome != Result.OK
    # some are late, none lives to see the end
    assert np.isnan(rows[-1, 0])
    assert np.isfinite(rows[3, 0])


@pytest.mark.parametrize("stepper", ADAPTIVE)
def test_steps_are_limited(stepper):
    marching, outcome, _ = march(stepper, (NEVER, NEVER, 0.0), most_steps=1)
    assert outcome == Result.TOO_MANY_STEPS
    assert "more steps" in marching.explain(outcome)


def test_every_result_has_its_words():
    assert set(MESSAGES) == set(Result) - {Result.OK}
