"""Offset of pulleys, and strands that bend sideways: limits in which other closed forms are known, and published digits."""

import math

import numpy as np
import pytest

from cvt_hpc.physics.geometry import driven_radius
from cvt_hpc.physics.out_of_plane import (
    axial_offset,
    buckling_push,
    clamped_force,
    clamped_frequency,
    clamped_moment,
    pinned_frequencies,
)

LENGTH, EI, SHEAR, MASS = 0.15411, 47.6, 2.4e6, 1.4639  # [m], [N m^2], [N], [kg/m]
# a common variator of the loose sheaves on opposite sides: [m], and e [mm] by ratio, aligned at 1
BELT, DISTANCE = 0.661195, 0.155
OFFSETS = {1.35: -0.1096, 2.0: -0.5300, 2.5: -0.8522}
# the strand's length above is rounded to 5 um of 154 mm, in the third power
ROUNDED = 1e-4


def scene(ratio, sides=("right", "left")):
    radius = driven_radius(ratio, BELT, DISTANCE)
    loose = {f"{pulley}_loose_side": side for pulley, side in zip(("driving", "driven"), sides, strict=True)}
    angle = math.radians(11.0)
    return {
        "ratio": ratio,
        "driven_radius": radius,
        "centre_distance": DISTANCE,
        "half_wedge_angle": angle,
    } | loose


@pytest.mark.parametrize("ratio", OFFSETS)
def test_pulleys_whose_loose_sheaves_are_opposite_are_out_of_line_by_both_radii(ratio):
    asked = scene(ratio)
    radii = asked["driven_radius"], asked["driven_radius"] / ratio
    found = axial_offset(asked, 1.0)
    assert found * 1e3 == pytest.approx(OFFSETS[ratio], abs=5.1e-5)
    # to second order in the difference of the radii; what is left is of the fourth
    second = -math.tan(math.radians(11.0)) * (radii[0] - radii[1]) ** 2 / (math.pi * DISTANCE)
    assert found == pytest.approx(second, rel=0.1 * ((radii[0] - radii[1]) / DISTANCE) ** 2)
    assert axial_offset(asked, ratio) == pytest.approx(0.0, abs=1e-15)
    # a ratio and its inverse have the same radii, at the other pulleys
    assert axial_offset(scene(1.0 / ratio), 1.0) == pytest.approx(found, rel=1e-10)
    mirrored = axial_offset(scene(ratio, ("left", "right")), 1.0)
    assert mirrored == -found


def test_pulleys_whose_loose_sheaves_are_on_one_side_are_out_of_line_by_the_difference():
    asked = scene(2.0, ("right", "right"))
    difference = 0.5 * asked["driven_radius"]
    assert axial_offset(asked, 1.0) == pytest.approx(-math.tan(math.radians(11.0)) * difference, rel=1e-12)


def test_the_lateral_force_of_a_misaligned_strand():
    tensions = (0.0, 1000.0, 2000.0, 4000.0)
    forces = [clamped_force(5e-4, LENGTH, tension, EI) for tension in tensions]
    assert forces == pytest.approx([78.025, 81.916, 85.803, 93.562], rel=ROUNDED)
    moments = [clamped_moment(5e-4, LENGTH, tension, EI) for tension in tensions]
    assert moments[0] == pytest.approx(6.0 * EI * 5e-4 / LENGTH**2) and moments[-1] == pytest.approx(
        6.21, abs=5e-3
    )
    # without tension a beam's, without stiffness a string's, and no jump where the formula changes
    assert clamped_force(5e-4, LENGTH, 4000.0, 1e-9) == pytest.approx(4000.0 * 5e-4 / LENGTH, rel=1e-4)
    edge = 4e-6 * EI / LENGTH**2  # where u is 1e-3
    both = [clamped_force(5e-4, LENGTH, edge * share, EI) for share in (0.999, 1.001)]
    assert both[0] == pytest.approx(both[1], rel=1e-8) and both[0] == pytest.approx(forces[0], rel=1e-6)


