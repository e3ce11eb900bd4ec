"""All eigenvalues of a sparse matrix in a band of frequencies that are not strongly damped.

Shift and invert: about a point of the complex plane Arnoldi's method finds the nearest eigenvalues, and no
other lies in the disc up to the farthest of them. Discs are laid up along the middle of the rectangle that
was requested, each as far on as the last one reaches, until they cover it: so nothing in it can be missed.
"""

import numpy as np
from scipy.sparse import csc_array, eye_array
from scipy.sparse.linalg import LinearOperator, eigs, splu

NEAREST = 12  # eigenvalues of each disc to begin with: fewer need more discs, more take longer
FIRST_REACH = 2.0 * np.pi * 400.0  # [rad/s]: half of the part of the band that the first disc covers, guessed
OVERLAP = 0.95  # of a disc's half height
ALIKE = 1e-5  # relative: eigenvalues of two discs that are one


def eigenpairs(
    matrix: csc_array, low: float, high: float, decay: float, growth: float
) -> tuple[np.ndarray, np.ndarray]:
    """Eigenvalues in a rectangle, -`decay` to `growth` by `low` to `high`, and their vectors.

    The real (n, n) matrix has those of rates [1/s] and circular frequencies [rad/s]. Values, (m,), are in the
    order of their real parts, the largest first; vectors, (n, m), are columns of length 1.
    """
    whole, identity = matrix.astype(complex), eye_array(matrix.shape[0], format="csc")
    start = np.random.default_rng(0).normal(size=matrix.shape[0]) + 0j
    values, vectors = np.empty(0, complex), np.empty((matrix.shape[0], 0), complex)
    middle, width = 0.5 * (growth - decay), 0.5 * (growth + decay)
    covered, reach, nearest = low, FIRST_REACH, NEAREST
    while covered < high:
        centre = middle + 1j * (covered + OVERLAP * reach)
        inverse = splu((whole - centre * identity).tocsc())
        operator = LinearOperator(matrix.shape, matvec=inverse.solve, dtype=complex)
        found, shapes = eigs(operator, k=nearest, which="LM", v0=start)
        found = centre + 1.0 / found
        radius = np.abs(found - centre).max()
        reach = np.sqrt(max(radius**2 - width**2, 0.0))
        if reach < 0.1 * width:
            # they lie so densely that the disc hardly reaches beyond the rectangle
            nearest, reach = 2 * nearest, width
            continue
        if centre.imag - reach > covered:
            continue  # the disc is smaller than was guessed: lay it nearer
        covered = centre.imag + reach
        values, vectors = np.append(values, found), np.hstack([vectors, shapes])
    wanted = (values.imag > low) & (values.imag < high)
    wanted &= (values.real > -decay) & (values.real < growth)
    values, vectors = values[wanted], vectors[:, wanted]
    fresh = [k for k in range(values.size) if not np.any(np.abs(values[:k] / values[k] - 1.0) < ALIKE)]
    order = np.array(fresh, dtype=int)[np.argsort(-values[fresh].real, kind="stable")]
    return values[order], vectors[:, order]
