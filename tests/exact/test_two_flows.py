"""Two flows of ring material, one for each package: directions, linear system, a free ring, balances, and one flow."""

from functools import partial

import numpy as np
import pytest

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.pushbelt import fields as pushbelt_fields
from cvt_hpc.models.pushbelt.belt import in_lanes, of_lanes
from cvt_hpc.models.pushbelt.stepping import advance_by
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt import fields as spatial_fields
from cvt_hpc.models.spatial_pushbelt.belt import with_two_flows
from cvt_hpc.models.spatial_pushbelt.transient import EQUATIONS, advance
from cvt_hpc.solvers.linked_blocks import field_of_right
from support import spatial_chains as chains
from support.pushbelts import THRUST
from support.spatial_belts import LOAD, NODES, STEP, inputs, kept_scene, stored

V, W = spatial_fields.ROW_V, spatial_fields.ROW_HALF  # numbers of these unknowns


def shaken(seed):
    """A loaded belt out of order, with flows that slip and are strained differently."""
    belt, state, _ = kept_scene(pin_clearance=2e-5, ring_friction_speed=0.02)
    state = with_two_flows(belt, state)
    rng = np.random.default_rng(seed)
    f = of_lanes(state.elements).copy()
    f[:, :3] += rng.normal(0.0, 2e-5, (NODES, 3))
    for first in (spatial_fields.HEADING, spatial_fields.OUTWARD):
        f[:, first : first + 3] += rng.normal(0.0, 2e-3, (NODES, 3))
    x, o = (
        f[:, spatial_fields.HEADING : spatial_fields.HEADING + 3],
        f[:, spatial_fields.OUTWARD : spatial_fields.OUTWARD + 3],
    )
    x /= np.linalg.norm(x, axis=1)[:, None]
    o -= np.sum(o * x, 1)[:, None] * x
    o /= np.linalg.norm(o, axis=1)[:, None]
    f[:, spatial_fields.SPEED : spatial_fields.SPEED + 8] += rng.normal(0.0, 0.05, (NODES, 8))
    f[:, spatial_fields.HALF_SPEED] = rng.normal(0.0, 0.05, NODES)
    f[:, [spatial_fields.SADDLE_RIGHT, spatial_fields.SADDLE_LEFT]] = rng.uniform(10.0, 40.0, (NODES, 2))
    state.elements.data[:] = in_lanes(f).data
    return belt, state, b.workspace(belt, NODES, 2), rng


def along(step, direction, x, number):
    """Rates along x (nodes, 9) by a direction of six numbers, and 1 of a further unknown."""
    return np.sum(step[:, direction : direction + 6] * x[:, :6], 1) + x[:, number]


def stretches(step, x):
    """Rates along x (nodes, 9) at which both packages are shortened together, and half of their difference."""
    ahead = np.roll(x, -1, 0)
    of_both = along(step, spatial_fields.TENSION_I, x, V) - along(step, spatial_fields.TENSION_J, ahead, V)
    apart = along(step, spatial_fields.DIFFERENCE_I, x, W)
    return of_both, apart - along(step, spatial_fields.DIFFERENCE_J, ahead, W)


