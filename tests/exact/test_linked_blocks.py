"""The cyclic block solver in linked lanes against dense elimination."""

import numpy as np
import pytest

from cvt_hpc.solvers.cyclic_blocks import block_size
from cvt_hpc.solvers.linked_blocks import empty_scratch, empty_system, field_of_right, solve


def random_ring(n, b):
    """Blocks A, which are not symmetric, and U; the rows are diagonally dominant."""
    draw = np.random.default_rng([n, b])
    a, u = draw.normal(size=(2, n, b, b))
    return a + 3.0 * b * np.eye(b), u, draw


def by_columns(blocks):
    return blocks.transpose(0, 2, 1).reshape(len(blocks), -1)


def solved(a, u, right, parts):
    """Solutions, and whether the solver found the matrix regular."""
    n, b, columns = right.shape
    system = empty_system(n, parts, b, columns)
    values = np.full((n, system.data.shape[1]), np.nan)  # what is not given is not read
    values[:, : b * b], values[:, b * b : 2 * b * b] = by_columns(a), by_columns(u)
    values[:, field_of_right(b) :] = by_columns(right)
    system.data[:] = values.reshape(parts, n // parts, -1).transpose(1, 2, 0)
    is_regular = solve(system, empty_scratch(parts, b, columns), block_size(b))
    found = system.data.transpose(2, 0, 1).reshape(n, -1)[:, field_of_right(b) :]
    return found.reshape(n, columns, b).transpose(0, 2, 1), is_regular


def dense(a, u):
    n, b, _ = a.shape
    matrix = np.zeros((n, b, n, b))
    for i in range(n):
        matrix[i, :, i] += a[i]
        matrix[i, :, (i + 1) % n] += u[i]
        matrix[(i + 1) % n, :, i] += u[i].T
    return matrix.reshape(n * b, n * b)


@pytest.mark.parametrize(
    ("rows", "parts", "b", "columns"),
    [
        (5, 8, 8, 8),
        (5, 8, 4, 3),
        (1, 8, 4, 4),
        (1, 1, 4, 4),
        (7, 1, 4, 4),
    ],
)
def test_as_dense_elimination(rows, parts, b, columns):
    n = rows * parts
    a, u, draw = random_ring(n, b)
    right = draw.normal(size=(n, b, columns))
    found, is_regular = solved(a, u, right, parts)
    assert is_regular
    expected = np.linalg.solve(dense(a, u), right.reshape(n * b, columns)).reshape(right.shape)
    # condition numbers are below 10: some hundred roundings of numbers below 1
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)


def test_all_nodes_of_a_long_ring_count():
    a, u, draw = random_ring(432, 8)
    right = draw.normal(size=(432, 8, 8))
    found, _ = solved(a, u, right, 8)
    left = a @ found + u @ np.roll(found, -1, 0) + np.roll(u, 1, 0).transpose(0, 2, 1) @ np.roll(found, 1, 0)
    np.testing.assert_allclose(left, right, rtol=0, atol=1e-13)


def free_ring(n, b):
    """Masses on a ring of springs, held nowhere: a translation is free, and only the last pivot shows it."""
    one = np.eye(b) + 0.1
    return np.tile(2.0 * one, (n, 1, 1)), np.tile(-one, (n, 1, 1))


def broken(ring, of_u, place, value):
    ring[of_u][place] = value
    return ring[:2]


@pytest.mark.parametrize(
    "ring",
    [
        free_ring(40, 4),
        broken(random_ring(40, 4), 0, (5, slice(None), 2), 0.0),  # the first node of a part: nothing fills it
        broken(random_ring(40, 4), 0, (3, 1, 1), np.nan),
        broken(random_ring(40, 4), 0, (4, 0, 0), np.inf),  # a separator's
        broken(random_ring(40, 4), 1, (7, 2, 2), np.nan),
    ],
    ids=["free ring", "empty column", "nan", "inf", "nan of U"],
)
def test_a_singular_matrix_is_a_failure(ring):
    a, u = ring
    assert not solved(a, u, np.ones((40, 4, 4)), 8)[1]
