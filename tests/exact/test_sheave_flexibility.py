"""jobs/sheave_flexibility.py: discs by finite elements against exact plates, rigid motion and their own modes."""

import runpy
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.physics.deflection import table_problem
from support.plates import deflection, frequency, rigidity

SCRIPT = Path(__file__).parents[2] / "jobs" / "sheave_flexibility.py"
MADE = runpy.run_path(str(SCRIPT))
INNER, OUTER, RADIUS = 0.02, 0.08, 0.05
FLAT = MADE["Disc"](INNER, OUTER, 1e-3, 1e-3, 0.0, 1e-3, 2.1e11, 0.3, 7850.0, 1.25e-3)


@pytest.fixture(scope="module")
def thin():
    return MADE["Sectors"](FLAT, (RADIUS,))


@pytest.fixture(scope="module")
def conical():
    return MADE["Sectors"](MADE["Disc"](cell=4e-3), (0.03, 0.075))


def test_exact_plates_have_the_published_eigenvalues():
    # clamped inside, free outside, ratio of radii 0.5: Leissa, Vibration of Plates (1969), table 2.30, to its digits
    found = [2.0 * np.pi * frequency(n, 0.5, 1.0, 1.0, 1.0) for n in range(4)]
    assert found == pytest.approx([13.0, 13.3, 14.7, 18.5], abs=0.07)


@pytest.mark.parametrize("n", [0, 1, 2, 4])
def test_a_thin_disc_is_kirchhoffs_plate(thin, n):
    # shear and the mesh each leave 1e-3 and 2e-3 at this thickness, of either sign
    stiffness = rigidity(FLAT.modulus, FLAT.inner_thickness)
    expected = deflection(n, INNER, OUTER, RADIUS, stiffness)
    assert thin.static(n, RADIUS) == pytest.approx(expected, rel=3e-3)
    found, shares = thin.modes(n, RADIUS, 3)
    mass = FLAT.density * FLAT.inner_thickness
    assert found[0] == pytest.approx(frequency(n, INNER, OUTER, stiffness, mass), rel=3e-3)
    assert (shares >= 0.0).all() and 0.9 * expected < shares.sum() < expected


def test_shear_softens_a_thick_disc_by_the_square_of_its_thickness():
    softer = []
    for thickness in (4e-3, 2e-3):
        disc = replace(FLAT, inner_thickness=thickness, outer_thickness=thickness, cell=2.5e-3)
        stiffness = rigidity(disc.modulus, thickness)
        found = MADE["Sectors"](disc, (RADIUS,)).static(4, RADIUS)
        softer.append(found / deflection(4, INNER, OUTER, RADIUS, stiffness) - 1.0)
    # 4 but for the mesh, which makes the thin one too stiff
    assert softer[0] > 0.03 and 3.5 < softer[0] / softer[1] < 5.0


def test_motion_as_a_rigid_body_strains_nothing(conical):
    basis = conical.basis
    r, z = basis.doflocs
    radially, around, axially = (
        np.concatenate(
            [kind[k::3].ravel() for kind in (basis.nodal_dofs, basis.facet_dofs, basis.interior_dofs)]
        )
        for k in range(3)
    )
    assert np.array_equal(np.sort(around), np.sort(conical.around))
    along, across, tilted = np.zeros((3, basis.N))
    along[axially] = 1.0
    across[radially], across[around] = 1.0, -1.0
    tilted[radially], tilted[around], tilted[axially] = -z[radially], z[around], r[axially]
    load = conical.load(0.075)
    assert load @ along == pytest.approx(1.0, rel=1e-12)  # the axial opening
    assert load @ np.where(np.isin(np.arange(basis.N), radially), 1.0, 0.0) == pytest.approx(
        -np.tan(np.deg2rad(11.0))
    )
    for n, moved in ((0, along), (1, across), (1, tilted)):
        stiffness, mass = conical.matrices(n)
        stored = np.abs(stiffness @ moved)
        assert stored.max() < 1e-9 * np.abs(stiffness).max() * np.abs(moved).max()
        if moved is not tilted:
            assert moved @ mass @ moved == pytest.approx(mass_of(conical.disc), rel=1e-9)


