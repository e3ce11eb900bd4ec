"""The spatial pushbelt between its pulleys: planar limit, symmetry, slip limit, single contacts, stiff sheaves."""

import numpy as np
import pytest

from cvt_hpc.models.pushbelt import belt as p
from cvt_hpc.models.pushbelt import fields as pushbelt_fields
from cvt_hpc.models.pushbelt.belt import in_lanes, of_lanes
from cvt_hpc.models.pushbelt.belt import workspace as planar_workspace
from cvt_hpc.models.pushbelt.transient import advance as planar_advance
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt import fields as spatial_fields
from cvt_hpc.models.spatial_pushbelt.flank import flank_forces
from cvt_hpc.models.spatial_pushbelt.transient import _accept, _evaluate, _prepare, advance
from support import spatial_chains as chains
from support.pushbelts import THRUST, given, start
from support.spatial_belts import (
    LOAD,
    NODES,
    RAMP,
    STEP,
    inputs,
    kept_scene,
    leaning_loads,
    scene,
    sheaves_modes,
)

MODES = ((6e8, 3e8, 3e8), (6e8, 3e8, 3e8))  # [N/m]
UNLIKE = ((6e8, 3e8, 4e8), (7e8, 5e8, 2e8))  # [N/m]


def test_in_its_plane_it_is_the_planar_belt():
    # with one height of flank points on the pitch line, as the planar belt has; heavy as on another planet
    planar, planar_state = start(given(NODES, modal_stiffness=MODES, gravity=300.0))
    belt, state = chains.beside_planar(planar, planar_state, flank_reach=0.0, gravity=300.0)
    work, planar_work = b.workspace(belt, NODES), planar_workspace(planar, NODES)
    for thrusts, loads, steps in (
        ((500.0, THRUST), (0.0, 0.0), RAMP),
        ((THRUST, THRUST), (0.0, LOAD), RAMP),
        ((THRUST, THRUST), (LOAD, LOAD), 2 * RAMP),
    ):
        assert advance(belt, b.NEWTON, state, work, inputs(thrusts, loads), steps, STEP) == 0
        flat = inputs(thrusts, loads, 5)
        assert planar_advance(planar, p.NEWTON, planar_state, planar_work, flat, steps, STEP) == 0
    f, g = of_lanes(state.elements), of_lanes(planar_state.elements)
    assert not f[:, [2, 5, 8]].any()
    side = np.where(f[:, 1] < 0.0, 0, 1)
    on_strand = (f[:, 0] > 0.05) & (f[:, 0] < 0.105)
    push, flat_push = (
        f[:, spatial_fields.PUSH : spatial_fields.PUSH + 4].sum(1),
        g[:, pushbelt_fields.EDGE] + g[:, pushbelt_fields.HEAD],
    )
    for strand in (0, 1):
        there = on_strand & (side == strand)
        assert f[there, spatial_fields.TENSION].mean() == pytest.approx(
            g[there, pushbelt_fields.TENSION].mean(), rel=6e-3
        )
        # 10 N: what is left in the loose strand comes and goes
        assert push[there].mean() == pytest.approx(flat_push[there].mean(), rel=6e-3, abs=10.0)
    thrust = (
        g[:, pushbelt_fields.FLANK] * planar.cosine + g[:, pushbelt_fields.FLANK_FRICTION_M] * planar.sine
    )
    driving = float(((1.0 - g[:, pushbelt_fields.DRIVEN]) * thrust).sum())
    # the planar belt's sliding along the meridian is v_r / cos d0, not v_r cos d0: 4 % of a part of friction
    assert state.loads[spatial_fields.DRIVING_LEFT] == pytest.approx(driving, rel=6e-3)
    assert state.loads[spatial_fields.DRIVING_RIGHT] == state.loads[spatial_fields.DRIVING_LEFT]
    for spatial, flat in (
        (pushbelt_fields.FLANK_LOSS, pushbelt_fields.FLANK_LOSS),
        (pushbelt_fields.RING_LOSS, pushbelt_fields.RING_LOSS),
        (pushbelt_fields.DAMPING_LOSS, pushbelt_fields.DAMPING_LOSS),
        (pushbelt_fields.GRAVITY_WORK, pushbelt_fields.GRAVITY_WORK),
    ):
        assert state.totals[spatial] == pytest.approx(planar_state.totals[flat], rel=1e-2)


