"""Contact of one wrap by a full matrix of flexibilities: Cholesky's factor of the closed stations.

With u = sqrt(h) f the contact of `compliance.py` is symmetric, (I + K) u = -c_e sqrt(h) G for the closed
stations, K = c_e a sqrt(h) (b W + r^2 / c_tilt U^T U) sqrt(h). W need only be positive semi-definite,
its entries may have either sign: I + K is positive definite, so that the search for the closed set ends. The
factor takes m^3 / 6 products and is kept while the set stays, a solution takes m^2.

Arrays of lanes or plain ones. `matrix` is (m, 2 m): I + K on the left, on the right the factor's lower
triangle with reciprocals on its diagonal. Open stations have the rows and columns of the unit matrix in it.
"""

from typing import Any

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import anywhere, fma, select, sqrt


@kernel
def factorise_closed(matrix: Any, stations: Any, closed: int, m: int) -> None:
    """Cholesky's factor of the rows and columns whose `closed` is 1."""
    for j in range(m):
        shut = stations[j, closed]
        for k in range(j):
            total = shut * stations[k, closed] * matrix[j, k]
            for i in range(k):
                total = fma(-matrix[j, m + i], matrix[k, m + i], total)
            matrix[j, m + k] = total * matrix[k, m + k]
        total = fma(shut, matrix[j, j], 1.0 - shut)
        for i in range(j):
            total = fma(-matrix[j, m + i], matrix[j, m + i], total)
        matrix[j, m + j] = 1.0 / sqrt(total)


@kernel
def solve_closed(matrix: Any, root: np.ndarray, stations: Any, fields: tuple, stiffness: Any) -> None:
    """Force of closed stations, and -c_e times the opening of open ones [N/m], from gaps.

    Of `matrix` with its factor, `root` sqrt(h) (m,) [m^(1/2)] and `stiffness` c_e [N/m^2]. `fields` tells
    where `stations` (m, ...) have the closed set, the gap, work space and the result.
    """
    closed, gap, y, push = fields
    m = root.size
    for j in range(m):
        total = -root[j] * stations[j, closed] * stiffness * stations[j, gap]
        for i in range(j):
            total = fma(-matrix[j, m + i], stations[i, y], total)
        stations[j, y] = total * matrix[j, m + j]
    for j in range(m - 1, -1, -1):
        total = stations[j, y] * matrix[j, m + j]
        stations[j, y] = total
        for i in range(j):
            stations[i, y] = fma(-matrix[j, m + i], total, stations[i, y])
    for j in range(m):
        force, is_open = stations[j, y] / root[j], stations[j, closed] < 0.5
        if anywhere(is_open):
            total = stiffness * stations[j, gap] * root[j]
            for i in range(m):
                total = fma(matrix[j, i], stations[i, y], total)
            force = select(is_open, -total / root[j], force)
        stations[j, push] = force
