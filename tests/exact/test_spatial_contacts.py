"""Contacts of the spatial pushbelt: golden digits, rates of all gaps, forces without resultant, the linear system."""

import numpy as np
import pytest
from numba import njit
from scipy.optimize import brentq

from cvt_hpc.models.pushbelt.belt import DRIVEN_RADIUS, DRIVING_RADIUS
from cvt_hpc.models.pushbelt.start import in_lanes, of_lanes, start
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt.faces import face_gap
from cvt_hpc.models.spatial_pushbelt.flank import flank_directions, frustum, frustum_gap
from cvt_hpc.models.spatial_pushbelt.pin import pin_offset
from cvt_hpc.models.spatial_pushbelt.step import _assemble, _evaluate, _prepare
from cvt_hpc.physics.friction_laws import Law
from support import spatial_chains as chains
from support.pushbelts import given

NODES, STEP, LOAD = 64, 1e-5, 81.0
RIGHT = b.RIGHT


@njit
def at_flank(belt, q, axis, side, groove):
    radial, radius, along = frustum(q, 0.0, axis)
    n, m, t = flank_directions(belt, radial, axis, side)
    return frustum_gap(belt, side, radius, along, groove, 0.0), n, m, t, radius


def test_a_point_on_the_frustum_of_a_sheave():
    belt = chains.belt(half_width=0.012)
    q, v = (0.040, 0.025, 0.0119), np.array([-7.9, 12.6, 0.05])
    gap, n, m, t, radius = at_flank(belt, q, (0.0, 0.0, 1.0), 1.0, 0.04733)
    assert gap == pytest.approx(6.7615278218e-5, abs=1e-15)
    assert n == pytest.approx((0.161805704468, 0.101128565293, -0.981627183448), abs=1e-12)
    assert m == pytest.approx((0.832418186729, 0.520261366706, 0.190808995377), abs=1e-12)
    assert v @ n == pytest.approx(-0.053126501784, abs=1e-11)
    assert v @ m == pytest.approx(-0.011270004899, abs=1e-11)
    assert v @ t - 314.159265 * radius == pytest.approx(0.052907364135, abs=1e-11)
    for k in range(3):  # n is the gradient of the gap
        d = 1e-6 * np.eye(3)[k]
        gaps = [at_flank(belt, tuple(q + sign * d), (0.0, 0.0, 1.0), 1.0, 0.04733)[0] for sign in (1.0, -1.0)]
        assert (gaps[0] - gaps[1]) / 2e-6 == pytest.approx(n[k], abs=1e-8)
    # Schindler's form, (|d - s a| - r_h) cos phi from the base of the frustum, with phi = pi / 2 - d0
    # (Schindler 2008, eqs 16-22): r_h = R + (z - B) / tan d0
    tangent = np.tan(chains.WEDGE)
    r_h = 0.04733 + (0.0119 - 0.012) / tangent
    assert (np.hypot(0.040, 0.025) - r_h) * np.sin(chains.WEDGE) == pytest.approx(gap, rel=1e-9)


@njit
def plane_gap(ri, xi, oi, rj, xj, thickness, height, side):
    return face_gap(ri, xi, oi, rj, xj, thickness, height, side)[0]


@pytest.mark.parametrize(
    ("pitch", "edge", "head"),
    [(0.0, 0.7, 0.7), (-0.02, 30.544885, -79.447782), (0.02, -29.451115, 80.541552)],
)
def test_front_points_at_the_rear_plane(pitch, edge, head):
    x = (np.cos(pitch), np.sin(pitch), 0.0)
    for height, expected in ((-1.5e-3, edge), (4e-3, head)):
        gap = plane_gap(
            (0.0, 0.0, 0.0),
            (1.0, 0.0, 0.0),
            (0.0, -1.0, 0.0),
            (1.5305e-3, 0.0, 0.0),
            x,
            1.5298e-3,
            height,
            2e-3,
        )
        assert 1e6 * gap == pytest.approx(expected, abs=1e-6)


def circle_and_ellipse(circle, centre, first, second):
    """Parameters at which a circle about `circle` is next to an ellipse or farthest from it (eq. 25)."""

    def slope(phi):
        across = -first * np.sin(phi) + second * np.cos(phi)
        return 2.0 * across @ (circle - centre) + np.sin(2.0 * phi) * (first @ first - second @ second)

    places = np.linspace(0.0, 2.0 * np.pi, 721)
    values = [slope(phi) for phi in places]
    changes = [k for k in range(720) if values[k] * values[k + 1] < 0.0]
    roots = np.array([brentq(slope, places[k], places[k + 1], xtol=1e-14) for k in changes])
    points = centre + np.outer(np.cos(roots), first) + np.outer(np.sin(roots), second)
    return roots, np.linalg.norm(points - circle, axis=1)


