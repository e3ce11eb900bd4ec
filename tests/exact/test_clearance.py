"""A sheave that tilts within a clearance before it bears: a spring behind a gap, limits, symmetry, and Lemke."""

import numpy as np
import pytest
from scipy.optimize import brentq

from cvt_hpc.physics import compliance
from cvt_hpc.physics.clearance import bearing_direction, principal_axes
from cvt_hpc.physics.compliance import (
    ROUNDS_OF_BLOCK_FLIPS,
    lane_contact,
    plain_contact,
    solve_contact,
    solve_wrap,
)
from cvt_hpc.physics.deflection import interpolated
from cvt_hpc.physics.sheaves import flexibility, sheaves
from support.complementarity import solve_lcp
from support.wraps import ARC, RADIUS, STATIONS, courses, local_kernel, places, random_wrap

MOST_ROUNDS, LANES = 400, 8
CLEARANCES = (1e-6, 3e-5, 3e-4)  # [m]: far below, at and above the overlaps of `courses`


def plain_force(wrap, gap):
    force = np.empty(gap.size)
    assert solve_wrap(plain_contact(wrap), np.ascontiguousarray(gap), force) > 0
    return force


def lane_forces(contact, gaps):
    contact.stations.data[:, compliance.GAP] = gaps
    solve_contact(contact, MOST_ROUNDS)
    closed = contact.stations.data[:, compliance.CLOSED] > 0.5
    return np.where(closed, np.maximum(contact.stations.data[:, compliance.PUSH], 0.0), 0.0)


def tilting(wrap, force):
    """s [N]."""
    return wrap.tilt @ (wrap.weight * force)


def opening(wrap, gap, force, contact):
    """Gap of each station, by an opening that the law allows."""
    s, loose = tilting(wrap, force), contact.scalars[0, [compliance.LOOSE_1, compliance.LOOSE_2]]
    if np.linalg.norm(s) > 1e-3:  # else the direction is that of round-off
        assert loose == pytest.approx(wrap.clearance * s / np.linalg.norm(s), abs=1e-9 * wrap.clearance)
    assert np.linalg.norm(loose) <= wrap.clearance * (1.0 + 1e-12)
    return gap + flexibility(wrap) @ force + loose @ wrap.tilt


def with_clearance(random, clearance, **values):
    return random_wrap(random, **values)._replace(clearance=clearance)


def tabulated(wrap):
    """The same disc by a matrix of flexibilities."""
    table = interpolated(wrap.angle, local_kernel(wrap)[:1], wrap.angle, wrap.angle[-1])
    return wrap._replace(flexibilities=table)


@pytest.mark.parametrize("place", [0, 7, STATIONS - 1])
@pytest.mark.parametrize("form", [lambda wrap: wrap, tabulated], ids=["kernel", "table"])
def test_one_station_is_a_spring_behind_a_gap(place, form):
    """A single force tilts towards itself: f (1 / c_e + w + kappa h) = overlap - c, and nothing before."""
    wrap = form(with_clearance(np.random.default_rng(1), 5e-5, stiffness=1.0))
    give = flexibility(wrap)[place, place]
    for overlap in (1e-5, 4.9e-5, 5.1e-5, 2e-4):
        gap = np.full(STATIONS, 1e-2)
        gap[place] = -overlap
        force = plain_force(wrap, gap)
        # within the clearance 1e-6 N/m over the arc stands for nothing
        expected = max(overlap - 5e-5, 0.0) / give
        assert force[place] == pytest.approx(expected, rel=1e-9, abs=1e-6 * ARC / wrap.weight[place])
        assert not np.delete(force, place).any()


