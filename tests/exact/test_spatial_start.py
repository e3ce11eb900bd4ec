"""The start of a spatial pushbelt: where its elements lie and how they move, out of the plane as in it."""

import numpy as np
import pytest

from cvt_hpc.job import build_job
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.belt import equal_chords, of_lanes, outset
from cvt_hpc.models.spatial_pushbelt import fields as spatial_fields
from cvt_hpc.models.spatial_pushbelt.belt import start
from cvt_hpc.physics.out_of_plane import clamped_force
from cvt_hpc.variator.history import points_at, regions

OFFSET, EI = 5e-4, 47.6  # [m], [N m^2]
NODES = 432
STILL = {"disturbance": 0.0, "sheave_stiffness": np.inf, "belt_length": 0.6612}
P = build_job({"name": "start", "model": "spatial_pushbelt"}, "start", STILL).point(0)
PATH = outset(P).line.path
SPEED = P["driving_speed"] * PATH.driving_radius


def started(**changes):
    """Constants, fields (n, STATE_FIELDS), pulleys, and region of each element."""
    belt, state = start({**P, **changes})
    places, _ = equal_chords(lambda s: points_at(PATH, 0.155, s)[0], PATH.path_length, NODES)
    return belt, of_lanes(state.elements), state.pulleys, regions(PATH, places)


def vectors(fields, first):
    return fields[:, first : first + 3]


def inside(region, which):
    """Elements of a region with two neighbours on each side in it."""
    found = region == which
    for shift in (-2, -1, 1, 2):
        found = found & (np.roll(region, shift) == which)
    return found


def test_an_aligned_belt_starts_in_its_plane():
    belt, e, pulleys, region = started()
    assert not e[
        :,
        [
            spatial_fields.POSITION + 2,
            spatial_fields.SPEED + 2,
            spatial_fields.SLOPE,
            spatial_fields.SLOPE_RATE,
        ],
    ].any()
    assert not e[
        :,
        [
            spatial_fields.OMEGA,
            spatial_fields.OMEGA + 1,
            spatial_fields.HEADING + 2,
            spatial_fields.OUTWARD + 2,
        ],
    ].any()
    # pitch points of the arcs lie on the radii of the pulleys
    pitch = vectors(e, spatial_fields.POSITION) - belt.pitch_depth * vectors(e, spatial_fields.OUTWARD)
    for k, radius in ((0, pulleys[f.DRIVING_RADIUS]), (2, pulleys[f.DRIVEN_RADIUS])):
        found = np.hypot(pitch[region == k, 0] - 0.5 * k * 0.155, pitch[region == k, 1])
        assert found == pytest.approx(radius, rel=1e-12)
    tension = belt.ring_stiffness * (
        np.linalg.norm(np.diff(vectors(e, spatial_fields.POSITION), axis=0), axis=1)
        / e[:-1, spatial_fields.LENGTH]
        - 1.0
    )
    assert tension == pytest.approx(600.0, rel=1e-9) and (e[:, spatial_fields.TENSION] == 6e6 * 1e-4).all()


@pytest.mark.parametrize(
    "changes", [{"misalignment": OFFSET}, {"axis_tilt": 2e-3, "axis_skew": -1e-3}], ids=str
)
def test_elements_turn_and_move_along_the_path(changes):
    belt, e, _, region = started(**changes)
    x, o = vectors(e, spatial_fields.HEADING), vectors(e, spatial_fields.OUTWARD)
    assert np.linalg.norm(x, axis=1) == pytest.approx(1.0) == pytest.approx(np.linalg.norm(o, axis=1))
    assert (x * o).sum(axis=1) == pytest.approx(0.0, abs=1e-15)
    # what is of each element follows from its neighbours, up to the polygon's second order
    per_second = SPEED / (2.0 * belt.pitch)
    omega, u = vectors(e, spatial_fields.OMEGA), vectors(e, spatial_fields.SPEED)
    for which in range(4):
        here = inside(region, which)
        for field, given in ((spatial_fields.HEADING, np.cross(omega, x)), (spatial_fields.POSITION, u)):
            rate = per_second * (
                np.roll(vectors(e, field), -1, axis=0) - np.roll(vectors(e, field), 1, axis=0)
            )
            least = 1e-3 * np.abs(rate[here]).max()
            assert np.abs(given - rate)[here].max() < least, (which, field)
    assert e[:, spatial_fields.SLOPE] == pytest.approx(x[:, 2] / np.hypot(x[:, 0], x[:, 1]), abs=1e-15)