def test_tensions_of_both_packages_change_by_their_directions():
    belt, state, work, rng = shaken(1)
    f = of_lanes(state.elements).copy()
    place, _ = chains.lines(belt, f)
    right, left = np.linalg.norm(np.roll(place, -1, axis=1) - place, axis=2)
    # the direction of a tension is its rate at a strain of zero
    f[:, spatial_fields.LENGTH], f[:, spatial_fields.HALF_LENGTH] = 0.5 * (right + left), 0.5 * (right - left)
    belt = belt._replace(ring_time=3.0)  # by which a tension at the start of a step changes with the speeds
    x = rng.normal(0.0, 1.0, (NODES, 9)) * [1, 1, 1, 100, 100, 100, 1, 0, 1]
    small, measured = 3e-9, {}
    for sign in (-1.0, 0.0, 1.0):
        g = f.copy()
        g[:, spatial_fields.SPEED : spatial_fields.SPEED + 8], g[:, spatial_fields.HALF_SPEED] = (
            sign * small * x[:, :8],
            sign * small * x[:, W],
        )
        state.elements.data[:] = in_lanes(g).data
        EQUATIONS.prepare(belt, state, work, 1.0)
        measured[sign] = of_lanes(work.step).copy()
    step = measured[0.0]
    of_both, apart = stretches(step, x)
    own, cross = step[:, spatial_fields.TENSION_SLOPE], step[:, spatial_fields.CROSS_SLOPE]
    assert np.abs(cross).max() > 1e-4 * own.max()
    damper = 3.0 / 3.25
    for field, expected in (
        (spatial_fields.START_TENSION, -damper * (own * of_both + cross * apart)),
        (spatial_fields.START_DIFFERENCE, -damper * (own * apart + cross * of_both)),
    ):
        found = (measured[1.0][:, field] - measured[-1.0][:, field]) / (2.0 * small)
        # 2e-7: differences of lengths of 6 mm by 3e-9 m
        assert found == pytest.approx(expected, abs=2e-7 * np.abs(expected).max())
    f[:, spatial_fields.SPEED : spatial_fields.SPEED + 8] = f[:, spatial_fields.HALF_SPEED] = 0.0
    f[:, spatial_fields.LENGTH], f[:, spatial_fields.HALF_LENGTH] = right, 0.1 * right
    state.elements.data[:] = in_lanes(f).data
    EQUATIONS.prepare(belt, state, work, 1.0)
    step, half = of_lanes(work.step), 0.5 * belt.ring_stiffness
    one, two = half * (1.0 / 1.1 - 1.0), half * (left / (0.9 * right) - 1.0)
    assert step[:, spatial_fields.START_TENSION] == pytest.approx(one + two)
    assert step[:, spatial_fields.START_DIFFERENCE] == pytest.approx(one - two)


def test_both_packages_slip_along_their_own_lines():
    belt, state, work, _ = shaken(2)
    f = of_lanes(state.elements).copy()
    f[:, spatial_fields.CHANGE : spatial_fields.CHANGE + 9] = 0.0
    state.elements.data[:] = in_lanes(f).data
    EQUATIONS.prepare(belt, state, work, STEP)
    EQUATIONS.evaluate(belt, state, work, LOAD, STEP)
    found = of_lanes(state.elements)
    slips = []
    for side, line, t in zip((1.0, -1.0), *chains.lines(belt, f), strict=True):
        moving = f[:, spatial_fields.SPEED : spatial_fields.SPEED + 3] + np.cross(
            f[:, spatial_fields.OMEGA : spatial_fields.OMEGA + 3], line - f[:, :3]
        )
        slips.append(f[:, spatial_fields.V] + side * f[:, spatial_fields.HALF_SPEED] - np.sum(t * moving, 1))
    scale = np.abs(slips).max()
    for field, slip in (
        (spatial_fields.RING_SLIP, 0.5 * (slips[0] + slips[1])),
        (spatial_fields.HALF_SLIP, 0.5 * (slips[0] - slips[1])),
    ):
        assert found[:, field] == pytest.approx(slip, abs=1e-12 * scale)


def evaluated(belt, state, work):
    """Residuals of elements and border, of an iterate evaluated twice, so that duals are those of its slips."""
    for _ in range(2):
        EQUATIONS.evaluate(belt, state, work, LOAD, STEP)
    found = of_lanes(work.iterate)
    own = np.hstack(
        [
            found[:, spatial_fields.RESIDUAL : spatial_fields.RESIDUAL + 8],
            found[:, spatial_fields.HALF_RESIDUAL, None],
        ]
    )
    return own, work.border[:, -1].copy()