def test_one_way_of_tilting_is_a_spring_behind_a_gap():
    """Rigid discs and collar under a symmetric load: one equation, s = c_e sum h U (overlap - U (c + kappa s))."""
    arc, clearance = np.pi * RADIUS, 2e-5
    wrap = sheaves(*places(21, arc, RADIUS), RADIUS, 1.0, 4e7, 4e9, 0.012, 3e10, np.inf)._replace(
        clearance=clearance
    )
    angles = np.arange(21) * wrap.weight[1] / RADIUS
    lever = wrap.tilt.T @ [0.0, 1.0]  # the middle of half a turn
    assert lever == pytest.approx(np.sin(angles))
    force = plain_force(wrap, np.full(21, -1e-4))
    stiffness = 3e10 * wrap.weight
    s = (1e-4 * stiffness @ lever - clearance * stiffness @ lever**2) / (
        1.0 + wrap.tilt_compliance * stiffness @ lever**2
    )
    assert tilting(wrap, force) == pytest.approx([0.0, s], rel=1e-11, abs=1e-6)
    expected = 3e10 * (1e-4 - lever * (clearance + wrap.tilt_compliance * s))
    assert force == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("clearance", CLEARANCES)
@pytest.mark.parametrize("form", [lambda wrap: wrap, tabulated], ids=["kernel", "table"])
def test_gaps_are_closed_under_the_law(clearance, form, tell):
    random = np.random.default_rng(3)
    wraps = [form(with_clearance(random, clearance)) for _ in range(LANES)]
    contact, plain = lane_contact(wraps, np.float64), [plain_contact(wrap) for wrap in wraps]
    bearing = 0
    for gaps in courses(random, LANES):
        found = lane_forces(contact, gaps)
        for lane, wrap in enumerate(wraps):
            alone = np.empty(STATIONS)
            assert solve_wrap(plain[lane], np.ascontiguousarray(gaps[:, lane]), alone) > 0
            assert np.array_equal(found[:, lane], alone)
            gap = opening(wrap, gaps[:, lane], alone, plain[lane])
            # 0.03 N/m over c_e: the sheaves' part of 1e7 N/m, to a condition of 1e5 eps
            tell("gap or overlap of a wrap against the law [m]", (min(gap.min(), 0.0), *gap[alone > 0.0]))
            assert gap.min() > -1e-12
            assert np.abs(gap[alone > 0.0]).max(initial=0.0) < 1e-12
            bearing += np.linalg.norm(tilting(wrap, alone)) > 1.0
        assert not contact.scalars.data[0, compliance.UNSOLVED].any()
    assert (bearing > 10) == (clearance < 1e-4)  # wraps of more than half a turn hold a loose sheave


@pytest.mark.parametrize("seed", range(3))
def test_forces_are_lemkes_with_the_compliance_of_that_load(seed):
    """With sigma = |s| the collar is a softer one, kappa + c / sigma in either direction."""
    random = np.random.default_rng(seed)
    wrap = with_clearance(random, 2e-5, stiffness=1.0)
    checked = 0
    for gaps in courses(random, 1):
        gap, ce = gaps[:, 0], wrap.element_stiffness
        force = plain_force(wrap, gap)
        sigma = np.linalg.norm(tilting(wrap, force))

        def softer(size, gap=gap, ce=ce):
            own = wrap._replace(tilt_compliance=wrap.tilt_compliance + wrap.clearance / size)
            return solve_lcp(ce * flexibility(own), ce * gap)

        if sigma < 1.0:
            continue
        root = brentq(
            lambda size, of=softer: np.linalg.norm(tilting(wrap, of(size))) - size, 1e-2, 1e7, rtol=1e-14
        )
        assert sigma == pytest.approx(root, rel=1e-9)
        assert force == pytest.approx(softer(root), abs=1e-3)
        checked += 1
    assert checked >= 2


@pytest.mark.parametrize("turn", [0.3, 1.0, 2.5])
def test_the_law_has_no_direction(turn):
    random = np.random.default_rng(11)
    wrap = with_clearance(random, 3e-5, stiffness=1.0)
    cosine, sine = np.cos(turn), np.sin(turn)
    turned = wrap._replace(tilt=np.array([[cosine, -sine], [sine, cosine]]) @ wrap.tilt)
    for gaps in courses(random, 1):
        force = plain_force(wrap, gaps[:, 0])
        assert plain_force(turned, gaps[:, 0]) == pytest.approx(force, abs=1e-9 * max(force.max(), 1e3))


