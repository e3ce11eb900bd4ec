"""The curve of steady states over all loads, followed along its arc from corner to corner.

Under a given load there may be one steady state, several or none. At the torque that friction carries the
states turn back. Where gaps open in a driving wrap they turn back for every cell that opens, and where no
strand pushes the play passes from one place to the other while the load hardly changes. So neither the load
nor the driven speed separates states, but the arc of their curve does.

Between two corners, at which elements of a cell meet or part, the curve is smooth: its tangent is the null
vector of the Jacobian without the driven pulley's balance of moments, sum of the flanks' moments = i M, which
gives the load M. There the equations are those of one set of pressed cells, whose pushes go on beyond their
corners, so that corrections do not see other corners nearby. A step that would cross one ends on it, and the
cell changes its side. The curve goes on in the direction in which the slopes above its tangent have a
determinant of the same sign as before: that holds along a smooth curve, where it turns back, and across
corners (Allgower and Georg, Numerical continuation methods, 1990, ch. 2 and 15).

A strand lets go in all of its cells at nearly one place: their pushes are alike but for the momentum of the
elements, some 1e-11 of strain. The order in which they part follows from these, so states are found to
round-off. Of corners that not even that tells apart the one that is met most steeply counts (ratio test of
Harris 1973), and its cell changes sides in place. One that does so twice is below round-off, and does not
count until the next state.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array, vstack
from scipy.sparse.csgraph import connected_components
from scipy.sparse.linalg import splu

from cvt_hpc.models.steady_variator.continuation import FAR, mean_size
from cvt_hpc.models.steady_variator.equations import MOMENT, SPEED, Equations

# Steps, as the root mean square of the unknowns over their sizes: first, longest, and shortest that is tried
FIRST, LONGEST, SHORTEST = 1e-3, 0.1, 1e-12
CORRECTIONS, FACTORISATIONS = 6, 3  # at most: by one factorisation, and of these in a step
_EASY = 5  # with so few corrections the next step is twice as long
MOST = 20  # steps of a curve, over the number of stations: default belt from 20 to 160 N m 7, at 80 stations
_SETS = 10  # of pressed cells, tried where a curve begins
# Of the last correction, by its root mean square (round-off leaves 1e-12), and what it leaves of a strain
CLOSE, NEAR = 1e-11, 1e-12
MOST_TURNS = 2  # of a cell's sides in place
NONE = -1  # in the place of a corner


class Piece(NamedTuple):
    """The curve about a state, with a set of pressed cells."""

    x: np.ndarray  # unknowns of the state, (n,)
    pressed: np.ndarray  # (2 N,) bool: the cells that are taken as pressed, on both of their corners
    factors: Any  # SuperLU of the residual's slopes with a direction below them
    # in which the residual does not change, (n,); over the unknowns' sizes, of mean square 1
    tangent: np.ndarray
    sense: float  # sign (1 or -1) of the determinant of these slopes above the tangent


class _Reached(NamedTuple):
    """A state that was corrected: its unknowns, its load [N m], and after how many corrections."""

    x: np.ndarray
    load: float
    corrections: int


class Curve:
    """Steady states of one belt, whose load in `equations` has no influence.

    The last correction is of `tolerance` at most, a root mean square over the unknowns' sizes. within(share)
    is the state with its load [N m] at a share of the last step, 0 to 1; None if not found.
    """

    def __init__(self, equations: Equations, tolerance: float) -> None:
        self._equations, self._tolerance = equations, tolerance
        # The arc leaves out the memories of friction, which jump where a station opens
        self._measured = np.ones(equations.sizes.size)
        self._measured[equations.memories] = 0.0
        self.within: Callable[[float], tuple[np.ndarray, float] | None] = lambda share: None

    def along(self, x: np.ndarray, sign: float) -> Iterator[tuple[np.ndarray, float]]:
        """Yield states with their loads [N m], as far as they are found, from the unknowns `x` of one.

        The driven speed rises (sign 1) or falls (-1) at first.
        """
        ahead = np.zeros(x.size)
        ahead[SPEED] = sign
        piece, step = self._begun(x, ahead), FIRST
        count = self._equations.belt.cell.size
        turns = np.zeros(2 * count, dtype=int)  # of each cell's sides, in place
        for _ in range(MOST * count):
            if piece is None:
                return
            told = turns < MOST_TURNS
            corner, distance = self._next_corner(piece, told)
            found = None
            if distance > 0.0:
                found, step, corner = self._stepped(piece, step, corner, distance, told)
            if found is not None:
                self.within = partial(self._within, piece, self._way(piece, found.x))
                turns[:] = 0
            elif corner == NONE:
                return
            else:
                turns[corner] += 1
            piece = self._next(piece, piece.x if found is None else found.x, corner)
            if found is not None:
                yield found.x, found.load

    def _within(self, piece: Piece, step: float, share: float) -> tuple[np.ndarray, float] | None:
        """State with its load at a share of a step."""
        found = self._corrected(piece, share * step)
        return None if found is None else (found.x, found.load)

    def _begun(self, x: np.ndarray, ahead: np.ndarray) -> Piece | None:
        """The curve about a state near x, to its own tolerance."""
        pressed = self._equations.corners(x).ravel() > 0.0
        for _ in range(_SETS):
            piece = self._piece(x, pressed, ahead)
            if piece is None or (found := self._corrected(piece, 0.0)) is None:
                return None
            wrong = self._inside(found.x, pressed) < -NEAR
            if not wrong.any():
                return piece._replace(x=found.x)
            x, pressed = found.x, pressed ^ wrong
        return None

    def _next(self, before: Piece, x: np.ndarray, corner: int) -> Piece | None:
        """The curve about the next state, beyond a corner that it is on."""
        pressed = before.pressed.copy()
        if corner != NONE:
            pressed[corner] = not pressed[corner]
        piece = self._piece(x, pressed, before.tangent)
        if piece is None or piece.sense == before.sense:
            return piece
        return piece._replace(tangent=-piece.tangent, sense=before.sense)

    def _stepped(
        self, piece: Piece, step: float, corner: int, distance: float, told: np.ndarray
    ) -> tuple[_Reached | None, float, int]:
        """Return the next state, the length of the step from there, and the corner on which it is.

        Without a state: the corner on which the piece is; or NONE, where no step succeeds. `corner` and
        `distance` are those of `_next_corner`; corners that count are `told`, (2 N,) bool.
        """
        meets = corner if distance < step else NONE
        taken = min(distance, step)
        before = self._inside(piece.x, piece.pressed)
        while taken > SHORTEST:
            found = self._corrected(piece, taken, meets)
            if found is None:
                step = taken = 0.25 * taken
                meets = NONE
                continue
            inside = self._inside(found.x, piece.pressed)
            inside[~told] = 0.0
            if meets != NONE:
                inside[meets] = 0.0
            if inside.min() >= -NEAR:
                easy = found.corrections <= _EASY and meets == NONE
                return found, min(2.0 * step, LONGEST) if easy else step, meets
            # onto the corner that was crossed first; from one that is as near as round-off nothing leads away
            crossed = inside < -NEAR
            there = np.where(crossed & (before <= NEAR), before - inside, 0.0)
            if there.any():
                return None, step, int(np.argmax(there))
            shares = np.full(inside.size, np.inf)
            shares[crossed] = before[crossed] / (before[crossed] - inside[crossed])
            meets = int(np.argmin(shares))
            taken *= float(shares[meets])
        return None, step, NONE

    def _inside(self, x: np.ndarray, pressed: np.ndarray) -> np.ndarray:
        """Distances (2 N,) that are left to the corners of a set of pressed cells."""
        return np.where(pressed, 1.0, -1.0) * self._equations.corners(x).ravel()

    def _rates(self, piece: Piece) -> np.ndarray:
        """Change (2 N,) of these distances along the tangent."""
        slopes = self._equations.corner_slopes(piece.x)
        return np.where(piece.pressed, 1.0, -1.0) * (slopes @ (piece.tangent * self._equations.sizes))

    def _next_corner(self, piece: Piece, told: np.ndarray) -> tuple[int, float]:
        """Corner that the tangent meets first, and the step to there; 0 if the piece is on it.

        Of those (2 N,) that count.
        """
        inside, nears = self._inside(piece.x, piece.pressed), -self._rates(piece)
        met = np.flatnonzero(told & (nears > 0.0))
        if met.size == 0:
            return NONE, np.inf
        inside, nears = np.maximum(inside[met], 0.0), nears[met]
        if (first := np.min((inside + NEAR) / nears)) > LONGEST:
            return NONE, np.inf
        together = inside / nears <= first
        steepest = int(np.argmax(np.where(together, nears, 0.0)))
        near = inside[steepest] <= NEAR
        return int(met[steepest]), 0.0 if near else float(inside[steepest] / nears[steepest])

    def _residual(self, x: np.ndarray, pressed: np.ndarray) -> tuple[np.ndarray, float] | None:
        """Return the residual of `Equations` without the balance that gives the load, and the load [N m]."""
        left = self._equations.residual(x, pressed.reshape(2, -1))
        if left is None or not np.all(np.isfinite(left)):
            return None
        belt = self._equations.belt
        return np.delete(left, MOMENT), float(belt.load + left[MOMENT] * belt.driven_inertia / belt.ratio)

    def _piece(self, x: np.ndarray, pressed: np.ndarray, near: np.ndarray) -> Piece | None:
        """The curve about x, its tangent nearer to another one; None: it has none."""
        if self._residual(x, pressed) is None:
            return None
        slopes = self._equations.jacobian(x, pressed=pressed.reshape(2, -1)).tocsr()
        slopes = slopes[np.delete(np.arange(slopes.shape[0]), MOMENT)]
        matrix = vstack([slopes, csr_array(self._across(near)[np.newaxis])], format="csc")
        if not np.all(np.isfinite(matrix.data)):
            return None
        try:
            factors = splu(matrix)
        except RuntimeError:  # exactly singular
            return None
        last = np.zeros(near.size)
        last[-1] = 1.0
        found = factors.solve(last) / self._equations.sizes
        size = np.sqrt(np.mean((found * self._measured) ** 2))
        return Piece(x, pressed, factors, found / size, determinant_sign(factors))

    def _across(self, tangent: np.ndarray) -> np.ndarray:
        """Slopes (n,) with the unknowns of the way along a tangent, times their number."""
        return tangent * self._measured / self._equations.sizes

    def _way(self, piece: Piece, x: np.ndarray) -> float:
        """Step along the tangent to the plane in which a state is."""
        return float(self._across(piece.tangent) @ (x - piece.x)) / x.size

    def _corrected(self, piece: Piece, step: float, corner: int = NONE) -> _Reached | None:
        """State from a step along the tangent: on a corner, or else in the plane across the tangent.

        First by the piece's factors, then by new ones, as where flanks meet or part on the way.
        """
        sizes, row = self._equations.sizes, self._across(piece.tangent)
        found, size, left = piece.x + step * piece.tangent * sizes, np.inf, 0.0
        for factorisation in range(FACTORISATIONS):
            if factorisation > 0:
                renewed = self._piece(found, piece.pressed, piece.tangent)
                if renewed is None:
                    return None
                piece = renewed
            along = piece.tangent * sizes
            for correction in range(CORRECTIONS):
                if (residual := self._residual(found, piece.pressed)) is None:
                    return None
                change = -piece.factors.solve(np.append(residual[0], 0.0))
                if corner != NONE:
                    left = self._equations.corners(found).ravel()[corner]
                    row = self._equations.corner_slopes(found)[[corner]].toarray()[0]
                change -= (left + row @ change) / (row @ along) * along
                before, size = size, mean_size(self._equations, change)
                if not size < FAR:  # SuperLU crashes on slopes out there
                    return None
                found = found + change
                if size < CLOSE or 0.5 * before < size < self._tolerance:
                    if (last := self._residual(found, piece.pressed)) is None:
                        return None
                    return _Reached(found, last[1], factorisation * CORRECTIONS + correction + 1)
                if size > before:
                    break
        return None


def determinant_sign(factors: Any) -> float:
    """Sign of the determinant of a matrix that SuperLU has factorised."""
    sign = float(np.prod(np.sign(factors.U.diagonal())))
    for places in (factors.perm_r, factors.perm_c):
        n = places.size
        cycles, _ = connected_components(csr_array((np.ones(n), (np.arange(n), places)), shape=(n, n)))
        sign *= (-1.0) ** (n - cycles)
    return sign
