"""Steady states along their own curve, round the fold at the largest load: pseudo-arclength continuation.

Toward the torque that friction carries the states turn back, and no walk along the load reaches that. Along
the length of the curve, over the unknowns' sizes, it is a point like any other (Keller 1977): the load joins
the unknowns, and the length of the step along the last tangent the equations.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.sparse import csc_array, csr_array, hstack, vstack
from scipy.sparse.linalg import SuperLU, splu

from cvt_hpc.models.steady_variator.equations import Equations

LOAD_SIZE = 10.0  # [N m]: what counts alike in the load, beside the unknowns' sizes
FIRST = 2.0  # [N m]: load of the first step
STEPS, MOST = 12, 400  # Newton's for a state; states
SHARPEST = 0.5  # cosine: a curve that turns further within a step is another one, or the step is too long
SHORTEST = 1e-4  # of the first step


def largest_load(
    equations: Equations,
    load: Callable[[float], None],
    x: np.ndarray,
    start: float,
    tolerance: float,
    within: float,
    most: float = np.inf,
) -> tuple[np.ndarray, float] | None:
    """State at the fold that comes next as the load grows, in the direction that it has.

    Parameters
    ----------
    equations : Equations
        With their constants, corners sharp.
    load : callable
        load(M) puts them under a load [N m].
    x : (n,) array
        Their solution under the load `start`.
    start : float
        [N m]
    tolerance : float
        Root mean square of Newton's last step, over the unknowns' sizes.
    within : float
        How closely the largest load is found [N m].
    most : float
        Size of a load where the curve need not be followed further [N m].

    Returns
    -------
    ((n,) array, float) or None
        The unknowns, and the load [N m]: at the fold, or the first beyond `most`; None where the curve cannot
        be followed that far.
    """
    sign = -1.0 if start < 0.0 else 1.0
    curve = _Curve(equations, load, tolerance)
    z = np.append(x, start)
    known = curve.factors(z, curve.upwards)
    if known is None:
        return None
    tangent = curve.tangent(known[0], sign * curve.upwards)
    step = first = FIRST / LOAD_SIZE / abs(tangent[-1])
    for _ in range(MOST):
        found = curve.ahead(z, tangent, step)
        if found is None or (turned := curve.tangent(found[1], tangent)) @ tangent < SHARPEST:
            step *= 0.5
            if step < SHORTEST * first:
                return None
            continue
        if sign * turned[-1] <= 0.0:
            if step * sign * tangent[-1] * LOAD_SIZE < within:
                return z[:-1], float(z[-1])
            step *= 0.25
            continue
        z, tangent, step = found[0], turned, 1.5 * step
        if sign * z[-1] >= most:
            return z[:-1], float(z[-1])
    return None


class _Curve:
    """States and loads z = (x, M) that solve the equations; tangents are over the sizes, of length 1."""

    def __init__(self, equations: Equations, load: Callable[[float], None], tolerance: float) -> None:
        self.equations, self.load, self.tolerance = equations, load, tolerance
        self.sizes = np.append(equations.sizes, LOAD_SIZE)
        self.upwards = np.zeros(self.sizes.size)
        self.upwards[-1] = 1.0

    def factors(self, z: np.ndarray, tangent: np.ndarray) -> tuple[SuperLU, np.ndarray] | None:
        """Factors of the equations and of the length along a tangent; what the equations leave."""
        self.load(z[-1] + 1.0)
        beyond = self.equations.residual(z[:-1])
        self.load(z[-1])
        residual = self.equations.residual(z[:-1])
        if residual is None or beyond is None or not np.all(np.isfinite(residual)):
            return None
        # the load stands in them linearly: a difference over 1 N m is its slope
        slopes = hstack([self.equations.jacobian(z[:-1]), csc_array((beyond - residual)[:, None])])
        if not np.all(np.isfinite(slopes.data)):
            return None
        try:
            return splu(vstack([slopes, csr_array((tangent / self.sizes)[None])], format="csc")), residual
        except RuntimeError:  # exactly singular
            return None

    def ahead(self, z: np.ndarray, tangent: np.ndarray, length: float) -> tuple[np.ndarray, SuperLU] | None:
        """Newton's iteration for the state a length on, and its last factors."""
        found = z + length * tangent * self.sizes
        for _ in range(STEPS):
            matrix = self.factors(found, tangent)
            if matrix is None:
                return None
            short = length - tangent @ ((found - z) / self.sizes)
            change = matrix[0].solve(np.append(-matrix[1], short))
            found = found + change
            size = np.sqrt(np.mean((change / self.sizes) ** 2))
            if size < self.tolerance:
                return found, matrix[0]
            if not np.isfinite(size):
                return None
        return None

    def tangent(self, factors: SuperLU, last: np.ndarray) -> np.ndarray:
        """Direction of the curve, on from the last one."""
        found = factors.solve(self.upwards) / self.sizes
        found /= np.linalg.norm(found)
        return found if found @ last > 0.0 else -found