def test_no_clearance_is_the_contact_without_to_the_last_bit():
    """Also beside lanes that have clearance."""
    random = np.random.default_rng(5)
    wraps = [random_wrap(random) for _ in range(LANES)]
    mixed = [wrap._replace(clearance=2e-5 * (lane % 2)) for lane, wrap in enumerate(wraps)]
    assert lane_contact(mixed, np.float64).has_clearance and not lane_contact(wraps, np.float64).has_clearance
    for form in (lambda wrap: wrap, tabulated):
        none = lane_contact([form(wrap) for wrap in wraps], np.float64)
        beside = lane_contact([form(wrap) for wrap in mixed], np.float64)
        for gaps in courses(random, LANES):
            expected, found = lane_forces(none, gaps), lane_forces(beside, gaps)
            assert np.array_equal(found[:, ::2], expected[:, ::2])
            assert not np.array_equal(found[:, 1::2], expected[:, 1::2])
        for row in (compliance.SOLVES, compliance.UNSOLVED):
            assert np.array_equal(beside.scalars.data[0, row, ::2], none.scalars.data[0, row, ::2])


def test_a_small_clearance_goes_to_none_in_first_order():
    wrap, gap = with_clearance(np.random.default_rng(2), 0.0, stiffness=1.0), np.full(STATIONS, -4e-5)
    none = plain_force(wrap, gap)
    errors = [np.abs(plain_force(wrap._replace(clearance=c), gap) - none).max() for c in (4e-8, 2e-8, 1e-8)]
    assert np.divide(errors[:-1], errors[1:]) == pytest.approx([2.0, 2.0], abs=0.01)


def test_a_large_clearance_is_a_sheave_that_tilts_freely():
    """Over more than half a turn the belt holds it; by a collar of no stiffness, of which 1 N m/rad is next to it."""
    gap = -4e-5 * (1.0 + 0.3 * np.cos(3.0 * np.linspace(0.0, 1.0, STATIONS)))
    wrap = with_clearance(np.random.default_rng(8), 0.05, stiffness=1.0)
    force = plain_force(wrap, gap)
    free = wrap._replace(tilt_compliance=RADIUS**2, clearance=0.0)
    expected = solve_lcp(wrap.element_stiffness * flexibility(free), wrap.element_stiffness * gap)
    assert force == pytest.approx(expected, abs=1e-4 * expected.max())
    assert force.max() > 1e4
    assert np.linalg.norm(tilting(wrap, force)) <= plain_contact(wrap).scalars[0, compliance.LEAST_LOAD]


def test_a_stiff_collar_tilts_by_its_clearance_and_no_more():
    """Rigid sheaves: each element is pressed by its overlap less c cos(phi - phi_s)."""
    random = np.random.default_rng(9)
    wrap = with_clearance(random, 1.5e-5, stiffness=np.inf)
    gap = -4e-5 * (1.0 + 0.3 * np.cos(3.0 * np.linspace(0.0, 1.0, STATIONS)))
    force = plain_force(wrap, gap)
    s = tilting(wrap, force)
    assert np.linalg.norm(s) > 100.0
    expected = np.maximum(-gap - 1.5e-5 * (s / np.linalg.norm(s)) @ wrap.tilt, 0.0) * wrap.element_stiffness
    assert force == pytest.approx(expected, rel=1e-10)


def test_searches_end_where_block_flips_cycle():
    # rough gaps on sheaves far softer than any job's
    random = np.random.default_rng(0)
    solves = []
    for _ in range(600):
        m, arc = int(random.integers(10, 60)), random.uniform(0.1, 0.3)
        wrap = sheaves(*places(m, arc, RADIUS), RADIUS, 0.1, 4e3, 4e9, random.uniform(0.02, 0.1), 3e10)
        wrap = wrap._replace(clearance=10.0 ** random.uniform(-7.0, -3.0))
        gap, force = 2e-5 * random.normal(size=m), np.empty(m)
        contact = plain_contact(wrap)
        solves.append(solve_wrap(contact, gap, force))
        found = opening(wrap, gap, force, contact)
        # what the dense product of forces and soft sheaves loses
        assert solves[-1] > 0 and found.min() >= -1e-11
        assert np.abs(found[force > 0.0]).max(initial=0.0) <= 1e-11
    assert max(solves) > ROUNDS_OF_BLOCK_FLIPS