@njit
def offset(ri, xi, oi, rj, xj, oj, thickness, height):
    return pin_offset(ri, xi, oi, rj, xj, oj, thickness, height)[:2]


def test_pin_and_hole():
    roots, distances = circle_and_ellipse(
        np.array([0.3, 0.2]), np.zeros(2), np.array([1.05, 0.0]), np.array([0.0, 1.0])
    )
    assert roots == pytest.approx([0.701543885, 3.598344099], abs=1e-9)
    assert distances == pytest.approx([0.671135100, 1.397996843], abs=1e-9)
    # a pin of 2 mm, tilted by 3 mrad against its hole: clearance less offset is the distance to the nearer point
    clearance, tilt, thickness, height = 1e-4, 3e-3, 1.53e-3, 2.5e-3
    xi, oi = (1.0, 0.0, 0.0), (0.0, -1.0, 0.0)
    xj, oj = (np.cos(tilt), np.sin(tilt), 0.0), (np.sin(tilt), -np.cos(tilt), 0.0)
    ri, rj = (0.0, 0.0, 0.0), (thickness, 3e-5, 4e-5)
    d, size = offset(ri, xi, oi, rj, xj, oj, thickness, height)
    # in the plane across x_j: the pin's circle is an ellipse there
    radius = 2e-3 - clearance
    across = np.array([np.dot(d, oj), d[2]])
    _, distances = circle_and_ellipse(
        np.zeros(2), across, np.array([radius * np.cos(tilt), 0.0]), np.array([0.0, radius])
    )
    assert 2e-3 - distances.max() == pytest.approx(clearance - size, abs=1e-8)


def shaken(seed, **changes):
    """A pressed belt with gaps, slips, rotations and modes out of order, beside tilted pulleys."""
    stiffness = ((6e8, 3e8, 3e8), (9e8, 2e8, 1e8))
    planar, planar_state = start(given(nodes=NODES, modal_stiffness=stiffness, friction_speed=0.05))
    axes = np.array([[3e-3, -2e-3, 1.0], [-1e-3, 4e-3, 1.0]])
    constants = {
        "axes": axes / np.linalg.norm(axes, axis=1)[:, None],
        "loose_side": np.array([1.0, -1.0]),
        "pin_clearance": 2e-5,
        "thickness": planar.thickness + 2e-5,
        "ring_friction_speed": 0.02,
        "lateral_damping": 3.0,
        "flank_law": int(Law.STRIBECK),
        "flank_gradient": -0.3,
        "friction_memory": 3e-4,
    }
    belt, state = chains.beside_planar(planar, planar_state, **constants | changes)
    rng = np.random.default_rng(seed)
    f = of_lanes(state.elements).copy()
    f[:, :3] += rng.normal(0.0, 2e-5, (NODES, 3))
    f[:, 3:6] += rng.normal(0.0, 2e-3, (NODES, 3))
    f[:, 3:6] /= np.linalg.norm(f[:, 3:6], axis=1)[:, None]
    f[:, 6:9] += rng.normal(0.0, 2e-3, (NODES, 3))
    f[:, 6:9] -= np.sum(f[:, 6:9] * f[:, 3:6], 1)[:, None] * f[:, 3:6]
    f[:, 6:9] /= np.linalg.norm(f[:, 6:9], axis=1)[:, None]
    f[:, b.SLOPE] = rng.normal(0.0, 2e-3, NODES)
    f[:, b.SPEED : b.SPEED + 8] += rng.normal(0.0, 0.05, (NODES, 8))
    f[:, b.SADDLE] = rng.uniform(20.0, 80.0, NODES)
    f[:, b.V_FILTERED : b.V_FILTERED + 4] = rng.uniform(0.0, 0.2, (NODES, 4))
    state.elements.data[:] = in_lanes(f).data
    state.openings[:] = rng.normal(0.0, 1e-6, state.openings.shape)
    state.leans[:] = rng.normal(0.0, 1e-6, state.openings.shape)
    state.pulleys[[DRIVING_RADIUS, DRIVEN_RADIUS]] += 1e-4
    state.pulleys[[b.DRIVING_MIDDLE, b.DRIVEN_MIDDLE]] = 3e-5, -2e-5
    return belt, state, b.workspace(belt, NODES), rng


def rate(own, ahead, first, last, x):
    """Rate of a law between neighbours by directions at this element and at the next one, by fields of `step`."""
    return np.sum(own * x[:, first], 1) + np.sum(ahead * np.roll(x, -1, 0)[:, last], 1)


