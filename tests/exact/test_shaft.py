"""Bending shafts against closed forms, and what their deflection does to the groove against its geometry."""

import numpy as np
import pytest
from scipy.integrate import quad

from cvt_hpc.physics.shaft import (
    Bearing,
    Seats,
    beam_flexibility,
    bearing_reactions,
    free_opening,
    gap_shares,
    shaft_compliance,
)

MODULUS, DIAMETER, LENGTH = 2.1e11, 0.03, 0.2
BENDING = MODULUS * np.pi / 64.0 * DIAMETER**4
ENDS = [Bearing(0.0, np.inf), Bearing(LENGTH, np.inf)]
CLAMPED = [Bearing(0.0, np.inf, np.inf)]
ANGLE = np.deg2rad(11.0)


def uniform(bearings, *places):
    return beam_flexibility([LENGTH], [DIAMETER], MODULUS, bearings, places)


@pytest.mark.parametrize("share", [0.5, 0.3])
def test_simply_supported(share):
    a, b = share * LENGTH, (1.0 - share) * LENGTH
    found = uniform(ENDS, a, 0.0, LENGTH)
    assert found[0, 0] == pytest.approx(a**2 * b**2 / (3 * BENDING * LENGTH), rel=1e-12)
    assert found[3, 0] == pytest.approx(a * b * (LENGTH + b) / (6 * BENDING * LENGTH), rel=1e-12)
    assert found[5, 0] == pytest.approx(-a * b * (LENGTH + a) / (6 * BENDING * LENGTH), rel=1e-12)
    assert np.array_equal(found, found.T)


def test_cantilever():
    expected = np.array([[LENGTH**3 / 3, LENGTH**2 / 2], [LENGTH**2 / 2, LENGTH]]) / BENDING
    assert uniform(CLAMPED, LENGTH) == pytest.approx(expected, rel=1e-12)


def test_overhang():
    a, over = 0.12, LENGTH - 0.12
    found = uniform([Bearing(0.0, np.inf), Bearing(a, np.inf)], LENGTH)
    assert found[0, 0] == pytest.approx(over**2 * LENGTH / (3 * BENDING), rel=1e-12)


def test_stepped_beam_is_the_work_of_its_moments():
    lengths, diameters = [0.03, 0.05, 0.08, 0.04], [0.025, 0.04, 0.05, 0.03]
    ends, load, read = np.cumsum(lengths), 0.07, 0.13

    def per_bending(x):
        return 1.0 / (MODULUS * np.pi / 64.0 * diameters[int(np.searchsorted(ends, x))] ** 4)

    def moment(x, place):
        """Of a simply supported beam under a unit force."""
        return min(x, place) * (LENGTH - max(x, place)) / LENGTH

    expected, _ = quad(
        lambda x: moment(x, load) * moment(x, read) * per_bending(x),
        0.0,
        LENGTH,
        points=[*ends[:-1], load, read],
    )
    found = beam_flexibility(lengths, diameters, MODULUS, ENDS, [load, read])
    assert found[2, 0] == pytest.approx(expected, rel=1e-9)


def test_bearings_give_by_levers():
    springs = [Bearing(0.0, 1e8), Bearing(LENGTH, 3e8)]
    stiff = beam_flexibility([LENGTH], [DIAMETER], 1e6 * MODULUS, springs, [0.05])
    assert stiff[0, 0] == pytest.approx(0.75**2 / 1e8 + 0.25**2 / 3e8, rel=1e-4)
    both = uniform(springs, 0.05)
    assert both[0, 0] == pytest.approx(0.75**2 / 1e8 + 0.25**2 / 3e8 + uniform(ENDS, 0.05)[0, 0], rel=1e-9)


@pytest.mark.parametrize("bearings", [[], [Bearing(0.05, 1e8)]])
def test_a_shaft_without_bearings_is_refused(bearings):
    with pytest.raises(ValueError, match="bearings that hold the shaft"):
        uniform(bearings, 0.1)


