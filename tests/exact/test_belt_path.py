"""Belts around circles: exact lengths, closure, points and their coordinates, and paths that cannot be."""

import numpy as np
import pytest

from cvt_hpc.physics.belt_path import belt_path, points_at, regions
from cvt_hpc.physics.geometry import variator
from cvt_hpc.physics.nearest_on_path import along

# three pulleys around which a belt runs counter-clockwise, and one that presses from outside
CENTRES = np.array([[0.0, 0.0], [0.3, 0.05], [0.2, 0.3], [0.08, 0.16]])
RADII, TURNS = np.array([0.06, 0.05, 0.07, 0.02]), np.array([1.0, 1.0, 1.0, -1.0])


def two(turn, distance=0.4, radii=(0.05, 0.08)):
    return belt_path(np.array([[0.0, 0.0], [distance, 0.0]]), np.array(radii), np.array([1.0, turn]))


def test_an_open_belt_is_that_of_a_variator():
    path, exact = two(1.0), variator(1.6, 0.08, 0.4)
    np.testing.assert_allclose(path.wrap, [exact.driving_wrap, exact.driven_wrap], rtol=1e-14)
    np.testing.assert_allclose(path.spans, exact.strand_length, rtol=1e-14)
    assert path.path_length == pytest.approx(exact.path_length, rel=1e-14)


def test_a_crossed_belt_has_its_exact_length():
    """Both wraps are pi + 2 asin((R1 + R2) / a), both spans sqrt(a^2 - (R1 + R2)^2)."""
    path = two(-1.0)
    wrap = np.pi + 2.0 * np.arcsin(0.13 / 0.4)
    np.testing.assert_allclose(path.wrap, wrap, rtol=1e-14)
    exact = 0.13 * wrap + 2.0 * np.sqrt(0.4**2 - 0.13**2)
    assert path.path_length == pytest.approx(exact, rel=1e-14)


def test_a_belt_around_equal_circles_at_the_corners_of_a_polygon():
    """Its spans are the sides, its arcs together one circle."""
    corners = 0.5 * np.array([[np.cos(a), np.sin(a)] for a in np.arange(5) * 0.4 * np.pi])
    path = belt_path(corners, np.full(5, 0.1), np.ones(5))
    assert path.path_length == pytest.approx(5 * np.sin(0.2 * np.pi) + 0.2 * np.pi, rel=1e-14)


@pytest.mark.parametrize("path", [two(1.0), two(-1.0), belt_path(CENTRES, RADII, TURNS)])
def test_points_lie_along_the_path_and_are_found_there(path):
    position = (np.arange(400) + 0.5) / 400 * path.path_length
    points, angle, curvature = points_at(path, position)
    h = 1e-6
    ahead, behind = (points_at(path, position + side * h)[0] for side in (1.0, -1.0))
    direction = np.stack([np.cos(angle), np.sin(angle)], 1)
    np.testing.assert_allclose((ahead - behind) / (2.0 * h), direction, rtol=0, atol=1e-5)
    turned = np.gradient(np.unwrap(angle), position)
    inside = np.diff(regions(path, position), prepend=-1, append=-1)
    inside = (inside[1:] == 0) & (inside[:-1] == 0)
    np.testing.assert_allclose(turned[inside], curvature[inside], rtol=0, atol=1e-9)
    side = np.stack([np.sin(angle), -np.cos(angle)], 1)
    for offset in (-0.004, 0.0, 0.004):
        found, off = along(path, points + offset * side, 0.5 * direction)
        np.testing.assert_allclose(found, position, rtol=0, atol=1e-12)
        np.testing.assert_allclose(off, offset, rtol=0, atol=1e-12)


def test_a_pulley_from_outside_bends_the_belt_back():
    path = belt_path(CENTRES, RADII, TURNS)
    assert TURNS @ path.wrap == pytest.approx(2.0 * np.pi, rel=1e-14)
    without = belt_path(CENTRES[:3], RADII[:3], TURNS[:3])
    assert path.path_length > without.path_length and 0.0 < path.wrap[3] < np.pi


def test_a_crossed_belt_may_run_around_several():
    """Spans cross once, so that it winds around all together not at all."""
    corners = np.array([[0.0, 0.0], [0.4, 0.1], [0.4, -0.1]])
    path = belt_path(corners, np.full(3, 0.05), np.array([1.0, -1.0, -1.0]))
    assert np.array([1.0, -1.0, -1.0]) @ path.wrap == pytest.approx(0.0, abs=1e-14)


@pytest.mark.parametrize(
    ("centres", "radii", "turns", "message"),
    [
        (CENTRES[:2] * 0.3, RADII[:2], TURNS[:2], "overlap: pulleys 1 and 2 at a distance of 0.09"),
        (CENTRES, RADII, [1, 1, 1, 1], "winds around them 2 times"),
        (
            np.array([[0.0, 0.0], [0.3, 0.0], [0.15, -0.05]]),
            [0.05, 0.05, 0.03],
            [1, 1, -1],
            "span behind pulley 1 that runs into pulley 3",
        ),
        (  # an idler outside of the belt, which reaches it by a loop around the idler, or backwards
            np.array([[0.0, 0.0], [0.2, -0.1], [0.4, 0.0]]),
            [0.05, 0.03, 0.05],
            [1, -1, 1],
            "crosses itself as it wraps pulley 2 by 349 deg, more than 270",
        ),
        (
            np.array([[0.0, 0.0], [0.4, 0.0], [0.2, -0.1]]),
            [0.05, 0.05, 0.03],
            [1, 1, -1],
            "spans behind pulleys 1 and 2 cross",
        ),
    ],
)
def test_belts_that_do_not_close_are_refused(centres, radii, turns, message):
    with pytest.raises(ValueError, match=message):
        belt_path(centres, radii, np.array(turns))
