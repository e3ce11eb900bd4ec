"""The linear system of a step: coordinates across the belt, coupled by friction with speeds along it.

    E x + R^T c v_0 = f,    c R x + A v = y

x are the increments of the R coordinates' rates, v = (v_0, v_1) those of both layers' speeds at the N
stations, c the cross slope of friction, R the shapes; hoop stresses couple both likewise. A is cyclic
block-tridiagonal, symmetric positive definite: the layers are chains of masses. It is eliminated for all
columns of c R at once, and the remaining system is dense and small.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.quasi_static_belt import fields as f


class Chain(NamedTuple):
    """Work space of the layers' elimination, C = R + 3 columns."""

    diagonal: np.ndarray  # shape (N, 3): blocks at the stations (00, 01, 11) without the links [N s/m]
    # shape (2, N): slopes of the stresses in the cells with the speeds' differences, by layer [N s/m]
    links: np.ndarray
    inverse: np.ndarray  # shape (N, 3): of the eliminated blocks
    # shape (N, 2, C): by station and layer the right side, c R, and the two that close the ring; then the
    # solution
    columns: np.ndarray


def chain(stations: int, coordinates: int) -> Chain:
    """Work space; a whole number of registers wide."""
    width = 8 * ((coordinates + 3 + 7) // 8)
    return Chain(
        np.zeros((stations, 3)),
        np.zeros((2, stations)),
        np.zeros((stations, 3)),
        np.zeros((stations, 2, width)),
    )


@kernel
def solve_chain(work: Chain) -> None:
    """Replace all columns but the last two by A^-1 times them."""
    n, width = work.diagonal.shape[0], work.columns.shape[2]
    x, inverse, last = work.columns, work.inverse, n - 1
    of_element, of_ring = work.links[f.ELEMENT], work.links[f.RING]
    to_element, to_ring = width - 2, width - 1  # columns by the last station's speeds
    for j in range(last):
        d00 = work.diagonal[j, f.ELEMENT_ELEMENT] + of_element[j] + of_element[j - 1]
        d01 = work.diagonal[j, f.ELEMENT_RING]
        d11 = work.diagonal[j, f.RING_RING] + of_ring[j] + of_ring[j - 1]
        if j > 0:
            d00 -= of_element[j - 1] * of_element[j - 1] * inverse[j - 1, f.ELEMENT_ELEMENT]
            d01 -= of_element[j - 1] * of_ring[j - 1] * inverse[j - 1, f.ELEMENT_RING]
            d11 -= of_ring[j - 1] * of_ring[j - 1] * inverse[j - 1, f.RING_RING]
        scale = 1.0 / (d00 * d11 - d01 * d01)
        i00, i01, i11 = d11 * scale, -d01 * scale, d00 * scale
        inverse[j, f.ELEMENT_ELEMENT], inverse[j, f.ELEMENT_RING], inverse[j, f.RING_RING] = i00, i01, i11
        # the last station's speeds act on the first one and on the one behind it
        element, ring = x[j, f.ELEMENT], x[j, f.RING]
        element[to_element] = ring[to_ring] = 0.0
        element[to_ring] = ring[to_element] = 0.0
        if j == 0:
            element[to_element], ring[to_ring] = of_element[last], of_ring[last]
        if j == last - 1:
            element[to_element] += of_element[j]
            ring[to_ring] += of_ring[j]
        if j > 0:
            e0, e1 = of_element[j - 1], of_ring[j - 1]
            back_0, back_1 = x[j - 1, f.ELEMENT], x[j - 1, f.RING]
            for k in range(width):
                r0, r1 = element[k] + e0 * back_0[k], ring[k] + e1 * back_1[k]
                element[k], ring[k] = i00 * r0 + i01 * r1, i01 * r0 + i11 * r1
        else:
            for k in range(width):
                r0, r1 = element[k], ring[k]
                element[k], ring[k] = i00 * r0 + i01 * r1, i01 * r0 + i11 * r1
    for j in range(last - 2, -1, -1):
        e0, e1, i01 = of_element[j], of_ring[j], inverse[j, f.ELEMENT_RING]
        a, b = inverse[j, f.ELEMENT_ELEMENT] * e0, i01 * e1
        c, d = i01 * e0, inverse[j, f.RING_RING] * e1
        element, ring, next_0, next_1 = x[j, f.ELEMENT], x[j, f.RING], x[j + 1, f.ELEMENT], x[j + 1, f.RING]
        for k in range(width):
            element[k] += a * next_0[k] + b * next_1[k]
            ring[k] += c * next_0[k] + d * next_1[k]
    # the last station closes the ring
    h0, h1, g0, g1 = of_element[last - 1], of_ring[last - 1], of_element[last], of_ring[last]
    back_0, back_1 = x[last - 1, f.ELEMENT], x[last - 1, f.RING]
    first_0, first_1 = x[0, f.ELEMENT], x[0, f.RING]
    diagonal = work.diagonal[last]
    s00 = diagonal[f.ELEMENT_ELEMENT] + h0 + g0 - h0 * back_0[to_element] - g0 * first_0[to_element]
    s01 = diagonal[f.ELEMENT_RING] - h0 * back_0[to_ring] - g0 * first_0[to_ring]
    s11 = diagonal[f.RING_RING] + h1 + g1 - h1 * back_1[to_ring] - g1 * first_1[to_ring]
    scale = 1.0 / (s00 * s11 - s01 * s01)
    element, ring = x[last, f.ELEMENT], x[last, f.RING]
    for k in range(to_element):
        r0 = element[k] + h0 * back_0[k] + g0 * first_0[k]
        r1 = ring[k] + h1 * back_1[k] + g1 * first_1[k]
        element[k], ring[k] = scale * (s11 * r0 - s01 * r1), scale * (s00 * r1 - s01 * r0)
    for j in range(last):
        to_0, to_1 = x[j, f.ELEMENT], x[j, f.RING]
        a0, b0, a1, b1 = to_0[to_element], to_0[to_ring], to_1[to_element], to_1[to_ring]
        for k in range(to_element):
            to_0[k] += a0 * element[k] + b0 * ring[k]
            to_1[k] += a1 * element[k] + b1 * ring[k]


@kernel
def solve_dense(matrix: np.ndarray, size: int, x: np.ndarray) -> None:
    """Solve by elimination without exchange of rows: the matrix has a positive definite symmetric part.

    Its column `size` is the right side, all of it is used up. The result is set into `x`.
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
