"""The explicit step in lanes against its scheme, written out with the readable right-hand side: to round-off."""

from functools import cache

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State, belt_constants, initial_state
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from cvt_hpc.models.elastic_belt.rhs import (
    contact_forces,
    fresh_contacts,
    load_at,
    sliding_speed,
    speed_share_at,
    strains,
    transported,
)
from support.equations import evaluate
from support.fast_runs import march, march_fast
from support.marched import job

BASE = {"stations": 96, "load": 100.0, "duration": 0.06, "rise_time": 0.01}
TABLE = {
    "friction_law": "table",
    "table_force": (0.0, 2e5),
    "table_speed": (0.0, 0.05, 0.3),
    "table_mu": ((0.12, 0.09, 0.08), (0.11, 0.08, 0.07)),
}
FREE = {
    "driving_inertia": 0.05,
    "drive_slope": 5.0,
    "driving_spring_rate": 2e6,
    "driven_spring_rate": 1e6,
    "driving_piston": (0.02, 0.09),
    "driven_piston": (0.02, 0.08),
    "tilt_lag": 1e-3,
    "collar_clearance": 1e-3,
}
CONTROLLED = {"driving_axial": "ratio", "clamping": "torque_ratio", "held_torque_ratio": 0.5}
CASES = {
    "memory": {},
    "no memory": {"friction_memory": 0.0},
    "table": TABLE,
    "table without memory": TABLE | {"friction_memory": 0.0},
    "constant friction": {"friction_law": "coulomb", "friction_gradient": 0.0},
    "other laws": {"friction_law": "cubic", "friction_memory": 1e-3},
    "ramp": {"load_history": "ramp", "load_start": 60.0, "load": 140.0},
    "ramp of speed": {"speed_history": "ramp", "speed_start": 100.0},
    "profiles": {
        "profile_time": (0.01, 0.015, 0.04),
        "load_profile": (0.5, 1.0, 1.5),
        "driving_speed_profile": (0.9, 1.0, 1.1),
        "thrust_profile": (1.2, 1.0, 0.8),
    },
    "rising": {"rise_time": 0.03},  # the start-up's damping and load, half way
    "rigid": {"sheave_stiffness": np.inf, "stiffness_of": "sheave", "load": -80.0},
    "free pulleys": FREE | {"driving_axial": "thrust"},
    "clearance without lag": {"collar_clearance": 1e-3},
    "controlled pulleys": FREE | CONTROLLED,
    "driven by its driven pulley": CONTROLLED
    | {"driven_inertia": np.inf, "driving_inertia": 0.05, "rise_time": 0.03},
}
CASES |= {
    "elements tilt": {"tilt_spring": 3267.0},
    "path's curvature, narrow column": {
        "curvature_terms": "path",
        "column_bending": "rocking",
        "column_stiffness": 2.0,
        "outer_edge": 3e-4,
        "inner_edge": 2e-4,
    },
    "straight at rest, wide column": {
        "curvature_terms": "straight",
        "bending_stiffness": 0.05,
        "column_bending": "rocking",
        "column_stiffness": 20.0,
        "outer_edge": 3e-3,
    },
}
STEP = 1e-7


@cache
def rough_belt(case):
    """A belt 20 ms after its start, roughened: gaps open and close, elements press, flanks slide every way."""
    parameters = job(**BASE | CASES[case]).parameters
    belt = belt_constants(parameters)
    state = march_fast(belt, initial_state(parameters, belt), 4e-6, 5000)
    random = np.random.default_rng(5)
    for row, size in ((f.W, 2e-5), (f.U, 0.05), (f.V_ELEMENT, 0.2), (f.V_RING, 0.05), (f.V_FILTERED, 0.02)):
        state.fields[row] += size * random.normal(size=belt.cell.size)
    state.fields[f.ELEMENT_TILT :] += 3e-3 * random.normal(size=belt.cell.size)
    # every sixth cell hardly pressed, 40 N, less than its damper's force
    state.fields[f.N_ELEMENT, ::6] *= (1.0 + forces(belt, state)[1][0, ::6]) / (1.0 - 1e-6)
    state.fields[f.V_FILTERED] = np.abs(state.fields[f.V_FILTERED])
    state.scalars[f.LAYER_WORK] = 0.0
    if belt.pulleys.are_free:
        # not yet beyond the collar's clearance
        state.scalars[f.FIRST_STATE + f.DRIVEN_COS : f.FIRST_STATE + f.DRIVEN_COS + 2] *= 0.02
    return belt, state


def forces(belt, state):
    """Axial line forces (N,), strains (2, N)."""
    force, eps = np.zeros(belt.cell.size), np.zeros((2, belt.cell.size))
    assert contact_forces(belt, state, fresh_contacts(belt), force) > 0
    strains(belt, state.fields, eps)
    return force, eps


