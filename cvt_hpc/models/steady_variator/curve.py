"""The curve of steady states over all loads, followed along its arc from corner to corner.

Under a given load there may be one steady state, several or none. At the torque that friction carries the
states turn back. Where gaps open in a driving wrap they turn back for every cell that opens, and where no
strand pushes the play passes from one place to the other while the load hardly changes. So neither the load
nor the driven speed separates states, and the arc of their curve does.

Between two corners, at which elements of a cell meet or part, the curve is smooth: its tangent is the null
vector of the Jacobian without the driven pulley's balance of moments, sum of the flanks' moments = i M, which
gives the load M. At a corner the curve goes on in the direction that brings that cell to its other side
(continuation of a piecewise smooth curve; Allgower and Georg, Numerical continuation methods, 1990, ch. 15).
"""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csc_array, csr_array, vstack
from scipy.sparse.linalg import splu

from cvt_hpc.models.steady_variator.equations import MOMENT, SPEED, Equations
from cvt_hpc.models.steady_variator.newton import mean_size

# Steps, as the root mean square of the unknowns over their sizes: first, longest, and shortest that is tried
FIRST, LONGEST, SHORTEST = 1e-3, 0.1, 1e-12
PROBE = 1e-4  # at the most, of the step over which a corner's distance is linear
CORRECTIONS, FACTORISATIONS = 4, 3  # at most: by one factorisation, and of these in a step
EASY = 3  # with so few corrections the next step is twice as long
MOST = 1500  # steps of a curve
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
        self._open = 0.0

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
        slopes = self._slopes(x, pressed)
        ahead = np.zeros(x.size)
        ahead[SPEED] = sign
        tangent, step, passed = self._tangent(slopes, ahead), FIRST, -1
        for _ in range(MOST):
            corner, distance = self._next_corner(x, tangent, margin, pressed, passed, step)
            meets = distance < step
            taken = distance if meets else step
            # beyond a corner the strain of its cell may change a thousand times as fast: it leads there
            across = tangent if passed < 0 else self._strain_of(passed)
            found = self._corrected(x, tangent, taken, slopes, across, pressed)
            if found is not None:
                reached, corrections = found
                there = self._corners(reached)
                crossed = ((there > 0.0) != pressed) & ((margin > 0.0) == pressed) & (np.abs(there) > NEAR)
                if meets:
                    crossed[corner] = False
            if found is None or (crossed.any() and taken > SHORTEST):
                step = 0.25 * taken
                if step < SHORTEST:
                    return
                continue
            x, margin, passed, before = reached, there, -1, tangent
            inside = margin[corner] if pressed[corner] else -margin[corner]
            meets = meets and inside < NEAR  # otherwise the next step meets it
            if meets:
                pressed = pressed.copy()
                pressed[corner] = not pressed[corner]
                passed = corner
            elif corrections <= EASY:
                step = min(2.0 * step, LONGEST)
            slopes = self._slopes(x, pressed)
            try:
                tangent = self._tangent(slopes, before)
            except RuntimeError:  # exactly singular
                return
            if meets and (self._rates(x, tangent, margin, PROBE)[corner] > 0.0) != pressed[corner]:
                tangent = -tangent
            yield x, self._load

    def _corners(self, x: np.ndarray) -> np.ndarray:
        """Distances from all corners, (2 N,)."""
        return self._equations.corners(x).ravel()

    @property
    def _load(self) -> float:
        """Torque at the driving pulley that belongs to the last residual [N m]."""
        belt = self._equations.belt
        return belt.load + self._open * belt.driven_inertia / belt.ratio

    def _residual(self, x: np.ndarray) -> np.ndarray | None:
        """As of `Equations`, without the balance that gives the load; None where it has no value."""
        left = self._equations.residual(x)
        if left is None or not np.all(np.isfinite(left)):
            return None
        self._open = float(left[MOMENT])
        return np.delete(left, MOMENT)

    def _slopes(self, x: np.ndarray, pressed: np.ndarray) -> csr_array:
        """Slopes of the residual (n - 1, n) about x, with a set of pressed cells."""
        self._residual(x)
        slopes = self._equations.jacobian(x, pressed=pressed.reshape(2, -1)).tocsr()
        return slopes[np.delete(np.arange(slopes.shape[0]), MOMENT)]

    def _bordered(self, slopes: csr_array, along: np.ndarray) -> csc_array:
        """Slopes, and below them a direction over the unknowns' sizes."""
        return vstack([slopes, csr_array((along / self._equations.sizes)[np.newaxis])], format="csc")

    def _tangent(self, slopes: csr_array, near: np.ndarray) -> np.ndarray:
        """Direction of the curve over the unknowns' sizes, of mean square 1, nearer to another one."""
        last = np.zeros(near.size)
        last[-1] = 1.0
        found = splu(self._bordered(slopes, near)).solve(last) / self._equations.sizes
        return found / np.sqrt(np.mean(found**2))

    def _strain_of(self, corner: int) -> np.ndarray:
        """Direction (n,) in which the strain of a corner's cell changes alone."""
        count = self._equations.belt.cell.size
        found = np.zeros(self._equations.sizes.size)
        found[count + corner % count] = 1.0
        return found

    def _rates(self, x: np.ndarray, tangent: np.ndarray, margin: np.ndarray, over: float) -> np.ndarray:
        """Change (N,) of the cells' squeeze along the curve, per step."""
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
        slopes: csr_array,
        across: np.ndarray,
        pressed: np.ndarray,
    ) -> tuple[np.ndarray, int] | None:
        """State in a plane, across a direction, at a step along the tangent; corrections to it.

        First by the slopes at x, then by their own, as where flanks meet or part on the way.
        """
        found = x + step * tangent * self._equations.sizes
        for factorisation in range(FACTORISATIONS):
            try:
                factors = splu(self._bordered(slopes, across))
            except RuntimeError:  # exactly singular
                return None
            for correction in range(CORRECTIONS):
                residual = self._residual(found)
                if residual is None:
                    return None
                change = -factors.solve(np.append(residual, 0.0))
                found = found + change
                if mean_size(self._equations, change) < self._tolerance:
                    done = factorisation * CORRECTIONS + correction + 1
                    return None if self._residual(found) is None else (found, done)
            if self._residual(found) is None:
                return None
            slopes = self._slopes(found, pressed)
        return None