def test_what_is_symmetric_stays_in_its_plane():
    # exactly: what both sides do across the plane cancels to the last bit, so that no instability finds a seed
    _, state, _ = scene(offset=0.0, modal=MODES, ramp=300, pin_clearance=1e-5)
    f = of_lanes(state.elements)
    assert np.array_equal(f, chains.mirrored(f))
    assert not f[:, [2, 5, 8, spatial_fields.SLOPE]].any()
    assert not state.leans.any()


def test_the_mirror_image_moves_as_the_mirror_image():
    """Under thrust and load, with offset, tilt and loose sheaves on one side, for 2 ms: to the last bit."""
    axes = np.array([[0.0, 0.0, 1.0], [2e-3, 0.0, 1.0]])
    axes[1] /= np.linalg.norm(axes[1])
    constants = {"loose_side": np.array([1.0, -1.0]), "axes": axes, "pin_clearance": 5e-5}
    belt, state, work = scene(modal=MODES, ramp=300, **constants)
    image = chains.state(
        chains.mirrored(of_lanes(state.elements)),
        state.pulleys * [1, 1, 1, 1, -1, -1],
        state.openings.shape[1],
    )
    image.openings[:], image.leans[:], image.increments[:] = state.openings, -state.leans, state.increments
    hold = inputs((THRUST, THRUST), (LOAD, LOAD))
    looking_glass = belt._replace(loose_side=-belt.loose_side, axes=belt.axes * [-1.0, -1.0, 1.0])
    for of_one, moved in ((belt, state), (looking_glass, image)):
        assert advance(of_one, b.NEWTON, moved, work, hold, 200, STEP) == 0
    f = of_lanes(state.elements)
    assert np.abs(f[:, 2]).max() > 1e-4
    assert np.array_equal(f, chains.mirrored(of_lanes(image.elements)))
    assert np.array_equal(state.loads, image.loads[[1, 0, 3, 2, 4, 5]])
    assert np.array_equal(state.leans, -image.leans)
    assert np.array_equal(state.pulleys, image.pulleys * [1, 1, 1, 1, -1, -1])


def test_slip_limit():
    # a belt that slips all along the driving arc carries 2 mu F R / cos d0, whatever its offset
    belt, state, work = scene(driven_inertia=0.2)
    overload = inputs((14e3, 14e3), (300.0, 300.0))
    advance(belt, b.NEWTON, state, work, overload, 3000, STEP)
    f = of_lanes(state.elements)
    flank, driving = f[:, spatial_fields.FLANK : spatial_fields.FLANK + 4], f[:, spatial_fields.DRIVEN] < 0.5
    assert (
        f[driving, spatial_fields.FLANK_SLIP_T : spatial_fields.FLANK_SLIP_T + 4][flank[driving] > 10.0]
        < -1.0
    ).all()
    radius = np.linalg.norm(f[:, :2] - belt.pitch_depth * f[:, 6:8], axis=1)[:, None]
    heights = np.array([-1.0, 1.0, -1.0, 1.0]) * belt.flank_reach
    carried = (flank * (radius + heights))[driving].sum() / flank[driving].sum()
    thrust = 0.5 * state.loads[: spatial_fields.DRIVEN_LEFT].sum()
    limit = 2.0 * belt.flank_kinetic * carried / belt.cosine
    assert -state.loads[spatial_fields.DRIVING_TORQUE] / thrust == pytest.approx(limit, rel=1e-3)


