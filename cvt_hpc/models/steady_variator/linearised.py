"""Jacobian of the belt's rates about a state: local slopes by difference quotients, the contact exactly.

A rate knows its neighbours up to two stations away, but for two things: the axial forces, which the sheaves'
deformation ties to every displacement of a wrap, and the pulleys. So the forces count as unknowns of
their own: stations five apart can then be moved together, and some ninety evaluations give all slopes. With
the set of closed stations the forces follow from the gaps by a linear system, df = -C^-1 dg. Pulleys know the
belt by eight numbers (`pulled_by`) alone, so their rows are the slopes with these times those of them.

A push that is nearly zero has a corner nearby, at which elements part. A difference quotient across it would
be a mean of both slopes, by which Newton's iteration moves between two sets of pressed elements for ever. So
slopes are taken on the state's own side of each corner, beyond the reach of the increments.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from scipy.sparse import csc_array, csr_array

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import one_system as one
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.rhs import strains
from cvt_hpc.physics import compliance
from cvt_hpc.physics.sheaves import flexibility
from cvt_hpc.solvers.arrays import copy

REACH = 2  # stations to either side that a rate knows of
STRIDE = 2 * REACH + 1
FORCE = MOMENT = -1  # after the fields: among the acting quantities, and among those acted on
_SIZE_OF_FORCE = 1e5  # [N/m]
# Relative to the sizes, for central differences: the third derivative's part is 1e-12 of a slope, round-off
# 1e-10 of the steepest slopes.
INCREMENT = 1e-6
BEYOND = 1.5  # of the farthest that one increment moves a push
_SIZES_OF_PULL = np.array([100.0, 100.0, *[1e4] * 6])  # of `pulled_by` [N m], [N]


@kernel
def _local_slopes(flat: one.FlatBelt, increments: np.ndarray, near: np.ndarray, turning: np.ndarray) -> None:
    """Set slopes of all rates with the axial forces held, about `flat.state` under `flat.force`.

    `increments` are those of the K fields and axial force: 8, or 9 where elements tilt. Result in `near`, (K,
    K, N, 5): slope of rate o (of the fields; the moment on the driven pulley) at station j + d - 2 with
    unknown i (the fields; the axial force) at station j, in [o, i, j, d]; in `turning`, (K, N): slopes of
    rates and moments with the driven pulley's speed.
    """
    n, fields, count = flat.belt.cell.size, flat.state.fields, increments.size
    origin, force = fields.copy(), flat.force.copy()
    ahead, behind = np.zeros((count, n)), np.zeros((count, n))
    # around the ring in strides of five stations, but the first n % 5 of six
    longer = n % STRIDE * (STRIDE + 1)
    groups = np.array([j % (STRIDE + 1) if j < longer else (j - longer) % STRIDE for j in range(n)])
    for i in range(count):
        moved, unmoved = (flat.force, force) if i == count - 1 else (fields[i], origin[i])
        for group in range(STRIDE + (longer > 0)):
            chosen = np.flatnonzero(groups == group)
            for sign, out in ((1.0, ahead), (-1.0, behind)):
                for row in range(fields.shape[0]):
                    copy(origin[row], fields[row])
                for j in chosen:
                    moved[j] = unmoved[j] + sign * increments[i]
                _evaluate(flat, out)
                copy(unmoved, moved)
            for j in chosen:
                for d in range(STRIDE):
                    k = (j + d - REACH) % n
                    for o in range(count):
                        near[o, i, j, d] = (ahead[o, k] - behind[o, k]) / (2.0 * increments[i])
    _slopes_with_scalar(flat, f.DRIVEN_SPEED, one.SIZE_OF_SPEED, turning)


@kernel
def _slopes_with_scalar(flat: one.FlatBelt, place: int, size: float, slopes: np.ndarray) -> None:
    """Slopes of all rates and moments with one of the state's scalars, forces held, into `slopes` (K, N)."""
    ahead, behind = np.zeros(slopes.shape), np.zeros(slopes.shape)
    scalars = flat.state.scalars
    unmoved = scalars[place]
    for sign, out in ((1.0, ahead), (-1.0, behind)):
        scalars[place] = unmoved + sign * INCREMENT * size
        _evaluate(flat, out)
    for o in range(slopes.shape[0]):
        for j in range(slopes.shape[1]):
            slopes[o, j] = (ahead[o, j] - behind[o, j]) / (2.0 * INCREMENT * size)
    scalars[place] = unmoved


