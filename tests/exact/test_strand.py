"""A moving strand with everything else switched off: strings and beams with known eigenvalues.

The belt's own acceleration kernel is linearised by probing it with unit columns of w and u.
"""

import numpy as np
import pytest
from scipy.linalg import eigh

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import State
from cvt_hpc.models.elastic_belt.one_system import flat_belt
from support.equations import evaluate
from support.straight import LENGTH, MASS, TENSION, WAVE, moving_straight, straight_belt


def linearise(belt, **forces):
    """Matrices of u' = K w + G u around the straight belt."""
    n = belt.cell.size
    fields, scalars = moving_straight(belt, **forces)
    flat, matrices = flat_belt(belt), np.empty((2, n, n))
    for matrix, row in zip(matrices, (f.W, f.U), strict=True):
        for j in range(n):
            probed = fields.copy()
            probed[row, j] = 1.0
            evaluate(flat, State(probed, scalars))
            matrix[:, j] = flat.rate[f.U]
    return matrices


def pinned(matrices):
    """The rows and columns inside the first half; w = 0 at both its ends."""
    inside = slice(1, matrices[0].shape[0] // 2)
    return [matrix[inside, inside] for matrix in matrices]


def eigenvalues(stiffness, gyroscopic):
    """Eigenvalues with positive imaginary part, by ascending frequency [1/s]."""
    n = len(stiffness)
    found = np.linalg.eigvals(np.block([[np.zeros((n, n)), np.eye(n)], [stiffness, gyroscopic]]))
    return np.sort_complex(-1j * found[found.imag > 0.0]) * 1j


def pinned_frequencies(cells, share, **forces):
    """Lowest two circular frequencies of the pinned string at v = share c, in units of c / L."""
    found = eigenvalues(*pinned(linearise(straight_belt(cells, share * WAVE), **forces)))
    assert np.abs(found.real).max() < 1e-9 * np.abs(found.imag).max()  # conservative: only round-off
    return found.imag[:2] * LENGTH / WAVE


@pytest.mark.parametrize(
    ("share", "printed"), [(0.0, np.pi), (0.3, 2.858849), (0.6, 2.010619), (0.9, 0.596903)]
)
def test_moving_string(share, printed):
    # Wickert and Mote 1990: w_n = n pi (1 - (v/c)^2) c / L; `printed` to six digits
    exact = np.array([1, 2]) * np.pi * (1.0 - share**2)
    assert exact[0] == pytest.approx(printed, abs=5e-7)
    errors = np.array([pinned_frequencies(cells, share) / exact - 1.0 for cells in (32, 64, 128)])
    # Second order in the mesh: errors fall by 4, at v = 0 within the next term, (pi n / cells)^2 / 20. Near
    # the critical speed the gyroscopic shapes are shorter, n / (1 - v/c) waves, and the coarsest mesh is not
    # yet asymptotic.
    ratios = errors[:-1] / errors[1:]
    assert ratios[-1] == pytest.approx([4.0, 4.0], rel=0.02 if share < 0.8 else 0.1)
    assert np.abs(errors[-1]).max() < (1e-3 if share < 0.8 else 0.02)


def test_string_loses_its_stiffness_at_the_critical_speed():
    # F - m v^2 is zero at v = c, only round-off of F / (m h^2) is left; beyond, every displacement is driven
    # outwards
    still, _ = linearise(straight_belt(32))
    critical, _ = linearise(straight_belt(32, WAVE))
    assert np.abs(critical).max() < 1e-12 * np.abs(still).max()
    beyond, _ = pinned(linearise(straight_belt(32, 1.01 * WAVE)))
    assert np.linalg.eigvalsh(beyond).min() > 0.0


@pytest.mark.parametrize("share", [0.3, 1.5])
def test_waves_run_with_the_belt_at_v_plus_c_and_against_it_at_v_minus_c(share):
    # exp(i k s + lambda t) on the periodic belt: lambda = -i k (v + c) and -i k (v - c)
    belt = straight_belt(64, share * WAVE)
    wave = np.pi / LENGTH
    shape = np.exp(1j * wave * belt.cell[0] * np.arange(128))
    stiffness, gyroscopic = ((matrix @ shape)[0] for matrix in linearise(belt))
    found = np.sort(np.roots([1.0, -gyroscopic, -stiffness]).imag)
    # central differences: (k h)^2 / 6 = 4e-4 of either speed
    assert found == pytest.approx(
        -wave * WAVE * np.array([share + 1.0, share - 1.0]), abs=1e-3 * wave * WAVE * (1.0 + share)
    )


def test_structure_of_the_matrices():
    # energy is kept: K symmetric, the gyroscopic G skew
    stiffness, gyroscopic = linearise(straight_belt(32, 0.5 * WAVE, bending=0.5))
    assert stiffness == pytest.approx(stiffness.T, abs=1e-12 * np.abs(stiffness).max())
    assert gyroscopic == pytest.approx(-gyroscopic.T, abs=1e-12 * np.abs(gyroscopic).max())
    # a belt displaced as a whole feels nothing
    assert stiffness.sum(axis=1) == pytest.approx(0.0, abs=1e-10 * np.abs(stiffness).max())


def odd(stiffness):
    """K on functions odd about both ends of the strand: hinged, w = w'' = 0 there."""
    n = stiffness.shape[0]
    inside = np.arange(1, n // 2)
    return stiffness[np.ix_(inside, inside)] - stiffness[np.ix_(inside, n - inside)]


def critical_speed(cells, share):
    """Least speed at which a hinged beam with EI = share T L^2 has a static solution, in units of c."""
    bending = share * TENSION * LENGTH**2
    still, moving = (odd(linearise(straight_belt(cells, v, bending))[0]) for v in (0.0, WAVE))
    # K(v) = K(0) + (v/c)^2 (K(c) - K(0)) is singular
    return np.sqrt(eigh(-still, moving - still, eigvals_only=True)[0])


def test_critical_speed_of_a_tensioned_beam():
    # v^2 = (T + EI pi^2 / L^2) / m; 1.048187 is printed. The mesh puts (4 / h^2) sin^2(pi h / 2 L) for (pi /
    # L)^2.
    exact = np.sqrt(1.0 + 0.01 * np.pi**2)
    assert exact == pytest.approx(1.048187, abs=5e-7)
    errors = np.array([critical_speed(cells, 0.01) - exact for cells in (16, 32, 64)])
    assert errors[:-1] / errors[1:] == pytest.approx([4.0, 4.0], rel=0.02)
    assert abs(errors[-1]) < 1e-4
    assert critical_speed(32, 0.0) == pytest.approx(1.0, rel=1e-9)  # round-off


@pytest.mark.parametrize("share", [0.001, 0.1])
def test_frequencies_of_a_hinged_beam_under_tension(share):
    # w_n^2 = (n pi / L)^2 (T + EI (n pi / L)^2) / m
    belt = straight_belt(96, bending=share * TENSION * LENGTH**2)
    found = np.sqrt(np.sort(-np.linalg.eigvals(odd(linearise(belt)[0])))[:3])
    wave = np.arange(1, 4) * np.pi / LENGTH
    exact = wave * np.sqrt(TENSION / MASS * (1.0 + share * (wave * LENGTH) ** 2))
    # mesh: (3 pi / 96)^2 / 12 of the beam's part, twice that of the string's
    assert found == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize(
    ("tension", "push", "net"),
    [(5000.0, 0.0, 5000.0), (8000.0, 3000.0, 5000.0), (20000.0, 0.0, 20000.0), (5000.0, 3750.0, 1250.0)],
)
def test_frequencies_go_with_the_root_of_tension_less_push(tension, push, net):
    found = pinned_frequencies(32, 0.0, tension=tension, push=push)
    # the same matrix times net / TENSION; T and P come back from strains of 1e-4 .. 1e-3: eps / 1e-4
    assert found == pytest.approx(pinned_frequencies(32, 0.0) * np.sqrt(net / TENSION), rel=1e-11)


def test_separated_elements_do_not_pull(tell):
    apart, alone = pinned_frequencies(32, 0.0, push=-3000.0), pinned_frequencies(32, 0.0)
    tell("frequency of a strand of separate elements by that of its rings [rad/s]", apart, alone)
    assert apart == pytest.approx(alone, rel=1e-11)


def test_damping_of_the_moving_strand():
    # d_b (w_t + v w_s) on a string at rest: every mode decays at d_b / 2 m
    found = eigenvalues(*pinned(linearise(straight_belt(32, damping=200.0))))
    assert found.real == pytest.approx(-200.0 / (2.0 * MASS), rel=1e-9)
    # and where it moves: the damper's own part of K is -d_b v d/ds, central
    belt = straight_belt(32, 0.5 * WAVE, damping=200.0)
    share = linearise(belt)[0] - linearise(straight_belt(32, 0.5 * WAVE))[0]
    row = 200.0 * 0.5 * WAVE / (2.0 * belt.cell[0] * MASS)
    expected = row * (np.eye(64, k=-1) - np.eye(64, k=1))
    expected[0, -1], expected[-1, 0] = row, -row
    assert share == pytest.approx(expected, abs=1e-9 * row)
