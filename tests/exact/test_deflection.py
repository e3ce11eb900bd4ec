"""Discs by flexibilities: contact against Lemke's algorithm and the local kernel, cones, tables and their errors."""

import numpy as np
import pytest

from cvt_hpc.lanes import LaneArray
from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import lane_contact, plain_contact, solve_contact, solve_wrap
from cvt_hpc.physics.deflection import cone_flexibilities, interpolated, table_matrix, table_problem
from cvt_hpc.physics.sheaves import flexibility
from support.complementarity import solve_lcp
from support.wraps import ARC, RADIUS, STATIONS, courses, local_kernel, random_wrap

SPACING, LANES, MOST_ROUNDS = ARC / (STATIONS - 1), 8, 300
PLACES = np.arange(STATIONS) * SPACING


def changing_sign(random):
    """Flexibilities [m/N] of the size of discs, of either sign: pressed here, it comes nearer over there."""
    modes = np.cos(np.outer(np.arange(1, 7), PLACES / ARC * np.pi) + random.uniform(0.0, 6.0, (6, 1)))
    found = 2e-8 * modes.T @ (modes / np.arange(1, 7)[:, None] ** 2) + 1e-10 * np.eye(STATIONS)
    assert found.min() < -0.03 * found.max()
    return found


def forces(contact, gaps):
    contact.stations.data[:, compliance.GAP] = gaps
    solve_contact(contact, MOST_ROUNDS)
    assert not contact.scalars.data[0, compliance.UNSOLVED].any()
    closed = contact.stations.data[:, compliance.CLOSED] > 0.5
    return np.where(closed, np.maximum(contact.stations.data[:, compliance.PUSH], 0.0), 0.0)


def plain_force(wrap, gaps):
    force = np.empty(STATIONS)
    assert solve_wrap(plain_contact(wrap), np.ascontiguousarray(gaps), force) > 0
    return force


@pytest.mark.parametrize("seed", range(3))
def test_forces_by_flexibilities_of_either_sign_are_lemkes(seed):
    random = np.random.default_rng(seed)
    wraps = [random_wrap(random)._replace(flexibilities=changing_sign(random)) for _ in range(LANES)]
    contact = lane_contact(wraps, np.float64)
    assert isinstance(contact.matrix, LaneArray)
    plain = [plain_contact(wrap) for wrap in wraps]
    sets = set()
    for gaps in courses(random, LANES)[:4]:
        found = forces(contact, gaps)
        for lane, wrap in enumerate(wraps):
            force = np.empty(STATIONS)
            assert solve_wrap(plain[lane], np.ascontiguousarray(gaps[:, lane]), force) > 0
            assert np.array_equal(found[:, lane], force)
            ce = wrap.element_stiffness
            expected = solve_lcp(ce * flexibility(wrap), ce * gaps[:, lane])
            assert force == pytest.approx(expected, abs=1e-3)
            sets.add(tuple(force > 0.0))
    assert len(sets) > LANES  # stations open and close


@pytest.mark.parametrize("seed", range(3))
def test_the_local_kernel_as_a_table_gives_the_forces_of_the_kernel(seed):
    random = np.random.default_rng(seed)
    wrap = random_wrap(random)
    table = interpolated(PLACES / RADIUS, local_kernel(wrap)[:1], wrap.angle, wrap.angle[-1])
    for gaps in courses(random, 1):
        expected = plain_force(wrap, gaps[:, 0])
        found = plain_force(wrap._replace(flexibilities=table), gaps[:, 0])
        assert found == pytest.approx(expected, abs=1e-9 * max(expected.max(), 1.0))


def test_a_cone_about_its_centre_is_in_series_with_its_collar():
    random = np.random.default_rng(5)
    wrap = random_wrap(random, 1.0)._replace(disc_compliance=1.0, tilt_compliance=RADIUS**2 / 4e5)
    cone = wrap._replace(flexibilities=cone_flexibilities(wrap.angle, RADIUS + wrap.rise, 2e5))
    series = wrap._replace(disc_compliance=0.0, tilt_compliance=RADIUS**2 / 4e5 + RADIUS**2 / 2e5)
    assert flexibility(cone) == pytest.approx(flexibility(series), rel=1e-12)
    for gaps in courses(random, 1):
        expected = plain_force(series, gaps[:, 0])
        assert plain_force(cone, gaps[:, 0]) == pytest.approx(expected, abs=1e-9 * max(expected.max(), 1.0))


def test_a_shifted_cone_turns_about_its_axis():
    # a force in the middle of the arc acts on the lever r - dr, and what lies beyond the axis closes
    stiffness, shift = 2e5, 0.03
    angles = np.pi * np.linspace(-0.5, 0.5, 21)
    found = cone_flexibilities(angles, RADIUS, stiffness, shift)
    assert found[10, 10] == pytest.approx((RADIUS - shift) ** 2 / stiffness, rel=1e-12)
    assert found[10, 0] == pytest.approx(-shift * (RADIUS - shift) / stiffness, rel=1e-12)
    assert np.linalg.matrix_rank(found, tol=1e-12 * found.max()) == 2


ANGLES = np.linspace(0.0, ARC / RADIUS, 9)
ROW = 1e-8 * np.exp(-ANGLES / 0.5)


def test_a_table_is_itself_at_its_knots_and_definite_between_them():
    whole = table_matrix(ANGLES, [ROW])
    assert whole[2, 5] == ROW[3] and np.array_equal(whole, whole.T)
    at_knots = interpolated(ANGLES, [ROW], ANGLES, ANGLES[-1])
    assert at_knots == pytest.approx(whole, rel=1e-12)
    assert np.array_equal(at_knots, interpolated(ANGLES, whole, ANGLES, ANGLES[-1]))
    for stations in (7, 40):
        found = interpolated(ANGLES, [ROW], np.linspace(0.0, ANGLES[-1], stations), ANGLES[-1])
        assert found == pytest.approx(found.T, rel=1e-12)
        assert np.linalg.eigvalsh(0.5 * (found + found.T))[0] > -1e-12 * found.max()
        assert found[0, 0] == ROW[0] and found[0, -1] == pytest.approx(ROW[-1], rel=1e-12)


@pytest.mark.parametrize(
    ("angles", "table", "expected", "found"),
    [
        (ANGLES, [ROW[:-1]], "1 or n rows of n flexibilities", "1 x 8"),
        ((), (), "1 or n rows of n flexibilities", "0 x 0"),
        (ANGLES, [ROW, ROW], "number of angles, 9", "2 x 9"),
        (ANGLES[::-1], [ROW], "angles that ascend, from 0 or before the inlet", "3.6 to 0 rad"),
        (np.r_[0.0, ANGLES[2:], 5.0], [ROW], "equidistant angles", "steps of"),
        (0.5 * ANGLES, [ROW], "angles over the whole wrap, 3.6 rad", "up to 1.8 rad"),
        (ANGLES, np.diag(ROW) + 1e-9 * np.eye(9, k=1), "a symmetric matrix", "1e-09 and 0 m/N between angles 1 and 2"),
        (ANGLES, [ROW - 0.5 * ROW[0]], "a positive definite matrix", "the eigenvalue -"),
    ],
)  # fmt: skip
def test_tables_that_no_disc_has_are_refused(angles, table, expected, found):
    told = table_problem(tuple(angles), table, ARC / RADIUS)
    assert expected in told[0] and found in told[1], told


def test_a_table_of_a_disc_is_taken():
    assert table_problem(tuple(ANGLES), [ROW], ARC / RADIUS) is None
