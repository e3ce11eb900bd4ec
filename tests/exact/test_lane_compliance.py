"""The contact of several runs at once against the plain solver of each, and Lemke on the dense matrix."""

import numpy as np
import pytest

from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import lane_contact, plain_contact, solve_contact, solve_wrap
from cvt_hpc.physics.sheaves import flexibility
from support.complementarity import solve_lcp
from support.wraps import STATIONS, courses, random_wrap

MOST_ROUNDS = 400
WIDTHS = {np.float64: 8, np.float32: 16}


def solve(contact, gaps, most_rounds=MOST_ROUNDS):
    """Forces (stations, lanes) [N/m]."""
    contact.stations.data[:, compliance.GAP] = gaps
    solve_contact(contact, most_rounds)
    closed = contact.stations.data[:, compliance.CLOSED] > 0.5
    return np.where(closed, np.maximum(contact.stations.data[:, compliance.PUSH], 0.0), 0.0)


def batch(seed, dtype=np.float64, **values):
    """Wraps, their contact in lanes, and courses of gaps."""
    random = np.random.default_rng(seed)
    wraps = [random_wrap(random, **values) for _ in range(WIDTHS[dtype])]
    return wraps, lane_contact(wraps, dtype), courses(random, len(wraps))


@pytest.mark.parametrize("seed", range(10))
def test_each_lane_is_the_plain_solver(seed):
    wraps, contact, course = batch(seed)
    plain = [plain_contact(wrap) for wrap in wraps]
    sets, counts = set(), np.zeros(len(wraps))
    for gaps in course:
        found = solve(contact, gaps)
        for lane, state in enumerate(plain):
            force = np.empty(STATIONS)
            counts[lane] += solve_wrap(state, np.ascontiguousarray(gaps[:, lane]), force)
            assert np.array_equal(found[:, lane], force)
            closed = state.stations[:, compliance.CLOSED]
            assert np.array_equal(contact.stations.data[:, compliance.CLOSED, lane], closed)
            sets.add(tuple(closed))
        assert np.array_equal(contact.scalars.data[0, compliance.SOLVES], counts)
        assert not contact.scalars.data[0, compliance.UNSOLVED].any()
    assert len(sets) > len(wraps)


@pytest.mark.parametrize("seed", range(3))
def test_each_lane_is_lemke_on_the_dense_matrix(seed):
    wraps, contact, course = batch(seed)
    for gaps in course[:3]:
        found = solve(contact, gaps)
        for lane, wrap in enumerate(wraps):
            ce = wrap.element_stiffness
            expected = solve_lcp(ce * flexibility(wrap), ce * gaps[:, lane])
            # as for the plain solver: 1e7 N/m times a condition of 1e5 times eps is 1e-4
            assert found[:, lane] == pytest.approx(expected, abs=1e-3)


def test_rigid_sheaves_leave_the_elements_alone():
    wraps, contact, course = batch(0, stiffness=np.inf)
    stiffness = [wrap.element_stiffness for wrap in wraps]
    # all open, all closed (nothing but open stations on the wrong side), and any
    for gaps in (np.abs(course[0]), -np.abs(course[0]), course[1]):
        expected = np.maximum(-gaps, 0.0) * stiffness
        assert solve(contact, gaps) == pytest.approx(expected, rel=1e-13, abs=1e-6)


def test_single_precision_knows_forces_to_its_round_off():
    wraps, contact, course = batch(4, np.float32)
    for gaps in course:
        found = solve(contact, gaps)
        for lane, wrap in enumerate(wraps):
            force = np.empty(STATIONS)
            given = gaps[:, lane].astype(np.float32).astype(float)
            assert solve_wrap(plain_contact(wrap), given, force) > 0
            # stations may be on the wrong side by 2 N/m; eps = 6e-8 times a condition of 1e2 of forces of 1e6 N/m
            assert found[:, lane] == pytest.approx(force, abs=2.0 + 3e-5 * force.max())
        assert not contact.scalars.data[0, compliance.UNSOLVED].any()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_a_lane_without_numbers_does_not_disturb_the_others(bad):
    (_, contact, course), (_, other, _) = batch(5), batch(5)
    spoiled = course.copy()
    spoiled[3:, 7, 2] = bad
    rest = np.delete(np.arange(8), 2)
    for gaps, bad_gaps in zip(course, spoiled, strict=True):
        expected, found = solve(contact, gaps), solve(other, bad_gaps)
        assert np.array_equal(found[:, rest], expected[:, rest])
        for row in (compliance.SOLVES, compliance.UNSOLVED):
            assert np.array_equal(other.scalars.data[0, row, rest], contact.scalars.data[0, row, rest])


def test_a_search_that_does_not_end_is_marked_in_its_lane_alone():
    # without the sheaves' part all stations that overlap stay closed: one solve; lane 3 has a station that is far off
    _, contact, _ = batch(6, stiffness=np.inf)
    gaps = np.full((STATIONS, 8), -1e-4)
    gaps[9, 3] = 1e-3
    solve(contact, gaps, most_rounds=1)
    assert contact.scalars.data[0, compliance.UNSOLVED].tolist() == [0, 0, 0, 1, 0, 0, 0, 0]
    assert contact.scalars.data[0, compliance.SOLVES].tolist() == [1, 1, 1, 2, 1, 1, 1, 1]
    # what is marked stays so
    solve(contact, gaps)
    assert contact.scalars.data[0, compliance.UNSOLVED].tolist() == [0, 0, 0, 1, 0, 0, 0, 0]


def test_neighbours_do_not_change_a_bit():
    # one wrap alone, and in each lane of a batch whose other searches take longer or shorter
    wraps, contact, course = batch(7)
    alone = [lane_contact([wrap], np.float64) for wrap in wraps]
    for gaps in course:
        found = solve(contact, gaps)
        for lane, single in enumerate(alone):
            assert np.array_equal(solve(single, gaps[:, [lane]])[:, 0], found[:, lane])
