"""Implicit steps on the belt: where their equations have no solution, because a force jumps."""

import pytest

from cvt_hpc.variables import Status
from support.belts import general

# Pressed elements have a damper, which is there from the moment their gap closes: P jumps from 0 to the damping
# times their speed of closing over a cell. A step that would end at the jump ends nowhere.
JUMP, NO_JUMP = {"element_damping": 20.0}, {"element_damping": 0.0}
SAMPLES = 10  # 0.5 ms, in which gaps close


@pytest.mark.parametrize("step", [1.5e-6, 3e-6])
def test_a_damper_that_sets_in_with_contact_leaves_implicit_euler_without_a_solution(step):
    # a shorter step is no way around
    run = general("theta", theta=1.0, solver_tolerance=1e-6, step=step, **JUMP)
    status, reason = run.advance(SAMPLES)
    assert status == Status.FAILED_NUMERICS
    assert "the equations of an implicit step were not solved" in reason


def test_without_that_damper_it_has_one_at_the_same_step():
    run = general("theta", theta=1.0, solver_tolerance=1e-6, step=3e-6, **NO_JUMP)
    assert run.advance(SAMPLES) is None
    assert run.done == SAMPLES
    # kinks are found by a matrix of their own: every other step or more takes one
    assert run.counters()["jacobians"] > 0.3 * run.steps