U, W = slice(0, 3), slice(3, 6)


def directions(step, f, x):
    """Rates along x (nodes, 8) of all gaps and strains, by the directions that forces have."""

    def of(first):
        return step[:, first : first + 3]

    xj = np.roll(f[:, 3:6], -1, 0)
    found = {}
    for p in range(4):
        found[b.PUSH_GAP + p] = rate(-xj, xj, U, U, x) + rate(
            of(b.PUSH_LEVER_I + 3 * p), of(b.PUSH_LEVER_J + 3 * p), W, W, x
        )
    n = of(b.PIN_NORMAL)
    found[b.PIN_GAP] = rate(-n, n, U, U, x) - rate(of(b.PIN_LEVER_I), -of(b.PIN_LEVER_J), W, W, x)
    tension = rate(of(b.TENSION_I), -of(b.TENSION_J), U, U, x)
    tension += rate(of(b.TENSION_I + 3), -of(b.TENSION_J + 3), W, W, x) + x[:, 6] - np.roll(x[:, 6], -1)
    found[b.PREDICTED_TENSION] = tension
    ci, cj = of(b.CHORD_I), of(b.CHORD_J)
    found[b.PREDICTED_MOMENT_I] = rate(-ci, ci, U, U, x) + np.sum(of(b.TURN_I) * x[:, W], 1)
    found[b.PREDICTED_MOMENT_J] = rate(-cj, cj, U, U, x) + np.sum(of(b.TURN_J) * np.roll(x, -1, 0)[:, W], 1)
    return found


def test_rates_of_all_gaps_and_strains():
    # what forces take as rates along a direction, against differences of gaps at q + X dt
    belt, state, work, rng = shaken(1, angle_damping=0.0)
    f, x = of_lanes(state.elements).copy(), rng.normal(0.0, 1.0, (NODES, 8)) * [1, 1, 1, 100, 100, 100, 1, 0]
    axial = np.cross(f[:, 6:9], f[:, 3:6])
    lengths = np.zeros(NODES)
    for side in (1.0, -1.0):
        line = f[:, :3] + side * belt.package_distance * axial
        lengths += 0.5 * np.linalg.norm(np.roll(line, -1, 0) - line, axis=1)
    f[:, b.LENGTH] = lengths  # the direction of the tension is its rate at a strain of zero
    state.leans[:] = 0.0
    small, measured = 3e-9, {}
    for sign in (-1.0, 0.0, 1.0):
        g = f.copy()
        g[:, b.SPEED : b.SPEED + 8] = sign * small * x
        state.elements.data[:] = in_lanes(g).data
        _prepare(belt, state, work, 1.0)
        measured[sign] = of_lanes(work.step).copy()
    step = measured[0.0]
    difference = (measured[1.0] - measured[-1.0]) / (2.0 * small)
    difference[:, b.PREDICTED_TENSION] *= -lengths / belt.ring_stiffness
    moments = [b.PREDICTED_MOMENT_I, b.PREDICTED_MOMENT_J]
    difference[:, moments] *= 2.0 / belt.angle_stiffness
    for field, expected in directions(step, f, x).items():
        scale = np.abs(expected).max()
        assert difference[:, field] == pytest.approx(expected, abs=2e-7 * scale), field
    driven = f[:, 0] > 0.5 * belt.centre_distance
    axis = np.where(driven[:, None], belt.axes[1], belt.axes[0])
    for p in range(4):
        side, reach = (-1.0, -1.0, 1.0, 1.0)[p], (-1.0, 1.0)[p % 2] * belt.flank_reach
        width = belt.half_width + reach * belt.sine / belt.cosine
        lever = (reach - belt.pitch_depth) * f[:, 6:9] + side * width * axial
        n = belt.sine * step[:, b.RADIAL + 3 * p : b.RADIAL + 3 * p + 3] - side * belt.cosine * axis
        expected = np.sum(n * (x[:, U] + np.cross(x[:, W], lever)), 1)
        scale = np.abs(expected).max()
        assert difference[:, b.FLANK_GAP + p] == pytest.approx(expected, abs=2e-7 * scale)


