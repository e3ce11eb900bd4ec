"""Sliding and forces along the belt: their derivation, and those of an instant beside means of the judged part."""

import numpy as np
import pytest

from cvt_hpc import simulate
from cvt_hpc.models.elastic_belt.along_belt import NEEDED, along_belt, elsewhere, sliding_angle, wrap_angles
from cvt_hpc.models.elastic_belt.belt import belt_constants, mesh
from cvt_hpc.physics.flank import flank_forces
from support.marched import CHEAP, job
from support.rungs import rung_job

LOADED = CHEAP | {"load": 120.0}
WEDGE = np.deg2rad(11.0)


@pytest.fixture(scope="module")
def history():
    """With profiles over the whole judged part."""
    return simulate(job(**LOADED, profile_duration=0.02), {"lanes": "runs"})


def test_the_normal_force_is_the_flanks_own():
    """f_P,n = f_ax / (cos d - mu sin d sin gamma), Bullinger et al. 2005, eq. 39, from radial and axial force."""
    grid = mesh(job(**LOADED).parameters)
    n = grid.cell.size
    axial, v_radial, v_tangential, mu = 3e5, -0.2, 0.1, 0.09
    radial, tangential = flank_forces(mu, 1e-6, np.sin(WEDGE), np.cos(WEDGE), axial, v_radial, v_tangential)
    sample = dict.fromkeys(NEEDED, np.zeros(n))
    touching = np.zeros(n)
    touching[: grid.counts[0]] = 1.0
    sample |= {
        "contact_force": axial * touching,
        "radial_friction": touching * (radial - 2.0 * np.tan(WEDGE) * axial),
        "tangential_friction": touching * tangential,
        "radial_speed": v_radial * np.ones(n),
        "sliding_speed": v_tangential * np.ones(n),
    }
    found = along_belt(sample, grid, {"half_wedge_angle": WEDGE})
    angle = found["sliding_angle"][0]
    assert angle == pytest.approx(np.arctan2(0.2 / np.cos(WEDGE), 0.1))
    expected = axial / (np.cos(WEDGE) - mu * np.sin(WEDGE) * np.sin(angle))
    inside = slice(0, grid.counts[0])
    assert found["normal_force"][inside] == pytest.approx(expected, rel=1e-9)
    assert found["friction_force"][inside] == pytest.approx(-2 * mu * expected * np.cos(angle), rel=1e-9)
    strand = slice(grid.starts[1] + 1, grid.starts[2])
    assert all(np.isnan(values[strand]).all() for values in found.values())


def test_stresses_go_in_straight_lines_between_the_middles_of_cells():
    grid = mesh(job(**LOADED).parameters)
    behind = np.roll(grid.cell, 1)
    assert np.ptp(grid.cell) > 0.1 * grid.cell.mean()  # cells are graded
    # from the middle of each cell a rise of 3 N/m, but for the cell where the path closes
    middles = np.cumsum(grid.cell) - 0.5 * grid.cell
    found = elsewhere(dict.fromkeys(NEEDED, 3.0 * middles), grid)
    stations = middles - 0.5 * grid.cell
    for name in ("ring_tension", "push_force"):
        assert found[name][1:] == pytest.approx(3.0 * stations[1:], rel=1e-12)
    closing = (3.0 * middles[0] * behind[0] + 3.0 * middles[-1] * grid.cell[0]) / (grid.cell[0] + behind[0])
    assert found["push_force"][0] == pytest.approx(closing, rel=1e-12)


def test_wrap_angles_run_on_where_a_groove_may_hold_the_belt():
    grid = mesh(job(**LOADED).parameters)
    found, known = wrap_angles(grid), np.zeros(grid.cell.size, bool)
    for region, radius in ((0, grid.path.driving_radius), (2, grid.path.driven_radius)):
        first, count = grid.starts[region], grid.counts[region]
        assert found[first : first + count + 1] == pytest.approx(grid.along(region) / radius, abs=1e-12)
        assert found[first - 1] < 0.0 and found[first + count + 1] > found[first + count]
        known[grid.zone(region).stations] = True
    assert np.array_equal(np.isfinite(found), known) and not known.all()


@pytest.mark.parametrize(
    ("radial", "tangential", "degrees"),
    [
        (-1, 0.0, 90),
        (0.0, 1, 0),
        (0.0, -1, 180),
        (-1, -1, 134.5),
        (1, 1e-9, -90),
        (1, -1, 225.5),
        (1, -1e-9, 270),
    ],
)
def test_the_sliding_angle_is_that_of_eq_36(radial, tangential, degrees, tell):
    found = np.degrees(sliding_angle(np.array(radial), np.array(tangential), WEDGE))
    tell("direction of sliding by eq. 36 [deg]", found, degrees)
    assert found == pytest.approx(degrees, abs=0.2)


def test_means_of_instants_are_the_profiles(history):
    assert history.sizes["profile_time"] == 400
    assert history["profile_time"].values[-1] == history["time"].values[-1]
    for name in (
        "normal_force",
        "friction_force",
        "ring_friction",
        "radial_sliding",
        "push_force",
        "mean_displacement",
    ):
        mean = history["momentary_" + name].astype(float).mean("profile_time").values
        scale = np.nanmax(np.abs(history[name].values))
        assert mean == pytest.approx(history[name].values, abs=1e-6 * scale, nan_ok=True), name


def test_forces_add_up_to_the_moments_of_the_drive(history, tell):
    belt = belt_constants(job(**LOADED).parameters)
    here = belt.driving_stations
    raised = belt.rise[here] + belt.upright[here] * history["momentary_mean_displacement"].values[:, here]
    friction = np.nan_to_num(history["momentary_friction_force"].values[:, here])
    moment = (friction * (belt.driving_radius + raised)) @ belt.dual[here]
    recorded = history["driving_moment"].values[-400:]
    tell("moment of the forces along the driving pulley [N m]", moment, recorded)
    assert moment == pytest.approx(recorded, rel=1e-4, abs=1e-3 * np.abs(recorded).max())
    speed = job(**LOADED).parameters["driving_speed"]
    assert recorded.mean() * speed == pytest.approx(history["driving_power"].item(), rel=1e-9)


def test_profiles_over_time_change_nothing_else(history):
    plain = simulate(job(**LOADED), {"lanes": "runs"})
    assert set(plain.variables) < set(history.variables)
    for name, variable in plain.variables.items():
        if variable.attrs.get("volatile") != "yes" and variable.dtype.kind == "f":
            assert history[name].values.tobytes() == variable.values.tobytes(), name


def test_a_steady_state_has_profiles_in_equilibrium():
    found = simulate(rung_job("steady_variator", load=100.0, stations=96))
    alone = (found["region"] == "driving arc").values & (found["push_force"].values < 1.0)
    flank, ring = (found[name].values[alone][4:-2] for name in ("friction_force", "ring_friction"))
    # where elements are apart nothing else holds them: what is left is the radial load on the spiral path
    assert flank == pytest.approx(ring * (1.0 + 1e-3 / (0.075 / 2.52)), rel=0.15)
