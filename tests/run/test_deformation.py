"""Deformation of the discs as a choice: what describes the same disc gives the same run."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import load_job
from cvt_hpc.models.elastic_belt.belt import mesh
from support.marched import fresh_record, job

SCENE = {"stations": 32, "duration": 0.04, "rise_time": 0.01, "load": 60.0, "friction_gradient": -0.4}
JUDGED = ("axial_force", "mean_push_force", "mean_ring_tension", "flank_loss")
RECORD = SCENE | {"precision": "double"}


def local_bending(collar=False):
    """Tables of the default's local kernel at the stations; with the tilt of its collar, too, where asked for."""
    p = job(**SCENE).parameters
    grid, found = mesh(p), {"sheave_deformation": "flexibilities"}
    for pulley, region, radius in (
        ("driving", 0, grid.path.driving_radius),
        ("driven", 2, grid.path.driven_radius),
    ):
        angles = np.arange(grid.counts[region] + 1) * grid.cell[grid.starts[region]] / radius
        length = p["local_length"]
        row = np.exp(-angles * radius / length) / (2.0 * length * p["local_stiffness"])
        if collar:
            row += radius**2 / p["tilt_stiffness"] * np.cos(angles)
        found |= {
            f"{pulley}_flexibility_angle": angles.tolist(),
            f"{pulley}_flexibility": [row.tolist()],
        }
    return found


@pytest.mark.parametrize(
    ("one", "other"),
    [
        ({}, local_bending()),
        ({}, local_bending(collar=True) | {"tilt_factor": np.inf}),
        ({"sheave_stiffness": 1.5}, local_bending() | {"sheave_stiffness": 1.5}),
        ({"sheave_stiffness": np.inf}, {"sheave_deformation": "cone", "cone_stiffness": np.inf}),
        (
            {"sheave_stiffness": np.inf, "tilt_stiffness": 1.5e5},
            {"sheave_deformation": "cone", "cone_stiffness": 3e5},
        ),
    ],
)
def test_two_descriptions_of_a_disc_give_one_run(one, other):
    expected, found = fresh_record(**RECORD, **one), fresh_record(**RECORD, **other)
    for name in JUDGED:
        size = np.abs(expected[name]).max()
        assert found[name] == pytest.approx(expected[name], abs=1e-6 * size), name
    # strands that move by a micrometre make more of round-off
    assert found["amplitude"] == pytest.approx(expected["amplitude"], abs=1e-10)


def test_a_cone_is_another_disc_than_local_bending():
    bending = fresh_record(**RECORD)["axial_force"]
    cone = fresh_record(**RECORD, sheave_deformation="cone")["axial_force"]
    assert np.abs(cone / bending - 1.0).max() > 1e-3


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"sheave_deformation": "flexibilities"}, "driving_flexibility: expected 1 or n rows of n flexibilities"),
        (local_bending() | {"driven_flexibility": [[1e-8, 2e-8], [2e-8, 1e-8]]}, "driven_flexibility: expected 1 or n"),
        ({"sheave_deformation": "cone", "cone_shift": 0.03}, "cone_shift: expected less than the radii, 0.0297"),
        ({"sheave_deformation": "cone", "contact_sweeps": 5}, "contact_sweeps: expected 0 with sheave_deformation cone"),
    ],
)  # fmt: skip
def test_what_does_not_fit_gets_one_line(values, told):
    with pytest.raises(InputError, match=told):
        job(**SCENE, **values)


def test_tables_come_from_files(tmp_path):
    lists = local_bending()
    for pulley in ("driving", "driven"):
        angles, (row,) = lists[f"{pulley}_flexibility_angle"], lists[f"{pulley}_flexibility"]
        lines = [f"{angle!r}, {1e6 * value!r}" for angle, value in zip(angles, row, strict=True)]
        (tmp_path / f"{pulley}.csv").write_text("\n".join(["angle [rad], flexibility [um/N]", *lines]))
    text = 'name = "x"\nmodel = "elastic_belt"\n[deflection]\nsheave_deformation = "flexibilities"\n'
    text += "".join(f'{p}_flexibility_file = "{p}.csv"\n' for p in ("driving", "driven"))
    (tmp_path / "x.toml").write_text(text + "[mesh]\nstations = 32\n")
    found = load_job(tmp_path / "x.toml").parameters
    for pulley in ("driving", "driven"):
        assert found[f"{pulley}_flexibility_angle"] == pytest.approx(lists[f"{pulley}_flexibility_angle"])
        assert found[f"{pulley}_flexibility"][0] == pytest.approx(lists[f"{pulley}_flexibility"][0])
    (tmp_path / "driving.csv").write_text("angle [rad], flexibility [N/m]\n0, 1\n1, 2\n")
    with pytest.raises(InputError, match=r"flexibility.*m/N"):
        load_job(tmp_path / "x.toml")
