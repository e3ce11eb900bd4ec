"""Sweeps of projected Gauss-Seidel in lanes against the same sweeps on the dense matrix, and where they lead."""

import numpy as np
import pytest

from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import lane_contact, plain_contact, solve_wrap
from cvt_hpc.physics.lane_gauss_seidel import sweep_lane_contact
from cvt_hpc.physics.sheaves import flexibility
from support.wraps import STATIONS, courses, random_wrap

LANES = 8


def batch(seed, sweeps, stiffness=None):
    random = np.random.default_rng(seed)
    wraps = [random_wrap(random, stiffness) for _ in range(LANES)]
    return wraps, lane_contact(wraps, np.float64, sweeps), courses(random, LANES)


def swept(contact, gaps):
    contact.stations.data[:, compliance.GAP] = gaps
    sweep_lane_contact(contact)
    return contact.stations.data[:, compliance.PUSH].copy()


def swept_densely(matrix, gap, force, sweeps):
    for _ in range(sweeps):
        for j in range(gap.size):
            force[j] = max(force[j] - (gap[j] + matrix[j] @ force) / matrix[j, j], 0.0)


@pytest.mark.parametrize("sweeps", [1, 4])
def test_each_lane_is_swept_as_the_dense_matrix_is(sweeps):
    wraps, contact, course = batch(3, sweeps)
    dense = [flexibility(wrap) for wrap in wraps]
    forces = [np.zeros(STATIONS) for _ in wraps]
    for call, gaps in enumerate(course, 1):
        found = swept(contact, gaps)
        for lane, (matrix, force) in enumerate(zip(dense, forces, strict=True)):
            swept_densely(matrix, gaps[:, lane], force, sweeps)
            # round-off of forces of up to 1e7 N/m
            assert found[:, lane] == pytest.approx(force, abs=1e-5)
        assert np.all(contact.scalars.data[0, compliance.SOLVES] == call)
    assert 0 < np.count_nonzero(found) < found.size


def test_many_sweeps_lead_to_the_exact_contact():
    sweeps = 400
    wraps, contact, course = batch(5, sweeps, stiffness=3.0)
    found = swept(contact, course[0])
    for lane, wrap in enumerate(wraps):
        force = np.empty(STATIONS)
        assert solve_wrap(plain_contact(wrap), np.ascontiguousarray(course[0][:, lane]), force) > 0
        closed = force > 0.0
        matrix = flexibility(wrap)[np.ix_(closed, closed)]
        lower = np.tril(matrix)
        rate = np.abs(np.linalg.eigvals(np.linalg.solve(lower, lower - matrix))).max()
        # the first error is of the forces' size, and each sweep leaves `rate` of it
        assert rate**sweeps < 1e-3
        assert found[:, lane] == pytest.approx(force, abs=1e-4 + rate**sweeps * force.max())
