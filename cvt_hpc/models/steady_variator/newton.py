"""Newton's iteration for equations with corners, by full steps.

With the corners sharp a full step solves the equations for the presumed set of pressed elements, and the next
set follows from its signs: the active-set iteration of complementarity problems, which ends after a few sets.
Shortening its steps, or rounding off the corners, only hinders it.
"""

from typing import Protocol

import numpy as np
from scipy.sparse import csc_array
from scipy.sparse.linalg import splu

FULL_STEPS = 15  # a good start needs 3 to 6, a far one 12
FAR = 1e4  # of the unknowns' sizes: a step beyond, such as 1 m of w, does not come back


class Solvable(Protocol):
    """Equations as Newton's iteration takes them: `Equations` under a load, `Released` on its way."""

    sizes: np.ndarray

    def residual(self, x: np.ndarray) -> np.ndarray | None:
        """Residual of the equations; None where they have no value."""

    def jacobian(self, x: np.ndarray, sided: bool) -> csc_array:
        """Slopes of the residual about the unknowns of its last call, as of `Equations`."""


def newton(equations: Solvable, x: np.ndarray, tolerance: float, sided: bool = True) -> np.ndarray | None:
    """Solve the steady equations from `x`, (n,), which stays as it is; None where the iteration does not end.

    The root mean square of the next step, over the unknowns' sizes, is `tolerance` at most. With slopes on
    the near side of each corner (`sided`) it ends after a few steps from a solution nearby. Mean slopes
    across those that are very near are better from far away.
    """
    residual = equations.residual(x)
    for _ in range(FULL_STEPS):
        if residual is None or not np.all(np.isfinite(residual)):
            return None
        matrix = equations.jacobian(x, sided)
        if not np.all(np.isfinite(matrix.data)):
            return None
        try:
            factors = splu(matrix)
        except RuntimeError:  # exactly singular
            return None
        step = -factors.solve(residual)
        if not mean_size(equations, step) < FAR:
            return None
        x = x + step
        residual = equations.residual(x)
        # by the same factors, the next step
        if residual is not None and mean_size(equations, factors.solve(residual)) < tolerance:
            return x
    return None


def mean_size(equations: Solvable, step: np.ndarray) -> float:
    """Root mean square of a step over the unknowns' sizes."""
    return float(np.sqrt(np.mean((step / equations.sizes) ** 2)))
