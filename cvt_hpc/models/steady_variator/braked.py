"""States at a held speed of the driven pulley: the load follows, as the moment of a brake that holds it.

Under a given load there may be one steady state, several or none. At the torque that friction carries the
states turn back. Where neither strand pushes, the play passes from one strand to the driving wrap and on to
the other strand while the load hardly changes, so that the load does not separate them. A brake that holds
the driven pulley's speed omega does: as omega falls slip grows, past the largest torque, and play moves; slip
is measured like that. The driven pulley's balance of moments, sum of the flanks' moments = i M, then gives M,
and leaves the equations as omega leaves the unknowns.

M(omega) has small folds where single cells open. Steps that do not come through are shortened, and where that
does not help the continuation leaps ahead, onto the curve behind such a fold.
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csc_array

from cvt_hpc.models.steady_variator.equations import MOMENT, SPEED, Equations
from cvt_hpc.models.steady_variator.newton import newton

# steps of the driven speed, over itself; the longest is 1/20 of the slip that counts as gross
FIRST, LONGEST, SHORTEST = 1e-4, 2.5e-3, 3e-6
LEAPS = (3e-4, 1e-3, 3e-3)  # beyond a place where shorter steps do not help
TRIES = 25  # Newton's steps: ten to fifteen where several cells open at once


class Braked:
    """The steady equations at a held driven speed; in the form that `newton` takes.

    Parameters
    ----------
    equations : Equations
        Of the belt; its load has no influence.

    Attributes
    ----------
    sizes : (n - 1,) array
        As of `Equations`, without that of the driven speed.
    speed : float
        Of the driven pulley [rad/s].
    """

    def __init__(self, equations: Equations) -> None:
        self._equations = equations
        self.sizes = np.delete(equations.sizes, SPEED)
        self.speed, self._open = 0.0, 0.0

    @property
    def load(self) -> float:
        """Torque at the driving pulley that belongs to the last residual [N m]."""
        belt = self._equations.belt
        return belt.load + self._open * belt.driven_inertia / belt.ratio

    def residual(self, x: np.ndarray) -> np.ndarray | None:
        """As of `Equations`, without the balance that gives the load."""
        left = self._equations.residual(self.whole(x))
        if left is None:
            return None
        self._open = float(left[MOMENT])
        return np.delete(left, MOMENT)

    def jacobian(self, x: np.ndarray) -> csc_array:
        """Slopes of the residual, (n - 1, n - 1)."""
        slopes = self._equations.jacobian(self.whole(x)).tocsr()
        rows, columns = (np.arange(slopes.shape[0]) for _ in range(2))
        return slopes[np.delete(rows, MOMENT)].tocsc()[:, np.delete(columns, SPEED)]

    def whole(self, x: np.ndarray) -> np.ndarray:
        """Unknowns of `Equations`."""
        return np.insert(x, x.size + 1 + SPEED, self.speed)

    def at(self, speed: float, x: np.ndarray, tolerance: float) -> tuple[np.ndarray, float] | None:
        """Unknowns of `Equations` at a driven speed from ones nearby, and their load; None: not found."""
        self.speed = speed
        found = newton(self, np.delete(x, SPEED), tolerance, most=TRIES)
        return None if found is None else (self.whole(found), self.load)

    def along(self, x: np.ndarray, sign: float, tolerance: float) -> Iterator[tuple[np.ndarray, float]]:
        """Solutions as the driven speed falls (sign -1) or rises (1), with their loads, as far as found."""
        before: np.ndarray | None = None
        step, leaps, leaping = FIRST, iter(LEAPS), False
        while step > 0.0:
            change = sign * step * x[SPEED]
            near = x if before is None else x + (x - before) * (change / (x[SPEED] - before[SPEED]))
            found = self.at(x[SPEED] + change, near, tolerance)
            if found is not None:
                before, x = x, found[0]
                step, leaps, leaping = min(2.0 * step, LONGEST), iter(LEAPS), False
                yield found
            elif step > SHORTEST and not leaping:
                step *= 0.25
            else:
                before, leaping, step = None, True, next(leaps, 0.0)
