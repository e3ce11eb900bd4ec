"""Contact of belt and sheaves: what matrices jobs can make, and that all are solved."""

import numpy as np
import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.physics.compliance import ROUNDS_OF_BLOCK_FLIPS, plain_contact, solve_wrap
from cvt_hpc.physics.sheaves import flexibility, sheaves
from support.wraps import places

STATIONS, ARC, RADIUS = 60, 0.27, 0.075
DEPTH = 2e-5  # [m]


def wrap(tilt=4e5, elements=3e10):
    return sheaves(*places(STATIONS, ARC, RADIUS), RADIUS, 1.0, tilt, 4e9, 0.012, elements)


def overlaps():
    """Rigid bodies overlap by some 20 um, roughly."""
    return -DEPTH + 0.1 * DEPTH * np.random.default_rng(0).normal(size=STATIONS)


@pytest.mark.parametrize("tilt", [4e5, 4e4, 4e3, 4e2])
def test_soft_sheaves_are_not_beyond_the_solver(tilt):
    # iterations over single contacts contract by 0.94 a sweep at 4e5 N m/rad and by 0.99996 at 4e2
    sheave, gap, force = wrap(tilt), overlaps(), np.zeros(STATIONS)
    assert 0 < solve_wrap(plain_contact(sheave), gap, force) <= ROUNDS_OF_BLOCK_FLIPS
    opening = gap + flexibility(sheave) @ force
    assert force.min() >= 0.0 and (force == 0.0).any() and opening.min() > -1e-10 * DEPTH
    assert np.abs(opening[force > 0.0]).max() < 1e-10 * DEPTH


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