def test_misaligned_strands_carry_the_force_of_a_clamped_beam():
    belt, e, pulleys, region = started(misalignment=OFFSET)
    assert pulleys[[spatial_fields.DRIVING_MIDDLE, spatial_fields.DRIVEN_MIDDLE]].tolist() == [
        -0.5 * OFFSET,
        0.5 * OFFSET,
    ]
    assert e[region == 0, spatial_fields.POSITION + 2] == pytest.approx(-0.5 * OFFSET)
    assert e[region == 2, spatial_fields.POSITION + 2] == pytest.approx(0.5 * OFFSET)
    moment = belt.ring_bending / belt.pitch * np.diff(e[:, spatial_fields.SLOPE])
    for which, sign in ((1, 1.0), (3, -1.0)):
        strand = np.flatnonzero(inside(region, which))
        shear = -np.diff(moment[strand[1:-1]]) / belt.pitch
        # chords of a straight strand are all alike: the second difference of a cubic's slope is exact
        assert shear == pytest.approx(sign * clamped_force(OFFSET, PATH.strand_length, 0.0, EI), rel=1e-6)


def test_a_mirrored_scene_starts_mirrored():
    changes = {"misalignment": OFFSET, "axis_tilt": 1e-3, "disturbance": 0.0}
    _, e, pulleys, _ = started(**changes)
    _, m, mirrored, _ = started(**{key: -value for key, value in changes.items()})
    odd = [
        spatial_fields.POSITION + 2,
        spatial_fields.HEADING + 2,
        spatial_fields.OUTWARD + 2,
        spatial_fields.SLOPE,
        spatial_fields.SPEED + 2,
        spatial_fields.OMEGA,
        spatial_fields.OMEGA + 1,
        spatial_fields.SLOPE_RATE,
    ]
    signs = np.ones(spatial_fields.STATE_FIELDS)
    signs[odd] = -1.0
    assert np.array_equal(e * signs, m)
    assert np.array_equal(
        pulleys[spatial_fields.DRIVING_MIDDLE :], -mirrored[spatial_fields.DRIVING_MIDDLE :]
    )


def test_elements_on_a_tilted_pulley_stand_across_its_axis():
    belt, e, _, region = started(axis_tilt=2e-3, axis_skew=-1e-3)
    axis = belt.axes[1]
    assert axis[:2] / axis[2] == pytest.approx(
        [np.tan(2e-3), np.tan(-1e-3)]
    ) and axis @ axis == pytest.approx(1.0)
    arc = region == 2
    pitch = vectors(e, spatial_fields.POSITION) - belt.pitch_depth * vectors(e, spatial_fields.OUTWARD)
    assert (pitch[arc] - [0.155, 0.0, 0.0]) @ axis == pytest.approx(0.0, abs=1e-15)
    axial = np.cross(vectors(e, spatial_fields.OUTWARD), vectors(e, spatial_fields.HEADING))
    # the heading is that of the polygon, which differs from the tangent of the arc's ends
    assert (axial @ axis)[inside(region, 2)] == pytest.approx(1.0, abs=1e-9)
    assert np.array_equal(e[region == 0, spatial_fields.POSITION + 2], np.zeros((region == 0).sum()))


def test_a_disturbance_is_drawn_by_its_seed_and_as_large_as_stated():
    sizes = {}
    for seed in (1, 2):
        _, e, _, region = started(disturbance=1e-6, seed=seed)
        height = e[:, spatial_fields.POSITION + 2] + 0.0
        assert not height[(region == 0) | (region == 2)].any()
        assert (
            0.98e-6 < np.abs(height).max() < 1.02e-6
        )  # roll of the elements has a share in the saddles' place
        sizes[seed] = height
    _, again, _, _ = started(disturbance=1e-6)
    assert np.array_equal(again[:, spatial_fields.POSITION + 2], sizes[1]) and not np.allclose(
        sizes[1], sizes[2], atol=1e-8
    )
