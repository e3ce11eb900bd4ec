"""Which unknowns of the flat belt act on which rates, and the Jacobian by few evaluations that follows.

For integrators that can use it: SciPy's BDF and Radau factorise it as a sparse matrix. It is sparse but for
the sheaves, whose deformation lets each displacement of a wrap act on every force of that wrap.
"""

import numpy as np
from scipy.sparse import csc_array

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.one_system import ROWS, FlatBelt, carried_places, rates, system
from cvt_hpc.steppers.system import RELATIVE_INCREMENT

SPEED, OPENING = -1, -2  # of the driven pulley, beside the rows of the state

# rate: {unknown: stations behind it (negative) to stations ahead of it that act on it}
REACH = {
    f.W: {f.U: (0, 0)},
    f.U: {
        f.W: (-2, 2),
        f.U: (-1, 1),
        f.V_ELEMENT: (-1, 1),
        f.V_RING: (-1, 1),
        f.V_FILTERED: (0, 0),
        f.N_ELEMENT: (-1, 0),
        f.N_RING: (-1, 0),
    },
    f.V_ELEMENT: {
        f.W: (-1, 1),
        f.U: (-1, 1),
        f.V_ELEMENT: (-1, 1),
        f.V_RING: (0, 0),
        f.V_FILTERED: (0, 0),
        f.N_ELEMENT: (-1, 0),
        f.N_RING: (-1, 0),
    },
    f.V_RING: {f.W: (-1, 1), f.U: (-1, 1), f.V_ELEMENT: (0, 0), f.V_RING: (-1, 1), f.N_RING: (-1, 0)},
    f.N_ELEMENT: {f.W: (-1, 2), f.V_ELEMENT: (0, 1), f.N_ELEMENT: (-1, 1)},
    f.N_RING: {f.W: (-1, 2), f.V_RING: (0, 1), f.N_RING: (-1, 1)},
}
# With a column that bears a moment, which knows strains and turning of the cells around
OF_COLUMN = {f.U: {f.N_ELEMENT: (-2, 1)}, f.V_ELEMENT: {f.W: (-2, 2)}}
# With elements that tilt by the rings' friction, which acts on both layers
OF_TILT = {
    f.V_ELEMENT: {f.ELEMENT_TILT: (0, 0)},
    f.V_RING: {f.ELEMENT_TILT: (0, 0)},
    f.ELEMENT_TILT: REACH[f.V_RING] | {f.V_RING: (0, 0), f.ELEMENT_TILT: (-1, 0)},
}
# A station's flank forces and filtered speed: beyond the above they depend on the driven pulley, the filtered
# speed where contact begins on sliding at the open station behind, and on where that is, by the forces
ON_FLANK = {f.U: (-1, 0), f.V_ELEMENT: (-1, 0), f.W: (-2, 1), f.V_FILTERED: (-1, 0)}


def pattern(flat: FlatBelt) -> csc_array:
    """Return the places at which the Jacobian of `flat.rates` may differ from 0, (n, n) bool."""
    belt = flat.belt
    n, count = belt.cell.size, flat.origin.size
    place = {row: k * n + np.arange(n) for k, row in enumerate(ROWS)}
    place |= carried_places(flat)
    place[SPEED], place[OPENING] = np.array([count - 2]), np.array([count - 1])
    found = np.zeros((count, count), dtype=bool)

    def mark(row: int, unknown: int, stations: np.ndarray, offsets: range) -> None:
        for offset in offsets:
            rows, columns = place[row][stations], place[unknown][(stations + offset) % n]
            known = (rows >= 0) & (columns >= 0)
            found[rows[known], columns[known]] = True

    for reach in (REACH, *[OF_COLUMN] * belt.has_column, *[OF_TILT] * belt.tilts):
        for row, reaches in reach.items():
            for unknown, (behind, ahead) in reaches.items():
                mark(row, unknown, np.arange(n), range(behind, ahead + 1))
    for arc, is_driven in ((belt.driving_stations, False), (belt.driven_stations, True)):
        for row in (f.U, f.V_ELEMENT, f.V_FILTERED):
            for unknown, (behind, ahead) in ON_FLANK.items():
                mark(row, unknown, arc, range(behind, ahead + 1))
        remembered = place[f.V_FILTERED][arc]
        remembered = remembered[remembered >= 0]
        pushed = [place[f.U][arc], place[f.V_ELEMENT][arc], remembered]
        moved = [place[f.W][arc]]
        if is_driven:
            pushed += [place[SPEED], place[OPENING]]
            moved += [place[OPENING]]
            found[np.concatenate(pushed), place[SPEED]] = True
            rim = [place[row] for row in (f.W, f.U, f.V_ELEMENT)]
            near = np.arange(arc[0] - 1, arc[-1] + 2) % n
            found[np.ix_(place[SPEED], np.concatenate([row[near] for row in rim]))] = True
            found[np.ix_(place[SPEED], remembered)] = True
        found[np.ix_(np.concatenate(pushed), np.concatenate(moved))] = True
    # states of free pulleys know both wraps, and all of those know them
    if flat.loose.size > 0:
        loose = count - 2 - flat.loose.size
        found[:, loose:] = found[loose:] = True
    return csc_array(found)


def groups(pattern: csc_array) -> np.ndarray:
    """A group for each column, (n,) int, such that no two columns of a group act on the same rate."""
    n = pattern.shape[1]
    rows = [pattern.indices[pattern.indptr[j] : pattern.indptr[j + 1]] for j in range(n)]
    taken: list[np.ndarray] = []
    found = np.zeros(n, dtype=int)
    for j in sorted(range(n), key=lambda j: -rows[j].size):
        free = [group for group, used in enumerate(taken) if not used[rows[j]].any()]
        if not free:
            free = [len(taken)]
            taken.append(np.zeros(pattern.shape[0], dtype=bool))
        found[j] = free[0]
        taken[found[j]][rows[j]] = True
    return found


class SparseJacobian:
    """Jacobian of `flat.rates` by difference quotients, several columns at once.

    `evaluations` counts those of the rates so far.
    """

    def __init__(self, flat: FlatBelt) -> None:
        self._flat = flat
        self._pattern = pattern(flat)
        self._scale = system(flat).scale
        self._rows = self._pattern.indices
        self._columns = np.repeat(np.arange(self._scale.size), np.diff(self._pattern.indptr))
        self._groups = groups(self._pattern)
        self.evaluations = 0

    def __call__(self, t: float, y: np.ndarray) -> csc_array:
        """Jacobian at a state, (n, n); not a number where a rate has no value."""
        base, values = self._rates(t, y), np.empty(self._rows.size)
        increments = RELATIVE_INCREMENT * np.maximum(np.abs(y), self._scale)
        for group in range(self._groups.max() + 1):
            moved = np.where(self._groups == group, y + increments, y)
            change = self._rates(t, moved) - base
            mine = self._groups[self._columns] == group
            columns = self._columns[mine]
            values[mine] = change[self._rows[mine]] / (moved - y)[columns]
        return csc_array((values, self._rows, self._pattern.indptr), shape=self._pattern.shape)

    def _rates(self, t: float, y: np.ndarray) -> np.ndarray:
        out = np.empty_like(y)
        self.evaluations += 1
        if not rates(self._flat, t, y, out):
            out[:] = np.nan
        return out