def test_a_clamped_element_without_friction(tell):
    # each flank carries N: 2 N sin d0 outwards, N cos d0 along the axis, and no moment where both heights are alike
    planar, planar_state = start(given(NODES, kinetic_friction=0.0, ring_friction=0.0))
    belt, state = chains.beside_planar(planar, planar_state)
    state.pulleys[[pushbelt_fields.DRIVING_RADIUS, pushbelt_fields.DRIVEN_RADIUS]] += 1e-5
    work = b.workspace(belt, NODES)
    f = of_lanes(state.elements)
    f[:, spatial_fields.SPEED : spatial_fields.SPEED + 8] = 0.0
    state.elements.data[:] = in_lanes(f).data
    _prepare(belt, state, work, 1e-9)
    flank_forces(
        belt,
        state.elements,
        state.pulleys,
        state.increments,
        state.openings,
        work.shapes,
        work.step,
        work.iterate,
        1e-9,
    )
    found, forces = (
        of_lanes(work.iterate),
        of_lanes(state.elements)[:, spatial_fields.FLANK : spatial_fields.FLANK + 4],
    )
    normal = forces.sum(1)
    pressed = normal > 0.0
    outward = np.hypot(found[:, spatial_fields.RESIDUAL], found[:, spatial_fields.RESIDUAL + 1])
    assert pressed.sum() > 40
    assert outward[pressed] == pytest.approx(normal[pressed] * belt.sine, rel=1e-4)
    tell("outward force of clamped elements [N]", outward[pressed], normal[pressed] * belt.sine)
    assert np.abs(found[:, spatial_fields.RESIDUAL + 2]).max() < 1e-9 * normal.max()
    # the penetration 1e-5 sin d0 on both points of stiffness c / 2
    middle = np.argmax(pressed & (np.abs(f[:, 1]) < 1e-3) & (f[:, 0] < 0.0))
    assert forces[middle] == pytest.approx(0.5 * belt.flank_stiffness * 1e-5 * belt.sine, rel=2e-2)


def test_both_sheaves_of_a_pulley_have_one_angular_velocity(tell):
    # Schindler et al. 2008, sec. 4.4.1: another speed of a pulley moves its left and right flank points alike
    planar, planar_state = start(given(NODES))
    belt, state = chains.beside_planar(planar, planar_state)
    work, slips = b.workspace(belt, NODES), []
    _prepare(belt, state, work, STEP)
    for change in (0.0, 1.0):
        state.pulleys[pushbelt_fields.DRIVING_SPEED] += change
        _evaluate(belt, state, work, LOAD, STEP)
        f = of_lanes(state.elements)
        slips.append(f[:, spatial_fields.FLANK_SLIP_T : spatial_fields.FLANK_SLIP_T + 4].copy())
    left_low, left_high, right_low, right_high = (slips[1] - slips[0]).T
    driving = f[:, spatial_fields.DRIVEN] < 0.5
    low = np.linalg.norm(f[:, :2] - (belt.pitch_depth + belt.flank_reach) * f[:, 6:8], axis=1)
    pressed = driving & (np.abs(f[:, 1]) < 0.02) & (f[:, 0] < 0.0)
    assert left_low[pressed] == pytest.approx(-low[pressed], rel=1e-3)
    assert (left_high - left_low)[pressed] == pytest.approx(-2.0 * belt.flank_reach, rel=1e-3)
    tell("sliding at the right sheave by the left one [m]", (right_low, right_high), (left_low, left_high))
    assert right_low == pytest.approx(left_low, rel=1e-12)
    assert right_high == pytest.approx(left_high, rel=1e-12)
    assert not (slips[1] - slips[0])[~driving].any()


def test_stiff_sheaves_are_rigid_ones():
    rigid, stiff = kept_scene(), scene(modal=((1e14, 1e14, 1e14), (1e14, 1e14, 1e14)))
    for k in (spatial_fields.DRIVING_LEFT, spatial_fields.DRIVEN_RIGHT, spatial_fields.DRIVING_TORQUE):
        assert stiff[1].loads[k] == pytest.approx(rigid[1].loads[k], rel=1e-2)
    assert np.abs(stiff[1].openings).max() < 1e-9


