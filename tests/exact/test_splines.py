"""Hierarchical B-splines: sums, derivatives of polynomials, and that finer levels add to the coarse space."""

import numpy as np
import pytest

from cvt_hpc.physics.splines import cubic_spline, hierarchical_splines

LENGTH, STATIONS = 0.6, 240
POSITION = LENGTH * np.arange(STATIONS) / STATIONS


def left_over(basis, target):
    """What the basis cannot show of a function, against its size."""
    q = np.linalg.lstsq(basis, target, rcond=None)[0]
    return np.abs(basis @ q - target).max() / np.abs(target).max()


def test_the_cardinal_spline():
    assert cubic_spline(np.array([0.0, 1.0, -1.0, 2.0, 2.5])) == pytest.approx(
        [2 / 3, 1 / 6, 1 / 6, 0.0, 0.0]
    )
    x = np.linspace(-2.0, 2.0, 4001)
    assert np.trapezoid(cubic_spline(x), x) == pytest.approx(1.0, abs=1e-9)
    # twice continuously differentiable at its knots
    for knot in (-1.0, 1.0):
        near = cubic_spline(knot + 1e-3 * np.array([-2, -1, 0, 1, 2]))
        second = near[:3] @ [1, -2, 1], near[2:] @ [1, -2, 1]
        assert second[0] == pytest.approx(second[1], abs=1e-8)


def test_splines_add_up_to_one_across_the_seam():
    splines = hierarchical_splines(POSITION, LENGTH, 20, [])
    assert splines.values.sum(axis=1) == pytest.approx(np.ones(STATIONS), abs=1e-14)


def test_a_level_all_around_makes_the_space_of_half_the_spacing():
    both = hierarchical_splines(POSITION, LENGTH, 20, [[(0.0, LENGTH)]])
    fine = hierarchical_splines(POSITION, LENGTH, 40, [])
    assert both.values.shape == fine.values.shape == (STATIONS, 40)
    assert np.bincount(both.levels).tolist() == [20, 20]
    for column in fine.values.T:
        assert left_over(both.values, column) < 1e-12
    assert np.linalg.cond(both.values) < 100.0


def test_finer_splines_stay_in_their_zone_and_change_no_coarse_one():
    coarse = hierarchical_splines(POSITION, LENGTH, 20, [])
    refined = hierarchical_splines(POSITION, LENGTH, 20, [[(-0.05, 0.05)], [(0.29, 0.31)]])
    assert np.array_equal(refined.values[:, :20], coarse.values)
    first = refined.levels == 1
    # across the seam, and no wider than twice their spacing beyond it
    apart = np.abs((refined.centres[first] + 0.3) % LENGTH - 0.3)
    assert apart.max() <= 0.05 and first.sum() == 4
    reach = refined.values[:, first].any(axis=1)
    assert np.all(np.minimum(POSITION[reach], LENGTH - POSITION[reach]) < 0.05 + 2 * 0.015)
    assert refined.spacings[refined.levels == 2] == pytest.approx(LENGTH / 80)
