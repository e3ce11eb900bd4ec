"""The belt as one system of equations: the readable right-hand side, number for number, in another order."""

from functools import cache

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State, belt_constants, initial_state
from cvt_hpc.models.elastic_belt.one_system import flat_belt, pack, rates, system, unpack
from support.fast_runs import FastRuns, march
from support.scene import VALUES

GIVEN = VALUES | {"duration": 0.1, "load": 100.0, "load_history": "ramp", "stations": 96}
FREE = {
    "driving_inertia": 0.05,
    "driving_axial": "thrust",
    "driven_spring_rate": 1e6,
    "tilt_lag": 1e-3,
    "collar_clearance": 1e-4,
}
CASES = {
    "free pulleys": FREE,
    "memory": {},
    "no memory": {"friction_memory": 0.0},
    "clearance without lag": {"collar_clearance": 5e-4},
    "rigid": {"sheave_stiffness": np.inf, "stiffness_of": "sheave"},
    "elements tilt": {"tilt_spring": 3267.0},
}


@cache
def rough_belt(case):
    """A belt in motion, roughened so that gaps open, elements press and flanks slip every way."""
    parameters = GIVEN | CASES[case]
    belt = belt_constants(parameters)
    run, random = FastRuns([belt], [initial_state(parameters, belt)]), np.random.default_rng(5)
    run.advance(5000, 4e-6)
    state = run.state(0)
    for row, size in ((f.W, 1e-6), (f.U, 0.05), (f.V_ELEMENT, 0.05), (f.V_RING, 0.05)):
        state.fields[row] += size * random.normal(size=belt.cell.size)
    state.fields[f.ELEMENT_TILT :] += 3e-3 * random.normal(size=belt.cell.size)
    return belt, state


def flat_rates(belt, state):
    flat = flat_belt(belt)
    y = pack(flat, state)
    out = np.full_like(y, np.nan)
    assert rates(flat, state.scalars[f.TIME], y, out)
    return flat, y, out


@pytest.mark.parametrize("case", CASES)
def test_a_state_survives_the_vector(case):
    belt, state = rough_belt(case)
    flat = flat_belt(belt)
    unpack(flat, 0.125, pack(flat, state))
    filtered = flat.remembering
    for row in range(len(state.fields)):
        here = filtered if row == f.V_FILTERED else slice(None)
        assert np.array_equal(flat.state.fields[row, here], state.fields[row, here])
    assert flat.state.scalars[:3].tolist() == [0.125, *state.scalars[[f.DRIVEN_SPEED, f.DRIVEN_POSITION]]]
    # every station that a groove may hold remembers; no other does
    assert filtered.size == (0 if case == "no memory" else np.count_nonzero(belt.touches))


@pytest.mark.parametrize("case", CASES)
def test_rates_are_those_of_the_explicit_step(case):
    # The explicit step advances velocities by the rates of the old state, and by nothing else: its first
    # increment is step x rate, of which round-off of 10 m/s, 1e-15, leaves 1e-6 m/s^2 at a step of 1 ns.
    belt, state = rough_belt(case)
    flat, _, out = flat_rates(belt, state)
    n, step = belt.cell.size, 1e-9
    after = march("explicit", belt, state, step, 1)
    for place, row in ((1, f.U), (2, f.V_ELEMENT), (3, f.V_RING)):
        change = (after.fields[row] - state.fields[row]) / step
        assert out[place * n : (place + 1) * n] == pytest.approx(change, abs=1e-5 + 1e-12 * abs(change).max())
    speed = (after.scalars[f.DRIVEN_SPEED] - state.scalars[f.DRIVEN_SPEED]) / step
    assert out[-2] == pytest.approx(speed, abs=1e-4)  # round-off of 125 rad/s
    position = (after.scalars[f.DRIVEN_POSITION] - state.scalars[f.DRIVEN_POSITION]) / step
    assert out[-1] == pytest.approx(position, rel=1e-6)
    changes = (after.scalars[flat.loose] - state.scalars[flat.loose]) / step
    assert out[-2 - flat.loose.size : -2] == pytest.approx(changes, rel=1e-6, abs=1e-4)


@pytest.mark.parametrize("case", CASES)
def test_what_velocities_advance_is_by_their_new_values_in_the_explicit_step(case):
    # at the explicit step's new velocities and old positions the rates of all else are its increments
    belt, state = rough_belt(case)
    step = 1e-9
    after = march("explicit", belt, state, step, 1)
    mixed = State(state.fields.copy(), state.scalars.copy())
    # which open stations have at once, and closed ones behind them already know
    is_open = flat_rates(belt, state)[0].force <= 0.0
    mixed.fields[f.V_FILTERED, is_open] = after.fields[f.V_FILTERED, is_open]
    after = march("explicit", belt, mixed, step, 1)
    for row in (f.U, f.V_ELEMENT, f.V_RING):
        mixed.fields[row] = after.fields[row]
    tilts = slice(f.ELEMENT_TILT, None)  # which goes by the old velocities
    mixed.fields[tilts] = after.fields[tilts]
    for place in (f.DRIVEN_SPEED, f.FIRST_STATE + f.EXCESS):
        mixed.scalars[place] = after.scalars[place]
    flat, y, out = flat_rates(belt, mixed)
    advanced = y + step * out
    advanced[system(flat).velocities] = y[system(flat).velocities]
    expected = pack(flat, after)
    first, last = 6 * belt.cell.size, (6 + belt.tilts) * belt.cell.size
    advanced[first:last], first = y[first:last], last
    remembering = np.arange(y.size) - first < flat.remembering.size
    remembering &= np.arange(y.size) >= first
    # the sums are taken from other origins, 10 m/s, 1 and 125 rad/s: an ulp of each
    assert advanced[~remembering] == pytest.approx(expected[~remembering], rel=1e-15, abs=2e-14)
    # a memory's exponential: the fastest, next to where contact begins, goes by 1e-4 of its way in this step
    change = (advanced - y)[remembering]
    assert np.all(np.abs((expected - y)[remembering] - change) < 1e-4 * np.abs(change) + 2e-14)


def test_velocities_know_their_positions():
    belt, state = rough_belt("memory")
    flat, y, out = flat_rates(belt, state)
    whole = system(flat)
    moving = np.flatnonzero(whole.position_of >= 0)
    assert whole.velocities[moving].all() and moving.size == belt.cell.size
    assert np.array_equal(out[whole.position_of[moving]], y[moving])
    assert (flat.origin[moving] == 0.0).all()
    assert whole.velocities.sum() == 3 * belt.cell.size + 1
    assert whole.scale.shape == y.shape and (whole.scale > 0.0).all()


def test_the_history_of_contact_leaves_no_trace():
    belt, state = rough_belt("memory")
    flat, y, out = flat_rates(belt, state)
    lifted = y.copy()
    lifted[: belt.cell.size] += 1e-3  # every station leaves the grooves
    again = np.empty_like(out)
    assert rates(flat, 0.02, lifted, again)
    assert rates(flat, state.scalars[f.TIME], y, again)
    # forces within 1e-5 N/m over masses of 1 kg/m
    assert again == pytest.approx(out, abs=1e-4)


def test_no_number_has_no_rates():
    belt, state = rough_belt("memory")
    flat, y, out = flat_rates(belt, state)
    y[3] = np.nan
    assert not rates(flat, 0.0, y, out)
