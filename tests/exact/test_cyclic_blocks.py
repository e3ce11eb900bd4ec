"""The cyclic block solver against dense elimination."""

import numpy as np
import pytest

from cvt_hpc.solvers.cyclic_blocks import (
    LOWER,
    UPPER,
    block_size,
    empty_blocks,
    empty_columns,
    empty_corner,
    factor,
    solve,
    solve_bordered,
)

BORDER, SIDES = 2, 2


def random_chain(n, b, dominance=4.0):
    """Unsymmetric blocks A, L, U of each node, diagonally dominant but for the order of a block's rows."""
    draw = np.random.default_rng([n, b])
    chain = draw.normal(size=(n, 3, b, b))
    for i in range(n):  # the large entries lie anywhere but on the diagonal: rows must be exchanged
        chain[i, 0] += dominance * b * np.eye(b)[draw.permutation(b)]
    chain[0, 0, 0] = 0.0, *[dominance * b] * (b - 1)  # without an exchange node 0 has no first pivot
    return chain, draw


def dense(chain):
    n, _, b, _ = chain.shape
    matrix = np.zeros((n, b, n, b))
    for i in range(n):
        for block, j in zip(chain[i], (i, i - 1, (i + 1) % n), strict=True):
            matrix[i, :, j] += block
    return matrix.reshape(n * b, n * b)


def factored(chain):
    n, _, b, _ = chain.shape
    blocks = empty_blocks(n, b)
    blocks.data[:n, : 3 * b, :b] = chain.reshape(n, 3 * b, b)
    return blocks, factor(blocks, block_size(b))


@pytest.mark.parametrize(("n", "b"), [(2, 4), (3, 4), (40, 4)])
def test_as_dense_elimination_with_and_without_border(n, b, tell):
    chain, draw = random_chain(n, b)
    blocks, regular = factored(chain)
    assert regular
    right = draw.normal(size=(n, b, BORDER + SIDES))
    columns = empty_columns(n, b, BORDER + SIDES)
    columns.data[:n] = right
    solve(blocks, columns, block_size(b))
    expected = np.linalg.solve(dense(chain), right.reshape(n * b, -1))
    # condition numbers are some 10: a few hundred roundings, of numbers below 1
    np.testing.assert_allclose(columns.data[:n].reshape(n * b, -1), expected, rtol=0, atol=1e-13)

    rows, corner = draw.normal(size=(n, BORDER, b)), empty_corner(BORDER, BORDER + SIDES)
    corner.data[0] = draw.normal(size=corner.data[0].shape)
    whole = np.block(
        [
            [dense(chain), right[..., :BORDER].reshape(n * b, BORDER)],
            [rows.transpose(1, 0, 2).reshape(BORDER, n * b), corner.data[0, :, :BORDER]],
        ]
    )
    sides = np.vstack([right[..., BORDER:].reshape(n * b, SIDES), corner.data[0, :, BORDER:]])
    columns.data[:n] = right
    assert solve_bordered(blocks, columns, rows, corner, block_size(b))
    found = np.vstack([columns.data[:n, :, BORDER:].reshape(n * b, SIDES), corner.data[0, :, BORDER:]])
    scale = np.linalg.cond(whole) * abs(found).max()
    tell("solution of a cyclic system by dense elimination", found, np.linalg.solve(whole, sides))
    np.testing.assert_allclose(found, np.linalg.solve(whole, sides), rtol=0, atol=1e-14 * scale)


def free_ring(n, b):
    """Masses on a ring of springs, held nowhere: a translation is free, and only the last pivot shows it."""
    one = np.eye(b) + 0.1
    return np.tile(np.stack([2.0 * one, -one, -one]), (n, 1, 1, 1))


def broken(chain, place, value):
    chain[place] = value
    return chain


@pytest.mark.parametrize(
    "chain",
    [
        free_ring(60, 4),
        broken(random_chain(9, 4)[0], (4, slice(None), 2), 0.0),  # an equation without unknowns
        broken(random_chain(9, 4)[0], (0, 0, 1, 1), np.nan),
        broken(random_chain(9, 4)[0], (8, 2, 0, 0), np.inf),
    ],
    ids=["free ring", "empty row", "nan", "inf"],
)
def test_a_singular_matrix_is_a_failure(chain):
    assert not factored(chain)[1]


def test_a_border_that_says_nothing_is_a_failure():
    blocks, _ = factored(random_chain(17, 4)[0])
    columns = empty_columns(17, 4, BORDER + SIDES)
    columns.data[:17] = 1.0
    empty = np.zeros((17, BORDER, 4))
    assert not solve_bordered(blocks, columns, empty, empty_corner(BORDER, BORDER + SIDES), block_size(4))


def test_an_open_chain():
    chain, _ = random_chain(6, 4)
    chain[0, LOWER] = chain[-1, UPPER] = 0.0
    blocks, regular = factored(chain)
    assert regular
    columns = empty_columns(6, 4, 4)
    columns.data[:6] = np.eye(24)[:, :4].reshape(6, 4, 4)
    solve(blocks, columns, block_size(4))
    np.testing.assert_allclose(
        columns.data[:6].reshape(24, 4), np.linalg.inv(dense(chain))[:, :4], rtol=0, atol=1e-13
    )
