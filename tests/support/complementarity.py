"""The judge of contact solvers: linear complementarity, w = M z + q, w >= 0, z >= 0, w.z = 0, for any small dense M.

Lemke's pivoting with the lexicographic rule of ties: it ends on every matrix, finds a solution for the
copositive-plus and P-matrices that contacts give, and says so when its ray is secondary (no solution found).
Source: Cottle, Pang and Stone, The Linear Complementarity Problem, sec. 4.4 and 4.9.
"""

from __future__ import annotations

import numpy as np


class ComplementarityError(ArithmeticError):
    """No solution was found: the pivoting ended on a ray or at its limit."""


def solve_lcp(matrix: np.ndarray, q: np.ndarray, max_pivots: int | None = None) -> np.ndarray:
    """Solve w = M z + q, w >= 0, z >= 0, w.z = 0.

    Parameters
    ----------
    matrix : (n, n) array
        M.
    q : (n,) array
        Right-hand side; any scale.
    max_pivots : int, optional
        Limit of pivots; default 50 n. (Lemke needs at most n on the contact problems here, 2^n on the worst
        matrices.)

    Returns
    -------
    z : (n,) array
        The solution; w follows as M z + q.

    Raises
    ------
    ComplementarityError
        If Lemke's path ends on a ray (no solution found) or the limit is reached.
    """
    matrix, q = np.asarray(matrix, dtype=float), np.asarray(q, dtype=float)
    n = q.size
    if np.all(q >= 0.0):
        return np.zeros(n)
    # to the order of one, so that round-off can be told from a pivot in any units
    force, size = np.abs(matrix).max() or 1.0, np.abs(q).max()
    matrix, q = matrix / force, q / size
    # columns: w (0..n-1), z (n..2n-1), artificial z0 (2n), right-hand side (2n+1)
    tableau = np.hstack([np.eye(n), -matrix, -np.ones((n, 1)), q[:, None]])
    basis = np.arange(n)
    row = _lexicographic_minimum(tableau, np.arange(n), np.ones(n), basis)
    entering = 2 * n
    for _ in range(50 * n if max_pivots is None else max_pivots):
        leaving = basis[row]
        tableau[row] /= tableau[row, entering]
        others = np.arange(n) != row
        tableau[others] -= np.outer(tableau[others, entering], tableau[row])
        basis[row] = entering
        if leaving == 2 * n:
            z = np.zeros(2 * n + 1)
            z[basis] = tableau[:, -1]
            return np.maximum(z[n : 2 * n], 0.0) * (size / force)
        entering = leaving + n if leaving < n else leaving - n
        column = tableau[:, entering]
        candidates = np.flatnonzero(column > 1e-12 * max(1.0, np.abs(column).max()))
        if candidates.size == 0:
            raise ComplementarityError("Lemke's path ends on a ray: no solution found")
        row = _lexicographic_minimum(tableau, candidates, column[candidates], basis)
    raise ComplementarityError("Lemke's pivoting reached its limit")


def _lexicographic_minimum(
    tableau: np.ndarray, rows: np.ndarray, divisors: np.ndarray, basis: np.ndarray
) -> int:
    """Row whose (right-hand side, basis inverse) / divisor is least, column by column: ties cannot cycle."""
    n = tableau.shape[0]
    for column in (-1, *range(n)):
        ratios = tableau[rows, column] / divisors
        least = ratios <= ratios.min() + 1e-12 * max(1.0, np.abs(ratios).max())
        rows, divisors = rows[least], divisors[least]
        artificial = rows[basis[rows] == 2 * n]
        if artificial.size:
            return int(artificial[0])
        if rows.size == 1:
            break
    return int(rows[0])