def test_the_lateral_force_is_that_of_the_beam_equation():
    """EI w'''' = T w'' by central differences, w 0 and e and w' 0 at the ends: second order in the mesh."""
    tension, offset, found = 4000.0, 5e-4, []
    for cells in (100, 200):
        h, n = LENGTH / cells, cells - 1
        bend = np.diag(np.full(n, 6.0)) - 4.0 * (np.eye(n, k=1) + np.eye(n, k=-1))
        bend += np.eye(n, k=2) + np.eye(n, k=-2)
        bend[0, 0] += 1.0  # a mirror image beyond the ends
        bend[-1, -1] += 1.0
        pull = 2.0 * np.eye(n) - np.eye(n, k=1) - np.eye(n, k=-1)
        ends = np.zeros(n)
        ends[-1] = offset * (4.0 * EI / h**4 + tension / h**2)
        ends[-2] = -offset * EI / h**4
        w = np.linalg.solve(EI / h**4 * bend + tension / h**2 * pull, ends)
        # of the shear force T w' - EI w''' half a cell from an end
        w = np.concatenate([[w[0], 0.0], w])
        found.append(tension * (w[2] - w[1]) / h - EI * (w[3] - 3.0 * w[2] + 3.0 * w[1] - w[0]) / h**3)
    exact = clamped_force(offset, LENGTH, tension, EI)
    # by a step of Richardson; what is left is of the fourth order
    assert (4.0 * found[1] - found[0]) / 3.0 == pytest.approx(exact, rel=1e-5)


def test_shear_softens_a_misaligned_strand():
    """Without tension a Timoshenko beam: both springs in series; a string has no shear of its own."""
    bending, shear = 12.0 * EI * 5e-4 / LENGTH**3, SHEAR * 5e-4 / LENGTH
    found = clamped_force(5e-4, LENGTH, 0.0, EI, SHEAR)
    assert found == pytest.approx(1.0 / (1.0 / bending + 1.0 / shear), rel=1e-12)
    assert clamped_force(5e-4, LENGTH, 4000.0, 1e-9, SHEAR) == pytest.approx(4000.0 * 5e-4 / LENGTH, rel=1e-4)
    # V e is twice the elastic energy, which tension changes by half of T w'^2 along the shape without it
    step = 1.0
    slope = clamped_force(1.0, LENGTH, step, EI, SHEAR) - clamped_force(1.0, LENGTH, 0.0, EI, SHEAR)
    x = np.linspace(0.0, 1.0, 20001)
    given = 12.0 * EI / (SHEAR * LENGTH**2)
    slopes = (6.0 * x * (1.0 - x) + given) / (1.0 + given) / LENGTH
    assert slope == pytest.approx(step * np.trapezoid(slopes**2, x) * LENGTH, rel=1e-4)


def test_the_lateral_frequencies_of_a_strand():
    found = pinned_frequencies(3, LENGTH, 4000.0, EI, MASS, SHEAR)
    assert found == pytest.approx([412.10, 1522.50, 3314.13], rel=ROUNDED)
    assert pinned_frequencies(1, LENGTH, 2000.0, EI, MASS, SHEAR)[0] == pytest.approx(394.26, rel=ROUNDED)
    string = 0.5 / LENGTH * math.sqrt(4000.0 / MASS)
    assert pinned_frequencies(2, LENGTH, 4000.0, 0.0, MASS) == pytest.approx([string, 2.0 * string])
    assert clamped_frequency(LENGTH, 4000.0, EI, MASS, SHEAR) == pytest.approx(858.57, rel=ROUNDED)


def test_the_clamped_frequency_in_its_limits():
    assert 2.0 * math.pi * clamped_frequency(1.0, 1e-12, 1.0, 1.0) == pytest.approx(
        4.730040744862704**2, rel=1e-9
    )
    # a string shortened by sqrt(EI / T) at each end, to first order
    tension = 1e8
    string = 0.5 * math.sqrt(tension) / (1.0 - 2.0 / math.sqrt(tension))
    assert clamped_frequency(1.0, tension, 1.0, 1.0) == pytest.approx(string, rel=1e-6)


def test_a_strand_without_frequency_buckles():
    push = buckling_push(LENGTH, 0.0, 0.5)
    assert push == pytest.approx(207.8, abs=0.05)
    assert pinned_frequencies(1, LENGTH, -push * (1.0 - 1e-12), 0.5, MASS)[0] < 1e-3
    assert buckling_push(LENGTH, 1000.0, 0.5, clamped=True) == pytest.approx(1000.0 + 4.0 * push)