def mass_of(disc):
    r = np.polynomial.Polynomial([0.0, 1.0])
    slope = (disc.outer_thickness - disc.inner_thickness) / (disc.outer_radius - disc.inner_radius)
    whole = (2.0 * r * (disc.inner_thickness + slope * (r - disc.inner_radius))).integ()
    return np.pi * disc.density * (whole(disc.outer_radius) - whole(disc.inner_radius))


def test_flexibilities_are_those_of_the_modes_and_converge_with_the_mesh(conical, tell):
    finer = MADE["Sectors"](MADE["Disc"](cell=2.5e-3), (0.03, 0.075))
    whole = conical.static(1, 0.075)
    frequencies, shares = conical.modes(1, 0.075, 8)
    tell("flexibility of a disc, by a finer mesh [m/N]", finer.static(1, 0.075), whole)
    tell("share of eight modes in the flexibility of a disc", shares.sum() / whole)
    assert (np.diff(frequencies) > 0.0).all()
    assert 0.98 * whole < shares.sum() < whole
    assert finer.static(1, 0.075) == pytest.approx(whole, rel=2e-3)
    assert finer.modes(1, 0.075, 1)[0] == pytest.approx(frequencies[:1], rel=1e-3)


def test_a_table_is_a_discs():
    # a force around the whole circle works on the harmonic 0 alone; hats make each harmonic weaker
    amplitudes = np.array([3.0, 2.0, 1.0, 0.5])
    angles = np.linspace(0.0, 2.0 * np.pi, 33)
    found = MADE["table"](amplitudes, angles)
    assert found[:-1].mean() == pytest.approx(3.0, rel=1e-12)
    assert found[0] < amplitudes.sum() and found[16] < 3.0
    assert found == pytest.approx(found[::-1], rel=1e-12)
    kept = np.array([a / np.sinc(0.5 * n * angles[1] / np.pi) ** 4 for n, a in enumerate(amplitudes)])
    assert MADE["table"](kept, angles)[0] == pytest.approx(amplitudes.sum(), rel=1e-12)


def test_both_pulleys_have_tables_that_a_job_takes(tmp_path):
    disc, scene = MADE["Disc"](cell=8e-3), MADE["Scene"](least_wave=0.04, stations=24)
    for dataset in MADE["both"](disc, scene).values():
        angles, row = dataset["angle"].values, dataset["flexibility"].values
        assert table_problem(tuple(angles), [row], angles[-1]) is None
        assert row.min() < -1e-3 * row[0]
        parts = dataset["modal_flexibility"].groupby(dataset["harmonic"]).sum().values
        assert MADE["table"](parts, angles) == pytest.approx(row, rel=1e-12)
        assert (dataset["modal_flexibility"] > 0.0).all() and (dataset["modal_mass"] >= 0.0).all()
        assert "assumptions" in dataset.attrs["comment"]


@pytest.mark.parametrize(
    ("arguments", "told"),
    [
        (["--outer-radius", "70 mm"], "flank: expected within 0.022 to 0.07 m, found 0.071 to 0.079 m"),
        (["--modulus", "-1 GPa"], "modulus: expected a finite number above 0, found -1e+09"),
        (["--poisson-ratio", "0.5"], "poisson_ratio: expected a number below 0.5, found 0.5"),
        (["--cell", "1 kg"], "--cell: expected a number in m, found 1 kg"),
    ],
)
def test_sizes_that_cannot_be_get_one_line(arguments, told, tmp_path):
    with pytest.raises(InputError) as error:
        MADE["write"]([str(tmp_path / "discs"), *arguments])
    assert str(error.value) == told
    assert not (tmp_path / "discs").exists()