def test_a_sheave_leans_with_its_lag_under_a_load_that_stays():
    planar, planar_state = start(given(NODES, modal_stiffness=MODES))
    belt, state = chains.beside_planar(planar, planar_state, modal_stiffness=np.array(UNLIKE))
    work, hold = b.workspace(belt, NODES), inputs((THRUST, THRUST), (LOAD, LOAD))[1]
    _prepare(belt, state, work, STEP)
    _evaluate(belt, state, work, LOAD, STEP)
    f = of_lanes(state.elements).copy()
    f[:, spatial_fields.FLANK : spatial_fields.FLANK + 4] = np.random.default_rng(5).uniform(
        0.0, 500.0, (NODES, 4)
    )
    target = leaning_loads(belt, f, sheaves_modes(belt, state)) / belt.modal_stiffness
    assert np.abs(target).min() > 1e-8
    steps = 200
    for done in range(1, steps + 1):
        state.elements.data[:] = in_lanes(f).data
        _accept(belt, state, work, hold, STEP)
        # explicit: dw / dt = (load / stiffness - w) / lag
        reached = 1.0 - (1.0 - STEP / belt.lean_lag) ** done
        assert state.leans == pytest.approx(reached * target, rel=1e-12)
        # which is 1 - exp(-t / lag) but for at most dt / (2 e lag)
        assert reached == pytest.approx(
            -np.expm1(-done * STEP / belt.lean_lag), abs=0.19 * STEP / belt.lean_lag
        )


def test_pins_push_back_beyond_their_clearance():
    nodes, clearance, pitch = 16, 1e-4, 0.02
    belt = chains.belt(
        pin_clearance=clearance,
        pin_stiffness=1e6,
        contact_time=0.0,
        pitch=pitch,
        thickness=0.9 * pitch,
        contact_stiffness=0.0,
    )
    # a straight line, closed upon itself, far from the pulleys
    fields = np.zeros((nodes, spatial_fields.STATE_FIELDS))
    fields[:, 0], fields[:, 1] = pitch * np.arange(nodes), 1.0
    fields[:, 3], fields[:, 7] = 1.0, -1.0
    fields[:, spatial_fields.LENGTH], fields[-1, spatial_fields.LENGTH] = pitch, (nodes - 1) * pitch
    fields[3, 1] += 1.2 * clearance
    fields[3, 2] = 1.6 * clearance
    state, work = chains.state(fields), b.workspace(belt, nodes)
    assert (
        advance(
            belt,
            b.NEWTON._replace(tolerance=1e-12),
            state,
            work,
            np.zeros((2, spatial_fields.INPUTS)),
            1,
            1e-9,
        )
        == 0
    )
    f = of_lanes(state.elements)
    # of both pairs of element 3: stiffness times what is beyond the clearance, along the offset
    assert f[[2, 3], spatial_fields.PIN] == pytest.approx(1e6 * clearance, rel=1e-3)
    assert np.delete(f[:, spatial_fields.PIN], [2, 3]) == pytest.approx(0.0, abs=1e-12)
    push = (
        belt.mass * f[3, spatial_fields.SPEED + 1] / 1e-9,
        belt.mass * f[3, spatial_fields.SPEED + 2] / 1e-9,
    )
    assert push[0] == pytest.approx(-2.0 * 0.6 * 1e6 * clearance, rel=0.3)
    _, momentum, _ = chains.energy_and_momentum(belt, f)
    assert np.abs(momentum).max() < 1e-6 * abs(belt.mass * f[3, spatial_fields.SPEED + 1])


def test_a_step_that_is_not_solved_names_its_contact():
    belt, state, work = kept_scene()
    hold = inputs((THRUST, THRUST), (LOAD, 1.5 * LOAD))
    strict = b.NEWTON._replace(tolerance=1e-14, most_iterations=3, most_failures=2)
    assert advance(belt, strict, state, work, hold, 10, STEP) == pushbelt_fields.NOT_CONVERGED
    assert state.counters[pushbelt_fields.IN_A_ROW] == 2
    assert 0 <= state.counters[pushbelt_fields.FAILED_ELEMENT] < NODES
    assert 0 <= state.counters[pushbelt_fields.FAILED_CONTACT] < len(spatial_fields.CONTACTS)
    broken = of_lanes(state.elements).copy()
    broken[5, spatial_fields.SPEED] = np.nan
    state.elements.data[:] = in_lanes(broken).data
    assert advance(belt, b.NEWTON, state, work, hold, 10, STEP) == pushbelt_fields.NOT_FINITE