def test_the_linear_system_is_the_slope_of_the_residuals():
    belt, state, work, rng = shaken(3)
    EQUATIONS.prepare(belt, state, work, STEP)
    f = of_lanes(state.elements).copy()
    f[:, spatial_fields.CHANGE : spatial_fields.CHANGE + 9] = rng.normal(0.0, 0.01, (NODES, 9))
    state.increments[:] = 0.3
    state.elements.data[:] = in_lanes(f).data
    residual, _ = evaluated(belt, state, work)
    EQUATIONS.assemble(belt, state, work, STEP)
    blocks, right = of_lanes(work.blocks), field_of_right(9)
    assert blocks[:, right : right + 9] == pytest.approx(residual)
    # tensions of the iterate, of which the recorded ones are those of the last
    step, found = of_lanes(work.step), of_lanes(work.iterate)
    change = f[:, spatial_fields.CHANGE : spatial_fields.CHANGE + 9]
    of_both, apart = stretches(step, change)
    own, cross = step[:, spatial_fields.TENSION_SLOPE], step[:, spatial_fields.CROSS_SLOPE]
    for predicted, at, expected in (
        (spatial_fields.START_TENSION, spatial_fields.ITERATE_TENSION, own * of_both + cross * apart),
        (
            spatial_fields.START_DIFFERENCE,
            spatial_fields.ITERATE_DIFFERENCE,
            own * apart + cross * of_both,
        ),
    ):
        assert step[:, predicted] - found[:, at] == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    direction = rng.normal(0.0, 1.0, (NODES, 9))
    diagonal, link = (blocks[:, k : k + 81].reshape(-1, 9, 9).transpose(0, 2, 1) for k in (0, 81))
    expected = np.einsum("ijk,ik->ij", diagonal, direction)
    expected += np.einsum("ijk,ik->ij", link, np.roll(direction, -1, 0))
    expected += np.roll(np.einsum("ikj,ik->ij", link, direction), 1, 0)
    found = []
    for sign in (1.0, -1.0):
        g = f.copy()
        g[:, spatial_fields.CHANGE : spatial_fields.CHANGE + 9] += sign * 1e-6 * direction
        state.elements.data[:] = in_lanes(g).data
        found.append(evaluated(belt, state, work)[0])
    slope = -(found[0] - found[1]) / 2e-6
    scale = np.abs(expected).max(axis=0)
    # as with one flow: friction is no straight line; no contact changes over between the two
    assert (np.abs(slope - expected) < 1e-5 * scale.max()).all()
    assert (np.abs(slope - expected)[:, W] < 1e-5 * scale[W]).all()


def test_a_free_ring_whose_packages_run_apart_keeps_its_energy_and_momentum():
    nodes, left = 216, []
    constants, _, fields = chains.free_ring(nodes, 0.1082, 250.0, lateral=0.2)
    for dt in (1e-5, 0.5e-5):
        state = with_two_flows(constants, chains.state(fields))
        f = of_lanes(state.elements).copy()
        f[:, spatial_fields.HALF_SPEED] = 0.5
        yawing = 5.0 * np.cos(4.0 * np.pi * np.arange(nodes) / nodes)[:, None]  # [rad/s]
        f[:, spatial_fields.OMEGA : spatial_fields.OMEGA + 3] += (
            yawing * f[:, spatial_fields.OUTWARD : spatial_fields.OUTWARD + 3]
        )
        before, momentum, moment = chains.energy_and_momentum(constants, f)
        state.elements.data[:] = in_lanes(f).data
        work, rest = b.workspace(constants, nodes, 2), np.zeros((2, spatial_fields.INPUTS))
        assert advance(constants, b.NEWTON_OF_TWO_FLOWS, state, work, rest, round(5e-3 / dt), dt) == 0
        f = of_lanes(state.elements)
        after, momentum_now, moment_now = chains.energy_and_momentum(constants, f)
        # elements that yaw pull one package more than the other
        assert 0.01 < np.abs(f[:, spatial_fields.TENSION_DIFFERENCE]).max()
        # what pulls a package here pulls it back elsewhere
        assert f[:, spatial_fields.HALF_SPEED].mean() == pytest.approx(0.5, abs=1e-12)
        assert np.ptp(f[:, spatial_fields.HALF_SPEED]) > 1e-6
        assert momentum_now == pytest.approx(momentum, abs=1e-12)
        # 2e-7, 1.1e-7 with one flow: the shear of the rings keeps its axial direction where elements yaw
        assert moment_now[2] == pytest.approx(moment[2], rel=2e-7)
        left.append(after / before - 1.0)
    # as with one flow, the energy's error falls with the step
    assert abs(left[0]) < 4e-6 and abs(left[1]) < 0.6 * abs(left[0])