def remembered(belt, before, state, force, step):
    """Filtered speeds at the end of a step, at the new velocities and the old contact."""
    old, found = before.fields[f.V_FILTERED], before.fields[f.V_FILTERED].copy()
    belt_speed, forget = (
        speed_share_at(belt, state.scalars[f.TIME]) * belt.belt_speed,
        1.0 / belt.friction_memory,
    )
    for j in np.flatnonzero(belt.touches):
        found[j] = speed = sliding_speed(belt, state, j)
        if force[j] > 0.0:
            carried, entering = transported(belt, force, j, belt_speed, speed, old[j - 1])
            target = (carried * entering + forget * speed) / (carried + forget)
            found[j] = target + (old[j] - target) * np.exp(-(carried + forget) * step)
    return found


def plain_step(belt, before, step):
    """The state after a step of symplectic Euler: velocities by the old state, all else by the new velocities.

    But for the memory, which goes to rest exactly, and at open stations at once.
    """
    state = before.copy()
    fields, scalars = state
    flat = flat_belt(belt)
    packed = evaluate(flat, state)
    force, rate, moments = flat.force, flat.rate, flat.moments
    for row in (f.U, f.V_ELEMENT, f.V_RING, *range(f.ELEMENT_TILT, len(fields))):
        fields[row] += step * rate[row]
    load = belt.ratio * load_at(belt, scalars[f.TIME])
    thrust = belt.thrust * np.interp(scalars[f.TIME], belt.profile[:, 0], belt.profile[:, 3])
    pressed = belt.driven.weight @ np.maximum(force[belt.driven_stations], 0.0)
    closing = (pressed - thrust) / belt.axial_damping
    turning = (moments @ belt.on_driven - load) / belt.driven_inertia
    if belt.pulleys.are_free:
        turning, closing = packed[-2:]
        scalars[f.FIRST_STATE :] += step * packed[-2 - f.STATES : -2]
    scalars[f.DRIVEN_SPEED] += step * turning
    scalars[f.TIME] += step
    if belt.friction_memory > 0.0:
        fields[f.V_FILTERED] = remembered(belt, before, state, force, step)
    evaluate(flat, state)  # what streams does so at the new velocities
    fields[f.W] += step * fields[f.U]
    for row in (f.N_ELEMENT, f.N_RING):
        fields[row] += step * rate[row]
    scalars[f.DRIVEN_POSITION] += step * closing
    return state


@pytest.mark.parametrize("case", CASES)
def test_the_rough_state_tries_every_branch(case):
    belt, state = rough_belt(case)
    force, eps = forces(belt, state)
    assert 0.05 < np.mean(force[belt.touches > 0.0] <= 0.0) < 0.8
    assert 0.05 < np.mean(eps[0] > 0.0) < 0.95
    opening = (np.roll(state.fields[f.V_ELEMENT], -1) - state.fields[f.V_ELEMENT]) / belt.cell
    damped, push = belt.element_damping * opening, -belt.element_stiffness * eps[0]
    # dampers that would make elements pull, and others
    assert np.sum((push > 0.0) & (damped > push)) > 3 and np.sum((push > 0.0) & (damped < push)) > 3


@pytest.mark.parametrize("case", CASES)
def test_a_step_is_that_of_the_readable_right_hand_side(case):
    belt, before = rough_belt(case)
    expected, found = plain_step(belt, before, STEP), march("explicit", belt, before, STEP, 1)
    # Round-off of the strains, 2e-16, is 2e-6 m/s^2 of an element's acceleration, and 1e-10 N/m of contact
    # forces less; of speeds of 10 m/s, 1 and 125 rad/s it is an ulp or two.
    for row, name in enumerate((*f.FIELDS, "element_tilt")[: len(before.fields)]):
        change = np.abs(expected.fields[row] - before.fields[row]).max()
        size = np.abs(expected.fields[row]).max()
        if row != f.V_FILTERED or belt.friction_memory > 0.0:
            assert change > 1e-11, name
        error = np.abs(found.fields[row] - expected.fields[row]).max()
        assert error < 1e-5 * STEP + 4e-16 * size, name
    assert found.scalars[f.TIME] == expected.scalars[f.TIME]
    assert found.scalars[f.DRIVEN_SPEED] == pytest.approx(expected.scalars[f.DRIVEN_SPEED], rel=4e-16)
    assert found.scalars[f.DRIVEN_POSITION] == pytest.approx(expected.scalars[f.DRIVEN_POSITION], rel=1e-12)
    assert found.scalars[f.FIRST_STATE :] == pytest.approx(
        expected.scalars[f.FIRST_STATE :], rel=1e-11, abs=1e-18
    )


def test_steps_follow_one_another():
    # what a step derives of its result is what the next one needs: differences grow with every step
    belt, state = rough_belt("memory")
    expected = State(*state)
    for _ in range(50):
        expected = plain_step(belt, expected, STEP)
    found = march("explicit", belt, state, STEP, 50)
    moved = np.abs(expected.fields - state.fields).max(axis=1)
    assert np.all(np.abs(found.fields - expected.fields).max(axis=1) < 1e-7 * moved)
