"""Newton's iteration for equations with corners: full steps, or damped ones where these do not lead home.

With the corners sharp a full step solves the equations for the presumed set of pressed elements, and the next
set follows from its signs: the active-set iteration of complementarity problems, which ends after a few sets.
Shortening its steps only hinders it. Far from home, and with corners rounded off, the step is shortened until
the next one would be smaller (Deuflhard's natural monotonicity test), whatever the equations' units.
"""

from __future__ import annotations

from typing import Protocol

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

FULL_STEPS = 15  # a good start needs 3 to 6, a far one 12
DAMPED_STEPS = 25
FAR = 1e4  # of the unknowns' sizes: a step beyond, such as 1 m of w, does not come back
SHORTEST = 1e-2  # of a full step: a direction that asks for less does not lead home


class Solvable(Protocol):
    """Equations as Newton's iteration takes them: `Equations` under a load, `Braked` at a speed."""

    sizes: np.ndarray

    def residual(self, x: np.ndarray) -> np.ndarray | None:
        """What the equations leave; None where they have no value."""

    def jacobian(self, x: np.ndarray) -> csc_array:
        """Slopes of the residual, about the unknowns of its last call."""


def newton(
    equations: Solvable,
    x: np.ndarray,
    tolerance: float,
    damped: bool = False,
    most: int = FULL_STEPS,
) -> np.ndarray | None:
    """Solve the steady equations.

    Parameters
    ----------
    equations : Solvable
        With their constants and rounding.
    x : (n,) array
        Where to begin; left as it is.
    tolerance : float
        Root mean square of what a further step would be, over the unknowns' sizes.
    damped : bool
        Shorten steps that do not lead home.
    most : int
        Of full steps.

    Returns
    -------
    (n,) array or None
        The solution; None where the iteration does not end.
    """
    residual, share = equations.residual(x), 1.0
    for _ in range(DAMPED_STEPS if damped else most):
        if residual is None or not np.all(np.isfinite(residual)):
            return None
        matrix = equations.jacobian(x)
        if not np.all(np.isfinite(matrix.data)):
            return None
        try:
            factors = splu(matrix)
        except RuntimeError:  # exactly singular
            return None
        step = -factors.solve(residual)
        size = _size(equations, step)
        if not size < FAR:
            return None
        share = min(1.0, 4.0 * share) if damped else 1.0
        while True:
            found = x + share * step
            residual = equations.residual(found)
            # by the same factors, what the next step would be
            ahead = np.inf if residual is None else _size(equations, factors.solve(residual))
            if not damped or ahead <= (1.0 - 0.25 * share) * size:
                break
            share *= 0.5
            if share < SHORTEST:
                return None
        if share == 1.0 and ahead < tolerance:
            return found
        x = found
    return None


def _size(equations: Solvable, step: np.ndarray) -> float:
    """Root mean square of a step over the unknowns' sizes."""
    return float(np.sqrt(np.mean((step / equations.sizes) ** 2)))