def test_single_precision_knows_forces_to_its_round_off():
    random = np.random.default_rng(4)
    wraps = [with_clearance(random, 2e-5) for _ in range(16)]
    contact = lane_contact(wraps, np.float32)
    for gaps in courses(random, 16):
        found = lane_forces(contact, gaps)
        for lane, wrap in enumerate(wraps):
            exact = plain_force(wrap, gaps[:, lane].astype(np.float32).astype(float))
            # eps of the forces without clearance, times a condition of 1e4 where little resists tilting
            size = plain_force(wrap._replace(clearance=0.0), gaps[:, lane]).max()
            assert found[:, lane] == pytest.approx(exact, abs=5.0 + 6e-4 * size)
        assert not contact.scalars.data[0, compliance.UNSOLVED].any()


def test_neighbours_do_not_change_a_bit():
    random = np.random.default_rng(7)
    wraps = [with_clearance(random, c) for c in np.geomspace(1e-7, 1e-3, LANES)]
    contact = lane_contact(wraps, np.float64)
    alone = [lane_contact([wrap], np.float64) for wrap in wraps]
    for gaps in courses(random, LANES):
        found = lane_forces(contact, gaps)
        for lane, single in enumerate(alone):
            assert np.array_equal(lane_forces(single, gaps[:, [lane]])[:, 0], found[:, lane])


def test_the_iteration_ends_from_every_load():
    """Loads from far within to far beyond, closed stations that resist one way of tilting by nothing at all."""
    worst = 0.0
    for lesser in (0.0, 1e-9, 1e-4, 0.1, 1.0):
        for size in np.geomspace(1e-3, 1e6, 37):
            for angle in (0.0, 1e-9, 1e-6, 1e-3, 0.1, 1.0, 1.5, 0.5 * np.pi):
                one, other = size * np.cos(angle), size * np.sin(angle)
                p_1, p_2, left = bearing_direction(one, other, 1.0, lesser, 1e-10, 1e-13)
                length = np.hypot(p_1, p_2)
                assert not left and length <= 1.0 + 2e-13
                worst = max(worst, length - 1.0)
                if length > 1.0 - 1e-9:
                    # the root: (sigma I + L) p = s_0
                    sigma = (one - p_1) / p_1 if abs(p_1) > abs(p_2) else (other - lesser * p_2) / p_2
                    assert sigma > 0.0
                else:
                    # within: s_0 = L p, but for the load that stands for none
                    assert (one, other) == pytest.approx((p_1, lesser * p_2), rel=1e-9, abs=1e-10)
    assert worst > 0.0


def test_an_iteration_that_does_not_end_is_marked_in_its_lane_alone():
    random = np.random.default_rng(6)
    contact = lane_contact([with_clearance(random, 2e-5, stiffness=1.0) for _ in range(LANES)], np.float64)
    contact.scalars.data[0, compliance.DIRECTION_ERROR, 3] = -10.0  # asks for what cannot be
    lane_forces(contact, np.full((STATIONS, LANES), -1e-4))
    assert contact.scalars.data[0, compliance.UNSOLVED].tolist() == [0, 0, 0, 1, 0, 0, 0, 0]


@pytest.mark.parametrize("angle", [0.0, 0.4, np.pi / 4, np.pi / 2, 2.0])
@pytest.mark.parametrize("values", [(3.0, 1.0), (1.0, 0.0), (2.0, 2.0), (0.0, 0.0)])
def test_principal_axes(angle, values):
    cosine, sine = np.cos(angle), np.sin(angle)
    turn = np.array([[cosine, -sine], [sine, cosine]])
    matrix = turn @ np.diag(values) @ turn.T
    c, s, larger, lesser = principal_axes(matrix[0, 0], matrix[0, 1], matrix[1, 1])
    assert (larger, lesser) == pytest.approx(values, abs=1e-15)
    assert np.hypot(c, s) == pytest.approx(1.0)
    found = np.array([[c, -s], [s, c]])
    assert found @ np.diag((larger, lesser)) @ found.T == pytest.approx(matrix, abs=1e-15)
