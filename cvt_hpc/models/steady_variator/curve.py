"""The curve of steady states over all loads, followed along its arc from corner to corner.

Under a given load there may be one steady state, several or none. At the torque that friction carries the
states turn back. Where gaps open in a driving wrap they turn back for every cell that opens, and where no
strand pushes the play passes from one place to the other while the load hardly changes. So neither the load
nor the driven speed separates states, but the arc of their curve does.

Between two corners, at which elements of a cell meet or part, the curve is smooth: its tangent is the null
vector of the Jacobian without the driven pulley's balance of moments, sum of the flanks' moments = i M, which
gives the load M. At a corner the curve goes on in the direction that brings that cell to its other side
(continuation of a piecewise smooth curve; Allgower and Georg, Numerical continuation methods, 1990, ch. 15).
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from scipy.sparse import csr_array, vstack
from scipy.sparse.linalg import splu

from cvt_hpc.models.steady_variator.equations import MOMENT, SPEED, Equations
from cvt_hpc.models.steady_variator.newton import FAR, mean_size

# Steps, as the root mean square of the unknowns over their sizes: first, longest, and shortest that is tried
FIRST, LONGEST, SHORTEST = 1e-3, 0.1, 1e-12
PROBE = 1e-4  # at the most, of the step over which a corner's distance is linear
CORRECTIONS, FACTORISATIONS = 4, 3  # at most: by one factorisation, and of these in a step
EASY = 3  # with so few corrections the next step is twice as long
MOST = 20  # steps of a curve, over the number of stations: default belt from 20 to 160 N m 7, at 80 stations
NEAR = 1e-9  # strain: so near to a corner the next piece begins


class Curve:
    """Steady states of one belt.

    Parameters
    ----------
    equations : Equations
        Of the belt; its load has no influence.
    tolerance : float
        Root mean square of the last correction, over the unknowns' sizes.
    """

    def __init__(self, equations: Equations, tolerance: float) -> None:
        self._equations, self._tolerance = equations, tolerance

    def along(self, x: np.ndarray, sign: float) -> Iterator[tuple[np.ndarray, float]]:
        """States with their loads [N m], as far as they are found.

        Parameters
        ----------
        x : (n,) array
            Unknowns of a state, where the curve begins.
        sign : float
            The driven speed rises (1) or falls (-1) at first.
        """
        margin = self._corners(x)
        pressed = margin > 0.0
        ahead = np.zeros(x.size)
        ahead[SPEED] = sign
        slopes = self._slopes(x, pressed)
        tangent = self._tangent(slopes, ahead)
        step, passed, taken_steps = FIRST, -1, 0
        while tangent is not None and step >= SHORTEST and taken_steps < MOST * margin.size // 2:
            corner, distance = self._next_corner(x, tangent, margin, pressed, passed, step)
            meets = distance < step
            taken = distance if meets else step
            # beyond a corner the strain of its cell may change a thousand times as fast: it leads there
            across = tangent if passed < 0 else self._strain_of(passed)
            found = self._corrected(x, tangent, taken, slopes, across, pressed)
            if found is None:
                step = 0.25 * taken
                continue
            reached, load, corrections = found
            there = self._corners(reached)
            crossed = ((there > 0.0) != pressed) & ((margin > 0.0) == pressed) & (np.abs(there) > NEAR)
            if meets:
                crossed[corner] = False
            if crossed.any() and taken > SHORTEST:
                step = 0.25 * taken
                continue
            x, margin, passed = reached, there, -1
            taken_steps += 1
            inside = margin[corner] if pressed[corner] else -margin[corner]
            meets = meets and inside < NEAR  # otherwise the next step meets it
            if meets:
                pressed = pressed.copy()
                pressed[corner] = not pressed[corner]
                passed = corner
            elif corrections <= EASY:
                step = min(2.0 * step, LONGEST)
            slopes = self._slopes(x, pressed)
            tangent = self._tangent(slopes, tangent)
            if meets and tangent is not None:
                nears = self._rates(x, tangent, margin, PROBE)[corner] > 0.0
                tangent = tangent if nears == pressed[corner] else -tangent
            yield x, load

    def _corners(self, x: np.ndarray) -> np.ndarray:
        """Distances from all corners, (2 N,)."""
        return self._equations.corners(x).ravel()

    def _residual(self, x: np.ndarray) -> tuple[np.ndarray, float] | None:
        """As of `Equations` (n - 1,), without the balance that gives the load, and the load [N m]."""
        left = self._equations.residual(x)
        if left is None or not np.all(np.isfinite(left)):
            return None
        belt = self._equations.belt
        return np.delete(left, MOMENT), float(belt.load + left[MOMENT] * belt.driven_inertia / belt.ratio)

    def _slopes(self, x: np.ndarray, pressed: np.ndarray) -> csr_array | None:
        """Slopes of the residual (n - 1, n) about x, with a set of pressed cells; None: it has no value."""
        if self._residual(x) is None:
            return None
        slopes = self._equations.jacobian(x, pressed=pressed.reshape(2, -1)).tocsr()
        return slopes[np.delete(np.arange(slopes.shape[0]), MOMENT)]

    def _factors(self, slopes: csr_array | None, along: np.ndarray) -> Any:
        """Factors of slopes, below them a direction over the unknowns' sizes; None: it has none."""
        if slopes is None:
            return None
        matrix = vstack([slopes, csr_array((along / self._equations.sizes)[np.newaxis])], format="csc")
        if not np.all(np.isfinite(matrix.data)):
            return None
        try:
            return splu(matrix)
        except RuntimeError:  # exactly singular
            return None

    def _tangent(self, slopes: csr_array | None, near: np.ndarray) -> np.ndarray | None:
        """Direction of the curve over the unknowns' sizes, of mean square 1, nearer to another one."""
        if (factors := self._factors(slopes, near)) is None:
            return None
        last = np.zeros(near.size)
        last[-1] = 1.0
        found = factors.solve(last) / self._equations.sizes
        return np.asarray(found / np.sqrt(np.mean(found**2)))

    def _strain_of(self, corner: int) -> np.ndarray:
        """Direction (n,) in which the strain of a corner's cell changes alone."""
        count = self._equations.belt.cell.size
        found = np.zeros(self._equations.sizes.size)
        found[count + corner % count] = 1.0
        return found

    def _rates(self, x: np.ndarray, tangent: np.ndarray, margin: np.ndarray, over: float) -> np.ndarray:
        """Change (2 N,) of the distances from all corners along the curve, over the step."""
        return (self._corners(x + over * tangent * self._equations.sizes) - margin) / over

    def _next_corner(
        self,
        x: np.ndarray,
        tangent: np.ndarray,
        margin: np.ndarray,
        pressed: np.ndarray,
        passed: int,
        step: float,
    ) -> tuple[int, float]:
        """Corner that the tangent meets first, but for the one just passed, and the step to there."""
        rates = self._rates(x, tangent, margin, min(step, PROBE))
        nears = np.where(pressed, rates < 0.0, rates > 0.0)
        distances = np.full(margin.size, np.inf)
        distances[nears] = np.maximum(-margin[nears] / rates[nears], 0.0)
        if passed >= 0:
            distances[passed] = np.inf
        corner = int(np.argmin(distances))
        return corner, float(distances[corner])

    def _corrected(
        self,
        x: np.ndarray,
        tangent: np.ndarray,
        step: float,
        slopes: csr_array | None,
        across: np.ndarray,
        pressed: np.ndarray,
    ) -> tuple[np.ndarray, float, int] | None:
        """State in a plane, across a direction, at a step along the tangent; its load, and the corrections.

        First by the slopes at x, then by their own, as where flanks meet or part on the way.
        """
        found = x + step * tangent * self._equations.sizes
        for factorisation in range(FACTORISATIONS):
            factors = self._factors(slopes if factorisation == 0 else self._slopes(found, pressed), across)
            if factors is None:
                return None
            for correction in range(CORRECTIONS):
                if (residual := self._residual(found)) is None:
                    return None
                change = -factors.solve(np.append(residual[0], 0.0))
                if not mean_size(self._equations, change) < FAR:  # SuperLU crashes on slopes out there
                    return None
                found = found + change
                if mean_size(self._equations, change) < self._tolerance:
                    if (last := self._residual(found)) is None:
                        return None
                    return found, last[1], factorisation * CORRECTIONS + correction + 1
        return None
