"""Contacts of the spatial pushbelt: golden digits of frustum, plane, pin and hole, pressed edges."""

import numpy as np
import pytest
from numba import njit
from scipy.optimize import brentq

from cvt_hpc.models.pushbelt.belt import of_lanes
from cvt_hpc.models.spatial_pushbelt import belt as b
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt.chain import predict
from cvt_hpc.models.spatial_pushbelt.faces import face_forces, face_gap, pin_offset, predict_faces
from cvt_hpc.models.spatial_pushbelt.flank import flank_directions, frustum, frustum_gap
from support import spatial_chains as chains


@njit
def at_flank(belt, q, axis, side, groove):
    radial, radius, along = frustum(q, 0.0, axis)
    n, m, t = flank_directions(belt, radial, axis, side)
    return frustum_gap(belt, side, radius, along, groove, 0.0), n, m, t, radius


def test_a_point_on_the_frustum_of_a_sheave(tell):
    belt = chains.belt(half_width=0.012)
    q, v = (0.040, 0.025, 0.0119), np.array([-7.9, 12.6, 0.05])
    gap, n, m, t, radius = at_flank(belt, q, (0.0, 0.0, 1.0), 1.0, 0.04733)
    assert gap == pytest.approx(6.7615278218e-5, abs=1e-15)
    tell("gap of a point at the frustum of a sheave [m]", gap, 6.7615278218e-5)
    assert n == pytest.approx((0.161805704468, 0.101128565293, -0.981627183448), abs=1e-12)
    assert m == pytest.approx((0.832418186729, 0.520261366706, 0.190808995377), abs=1e-12)
    assert v @ n == pytest.approx(-0.053126501784, abs=1e-11)
    assert v @ m == pytest.approx(-0.011270004899, abs=1e-11)
    assert v @ t - 314.159265 * radius == pytest.approx(0.052907364135, abs=1e-11)
    for k in range(3):  # n is the gradient of the gap
        d = 1e-6 * np.eye(3)[k]
        gaps = [at_flank(belt, tuple(q + sign * d), (0.0, 0.0, 1.0), 1.0, 0.04733)[0] for sign in (1.0, -1.0)]
        assert (gaps[0] - gaps[1]) / 2e-6 == pytest.approx(n[k], abs=1e-8)


@pytest.mark.parametrize(
    ("q", "expected", "normal"),
    [
        ((0.05, 0.03, 0.0049), 5.917376712540e-4, (-0.16361736, -0.09817042, 0.98162718)),
        ((0.062, -0.011, 0.006), 4.008747913608e-4, (-0.18787498, 0.03333266, 0.98162718)),
    ],
)
def test_a_point_on_the_frustum_of_the_paper(q, expected, normal, tell):
    """(|d - s a| - r_h) cos phi, r_h = r_1 + s tan phi, by the frustum's base (Schindler 2008, eqs 16-22)."""
    # phi = pi / 2 - d0; r_1 is the radius at z = 0, that of the groove where z is half of an element's width
    belt, tangent = chains.belt(), 5.144554016
    assert tangent == pytest.approx(1.0 / np.tan(chains.WEDGE), rel=1e-9)
    gap, n, _, _, _ = at_flank(belt, q, (0.0, 0.0, 1.0), 1.0, 0.03 + tangent * belt.half_width)
    tell("gap by eqs 16 to 22 [m]", gap, expected)
    tell("normal by eq. 21", -np.array(n), normal)
    assert gap == pytest.approx(expected, abs=1e-13)  # tan phi has ten digits
    # the paper's points into the frustum, ours against the element
    assert -np.array(n) == pytest.approx(normal, abs=1e-8)


@njit
def plane_gap(ri, xi, oi, rj, xj, thickness, height, side):
    return face_gap(ri, xi, oi, rj, xj, thickness, height, side)[0]


@pytest.mark.parametrize(
    ("pitch", "edge", "head"),
    [(0.0, 0.7, 0.7), (-0.02, 30.544885, -79.447782), (0.02, -29.451115, 80.541552)],
)
def test_front_points_at_the_rear_plane(pitch, edge, head, tell):
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
        tell("gap of points of a front at the next rear [um]", 1e6 * gap, expected)
        assert 1e6 * gap == pytest.approx(expected, abs=1e-6)


def pressed_edges(belt, push, curvature):
    """Forces at the edges, left and right, and moments (16 - 1,) of elements pressed along an arc out of their plane.

    Each is so close to the one behind as the push at the middle of the edge asks, and tilted, heads apart.
    """
    nodes, yaw, tilt, apart = 16, curvature * belt.pitch, 1e-3, push / belt.contact_stiffness
    fields = np.zeros((nodes, f.STATE_FIELDS))
    r, x, o = np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, -1.0, 0.0])
    for element in fields:
        element[:9] = *r, *x, *o
        edge = r + 0.5 * belt.thickness * x - belt.pitch_depth * o
        x = np.cos(tilt) * (np.cos(yaw) * x + np.sin(yaw) * np.cross(o, x)) - np.sin(tilt) * o
        o = o - (o @ x) * x
        o /= np.linalg.norm(o)
        r = edge + (0.5 * belt.thickness - apart) * x + belt.pitch_depth * o
    state, work = chains.state(fields), b.workspace(belt, nodes)
    predict(belt, state.elements, state.pulleys, work.step, 1e-9)
    predict_faces(belt, state.elements, work.step, 1e-9)
    work.iterate.data[:] = 0.0
    face_forces(belt, state.elements, work.step, work.iterate, 1e-9)
    forces, turns = (
        of_lanes(of)[:-1, k : k + n]
        for of, k, n in ((state.elements, f.PUSH, 4), (work.iterate, f.PAIR_J + 3, 3))
    )
    assert not forces[:, 2:].any()
    return forces[:, :2], -np.sum(turns * fields[1:, 6:9], axis=1)


def test_pressed_edges_bend_as_a_beam_until_one_opens():
    belt, push = chains.belt(), 500.0
    stiff = belt.contact_stiffness * belt.edge_width**2 * belt.pitch  # EI of 2 (c / 2) b^2 h
    assert stiff == pytest.approx(153.0, rel=1e-3)
    opens = push * belt.edge_width / stiff
    for share in (-0.999, -0.5, 0.0, 0.5, 0.999, 1.001):
        edges, moment = pressed_edges(belt, push, share * opens)
        # each edge has half of the push, and of the moment what its width asks, until one has none; tilt takes 5e-7
        expected = 0.5 * push * (1.0 + share)
        assert edges[:, 1] == pytest.approx(expected, abs=1e-6 * push)
        expected = min(share * push, expected) * belt.edge_width
        assert moment == pytest.approx(expected, abs=1e-6 * push * belt.edge_width)
        assert (edges[:, 0] > 0.0).all() == (share < 1.0)


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