@kernel
def _evaluate(flat: one.FlatBelt, out: np.ndarray) -> None:
    one.rates_under_forces(flat)
    for row in range(out.shape[0] - 1):
        copy(flat.rate[row], out[row])
    for j in range(flat.moments.size):
        out[MOMENT, j] = flat.moments[j] * (flat.belt.on_driven[j] if flat.loose.size == 0 else 1.0)


@kernel
def _pulley_slopes(flat: one.FlatBelt, pull: np.ndarray, sizes: np.ndarray) -> np.ndarray:
    """Slopes of `free_rates`, (10, 18): with `pulled_by`, driven speed, driven position, and STATES.

    `sizes` (18,) are those of the acting quantities, from which increments follow.
    """
    scalars, found = flat.state.scalars, np.zeros((10, sizes.size))
    for k in range(sizes.size):
        increment = INCREMENT * sizes[k]
        for sign in (1.0, -1.0):
            moved = pull.copy()
            place = f.DRIVEN_SPEED if k == 8 else f.DRIVEN_POSITION if k == 9 else f.FIRST_STATE + k - 10
            unmoved = scalars[place]
            if k < 8:
                moved[k] += sign * increment
            else:
                scalars[place] = unmoved + sign * increment
            rates = one.free_rates(flat.belt, flat.state, moved)
            for o in range(rates.size):
                found[o, k] += sign * rates[o] / (2.0 * increment)
            scalars[place] = unmoved
    return found


def corners(belt: Belt, state: State) -> np.ndarray:
    """Distances (2, N) of the cells from two corners of their push [1].

    The first is the strain by which elements push on each other, dampers included; the second that without
    them, which holds the strands and arcs. Elements are pressed where they are positive. Where elements rock
    on their edges (`column_bending`) both are those of the pitch line, not of the edge.
    """
    _, eps, damped = _strained(belt, state)
    u, v = state.fields[[f.U, f.V_ELEMENT]]
    opening = (np.roll(v, -1) - v) / belt.cell + 0.5 * belt.curvature * (u + np.roll(u, -1))
    return np.array([-eps - damped * opening, -eps])


