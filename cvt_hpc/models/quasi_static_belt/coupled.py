"""The linear system of a step: coordinates across the belt, coupled by friction with speeds along it.

    E x + R^T c v_0 = f,    c R x + A v = y

x are the increments of the R coordinates' rates, v = (v_0, v_1) those of both layers' speeds at the N
stations, c the cross slope of friction, R the shapes; hoop stresses couple both likewise. A is cyclic
block-tridiagonal, symmetric positive definite: the layers are chains of masses. It is eliminated for all
columns of c R at once, and the remaining system is dense and small.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel


class Chain(NamedTuple):
    """Work space of the layers' elimination, C = R + 3 columns.

    Attributes
    ----------
    diagonal : (N, 3) array
        Blocks at the stations (00, 01, 11) without the links [N s/m].
    links : (2, N) array
        Slopes of the stresses in the cells with the speeds' differences, by layer [N s/m].
    inverse : (N, 3) array
        Of the eliminated blocks.
    columns : (2 N, C) array
        The right side, c R, and the two that close the ring; then the solution.
    """

    diagonal: np.ndarray
    links: np.ndarray
    inverse: np.ndarray
    columns: np.ndarray


def chain(stations: int, coordinates: int) -> Chain:
    """Work space; a whole number of registers wide."""
    width = 8 * ((coordinates + 3 + 7) // 8)
    return Chain(
        np.zeros((stations, 3)),
        np.zeros((2, stations)),
        np.zeros((stations, 3)),
        np.zeros((2 * stations, width)),
    )


@kernel
def solve_chain(work: Chain) -> None:
    """Replace all columns but the last two by A^-1 times them."""
    n, width = work.diagonal.shape[0], work.columns.shape[1]
    x, e, inverse = work.columns, work.links, work.inverse
    last = n - 1
    for j in range(last):
        d00 = work.diagonal[j, 0] + e[0, j] + e[0, j - 1]
        d01 = work.diagonal[j, 1]
        d11 = work.diagonal[j, 2] + e[1, j] + e[1, j - 1]
        if j > 0:
            d00 -= e[0, j - 1] * e[0, j - 1] * inverse[j - 1, 0]
            d01 -= e[0, j - 1] * e[1, j - 1] * inverse[j - 1, 1]
            d11 -= e[1, j - 1] * e[1, j - 1] * inverse[j - 1, 2]
        scale = 1.0 / (d00 * d11 - d01 * d01)
        i00, i01, i11 = d11 * scale, -d01 * scale, d00 * scale
        inverse[j, 0], inverse[j, 1], inverse[j, 2] = i00, i01, i11
        # the last station's speeds act on the first one and on the one behind it
        x[2 * j, width - 2] = x[2 * j + 1, width - 1] = 0.0
        x[2 * j, width - 1] = x[2 * j + 1, width - 2] = 0.0
        if j == 0:
            x[0, width - 2], x[1, width - 1] = e[0, last], e[1, last]
        if j == last - 1:
            x[2 * j, width - 2] += e[0, j]
            x[2 * j + 1, width - 1] += e[1, j]
        row_0, row_1 = x[2 * j], x[2 * j + 1]
        if j > 0:
            e0, e1 = e[0, j - 1], e[1, j - 1]
            back_0, back_1 = x[2 * j - 2], x[2 * j - 1]
            for k in range(width):
                r0, r1 = row_0[k] + e0 * back_0[k], row_1[k] + e1 * back_1[k]
                row_0[k], row_1[k] = i00 * r0 + i01 * r1, i01 * r0 + i11 * r1
        else:
            for k in range(width):
                r0, r1 = row_0[k], row_1[k]
                row_0[k], row_1[k] = i00 * r0 + i01 * r1, i01 * r0 + i11 * r1
    for j in range(last - 2, -1, -1):
        e0, e1 = e[0, j], e[1, j]
        a, b, c, d = inverse[j, 0] * e0, inverse[j, 1] * e1, inverse[j, 1] * e0, inverse[j, 2] * e1
        row_0, row_1, next_0, next_1 = x[2 * j], x[2 * j + 1], x[2 * j + 2], x[2 * j + 3]
        for k in range(width):
            row_0[k] += a * next_0[k] + b * next_1[k]
            row_1[k] += c * next_0[k] + d * next_1[k]
    # the last station closes the ring
    h0, h1, g0, g1 = e[0, last - 1], e[1, last - 1], e[0, last], e[1, last]
    p, q = width - 2, width - 1
    s00 = work.diagonal[last, 0] + h0 + g0 - h0 * x[2 * last - 2, p] - g0 * x[0, p]
    s01 = work.diagonal[last, 1] - h0 * x[2 * last - 2, q] - g0 * x[0, q]
    s11 = work.diagonal[last, 2] + h1 + g1 - h1 * x[2 * last - 1, q] - g1 * x[1, q]
    scale = 1.0 / (s00 * s11 - s01 * s01)
    row_0, row_1 = x[2 * last], x[2 * last + 1]
    for k in range(p):
        r0 = row_0[k] + h0 * x[2 * last - 2, k] + g0 * x[0, k]
        r1 = row_1[k] + h1 * x[2 * last - 1, k] + g1 * x[1, k]
        row_0[k], row_1[k] = scale * (s11 * r0 - s01 * r1), scale * (s00 * r1 - s01 * r0)
    for j in range(last):
        a0, b0, a1, b1 = x[2 * j, p], x[2 * j, q], x[2 * j + 1, p], x[2 * j + 1, q]
        to_0, to_1 = x[2 * j], x[2 * j + 1]
        for k in range(p):
            to_0[k] += a0 * row_0[k] + b0 * row_1[k]
            to_1[k] += a1 * row_0[k] + b1 * row_1[k]


@kernel
def solve_dense(matrix: np.ndarray, size: int, x: np.ndarray) -> None:
    """Solve by elimination without exchange of rows: the matrix has a positive definite symmetric part.

    Parameters
    ----------
    matrix : (>= size, > size) array
        Its column `size` is the right side; used up.
    size : int
        Of the system.
    x : (>= size,) array
        Result.
    """
    for k in range(size):
        per_pivot = 1.0 / matrix[k, k]
        pivot = matrix[k]
        for i in range(k + 1, size):
            factor, row = matrix[i, k] * per_pivot, matrix[i]
            for c in range(k + 1, size + 1):
                row[c] -= factor * pivot[c]
    for k in range(size - 1, -1, -1):
        total = matrix[k, size]
        for c in range(k + 1, size):
            total -= matrix[k, c] * x[c]
        x[k] = total / matrix[k, k]
