"""A run by one stepper that goes on where a run by another stands."""

import numpy as np
import pytest

from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt.transient import batch
from cvt_hpc.models.quasi_static_belt.transient import batch as quasi_static_batch

COARSE = {"stations": 48, "duration": 0.04, "rise_time": 4e-3, "load": 60.0}
BEFORE, TOGETHER = 100, 20  # samples; the disturbance comes at 80
STEPS = {"explicit": 2e-7, "symplectic_euler": 2e-7, "imex": 2e-6}


def runs(stepper, model="elastic_belt", make=batch, count=1, **values):
    document = {"name": "test", "model": model, "stepper": stepper}
    options = {"step": STEPS[stepper]} if stepper in STEPS else {}
    options |= {"precision": "double"} if stepper == "imex" else {}
    point = build_job(document, "test.toml", COARSE | options | values).point(0)
    return make([point | {"disturbance": 1e-6 * (1 + k)} for k in range(count)], stepper)


def marched(group, samples):
    while group.done < samples:
        group.advance(samples - group.done)
        assert all(run.failure is None for run in group.runs)
    return group


@pytest.mark.parametrize("stepper", ["explicit", "symplectic_euler", "imex"])
def test_a_run_taken_over_is_the_run_that_was_not_broken_off(stepper):
    whole = marched(runs("explicit"), BEFORE + TOGETHER)
    taken = runs(stepper)
    taken.take_over(marched(runs("explicit"), BEFORE).runs)
    assert taken.done == BEFORE
    (run,) = marched(taken, BEFORE + TOGETHER).runs
    assert run.time == pytest.approx(6e-3, rel=1e-12)
    assert run.steps == pytest.approx(1e-3 / STEPS[stepper], abs=1)  # its own, without those before
    expected, found = whole.runs[0].displacement, run.displacement
    assert np.array_equal(found[:BEFORE], expected[:BEFORE])
    # the same steps from a state that was handed on to a part in 1e16; imex has an error of its own, of some nm
    moved = np.abs(expected[BEFORE:] - expected[BEFORE - 1]).max()
    assert moved > 1e-6
    assert found[BEFORE:] == pytest.approx(
        expected[BEFORE:], abs=moved * (0.02 if stepper == "imex" else 1e-8)
    )


def test_lanes_take_over_each_its_own_run():
    led = marched(runs("imex", count=3), BEFORE)
    taken = runs("imex", count=3)
    taken.take_over(led.runs)
    marched(taken, BEFORE + TOGETHER)
    marched(led, BEFORE + TOGETHER)
    for run, other in zip(taken.runs, led.runs, strict=True):
        moved = np.abs(other.displacement[BEFORE:] - other.displacement[BEFORE - 1]).max()
        assert run.displacement == pytest.approx(other.displacement, abs=1e-8 * moved)
    assert np.abs(taken.runs[0].displacement - taken.runs[2].displacement).max() > 1e-7


@pytest.mark.parametrize("stepper", ["imex", "symplectic_euler"])
def test_the_disturbance_comes_once(stepper):
    kick = 80
    late, early = marched(runs("explicit"), kick + 1), marched(runs("explicit"), kick)
    shift = []
    for led in (late, early):
        taken = runs(stepper)
        taken.take_over(led.runs)
        before = taken.runs[0].state.fields[0]
        taken.advance(1)
        shift.append(np.abs(taken.runs[0].state.fields[0] - before).max())
    # 1 um at the kick; within a sample the coarse belt moves by some nm otherwise
    assert shift[0] < 0.2e-6 < 0.5e-6 < shift[1]


def test_another_model_of_the_belt_takes_over_what_it_can_represent():
    led = marched(runs("explicit"), BEFORE)
    taken = runs("scipy_bdf", "quasi_static_belt", quasi_static_batch)
    taken.take_over(led.runs)
    (before,), (run,) = led.runs, taken.runs
    assert run.state.fields[0] == pytest.approx(before.state.fields[0], abs=2e-5)  # its splines are coarse
    assert run.state.scalars[1] == pytest.approx(before.state.scalars[1], rel=1e-12)
