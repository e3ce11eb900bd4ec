"""Deflection of the sheaves' discs: flexibilities w_ij of the stations of a wrap, by formula or by table.

A force F_j [N] on both flanks at station j opens the groove at station i by w_ij F_j (Castigliano's theorem
with Maxwell and Betti's reciprocity: Bullinger et al. 2005, eq. 10), so w is symmetric and positive definite,
its entries of either sign: a disc that is pressed on one side comes nearer on the other.
"""

from collections.abc import Sequence

import numpy as np

ROUND_OFF = 1e-6  # of the largest entry: asymmetry left by tables of six digits


def cone_flexibilities(
    angle: np.ndarray, distance: np.ndarray, stiffness: float, shift: float = 0.0
) -> np.ndarray:
    """Flexibilities w (m, m) [m/N] of a cone that tilts as a whole, of rank two: the "sinus approach".

    (Bullinger et al. 2005, fig. 10.) The axis of tilting is shifted by `shift` dr [m] from the centre towards
    the contact, here the middle of the arc; the paper does not give the place along the arc where it takes
    the contact. Tilting about the axis across that opens by r cos(phi) - dr, about the other by r sin(phi),
    with the stations' `angle` phi from the middle of the arc (m,) [rad] and `distance` r (m,) [m].
    `stiffness` is that of the cone against tilting, in series with that of its collar [N m/rad]; inf: rigid.
    """
    levers = np.array([distance * np.cos(angle) - shift, distance * np.sin(angle)])
    return levers.T @ levers / stiffness


def table_matrix(angles: Sequence[float], table: Sequence[Sequence[float]]) -> np.ndarray:
    """Square matrix (n, n) of a table of flexibilities w [m/N], of n rows of n or of one row of n.

    Its n angles [rad] ascend from the inlet, those before it negative. A single row is that of a body of
    revolution over the angle between two places; its angles are equidistant, from 0.
    """
    values = np.array(table, dtype=float)
    if len(values) > 1:
        return values
    apart = np.arange(len(angles))
    return values[0][np.abs(apart[:, None] - apart)]


def interpolated(
    angles: Sequence[float], table: Sequence[Sequence[float]], places: np.ndarray, wrap: float
) -> np.ndarray:
    """Flexibilities w of a wrap (m, m) [m/N] from a table as of `table_matrix`.

    Forces go to the knots beside them, openings come from there. So w stays symmetric and positive
    semi-definite on any mesh. Where knots are stations it is the table's. Stations beyond the first and the
    last angle have their flexibilities. A single row that is longer than the wrap reaches as far beyond the
    inlet as beyond the outlet. `places` (m,) are the stations' angles from the inlet and `wrap` that of the
    wrap [rad].
    """
    before = 0.5 * (angles[-1] - wrap) if len(table) == 1 else 0.0
    shares = np.array([np.interp(places + before, angles, unit) for unit in np.eye(len(angles))])
    found = shares.T @ table_matrix(angles, table) @ shares
    return 0.5 * (found + found.T)


def table_problem(
    angles: Sequence[float], table: Sequence[Sequence[float]], wrap: float
) -> tuple[str, str] | None:
    """Error in a table, as of `table_matrix`, for a wrap [rad]: expected and found; None if there is none."""
    n, steps = len(angles), np.diff(angles)
    if n < 2 or {len(row) for row in table} != {n} or len(table) not in (1, n):
        rows = " x ".join(str(size) for size in (len(table), len(table[0]) if table else 0))
        return f"1 or n rows of n flexibilities, n >= 2 being the number of angles, {n}", rows
    if angles[0] > 0.0 or steps.min() <= 0.0 or (len(table) == 1 and angles[0] < 0.0):
        return "angles that ascend, from 0 or before the inlet", f"{angles[0]:g} to {angles[-1]:g} rad"
    if len(table) == 1 and np.ptp(steps) > ROUND_OFF * steps.max():
        return (
            "equidistant angles of a disc of revolution",
            f"steps of {steps.min():g} to {steps.max():g} rad",
        )
    if angles[-1] < wrap * (1.0 - ROUND_OFF):
        return f"angles over the whole wrap, {wrap:.4g} rad", f"up to {angles[-1]:.4g} rad"
    matrix = table_matrix(angles, table)
    worst = np.abs(matrix - matrix.T).max()
    if not worst <= ROUND_OFF * np.abs(matrix).max():
        i, j = np.unravel_index(np.abs(matrix - matrix.T).argmax(), matrix.shape)
        pair = f"{matrix[i, j]:g} and {matrix[j, i]:g} m/N"
        return "a symmetric matrix, by Maxwell and Betti", f"{pair} between angles {i + 1} and {j + 1}"
    least = np.linalg.eigvalsh(0.5 * (matrix + matrix.T))[0]
    if least <= 0.0:
        return "a positive definite matrix, since no force gains work", f"the eigenvalue {least:g} m/N"
    return None
