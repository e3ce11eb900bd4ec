"""Deformation of the discs as a choice: what describes the same disc gives the same run."""

import runpy
from pathlib import Path

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import load_job
from cvt_hpc.models.elastic_belt.belt import belt_constants
from cvt_hpc.physics.ritz import modal_flexibilities
from cvt_hpc.simulation import run_points
from support.marched import fresh_record, job, never

SCENE = {"stations": 32, "duration": 0.04, "rise_time": 0.01, "load": 60.0, "friction_gradient": -0.4}
JUDGED = ("axial_force", "mean_push_force", "mean_ring_tension", "flank_loss")
RECORD = SCENE | {"precision": "double"}


def local_bending(collar=False):
    """Tables of the default's local kernel at the stations; with the tilt of its collar, too, where asked for."""
    p = job(**SCENE).parameters
    belt, found = belt_constants(p | {"duration": 1.0}), {"sheave_deformation": "flexibilities"}
    for pulley in ("driving", "driven"):
        wrap, radius, length = getattr(belt, pulley), getattr(belt, f"{pulley}_radius"), p["local_length"]
        apart = np.abs(wrap.angle[:, None] - wrap.angle)
        table = np.exp(-apart * radius / length) / (2.0 * length * p["local_stiffness"])
        if collar:
            table += radius**2 / p["tilt_stiffness"] * wrap.tilt.T @ wrap.tilt
        found |= {f"{pulley}_flexibility_angle": wrap.angle.tolist(), f"{pulley}_flexibility": table.tolist()}
    return found


FLEXIBILITIES = (2.0e-9, 4.6e-9, 3.8e-9, 1.8e-9, 0.8e-9, *(5e-9 / n**1.5 for n in range(5, 21)))
MODES = {
    f"{pulley}_mode_{key}": list(values)
    for pulley in ("driving", "driven")
    for key, values in (
        ("harmonic", map(float, range(21))),
        ("flexibility", FLEXIBILITIES),
        ("mass", (0.5, 0.2, 0.2, 0.2, 0.2, *(16 * [0.0]))),
    )
} | {"sheave_deformation": "ritz"}


def modes_as_tables():
    """Tables of these modes at the stations."""
    belt = belt_constants(job(**SCENE).parameters | {"duration": 1.0})
    found = {"sheave_deformation": "flexibilities"}
    for pulley in ("driving", "driven"):
        wrap, radius = getattr(belt, pulley), getattr(belt, f"{pulley}_radius")
        place = wrap.angle, wrap.weight / radius
        matrix = modal_flexibilities(np.arange(21.0), np.array(FLEXIBILITIES), *place)
        found[f"{pulley}_flexibility_angle"] = wrap.angle.tolist()
        found[f"{pulley}_flexibility"] = matrix.tolist()
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
        (MODES | {"ritz_limit": 0.0}, modes_as_tables()),
        (MODES | {"ritz_limit": 0.0, "sheave_stiffness": 1.5}, modes_as_tables() | {"sheave_stiffness": 1.5}),
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


def test_discs_with_inertia_settle_where_those_without_are():
    settled = RECORD | MODES | {"duration": 0.12, "stations": 48}
    expected, found = fresh_record(**settled, ritz_limit=0.0), fresh_record(**settled)
    for name in JUDGED:
        # frequencies of 5 kHz and more, a belt that rests; forces with or without inertia scatter by 1e-3 from step
        # to step (2 to 4.6 us), as long as the start is not quite over
        # of the push in t2 mN are left
        assert found[name] == pytest.approx(expected[name], rel=3e-3, abs=0.1), name
    assert not np.array_equal(found["axial_force"], expected["axial_force"])
    assert found["power_residual"] < 2e-3


def test_discs_with_inertia_do_not_feel_the_runs_beside_them():
    asked = job(**RECORD, **MODES)
    points = [asked.point(0) | {"sheave_stiffness": factor} for factor in (1.0, 1.5, np.inf)]
    together = run_points(asked, points, never)
    for point, expected in zip(points, together, strict=True):
        (found,) = run_points(asked, [point], never)
        for name in JUDGED:
            assert np.array_equal(found[name], expected[name]), name


def test_modes_of_a_disc_need_the_step_that_knows_them():
    with pytest.raises(
        InputError, match="sheave_deformation: expected bending, cone or flexibilities but by"
    ):
        job("explicit", **SCENE, **MODES)


def test_the_job_of_finite_elements_takes_its_discs_by_each_description():
    jobs = Path(__file__).parents[2] / "jobs"
    parts = runpy.run_path(str(jobs / "sheave_deformation.py"))["PARTS"]
    path = jobs / "sheave_deformation.toml"
    found = {name: load_job(path, part).parameters for name, part in parts.items()}
    # w_ij and the modes are of one disc: the table is that of the modes at its knots
    for pulley in ("driving", "driven"):
        p = found["ritz"]
        angles = found["w_ij"][f"{pulley}_flexibility_angle"]
        matrix = modal_flexibilities(
            np.array(p[f"{pulley}_mode_harmonic"]),
            np.array(p[f"{pulley}_mode_flexibility"]),
            np.array(angles),
            np.full(len(angles), angles[1]),
        )
        (row,) = found["w_ij"][f"{pulley}_flexibility"]
        assert matrix[0] == pytest.approx(row, rel=1e-9, abs=1e-9 * row[0])
        assert min(row) < 0.0  # pressed here, a disc comes nearer over there


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ({"sheave_deformation": "flexibilities"}, "driving_flexibility: expected 1 or n rows of n flexibilities"),
        (local_bending() | {"driven_flexibility": [[1e-8, 2e-8], [2e-8, 1e-8]]}, "driven_flexibility: expected 1 or n"),
        ({"sheave_deformation": "cone", "cone_shift": 0.03}, "cone_shift: expected less than the radii, 0.0297"),
        ({"sheave_deformation": "ritz"}, "driving_mode_harmonic: expected modes, with one harmonic, flexibility and mass"),
        (MODES | {"driven_mode_mass": [0.1]}, "driven_mode_harmonic: expected modes, .*found 21 and 21 and 1"),
        (MODES | {"driving_mode_harmonic": [0.5, *range(1, 21)]}, "driving_mode_harmonic: expected whole numbers of 0 or more, found 0.5"),
        (MODES | {"ritz_limit": 1e5, "step": 4e-6}, "ritz_limit: expected at most 3.979e.04 Hz at this step"),
    ],
)  # fmt: skip
def test_what_does_not_fit_gets_one_line(values, told):
    with pytest.raises(InputError, match=told):
        job(**SCENE, **values)


def test_tables_come_from_files(tmp_path):
    lists = local_bending()
    for pulley in ("driving", "driven"):
        # of discs of revolution one row
        angles = lists[f"{pulley}_flexibility_angle"] = np.linspace(0.0, 4.0, 12).tolist()
        row = (1e-8 * np.exp(-np.array(angles))).tolist()
        lists[f"{pulley}_flexibility"] = [row]
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
