"""The variator's path against plane geometry and a published pushbelt set."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc import load_job
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt.belt import belt_constants, mesh
from cvt_hpc.physics.geometry import cut_path, driven_radius, variator
from support.pages import ROOT

# A public pushbelt set (github wangzhanrock/CVT_VelocityInit): centre distance, belt length at mid pack
CENTRES = 0.155
BELT = 0.661195

ratios = st.floats(0.3, 3.0)
radii = st.floats(
    0.01, 0.038
)  # driven radius; with these ratios and the centre distance below, never overlapping


@given(ratios, radii)
def test_path_closes_in_the_plane(tell, ratio, driven_radius):
    # Walk along the path: clockwise arcs about both shafts, strands straight on. What touches both circles,
    # comes back to the start and has turned once has the right wraps and strands.
    path = variator(ratio, driven_radius, 0.2)
    assert path.driven_radius / path.driving_radius == pytest.approx(ratio, rel=1e-15)
    heading = 0.5 * (np.pi + path.driving_wrap)  # of t2, symmetric to t1
    start = point = path.driving_radius * 1j * np.exp(1j * heading)
    for radius, wrap, centre in (
        (path.driving_radius, path.driving_wrap, 0.0),
        (path.driven_radius, path.driven_wrap, 0.2),
    ):
        # round-off of a dozen operations on lengths of 0.2 m
        assert point - centre == pytest.approx(radius * 1j * np.exp(1j * heading), abs=1e-15)
        point = centre + (point - centre) * np.exp(-1j * wrap)
        heading -= wrap
        point += path.strand_length * np.exp(1j * heading)
    tell("end of a path around both pulleys [m]", (point.real, point.imag), (start.real, start.imag))
    assert point == pytest.approx(start, abs=1e-15)
    assert path.driving_wrap + path.driven_wrap == pytest.approx(2.0 * np.pi, rel=1e-15)


def test_the_working_point_is_that_of_the_paper(tell):
    # Lebrecht et al. 2004, sec. 3.1
    point = load_job(ROOT / "jobs" / "lebrecht_2004.toml").point(0)
    found = point["ratio"], point["driving_speed"] * 30.0 / np.pi
    tell("ratio and driving speed [rpm] of the working point", found, (2.52, 3000.0))
    tell("thrust at the working point [N]", point["thrust"])
    assert found == pytest.approx((2.52, 3000.0), rel=1e-9) and point["thrust"] >= 50e3


@given(ratios, radii)
def test_lengths_are_arcs_and_strands(ratio, driven_radius):
    path = variator(ratio, driven_radius, 0.2)
    arcs = path.driving_radius * path.driving_wrap, path.driven_radius * path.driven_wrap
    assert path.lengths == (arcs[0], path.strand_length, arcs[1], path.strand_length)
    assert path.path_length == pytest.approx(sum(arcs) + 2.0 * path.strand_length, rel=1e-15)


@pytest.mark.parametrize(
    ("driving", "driven"),
    [(72.71e-3, 36.35e-3), (55.89e-3, 55.89e-3), (36.35e-3, 72.71e-3), (30.687e-3, 76.718e-3)],
)
def test_one_belt_fits_every_published_ratio(driving, driven):
    # radii are printed to 5 um: each moves the length by its wrap, together 2 pi
    assert variator(driven / driving, driven, CENTRES).path_length == pytest.approx(
        BELT, abs=2.0 * np.pi * 5e-6
    )


@pytest.mark.parametrize(
    ("ratio", "driving", "driven"),
    [
        (0.5, 72.71e-3, 36.35e-3),
        (1.0, 55.89e-3, 55.89e-3),
        (2.0, 36.35e-3, 72.71e-3),
        (2.5, 30.687e-3, 76.718e-3),
    ],
)
def test_the_belt_gives_the_published_radii(ratio, driving, driven):
    found = driven_radius(ratio, BELT, CENTRES)
    printed = 5e-6 if ratio < 2.5 else 5e-7  # [m]: half of the last digit
    assert (found / ratio, found) == pytest.approx((driving, driven), abs=1.01 * printed)


@given(ratios, radii)
def test_the_radius_closes_the_belt(ratio, radius):
    length = variator(ratio, radius, 0.2).path_length
    # lengths are known to some 1e-16 of 0.5 m, and a radius moves them by its wrap, which is above 1.5 rad here
    assert driven_radius(ratio, length, 0.2) == pytest.approx(radius, abs=1e-15 * (1.0 + ratio))


@pytest.mark.parametrize("ratio", [0.01, 0.3, 1.0, 3.0, 100.0])
def test_belts_from_the_shortest_to_the_longest_close(ratio):
    shortest, longest = 2.0 * CENTRES, longest_belt(ratio)
    for share in (1e-12, 1e-3, 0.5, 0.999999):
        length = shortest + share * (longest - shortest)
        path = variator(ratio, driven_radius(ratio, length, CENTRES), CENTRES)
        assert path.path_length == pytest.approx(length, rel=1e-14)


@pytest.mark.parametrize("ratio", [0.3, 1.0, 2.5])
def test_belts_that_close_nowhere_are_refused(ratio):
    for length in (0.0, 2.0 * CENTRES, 1.000001 * longest_belt(ratio), np.inf, np.nan):
        with pytest.raises(ValueError, match="more than 0.31 m, twice the centre distance, and less than"):
            driven_radius(ratio, length, CENTRES)


def longest_belt(ratio):
    """Length of a belt on pulleys that all but touch [m]."""
    return variator(ratio, (1.0 - 1e-12) * CENTRES * ratio / (1.0 + ratio), CENTRES).path_length


def test_one_belt_has_the_same_rings_and_elements_at_each_ratio():
    document = {
        "name": "x",
        "model": "elastic_belt",
        "scene": {"belt_length": BELT, "centre_distance": CENTRES},
    }
    job = build_job(document | {"axes": {"ratio": [0.5, 1.0, 2.5]}}, "x.toml")
    for index in range(job.size):
        p = job.point(index)
        grid, curvature = mesh(p), belt_constants(p).curvature
        # the elements fill the path but for `play`; rings lie above it by `ring_offset`, once around
        assert grid.cell.sum() == pytest.approx(BELT, rel=1e-14)
        rings = grid.cell @ (1.0 + curvature * p["ring_offset"])
        assert rings == pytest.approx(BELT + 2.0 * np.pi * p["ring_offset"], rel=1e-14)


def test_published_wrap():
    path = variator(2.5, 76.717726657055e-3, CENTRES)
    assert path.driving_radius == pytest.approx(30.687090662822e-3, rel=1e-12)
    # the set's author solved for the angle by iteration, which stopped 2e-8 deg away from his radii
    assert np.rad2deg(path.driven_wrap) == pytest.approx(2.0 * 107.2758155568609, abs=1e-7)


def test_equal_pulleys():
    path = variator(1.0, 0.05, CENTRES)
    assert path.driving_wrap == path.driven_wrap == np.pi
    assert path.strand_length == CENTRES
    assert path.path_length == pytest.approx(2.0 * np.pi * 0.05 + 2.0 * CENTRES)


@pytest.mark.parametrize(("ratio", "driven"), [(1.0, 0.0775), (1.0, 0.08), (0.2, 0.05)])
def test_overlapping_pulleys_are_refused(ratio, driven):
    with pytest.raises(ValueError, match="overlap"):
        variator(ratio, driven, CENTRES)


@pytest.mark.parametrize("cells", [24, 25, 160, 1000])
@pytest.mark.parametrize("ratio", [0.2, 0.4, 1.0, 2.5, 5.0])
@pytest.mark.parametrize("refinement", [1.0, 4.0, 20.0])
def test_a_path_is_cut_into_the_cells_that_were_asked_for(cells, ratio, refinement):
    path = variator(ratio, 0.12 * ratio / (1.0 + ratio), 0.155)
    parts = cut_path(path, cells, refinement)
    assert sum(part.size for part in parts) == cells and min(part.size for part in parts) >= 4
    for part, length in zip(parts, path.lengths, strict=True):
        assert part.sum() == pytest.approx(length, rel=1e-12) and part.min() > 0.0
        # shortest at both ends, and alike from either
        assert part == pytest.approx(part[::-1], rel=1e-3)
        assert part[0] <= part.min() * 1.001 and part[0] * (refinement + 1.0) * 2.0 > part.max()
