"""Jacobian of the belt's rates about a state: local slopes by difference quotients, the contact exactly.

A rate knows its neighbours up to two stations away, but for two things: the axial forces, which the sheaves'
deformation ties to every displacement of a wrap, and the driven pulley. So the forces count as unknowns of
their own: stations five apart can then be moved together, and some ninety evaluations give all slopes. With
the set of closed stations the forces follow from the gaps by a linear system, df = -C^-1 dg.
"""

from __future__ import annotations

import numpy as np
from scipy.sparse import csc_array

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt.belt import DRIVEN_SPEED, FIELDS, V_FILTERED, W
from cvt_hpc.models.elastic_belt.one_system import (
    ROWS,
    SIZE_OF_SPEED,
    SIZES,
    FlatBelt,
    rates_under_forces,
    set_inlets,
)
from cvt_hpc.physics.compliance import CLOSED
from cvt_hpc.physics.sheaves import flexibility

REACH = 2  # stations to either side that a rate knows of
STRIDE = 2 * REACH + 1
FORCE = MOMENT = len(FIELDS)  # beside the fields: among what acts, and among what is acted on
SIZE_OF_FORCE = 1e5  # [N/m]
# Relative to the sizes, for central differences: the third derivative's part is 1e-12 of a slope, round-off
# 1e-10 of the steepest slopes.
INCREMENT = 1e-6
INCREMENTS = INCREMENT * np.array([*(SIZES[row] for row in range(len(FIELDS))), SIZE_OF_FORCE])


@kernel
def local_slopes(flat: FlatBelt, increments: np.ndarray, near: np.ndarray, turning: np.ndarray) -> None:
    """Slopes of all rates with the axial forces held, about `flat.state` under `flat.force`.

    Parameters
    ----------
    flat : FlatBelt
        The belt and its state, left as they are.
    increments : (8,) array
        Of the fields and the axial force.
    near : (8, 8, N, 5) array
        Result: slope of rate o (of the fields; the moment on the driven pulley) at station j + d - 2 with
        unknown i (the fields; the axial force) at station j, in [o, i, j, d].
    turning : (8, N) array
        Result: slopes of rates and moments with the driven pulley's speed.
    """
    n, fields, scalars = flat.belt.cell.size, flat.state.fields, flat.state.scalars
    origin, force, speed = fields.copy(), flat.force.copy(), scalars[DRIVEN_SPEED]
    ahead, behind = np.zeros((8, n)), np.zeros((8, n))
    # around the ring in strides of five stations, but the first n % 5 of six
    longer = n % STRIDE * (STRIDE + 1)
    groups = np.array([j % (STRIDE + 1) if j < longer else (j - longer) % STRIDE for j in range(n)])
    for i in range(8):
        moved, unmoved = (flat.force, force) if i == FORCE else (fields[i], origin[i])
        for group in range(STRIDE + (longer > 0)):
            chosen = np.flatnonzero(groups == group)
            for sign, out in ((1.0, ahead), (-1.0, behind)):
                fields[:] = origin
                for j in chosen:
                    moved[j] = unmoved[j] + sign * increments[i]
                _evaluate(flat, out)
                moved[:] = unmoved
            for j in chosen:
                for d in range(STRIDE):
                    k = (j + d - REACH) % n
                    for o in range(8):
                        near[o, i, j, d] = (ahead[o, k] - behind[o, k]) / (2.0 * increments[i])
    for sign, out in ((1.0, ahead), (-1.0, behind)):
        scalars[DRIVEN_SPEED] = speed + sign * INCREMENT * SIZE_OF_SPEED
        _evaluate(flat, out)
    turning[:] = (ahead - behind) / (2.0 * INCREMENT * SIZE_OF_SPEED)
    scalars[DRIVEN_SPEED] = speed
    set_inlets(flat)