def rates_beyond_corners(belt: Belt, state: State, pressed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return what the rates of u and v_element lack where pushes go on beyond their corners, (N,) [m/s^2].

    With them the rates are those of a belt whose pressed cells, (2, N) as of `corners`, pull, and whose other
    cells do not push, on either side of their corners: smooth there, and the belt's own where each cell is on
    its side. They are zeros where elements rock, whose corners these are not.
    """
    if belt.has_column:
        return np.zeros(belt.cell.size), np.zeros(belt.cell.size)
    distances = corners(belt, state)
    damped, held = belt.element_stiffness * (np.where(pressed, distances, 0.0) - np.maximum(distances, 0.0))
    w = state.fields[f.W]
    turned = held * (np.roll(w, -1) - w) / belt.cell
    bent = 0.5 * damped * belt.cell * belt.curvature
    across = bent + np.roll(bent, 1) - (turned - np.roll(turned, 1))
    along = np.roll(damped, 1) - damped
    return across / (belt.dual * belt.mass), along / (belt.dual * belt.element_mass)


def _strained(belt: Belt, state: State) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lengths of the cells [1], strains of elements [1], dampers over stiffness [s], each (N,)."""
    both = np.empty((2, belt.cell.size))
    strains(belt, state.fields, both)
    eps = both[0]
    stiffness = np.where(eps < 0.0, belt.element_stiffness, belt.bridging_stiffness)
    return (1.0 + eps) * state.fields[f.N_ELEMENT], eps, belt.element_damping / stiffness


def joined(entries: Iterable[Sequence[np.ndarray]], zeros: bool = False) -> tuple[np.ndarray, tuple]:
    """Values with rows and columns, as sparse arrays take them, of such triples; with `zeros` or without."""
    values, rows, columns = map(np.concatenate, zip(*entries, strict=True))
    kept = np.flatnonzero((values != 0.0) | zeros)
    return values[kept], (rows[kept], columns[kept])


class Linearisation:
    """Jacobians of the rates of belts that differ in neither mesh nor sheaves; `flat` is one of them."""

    def __init__(self, flat: one.FlatBelt) -> None:
        belt = flat.belt
        n, self._count = belt.cell.size, flat.origin.size
        self._arcs = [belt.driving_stations, belt.driven_stations]
        fields = len(flat.state.fields)
        sizes = [*(one.SIZES[row] for row in range(fields)), _SIZE_OF_FORCE]
        self._increments = INCREMENT * np.array(sizes)
        place = np.full((fields + 1, n), -1)
        for k, row in enumerate(one.ROWS):
            place[row] = k * n + np.arange(n)
        for row, places in one.carried_places(flat).items():
            place[row] = places
        unknown = place.copy()
        unknown[FORCE, np.concatenate(self._arcs)] = self._count + np.arange(sum(map(len, self._arcs)))
        o, i, j, d = np.indices((fields + 1, fields + 1, n, STRIDE))
        self._loose = self._count - 2 - flat.loose.size + np.arange(flat.loose.size)
        place[MOMENT] = self._count - 2
        if flat.loose.size:  # torque taken from the driving pulley, and put into the driven one
            place[MOMENT] = self._count + belt.on_driven.astype(int)
        place[f.W] = -1
        rows, columns = place[o, (j + d - REACH) % n], unknown[i, j]
        self._known = (rows >= 0) & (columns >= 0)
        self._rows, self._columns = rows[self._known], columns[self._known]
        self._turned = place >= 0
        self._turned_rows = place[self._turned]
        self._flexibility = [flexibility(belt.driving), flexibility(belt.driven)]
        self._near, self._turning = np.zeros(o.shape), np.zeros((fields + 1, n))

    def __call__(self, flat: one.FlatBelt, pressed: np.ndarray | None = None) -> csc_array:
        """Return the Jacobian of `flat.rates`, (n, n), about the state of its last call.

        `pressed`, (2, N) bool, tells on which side of its `corners` each cell is taken to be; without it
        slopes are means across those within reach of the increments.
        """
        belt, count, n = flat.belt, self._count, flat.belt.cell.size
        contents = flat.state.fields[f.N_ELEMENT]
        own, force = contents.copy(), flat.force.copy()
        if pressed is not None:
            contents[:] = self._off_corners(belt, flat.state, pressed)
            # stations that all but open or close, whose memory is another one when open
            away = BEYOND * self._increments[FORCE]
            nearly = (force != 0.0) & (np.abs(force) < away)
            flat.force[nearly] = np.copysign(away, force[nearly])
        _local_slopes(flat, self._increments, self._near, self._turning)
        contents[:], flat.force[:] = own, force
        if self._loose.size:
            return self._of_free_pulleys(flat)
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
                belt.driven.weight * (flat.force[belt.driven_stations] > 0.0) / belt.axial_damping,
                np.full(driven, count - 1),
                count + forces - driven + np.arange(driven),
            ),
        ]
        slopes = csc_array(joined(entries), shape=(count, count + forces))
        return slopes[:, :count] + slopes[:, count:] @ self._forces(flat)

    def _off_corners(self, belt: Belt, state: State, pressed: np.ndarray) -> np.ndarray:
        """Contents (N,) of the elements' cells, which no increment brings across a corner [1]."""
        length, eps, damped = _strained(belt, state)
        distances = corners(belt, state)
        of_path = 0.5 * np.abs(belt.curvature)
        w, u, v, content = self._increments[[f.W, f.U, f.V_ELEMENT, f.N_ELEMENT]]
        strained = BEYOND * np.maximum(of_path * w, content)
        reached = np.maximum(strained, BEYOND * damped * np.maximum(of_path * u, v / belt.cell))
        sides = np.where(pressed, 1.0, -1.0)
        moved = np.zeros(eps.size)
        # the corner with its damper counts more, so it is the last
        for side, distance, reach in zip(sides[::-1], distances[::-1], (strained, reached), strict=True):
            moved += side * np.maximum(reach - side * (distance + moved), 0.0)
        eps -= moved
        return length / (1.0 + eps)

    def _of_free_pulleys(self, flat: one.FlatBelt) -> csc_array:
        """Jacobian where pulleys have states of their own."""
        belt, count, n = flat.belt, self._count, flat.belt.cell.size
        excess = np.zeros_like(self._turning)
        _slopes_with_scalar(flat, f.FIRST_STATE + f.EXCESS, one.SIZE_OF_SPEED, excess)
        width, stations = count + sum(map(len, self._arcs)), np.arange(n)
        entries = [
            (self._near[self._known], self._rows, self._columns),
            (np.ones(n), stations, n + stations),  # w' = u
        ]
        for slopes, column in ((self._turning, count - 2), (excess, self._loose[f.EXCESS])):
            rows = self._turned_rows
            entries.append((slopes[self._turned], rows, np.full(rows.size, column)))
        local = csr_array(joined(entries), shape=(count + 2, width))
        # actions on the pulleys, by the unknowns and the forces
        acting = np.zeros((18, width))
        acting[:2] = local[count:].toarray()
        first = count
        for wrap, (sheave, arc) in enumerate(zip((belt.driving, belt.driven), self._arcs, strict=True)):
            own, weight = slice(first, first + arc.size), sheave.weight * (flat.force[arc] > 0.0)
            acting[2 + wrap, own] = weight
            acting[4 + 2 * wrap : 6 + 2 * wrap, own] = weight * sheave.tilt
            first = own.stop
        own_rows = [count - 2, count - 1, *self._loose]
        acting[8 + np.arange(10), own_rows] = 1.0
        sizes = np.array([*_SIZES_OF_PULL, one.SIZE_OF_SPEED, one.SIZE_OF_POSITION, *one.SIZES_OF_STATES])
        found = _pulley_slopes(flat, one.pulled_by(belt, flat.force, flat.moments), sizes) @ acting
        place = csr_array((np.ones(10), (own_rows, np.arange(10))), shape=(count, 10))
        slopes = (local[:count] + place @ csr_array(found)).tocsc()
        return slopes[:, :count] + slopes[:, count:] @ self._forces(flat)

    def _forces(self, flat: one.FlatBelt) -> csc_array:
        """Slopes of the axial forces, and of open stations' pulls, with the closed stations of the last call.

        With gaps g of the rigid bodies those of closed stations are -C_cc^-1 g_c, and pulls c_e times
        -(g_o + C_oc f_c).
        """
        entries, first = [], 0
        wedge = 2.0 * np.tan(flat.belt.half_wedge_angle)
        wraps = zip(self._arcs, self._flexibility, flat.contacts, strict=True)
        for wrap, (arc, matrix, contact) in enumerate(wraps):
            sheave = flat.belt.driven if wrap else flat.belt.driving
            is_closed = contact.stations[:, compliance.CLOSED] > 0.5
            closed, opened = np.flatnonzero(is_closed), np.flatnonzero(~is_closed)
            slopes = np.zeros(matrix.shape)
            slopes[np.ix_(closed, closed)] = -np.linalg.inv(matrix[np.ix_(closed, closed)])
            slopes[opened, opened] = -sheave.element_stiffness
            slopes[np.ix_(opened, closed)] -= sheave.element_stiffness * (
                matrix[np.ix_(opened, closed)] @ slopes[np.ix_(closed, closed)]
            )
            rows = first + np.arange(arc.size)
            # of the stations' displacements, of the groove's opening, and of the states that open it
            acting = [(wedge * slopes * sheave.upright, rows[:, None], arc[None, :])]
            openings = [(np.ones(arc.size), self._count - 1)] if wrap else []
            if self._loose.size:
                openings += [] if wrap else [(np.ones(arc.size), self._loose[f.SHIFT])]
                tilted = self._loose[f.DRIVEN_COS if wrap else f.DRIVING_COS]
                openings += [(sheave.tilt[k], tilted + k) for k in range(2)]
            acting += [(slopes @ opening, rows, np.full(arc.size, column)) for opening, column in openings]
            entries += [[part.ravel() for part in np.broadcast_arrays(*entry)] for entry in acting]
            first += arc.size
        return csc_array(joined(entries), shape=(first, self._count))