def test_packages_that_run_apart_are_braked_by_what_is_booked_as_loss():
    nodes, dt, radius, spin = 216, 1e-5, 0.1082, 250.0
    constants, _, fields = chains.free_ring(nodes, radius, spin)
    # elements that hardly roll and yaw, or the package that is strained more would turn them to a cone
    constants = constants._replace(
        ring_friction=0.06, ring_friction_speed=5e-4, roll_inertia=1e-3, yaw_inertia=1e-3
    )
    state = with_two_flows(constants, chains.state(fields))
    f = of_lanes(state.elements).copy()
    f[:, spatial_fields.HALF_SPEED] = 5.0
    f[:, spatial_fields.HALF_LENGTH] = (
        -2e-5 * f[:, spatial_fields.LENGTH]
    )  # the right package is strained more
    state.elements.data[:] = in_lanes(f).data
    work, rest, found = b.workspace(constants, nodes, 2), np.zeros((2, spatial_fields.INPUTS)), []
    for _ in range(2):
        assert advance(constants, b.NEWTON_OF_TWO_FLOWS, state, work, rest, 50, dt) == 0
        f = of_lanes(state.elements).copy()
        energy, _, _ = chains.energy_and_momentum(constants, f)
        found.append(
            (
                f,
                energy,
                state.totals[pushbelt_fields.FLANK_LOSS : pushbelt_fields.POWER_RESIDUAL].sum(),
                state.totals[pushbelt_fields.RING_LOSS],
            )
        )
    (f, energy, lost, at_rings), (g, energy_now, lost_now, at_rings_now) = found
    # the rings hold the elements on their circle: w' = -mu m_e omega^2 R / m_r, but for its breathing of 0.6 %
    braked = 0.06 * 50 * dt * constants.mass / constants.ring_mass * spin**2 * radius
    assert f[:, spatial_fields.HALF_SPEED] - g[:, spatial_fields.HALF_SPEED] == pytest.approx(
        braked, rel=1e-2
    )
    assert g[:, spatial_fields.TENSION_DIFFERENCE] == pytest.approx(
        2e-5 * constants.ring_stiffness, rel=0.05
    )  # less the cone
    pressed = 2.0 * np.sin(np.pi / nodes) * g[:, spatial_fields.TENSION_DIFFERENCE]
    assert g[:, spatial_fields.SADDLE_RIGHT] - g[:, spatial_fields.SADDLE_LEFT] == pytest.approx(
        pressed, rel=1e-2
    )
    assert energy - energy_now == pytest.approx(lost_now - lost, rel=1e-3)
    assert at_rings_now - at_rings == pytest.approx(lost_now - lost, rel=1e-2)


@pytest.mark.parametrize("time", [0.0, 1e-6])
def test_waves_in_the_packages_lose_what_their_damper_takes(time):
    nodes = 216
    constants, _, fields = chains.free_ring(nodes, 0.1082, 250.0)
    constants = constants._replace(ring_time=time)
    state = with_two_flows(constants, chains.state(fields))
    f = of_lanes(state.elements).copy()
    f[:, spatial_fields.HALF_SPEED] = 5.0 * np.cos(6.0 * np.pi * np.arange(nodes) / nodes)
    before, _, _ = chains.energy_and_momentum(constants, f)
    state.elements.data[:] = in_lanes(f).data
    work, rest = b.workspace(constants, nodes, 2), np.zeros((2, spatial_fields.INPUTS))
    assert advance(constants, b.NEWTON_OF_TWO_FLOWS, state, work, rest, 60, 1e-6) == 0
    after, _, _ = chains.energy_and_momentum(constants, of_lanes(state.elements))
    assert (before - after > 0.2) == (time > 0.0)  # of 1 J: waves of 22 kHz
    # (2 pi f dt)^2 is 2 %, and energy that is not lost is read half a step late: 5 % of 1 J
    loss = state.totals[pushbelt_fields.STRETCH_LOSS]
    assert loss == pytest.approx(before - after, **({"rel": 0.04} if time else {"abs": 0.1}))


