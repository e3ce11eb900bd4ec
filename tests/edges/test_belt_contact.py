"""Contact of belt and sheaves: what matrices jobs can make, how sweeps stall on them, and what others do."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import ROUNDS_OF_BLOCK_FLIPS, lane_contact, plain_contact, solve_wrap
from cvt_hpc.physics.lane_gauss_seidel import sweep_lane_contact
from cvt_hpc.physics.sheaves import flexibility, sheaves

STATIONS, ARC, RADIUS = 60, 0.27, 0.075
DEPTH = 2e-5  # [m]
LANES = 8  # all alike: kernels are compiled for full registers


def wrap(tilt=4e5, elements=3e10):
    return sheaves(ARC / (STATIONS - 1), STATIONS, RADIUS, 1.0, tilt, 4e9, 0.012, elements)


def overlaps():
    """Rigid bodies overlap by some 20 um, roughly."""
    return -DEPTH + 0.1 * DEPTH * np.random.default_rng(0).normal(size=STATIONS)


def swept(sheave, gap, tolerance, most):
    """Forces by sweeps, and after how many of them they change by the tolerance; 0 where they do not."""
    contact = lane_contact([sheave] * LANES, np.float64, sweeps=1)
    contact.stations.data[:, compliance.GAP] = gap[:, np.newaxis]
    force = contact.stations.data[:, compliance.PUSH, 0]
    for sweep in range(1, most + 1):
        before = force.copy()
        sweep_lane_contact(contact)
        if np.abs(force - before).max() <= tolerance * force.max():
            return force, sweep
    return force, 0


def contraction(matrix):
    """Spectral radius of a sweep while the set of closed contacts stays."""
    lower = np.tril(matrix)
    return np.abs(np.linalg.eigvals(np.linalg.solve(lower, lower - matrix))).max()


@pytest.mark.parametrize("tilt", [4e5, 4e4, 4e3])
def test_sweeps_stall_on_soft_sheaves_as_predicted_and_the_solver_does_not(tilt):
    sheave, gap, exact = wrap(tilt), overlaps(), np.zeros(STATIONS)
    solves = solve_wrap(plain_contact(sheave), gap, exact)
    assert 0 < solves <= ROUNDS_OF_BLOCK_FLIPS
    closed, dense = exact > 0.0, flexibility(sheave)
    rate = contraction(dense[np.ix_(closed, closed)])
    force, sweeps = swept(sheave, gap, 1e-6, 20_000)
    # the first error is of the force's size, its change in a sweep 1 - rate of that: 1e-6 = (1 - rate) rate^k
    assert sweeps == pytest.approx(np.log(1e-6 / (1.0 - rate)) / np.log(rate), rel=0.4)
    # a small change says little where the contraction is weak
    assert np.abs(force - exact).max() <= 1e-6 / (1.0 - rate) * exact.max()
    assert sweeps > 10 * solves


def test_very_soft_sheaves_are_beyond_sweeps():
    # contraction 0.99996: after 3000 sweeps they have not settled, and are wrong by a tenth; they must say so
    sheave, gap, exact = wrap(4e2), overlaps(), np.zeros(STATIONS)
    assert solve_wrap(plain_contact(sheave), gap, exact) > 0
    force, sweeps = swept(sheave, gap, 1e-7, 3000)
    assert sweeps == 0
    assert np.abs(force - exact).max() > 0.05 * exact.max()


@pytest.mark.parametrize("elements", 10.0 ** np.arange(9, 20, 2))
def test_stiff_elements_are_not_beyond_the_solver(elements):
    # forces grow with c_e: round-off of gaps of 20 um, 1e-21 m, times c_e passes the solver's threshold of
    # 1e-6 N/m at 1e15 N/m^2 without harm
    sheave, force = wrap(elements=elements), np.zeros(STATIONS)
    gap = overlaps() + DEPTH * np.cos(np.linspace(0.0, 9.0, STATIONS))
    assert solve_wrap(plain_contact(sheave), gap, force) > 0
    opening = gap + flexibility(sheave) @ force
    assert opening.min() > -1e-10 * DEPTH * (1.0 + elements / 1e12)


def test_every_matrix_of_a_job_has_one_solution():
    # symmetric positive definite, by the elements' own stiffness at least, whatever the sheaves
    for tilt in (4e2, 4e5, np.inf):
        for elements in (3e8, 3e10, 3e14):
            sheave = wrap(tilt, elements)
            symmetric = flexibility(sheave) / sheave.weight
            least = np.linalg.eigvalsh(0.5 * (symmetric + symmetric.T)).min()
            assert least > 0.9 / (elements * sheave.weight.max())


@pytest.mark.parametrize("key", ["tilt_stiffness", "local_stiffness", "flank_stiffness", "sheave_stiffness"])
def test_sheaves_that_push_back_the_wrong_way_are_refused(key):
    with pytest.raises(InputError, match=key):
        build_job({"name": "test", "model": "elastic_belt", "stepper": "imex"}, "test.toml", {key: -1e5})
