"""Bending of the belt about its path, and the effect of the path's curvature on the transverse motion.

The belt's curvature is kappa - kappa^2 w - w_ss in first order. Which energy of it is meant is
`curvature_terms`; EI bends, ()' is d/ds:

    none      V = EI/2 int w''^2                          deviations from the path, its curvature left out
    path      V = EI/2 int (w'' + kappa^2 w)^2            a belt whose shape at rest is the path
    straight  V = EI/2 int (w''^2 + 3 kappa^4 w^2 + kappa^2 w'^2 + 6 kappa^2 w w''
                            - 2 kappa^3 w - 2 kappa w'')      a belt that is straight at rest

The last is the square of the exact curvature of r + w to second order, and the matrix and the load of EI in
Bullinger et al. 2005, eqs 20 and 21, follow from it term by term; their eq. 15 has the curvature in first
order, whose square would have 1, 0 and 2 in the place of 3, 1 and 6. Its load kappa'' EI is a pair of forces
at each end of an arc.

The length of the belt over ds is (1 + kappa w) ds + w'^2/2 ds without a term kappa^2 w^2, so a tension
adds no F kappa^2 w: what F kappa gives way by is taken up by the longer arc.
"""

import numpy as np

from cvt_hpc.models.elastic_belt.belt_settings import CURVATURE_TERMS

NONE, PATH, STRAIGHT = range(len(CURVATURE_TERMS))


def second_difference(cell: np.ndarray, dual: np.ndarray) -> np.ndarray:
    """Second derivative at the stations of a ring, (N, N) [1/m^2]."""
    n = cell.size
    second = np.zeros((n, n))
    for j in range(n):
        left, right = 1.0 / (cell[j - 1] * dual[j]), 1.0 / (cell[j] * dual[j])
        second[j, j - 1] += left
        second[j, (j + 1) % n] += right
        second[j, j] -= left + right
    return second


def squared_curvature(
    cell: np.ndarray, dual: np.ndarray, curvature: np.ndarray, power: int = 2
) -> np.ndarray:
    """Square, or another power, of the path's curvature at the stations [1/m^2], mean over their lengths."""
    weighted = cell * curvature**power
    return 0.5 * (weighted + np.roll(weighted, 1)) / dual


def bending_bands(
    cell: np.ndarray, dual: np.ndarray, stiffness: float, curvature: np.ndarray, terms: int = NONE
) -> np.ndarray:
    """Force on each station by the displacements of five, (N, 5) [N/m^2]: the gradient of the energy.

    From lengths of cells and of stations [m] and the path's curvature in the cells [1/m], (N,) each, EI [N
    m^2], and the curvature terms NONE, PATH or STRAIGHT.
    """
    n = cell.size
    second = second_difference(cell, dual)
    if terms == PATH:
        second += np.diag(squared_curvature(cell, dual, curvature))
    force = -stiffness * (second.T * dual) @ second / dual[:, None]
    if terms == STRAIGHT:
        first = (np.roll(np.eye(n), 1, axis=1) - np.eye(n)) / cell[:, None]
        mixed = (3.0 * dual * squared_curvature(cell, dual, curvature))[:, None] * second
        more = mixed + mixed.T + (first.T * (cell * curvature**2)) @ first
        more += np.diag(3.0 * dual * squared_curvature(cell, dual, curvature, 4))
        force -= stiffness * more / dual[:, None]
    return np.array([[force[j, (j + k) % n] for k in range(-2, 3)] for j in range(n)])


def bending_load(
    cell: np.ndarray, dual: np.ndarray, stiffness: float, curvature: np.ndarray, terms: int
) -> np.ndarray:
    """Force of bending on the belt where w = 0, (N,) [N/m]: 0 unless it is straight at rest."""
    if terms != STRAIGHT:
        return np.zeros(cell.size)
    cubed = squared_curvature(cell, dual, curvature, 3)
    bent = second_difference(cell, dual).T @ (dual * squared_curvature(cell, dual, curvature, 1))
    return stiffness * (cubed + bent / dual)