def test_one_flow_is_two_flows_of_equal_packages_in_the_plane():
    """A belt that stays in its plane has equal packages: both march alike, up to the order of sums."""
    found = []
    for flows, newton in ((1, b.NEWTON), (2, b.NEWTON_OF_TWO_FLOWS)):
        belt, state, _ = kept_scene(offset=0.0)
        state = with_two_flows(belt, state) if flows == 2 else state
        hold = inputs((THRUST, THRUST), (LOAD, LOAD))
        assert advance(belt, newton, state, b.workspace(belt, NODES, flows), hold, 100, STEP) == 0
        found.append((of_lanes(state.elements).copy(), state.loads.copy()))
    (one, loads), (two, other_loads) = found
    assert not two[
        :,
        [
            spatial_fields.HALF_SPEED,
            spatial_fields.TENSION_DIFFERENCE,
            spatial_fields.HALF_LENGTH,
            spatial_fields.HALF_SLIP,
        ],
    ].any()
    assert two[:, spatial_fields.TENSION] == pytest.approx(one[:, spatial_fields.TENSION], rel=1e-6)
    assert other_loads == pytest.approx(loads, rel=1e-6)


def test_power_is_balanced_and_both_pulleys_take_the_same_axial_force():
    belt, state, _ = kept_scene()
    axial = []
    for flows, newton in ((1, b.NEWTON), (2, b.NEWTON_OF_TWO_FLOWS)):
        march = partial(called_alike(advance_by), EQUATIONS)  # step by step
        state = with_two_flows(belt, state) if flows == 2 else state
        work, hold = b.workspace(belt, NODES, flows), inputs((THRUST, THRUST), (LOAD, LOAD))
        if flows == 2:
            assert march(belt, newton, state, work, hold, 1500, STEP) == 0
        before, kept, loads = state.totals.copy(), stored(belt, state), []
        momentum = chains.energy_and_momentum(belt, of_lanes(state.elements))[1][2]
        for _ in range(2250):
            assert march(belt, newton, state, work, hold, 1, STEP) == 0
            loads.append(state.loads.copy())
        spent = state.totals - before
        rate = spent / spent[pushbelt_fields.TIME]
        lost = rate[pushbelt_fields.FLANK_LOSS : pushbelt_fields.POWER_RESIDUAL]
        assert (lost >= 0.0).all()
        open_power = (
            rate[pushbelt_fields.WORK_IN]
            - rate[pushbelt_fields.WORK_OUT]
            - rate[pushbelt_fields.THRUST_WORK]
            - lost.sum()
        )
        open_power -= (stored(belt, state) - kept) / spent[pushbelt_fields.TIME]
        assert abs(open_power) < 1e-4 * rate[pushbelt_fields.WORK_IN]
        mean = np.mean(loads, axis=0)
        net = (
            mean[spatial_fields.DRIVING_RIGHT] - mean[spatial_fields.DRIVING_LEFT],
            mean[spatial_fields.DRIVEN_RIGHT] - mean[spatial_fields.DRIVEN_LEFT],
        )
        # what is left of half a revolution is the belt's own axial motion
        momentum -= chains.energy_and_momentum(belt, of_lanes(state.elements))[1][2]
        assert net[0] + net[1] == pytest.approx(momentum / spent[pushbelt_fields.TIME], abs=1e-4 * net[0])
        axial.append(net[0])
    # 3 %: a polygon of 104 elements; with 216 and more it is 1 % (jobs/ring_flows.toml)
    assert axial[1] == pytest.approx(axial[0], rel=0.03)
    apart = of_lanes(state.elements)[:, spatial_fields.TENSION_DIFFERENCE]
    assert 5.0 < np.abs(apart).max() < 0.02 * of_lanes(state.elements)[:, spatial_fields.TENSION].mean()