def rigid_gap(seats, radius, x, phi):
    """Gap change between two rigid sheaves, moved as `x` says, by their surfaces in space."""
    tangent, middle = np.tan(ANGLE), 0.5 * (seats.fixed + seats.movable)
    found = []
    for k, seat in enumerate(seats):
        (v, theta), side = x[2 * k : 2 * k + 2], np.sign(seat - middle)
        # a point of the flank, further outside by `more`, that comes to lie at the belt's radius
        more = 0.0
        for _ in range(50):
            z = middle + side * tangent * more
            more -= radius + more + (v + theta * (z - seat)) * np.cos(phi) - radius
        found.append(side * (z - theta * (radius + more) * np.cos(phi) - middle))
    return sum(found)


@pytest.mark.parametrize("seats", [Seats(0.08, 0.12), Seats(0.12, 0.08)])
def test_the_gap_follows_the_sheaves(seats):
    radius, phi = 0.06, 0.7
    shares = gap_shares(seats, radius, ANGLE)
    for k in range(4):
        x = np.zeros(4)
        x[k] = 1e-7
        assert rigid_gap(seats, radius, x, phi) == pytest.approx(np.cos(phi) * shares @ x, rel=1e-4)


def test_a_pulley_that_turns_as_one_body_keeps_its_gap():
    # about the middle of its groove; a displacement opens it by twice the tangent, on the side away from it
    seats = Seats(0.08, 0.12)
    shares = gap_shares(seats, 0.06, ANGLE)
    assert shares @ [-0.02, 1.0, 0.02, 1.0] == pytest.approx(0.0, abs=1e-15)
    assert shares @ [1.0, 0.0, 1.0, 0.0] == pytest.approx(-2.0 * np.tan(ANGLE))


def test_compliance_of_bearings_alone_and_of_a_bent_middle():
    seats, radius = Seats(0.09, 0.11), 0.06
    springs = [Bearing(0.0, 1e8), Bearing(LENGTH, 1e8)]
    stiff = beam_flexibility([LENGTH], [DIAMETER], 1e9 * MODULUS, springs, seats)
    found = shaft_compliance(stiff, seats, radius, ANGLE)
    assert found == pytest.approx((2.0 * np.tan(ANGLE)) ** 2 / 2e8, rel=1e-4)
    # Opposite couples, a lever each, bend what lies between the seats into an arc; the shaft is straight beyond.
    # Forces of a tangent each pull both seats towards the other pulley, which that arc raises.
    tangent, half, a, b = np.tan(ANGLE), 0.01, 0.09, 0.11
    lever = radius - tangent * half
    raised = lever * half / BENDING * a
    pulled = tangent * (a**2 * b**2 / 3 + a * a * (LENGTH**2 - 2 * a**2) / 6) / (BENDING * LENGTH)
    expected = lever**2 * 2 * half / BENDING - 4 * tangent * raised + 2 * tangent * pulled
    bent = shaft_compliance(uniform(ENDS, *seats), seats, radius, ANGLE)
    assert bent == pytest.approx(expected, rel=1e-10)
    turned = shaft_compliance(uniform(ENDS, *seats[::-1]), Seats(*seats[::-1]), radius, ANGLE)
    assert turned == pytest.approx(bent, rel=1e-12)


def test_clearance_is_taken_up_by_both_bearings():
    positions, seats = (0.0, LENGTH), Seats(0.04, 0.08)
    shares = bearing_reactions(positions, seats, ANGLE)
    assert shares == pytest.approx(2.0 * np.tan(ANGLE) * np.array([0.7, 0.3]))
    assert free_opening(1e-5, positions, seats, ANGLE) == pytest.approx(2e-5 * np.tan(ANGLE))
    # an overhung pulley goes beyond the clearance of its bearings
    overhung = free_opening(1e-5, (0.0, 0.1), Seats(0.13, 0.17), ANGLE)
    assert overhung == pytest.approx(2e-5 * np.tan(ANGLE) * (1.5 + 0.5))
