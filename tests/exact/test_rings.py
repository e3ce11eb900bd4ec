"""One ring in linked parts: neighbours, sums and the cyclic system are those of the ring in one piece."""

import numpy as np
import pytest

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import (
    LaneArray,
    ahead,
    around,
    at_station,
    behind,
    like,
    merge_parts,
    ring_solution,
    select,
    set_station,
    split,
)

PARTS, ROWS = 8, 3
N = PARTS * ROWS


def ring(fields):
    """Random numbers at the stations of a ring, in one piece and in parts."""
    whole = LaneArray(N, fields, 1)
    whole.data[:] = np.random.default_rng(0).normal(size=whole.data.shape)
    return whole, split(whole, PARTS)


def merged(linked):
    """Numbers of a ring by station, (N, fields)."""
    if not linked.linked:
        return linked.data[:, :, 0]
    whole = LaneArray(linked.data.shape[0] * linked.data.shape[2], linked.data.shape[1], 1)
    put_together(linked, whole)
    return whole.data[:, :, 0]


@kernel
def put_together(linked, whole):
    merge_parts(linked, whole, whole.data.shape[1])


@kernel
def look_around(array, plain, found, found_plain):
    for j in range(array.rows):
        found[j, 0], found[j, 1] = behind(array, j, 0), ahead(array, j, 0)
    for j in range(plain.size):
        found_plain[j, 0], found_plain[j, 1] = behind(plain, j, 0), ahead(plain, j, 0)


def test_neighbours_are_those_of_the_ring():
    plain = np.arange(5.0)
    for array in ring(1):
        found = LaneArray(array.data.shape[0], 2, array.data.shape[2], linked=array.linked)
        found_plain = np.empty((5, 2))
        look_around(array, plain, found, found_plain)
        for values, seen in ((merged(array)[:, 0], merged(found)), (plain, found_plain)):
            assert np.array_equal(seen[:, 0], np.roll(values, 1))
            assert np.array_equal(seen[:, 1], np.roll(values, -1))


@kernel
def add_up(array, found, threshold):
    total = like(0.0, array[0, 0])
    beyond = total > 0.0
    for j in range(array.rows):
        total += array[j, 0]
        beyond |= array[j, 0] > threshold
    found[0, 0] = around(total)
    found[0, 1] = select(around(beyond), like(1.0, total), 0.0)


def test_a_sum_goes_over_all_parts_and_stands_in_each():
    whole, linked = ring(1)
    for array in (whole, linked):
        for rank in (1, 0):
            found = LaneArray(1, 2, array.data.shape[2], linked=array.linked)
            add_up(array, found, np.sort(whole.data.ravel())[-1 - rank])
            np.testing.assert_allclose(found.data[0, 0], whole.data.sum(), rtol=1e-13)  # order of the sum
            assert np.ptp(found.data[0, 0]) == 0.0  # to the last bit, or parts would go on apart
            assert (found.data[0, 1] == rank).all()


@kernel
def copy_stations(array, taken, first):
    row, part = first % array.rows, first // array.rows
    for k in range(taken.rows):
        taken[k, 0] = at_station(array, row, part, 0)
        set_station(array, row, part, 1, taken[k, 0])
        row += 1
        if row == array.rows:
            row, part = 0, part + 1


def test_single_stations_are_read_and_written():
    for array in ring(2):
        before, taken = merged(array), LaneArray(7, 1, 1)
        copy_stations(array, taken, 10)
        assert np.array_equal(taken.data[:, 0, 0], before[10:17, 0])
        before[10:17, 1] = before[10:17, 0]
        assert np.array_equal(merged(array), before)


@kernel
def solve(system, solution):
    s = system
    solution[0, 0], solution[0, 1] = ring_solution(
        s[0, 0], s[0, 1], s[0, 2], s[0, 3], s[0, 4], s[0, 5], s[0, 6], s[0, 7], s[0, 8], 1e-30
    )


@pytest.mark.parametrize("parts", [1, 2, 8])
def test_the_cyclic_system_is_solved(parts):
    linked = parts > 1
    system = LaneArray(1, 9, parts, linked=linked)
    rng = np.random.default_rng(3)
    system.data[0] = rng.normal(size=(9, parts))
    system.data[0, [0, 2]] += 8.0  # diagonally dominant
    solution = LaneArray(1, 2, parts, linked=linked)
    solve(system, solution)
    p, q, r, f0, f1, l00, l01, l10, l11 = system.data[0]
    matrix = np.zeros((parts, 2, parts, 2))
    for k in range(parts):
        coupling = np.array([[l00[k], l01[k]], [l10[k], l11[k]]])
        matrix[k, :, k] += np.array([[p[k], q[k]], [q[k], r[k]]])
        matrix[k, :, k - 1] += coupling
        matrix[k - 1, :, k] += coupling.T
    exact = np.linalg.solve(matrix.reshape(2 * parts, -1), np.stack([f0, f1], axis=-1).ravel())
    np.testing.assert_allclose(solution.data[0].T.ravel(), exact, rtol=1e-12)  # well conditioned
