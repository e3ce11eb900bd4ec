"""The belt under general steppers: the same run as by its own explicit step, and the Jacobian that helps."""

from functools import cache

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt.general_run import GeneralTransient, SparseJacobian, groups, pattern
from cvt_hpc.models.elastic_belt.one_system import flat_belt, pack, system
from cvt_hpc.variables import Status
from support.equations import slopes
from support.lone import Transient
from support.marched import CHEAP, job

SAMPLES = 15
COARSE = CHEAP | {"stations": 24}


@cache
def plain(step, **values):
    """By the belt's own explicit step."""
    asked = job("explicit", **COARSE | values, load=60.0, step=step)
    run = Transient(asked.point(0), "explicit")
    assert run.advance(SAMPLES) is None
    return run


def general(stepper, **values):
    asked = job(stepper, **COARSE | {"load": 60.0} | values)
    return GeneralTransient(asked.point(0), stepper)


@pytest.mark.parametrize(
    ("stepper", "values"),
    [
        ("symplectic_euler", {"step": 1e-7}),
        # with that damper pushes jump, and no step is short enough for it
        ("scipy_bdf", {"tolerance": 1e-4, "element_damping": 0.0}),
    ],
)
def test_runs_are_those_of_the_explicit_step(stepper, values):
    run = general(stepper, **values)
    assert run.advance(SAMPLES) is None
    assert run.done == SAMPLES and run.time == pytest.approx(SAMPLES * run.interval)
    # the explicit run's own error is what halving its step changes, twice over at the longer one
    alike = {key: value for key, value in values.items() if key == "element_damping"}
    coarse, fine = plain(2e-7, **alike), plain(1e-7, **alike)
    error = 2.0 * np.abs(coarse.displacement - fine.displacement).max()
    assert np.abs(run.displacement - fine.displacement).max() < 2.0 * error
    for name in ("ring_tension t1", "push_force t2", "axial_force driven", "driven_speed"):
        error = 2.0 * np.abs(coarse.channel(name) - fine.channel(name)).max()
        size = np.abs(fine.channel(name)).max()
        assert np.abs(run.channel(name) - fine.channel(name)).max() <= 3.0 * error + 1e-4 * size, name
    assert run.counters()["rates"] > run.steps > 0
    assert run.step == pytest.approx(run.time / run.steps)


@pytest.mark.parametrize(
    "course",
    [
        {"speed_history": "ramp", "speed_start": 305.0},
        {
            "profile_time": (0.0, 4e-4, 2.5e-3),
            "driving_speed_profile": (0.96, 0.98, 0.97),
            "load_profile": (1.0, 1.2, 1.1),
            "thrust_profile": (1.0, 1.1, 0.9),
        },
    ],
)
def test_a_course_is_that_of_the_explicit_step(course):
    values = COARSE | {"rise_time": 2.5e-4, "load": 60.0} | course
    run = GeneralTransient(job("symplectic_euler", **values, step=1e-7).point(0), "symplectic_euler")
    assert run.advance(30) is None
    coarse, fine = (
        Transient(job("explicit", **values, step=step).point(0), "explicit") for step in (2e-7, 1e-7)
    )
    for plain_run in (coarse, fine):
        while plain_run.done < 30:
            assert plain_run.advance(30 - plain_run.done) is None
    for name in ("ring_tension t1", "push_force t2", "axial_force driven", "driven_speed", "driving_speed"):
        error = 2.0 * np.abs(coarse.channel(name) - fine.channel(name)).max()
        size = np.abs(fine.channel(name)).max()
        assert np.abs(run.channel(name) - fine.channel(name)).max() <= 3.0 * error + 1e-4 * size, name
    assert 304.5 < run.channel("driving_speed")[-1] < 307.0


def test_the_strands_are_disturbed_once_the_start_up_is_over():
    short = {"rise_time": 1e-3, "step": 2e-7}
    run, same = (general("symplectic_euler", **short, disturbance=size) for size in (1e-6, 0.0))
    kick = round(short["rise_time"] / run.interval)
    assert run.advance(kick) is None and same.advance(kick) is None
    assert np.array_equal(run.displacement, same.displacement)
    assert run.advance(1) is None and same.advance(1) is None
    change = np.abs(run.displacement - same.displacement)[-1].max()
    assert 1e-7 < change < 2e-6


def test_a_state_that_is_no_number_ends_the_run():
    run = general("symplectic_euler", step=2e-7)
    assert run.advance(2) is None
    run.marching.y[7] = np.nan
    status, reason = run.advance(2)
    assert status == Status.FAILED_NUMERICS and reason
    assert run.done == 2


def test_the_sparse_jacobian_is_the_full_one():
    run = general("symplectic_euler", step=2e-7)
    assert run.advance(SAMPLES) is None
    flat = flat_belt(run.belt, run.time)
    y = pack(flat, run.state)
    full = slopes(system(flat), 0.0, y)
    sparse = SparseJacobian(flat)
    found = sparse(0.0, y).toarray()
    # nothing lies outside the pattern, and each column is the same quotient as alone
    assert not np.any(full[~pattern(flat).toarray()])
    assert found == pytest.approx(full, abs=1e-6 * np.abs(full).max())
    assert sparse.evaluations < y.size / 2


def test_no_two_columns_of_a_group_share_a_rate():
    flat = flat_belt(general("symplectic_euler", step=2e-7).belt)
    where = pattern(flat)
    together = groups(where)
    for group in range(together.max() + 1):
        assert where.toarray()[:, together == group].sum(axis=1).max() == 1