@kernel
def _evaluate(flat: FlatBelt, out: np.ndarray) -> None:
    set_inlets(flat)
    rates_under_forces(flat)
    out[:MOMENT], out[MOMENT] = flat.rate, flat.moments
    out[MOMENT, : flat.belt.driven_start] = 0.0


class Linearisation:
    """Jacobians of the rates of belts that differ in neither mesh nor sheaves.

    Parameters
    ----------
    flat : FlatBelt
        One of them.
    """

    def __init__(self, flat: FlatBelt) -> None:
        belt = flat.belt
        n, self._count = belt.cell.size, flat.origin.size
        self._arcs = [
            first + np.arange(sheave.weight.size)
            for first, sheave in ((0, belt.driving), (belt.driven_start, belt.driven))
        ]
        place = np.full((len(FIELDS) + 1, n), -1)
        for k, row in enumerate(ROWS):
            place[row] = k * n + np.arange(n)
        place[V_FILTERED, flat.remembering] = len(ROWS) * n + np.arange(flat.remembering.size)
        unknown = place.copy()
        unknown[FORCE, np.concatenate(self._arcs)] = self._count + np.arange(sum(map(len, self._arcs)))
        o, i, j, d = np.indices((8, 8, n, STRIDE))
        place[MOMENT] = self._count - 2
        place[W] = -1
        rows, columns = place[o, (j + d - REACH) % n], unknown[i, j]
        self._known = (rows >= 0) & (columns >= 0)
        self._rows, self._columns = rows[self._known], columns[self._known]
        self._turned = place >= 0
        self._turned_rows = place[self._turned]
        self._flexibility = [flexibility(belt.driving), flexibility(belt.driven)]
        self._near, self._turning = np.zeros(o.shape), np.zeros((8, n))

    def __call__(self, flat: FlatBelt) -> csc_array:
        """Jacobian of `flat.rates`, (n, n), about the state of its last call."""
        belt, count, n = flat.belt, self._count, flat.belt.cell.size
        local_slopes(flat, INCREMENTS, self._near, self._turning)
        self._near[MOMENT] /= belt.driven_inertia
        self._turning[MOMENT] /= belt.driven_inertia
        driven = self._arcs[1].size
        forces = sum(map(len, self._arcs))
        stations = np.arange(n)
        entries = [
            (self._near[self._known], self._rows, self._columns),
            (self._turning[self._turned], self._turned_rows, np.full(self._turned_rows.size, count - 2)),
            (np.ones(n), stations, n + stations),  # w' = u
            (
                belt.driven.weight / belt.axial_damping,
                np.full(driven, count - 1),
                count + forces - driven + np.arange(driven),
            ),
        ]
        values, rows, columns = map(np.concatenate, zip(*entries, strict=True))
        there = values != 0.0
        slopes = csc_array((values[there], (rows[there], columns[there])), shape=(count, count + forces))
        return slopes[:, :count] + slopes[:, count:] @ self._forces(flat)

    def _forces(self, flat: FlatBelt) -> csc_array:
        """Slopes of the axial forces with the unknowns, with the closed stations of the last call."""
        entries, first = [], 0
        wedge = 2.0 * np.tan(flat.belt.half_wedge_angle)
        for arc, matrix, contact in zip(self._arcs, self._flexibility, flat.contacts, strict=True):
            closed = np.flatnonzero(contact.stations[:, CLOSED])
            stiffness = np.linalg.inv(matrix[np.ix_(closed, closed)])
            rows, columns = np.meshgrid(first + closed, arc[closed], indexing="ij")
            entries.append((-wedge * stiffness.ravel(), rows.ravel(), columns.ravel()))
            if first > 0:
                opening = np.full(closed.size, self._count - 1)
                entries.append((-stiffness.sum(axis=1), first + closed, opening))
            first += arc.size
        values, rows, columns = map(np.concatenate, zip(*entries, strict=True))
        return csc_array((values, (rows, columns)), shape=(first, self._count))