def test_internal_forces_have_no_resultant_and_no_moment():
    belt, state, work, rng = shaken(2)
    f = of_lanes(state.elements).copy()
    _prepare(belt, state, work, STEP)
    step = of_lanes(work.step)
    shift, spin = rng.normal(0.0, 1.0, 3), rng.normal(0.0, 1.0, 3)
    # every law between neighbours has no rate in a rigid motion, in which the ring's material goes along
    x = np.zeros((NODES, 8))
    x[:, U], x[:, W] = shift + np.cross(spin, f[:, :3]), spin
    axial = np.cross(f[:, 6:9], f[:, 3:6])
    for side in (1.0, -1.0):
        arm = side * belt.package_distance * axial
        place = f[:, :3] + arm
        t = np.roll(place, -1, 0) - np.roll(place, 1, 0)
        t /= np.linalg.norm(t, axis=1)[:, None]
        x[:, 6] += 0.5 * np.sum(t * (x[:, U] + np.cross(x[:, W], arm)), 1)
    for field, found in directions(step, f, x).items():
        assert np.abs(found).max() < (1e-9 if field >= b.CHORD_I and field < b.YAW else 1e-12), field


def evaluated(belt, state, work, dt):
    """Residuals of elements and border, of an iterate evaluated twice, so that duals are those of its slips."""
    for _ in range(2):
        _evaluate(belt, state, work, LOAD, dt)
    own = of_lanes(work.iterate)[:, b.RESIDUAL : b.RESIDUAL + 8]
    return np.concatenate([own.ravel(), work.border[:, -1]])


def test_the_linear_system_is_the_slope_of_the_residuals():
    belt, state, work, rng = shaken(3)
    _prepare(belt, state, work, STEP)
    f = of_lanes(state.elements).copy()
    f[:, b.CHANGE : b.CHANGE + 8] = rng.normal(0.0, 0.01, (NODES, 8))
    state.increments[:] = [0.3, *rng.normal(0.0, 1e-7, 6)]
    state.elements.data[:] = in_lanes(f).data
    evaluated(belt, state, work, STEP)
    _assemble(belt, state, work, STEP)
    blocks, iterate = of_lanes(work.blocks), of_lanes(work.iterate)
    shapes, driven = of_lanes(work.shapes), of_lanes(state.elements)[:, b.DRIVEN]
    size = 8 * NODES
    matrix = np.zeros((size + 7, size + 7))
    for i in range(NODES):
        j, at = (i + 1) % NODES, slice(8 * i, 8 * i + 8)
        matrix[at, at] += blocks[i, :64].reshape(8, 8).T
        link = blocks[i, 64:128].reshape(8, 8).T
        matrix[at, 8 * j : 8 * j + 8] += link
        matrix[8 * j : 8 * j + 8, at] += link.T
        matrix[at, size:] = blocks[i, RIGHT + 8 : RIGHT + 64].reshape(7, 8).T
        matrix[size, 8 * i : 8 * i + 6] = iterate[i, b.TORQUE_ROW : b.TORQUE_ROW + 6]
    weights = np.hstack([(1.0 - driven)[:, None] * shapes, driven[:, None] * shapes])  # (nodes, 6)
    matrix[size, size] = iterate[:, b.TORQUE_OWN].sum() + belt.driven_inertia / STEP
    matrix[size, size + 1 :] = iterate[:, b.TORQUE_OPENING] @ weights
    for k in range(6):
        row = weights[:, k, None] * iterate[:, b.NORMAL_ROW : b.NORMAL_ROW + 6]
        matrix[size + 1 + k, :size] = np.hstack([row, np.zeros((NODES, 2))]).ravel()
        matrix[size + 1 + k, size + 1 :] = (weights[:, k] * iterate[:, b.NORMAL_YIELD]) @ weights
        matrix[size + 1 + k, size + 1 + k] += belt.modal_stiffness[k // 3, k % 3]
    kinds = {
        "speeds": np.concatenate([rng.normal(0.0, 1.0, size), np.zeros(7)]),
        "driven speed": np.eye(size + 7)[size] * 10.0,
        "openings": np.concatenate([np.zeros(size + 1), rng.normal(0.0, 1e-5, 6)]),
    }
    for what, direction in kinds.items():
        found = []
        for sign in (1.0, -1.0):
            g = f.copy()
            g[:, b.CHANGE : b.CHANGE + 8] += sign * 1e-6 * direction[:size].reshape(NODES, 8)
            increments = state.increments.copy()
            state.increments[:] += sign * 1e-6 * direction[size:]
            state.elements.data[:] = in_lanes(g).data
            found.append(evaluated(belt, state, work, STEP))
            state.increments[:] = increments
        slope = -(found[0] - found[1]) / 2e-6
        expected = matrix @ direction
        scale = np.abs(expected).max()
        # few contacts change over between the two
        wrong = np.abs(slope - expected) > 1e-5 * scale
        assert wrong.sum() <= 0, (what, np.flatnonzero(wrong)[:20], slope[wrong][:20], expected[wrong][:20])
