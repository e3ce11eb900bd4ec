"""The model's own step: leapfrog of the dynamic coordinates, lag exactly, friction and layers implicit.

Staggered in time as `elastic_belt/imex.py`: displacements and contents at t_k, rates and speeds at t_k-1/2.
Forces are those of `rhs.accelerations`; their slopes with the speeds, that is of flank and saddle friction
and of the layers' stresses, hoop forces included, make the step linearly implicit. Other elastic forces
across the belt are explicit:

- dynamic coordinates, of inertia M: M (p' - p) / dt = force, a leapfrog;
- lagging ones: (1 - exp(-dt / T)) of the way to where they would rest, so dt q' = (1 - exp(-dt / T)) K^-1
  force, which is exact for the forces of a spring K, at any dt / T.

Both have one dense system with the slopes of friction, into which the layers' cyclic block-tridiagonal one
is eliminated (`coupled.py`). With the steady flow of eqs 29 and 30 each layer has one speed in the place of
N, and its contents follow by an implicit step of their own (`contents.py`).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt.belt import (
    DRIVEN_POSITION,
    DRIVEN_SPEED,
    FIRST_STATE,
    LAYER_WORK,
    N_ELEMENT,
    TIME,
    V_ELEMENT,
    V_FILTERED,
    V_RING,
    Belt,
    Mesh,
    State,
    U,
    W,
)
from cvt_hpc.models.elastic_belt.imex_stations import implicit_shares
from cvt_hpc.models.elastic_belt.imex_system import CENTRED, LARGEST_OVERLAP, element_stress
from cvt_hpc.models.elastic_belt.lane_forces import LEAST_SHARE_OF_WIDTH
from cvt_hpc.models.elastic_belt.one_system import driven_thrust, free_rates, pulled_by
from cvt_hpc.models.elastic_belt.rhs import (
    accelerations,
    contact_forces,
    damped_push,
    damping_at,
    driving_speed_at,
    fresh_contacts,
    load_at,
    memory_transport,
    ring_drag,
    sliding_speed,
    speed_share_at,
    strains,
)
from cvt_hpc.models.quasi_static_belt.basis import Basis
from cvt_hpc.models.quasi_static_belt.contents import settle_contents
from cvt_hpc.models.quasi_static_belt.coupled import Chain, chain, solve_chain, solve_dense
from cvt_hpc.physics.compliance import Contact
from cvt_hpc.physics.flank import flank_shares, flank_sliding
from cvt_hpc.physics.friction import friction_coefficient, saturation

MOST_PASSES = 9
# rows of Work.stations
(
    ACROSS,
    ALONG,
    ALONG_RING,
    RADIAL_SLOPE,
    CROSS_SLOPE,
    TANGENTIAL_SLOPE,
    RADIAL_SPEED,
    TANGENTIAL_SPEED,
    STIFFNESS_OF_SADDLE,
    SADDLE_SPEED,
    UNSTRESSED,
    MEETING,
    REVERSING,
    RING_REVERSING,
    ELEMENT_STRAIN_AHEAD,
    ELEMENT_STRESS,
    RING_STRESS,
    HOOP_STRESS,
    ELEMENT_HOOP,
    RING_HOOP,
) = range(20)


class SplitBelt(NamedTuple):
    """Constants of a run and its step.

    Attributes
    ----------
    belt : Belt
        As of the elastic belt.
    shapes : (N, D + L) array
        Dynamic shapes first.
    dynamic : int
        Their number D.
    step : float
        [s]
    inertia : (D + L, D + L) array
        M / dt of the dynamic ones, dt / (1 - exp(-dt / T)) K of the lagging ones [N s/m].
    gyration : (D + L, D + L) array
        Half of the gyroscopic matrix per belt speed, antisymmetric [N s^2/m^2].
    steady_flow : bool
        Each layer has one speed.
    drag : (2,) array
        Of the material against its layer's mean motion, with the steady flow [N s/m^2].
    share : (2, N) array
        The layers' mass at the stations over the layer's whole mass [1].
    """

    belt: Belt
    shapes: np.ndarray
    dynamic: int
    step: float
    inertia: np.ndarray
    gyration: np.ndarray
    steady_flow: bool
    drag: np.ndarray
    share: np.ndarray


class Motion(NamedTuple):
    """State of a run.

    Attributes
    ----------
    state : State
        As of the elastic belt; its u is what slides.
    q, p : (D + L,) arrays
        Coordinates [m] and their rates [m/s].
    contacts : pair of Contact
        Closed sets.
    force : (N,) array
        Axial line forces of `state` [N/m].
    eps : (2, N) array
        Strains of `state`.
    counts : (3,) int array
        Steps, steps done again, solves of the contact.
    """

    state: State
    q: np.ndarray
    p: np.ndarray
    contacts: tuple[Contact, Contact]
    force: np.ndarray
    eps: np.ndarray
    counts: np.ndarray


class Work(NamedTuple):
    """Work space: at the stations (20, N), rates (7, N), moments (N,); the layers; the dense system."""

    stations: np.ndarray
    rate: np.ndarray
    moments: np.ndarray
    layers: Chain
    matrix: np.ndarray
    row: np.ndarray
    found: np.ndarray
    vector: np.ndarray
    closing: np.ndarray


def lag_drag(belt: Belt, grid: Mesh, lag: float) -> np.ndarray:
    """Drag (2,) [N s/m^2] by which the longest wave of a layer settles with a time constant [s]."""
    longest = 2.0 * np.pi / grid.path.path_length
    return np.array([belt.element_stiffness, belt.ring_stiffness]) * longest**2 * lag


def layer_shares(belt: Belt) -> np.ndarray:
    """The layers' mass at the stations over the layer's whole mass, (2, N) [1]."""
    layers = np.array([np.full(belt.cell.size, belt.element_mass), belt.ring_mass]) * belt.dual
    return layers / layers.sum(axis=1, keepdims=True)


def split_belt(
    belt: Belt, grid: Mesh, basis: Basis, limit: float, longitudinal: str, step: float
) -> SplitBelt:
    """Constants of a run.

    Parameters
    ----------
    belt, grid, basis
        The belt, its mesh and its shapes.
    limit : float
        Limit frequency [Hz].
    longitudinal : str
        As the parameter of the job.
    step : float
        [s]
    """
    lag = 1.0 / (2.0 * np.pi * limit)
    shapes = np.ascontiguousarray(np.hstack([basis.dynamic, basis.lagging]))
    count, slow = shapes.shape[1], basis.dynamic.shape[1]
    inertia = np.zeros((count, count))
    inertia[:slow, :slow] = (basis.dynamic.T * (belt.mass * belt.dual)) @ basis.dynamic / step
    held = basis.lagging.T @ basis.stiffness @ basis.lagging
    inertia[slow:, slow:] = step / -np.expm1(-step / lag) * held
    difference = np.roll(np.eye(belt.cell.size), 1, axis=1) - np.roll(np.eye(belt.cell.size), -1, axis=1)
    # 2 m v u_s, a difference of the neighbours over both cells, times the length of the station: half of it
    gyration = 0.5 * belt.mass * shapes.T @ difference @ shapes
    return SplitBelt(
        belt,
        shapes,
        slow,
        step,
        inertia,
        np.ascontiguousarray(0.5 * (gyration - gyration.T)),
        longitudinal == "steady_flow",
        lag_drag(belt, grid, lag),
        layer_shares(belt),
    )


def work_space(model: SplitBelt) -> Work:
    """Work space of a step."""
    n, size = model.belt.cell.size, model.shapes.shape[1] + 2
    width = 8 * ((size + 1 + 7) // 8)
    return Work(
        np.zeros((20, n)),
        np.zeros((7, n)),
        np.zeros(n),
        chain(n, model.shapes.shape[1]),
        np.zeros((size, width)),
        np.zeros(model.shapes.shape[1]),
        np.zeros(size),
        np.zeros(model.shapes.shape[1]),
        np.zeros(8 * ((model.shapes.shape[1] + 3 + 7) // 8)),
    )


def motion(model: SplitBelt, state: State) -> Motion:
    """Motion nearest to a state: its displacement by the shapes, its speeds by the dynamic ones."""
    belt, weight = model.belt, np.sqrt(model.belt.dual)
    fields = state.fields.copy()
    q = np.linalg.lstsq(model.shapes * weight[:, None], weight * fields[W], rcond=None)[0]
    p, slow = np.zeros_like(q), model.dynamic
    if slow:
        p[:slow] = np.linalg.lstsq(model.shapes[:, :slow] * weight[:, None], weight * fields[U], rcond=None)[
            0
        ]
    fields[W], fields[U] = model.shapes @ q, model.shapes @ p
    found = State(fields, state.scalars.copy())
    n = belt.cell.size
    moved = Motion(
        found, q, p, fresh_contacts(belt), np.zeros(n), np.zeros((2, n)), np.zeros(3, dtype=np.int64)
    )
    refresh(model, moved)
    return moved


@kernel
def refresh(model: SplitBelt, moved: Motion) -> bool:
    """Strains and contact forces of the present state; whether the contact has a solution."""
    strains(model.belt, moved.state.fields, moved.eps)
    solves = contact_forces(model.belt, moved.state, moved.contacts, moved.force)
    moved.counts[2] += solves
    return solves > 0


@kernel
def march(model: SplitBelt, moved: Motion, work: Work, steps: int, noted: np.ndarray) -> bool:
    """Take some steps; False where the contact has no solution.

    `noted` (3, N) are u and the layers' speeds two steps before the end less twice those one step before.
    """
    fields = moved.state.fields
    for taken in range(steps):
        if taken >= steps - 2:
            is_first = taken == max(steps - 2, 0)
            weight = 0.0 if taken < steps - 1 else -2.0
            for k, row in enumerate((U, V_ELEMENT, V_RING)):
                for j in range(fields.shape[1]):
                    if is_first:
                        noted[k, j] = fields[row, j]
                    noted[k, j] += weight * fields[row, j]
        if not _step(model, moved, work):
            return False
        moved.counts[0] += 1
    return True


@kernel
def _step(model: SplitBelt, moved: Motion, work: Work) -> bool:
    belt, state = model.belt, moved.state
    accelerations(belt, state, moved.force, moved.eps, work.rate, work.moments)
    _forces(model, moved, work)
    for attempt in range(MOST_PASSES):
        _slopes(model, moved, work)
        _couple(model, moved, work)
        if not _again(model, moved, work):
            break
        moved.counts[1] += attempt == 0
    for row in (MEETING, REVERSING, RING_REVERSING):
        work.stations[row] = 0.0
    _advance(model, moved, work)
    return refresh(model, moved)


@kernel
def _forces(model: SplitBelt, moved: Motion, work: Work) -> None:
    """Forces at the stations [N] without those of the layers' stresses."""
    belt, stations, fields = model.belt, work.stations, moved.state.fields
    n, v0, v1 = belt.cell.size, fields[V_ELEMENT], fields[V_RING]
    for j in range(n):
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        push_left = damped_push(belt, moved.eps[0, a], (v0[j] - v0[a]) / belt.cell[a])
        push_right = damped_push(belt, moved.eps[0, j], (v0[b] - v0[j]) / belt.cell[j])
        pull = belt.ring_stiffness * (moved.eps[1, j] - moved.eps[1, a])
        pull += belt.ring_damping * ((v1[b] - v1[j]) / belt.cell[j] - (v1[j] - v1[a]) / belt.cell[a])
        dual = belt.dual[j]
        stations[ACROSS, j] = dual * belt.mass * work.rate[U, j]
        stations[ALONG, j] = dual * belt.element_mass * work.rate[V_ELEMENT, j] + (push_right - push_left)
        stations[ALONG_RING, j] = dual * belt.ring_mass[j] * work.rate[V_RING, j] - pull


@kernel
def _slopes(model: SplitBelt, moved: Motion, work: Work) -> None:
    """Slopes of friction with the speeds [N s/m], and the layers' blocks, links and stresses."""
    belt, state, stations, step = model.belt, moved.state, work.stations, model.step
    n, fields, eps = belt.cell.size, state.fields, moved.eps
    w, u, v0, v1 = fields[W], fields[U], fields[V_ELEMENT], fields[V_RING]
    sine, cosine = np.sin(belt.half_wedge_angle), np.cos(belt.half_wedge_angle)
    per_cosine, per_width = 1.0 / cosine, 1.0 / belt.friction_speed
    damping = damping_at(belt, state.scalars[TIME])
    speed_share = speed_share_at(belt, state.scalars[TIME])
    driving_speed = driving_speed_at(belt, state)
    blocks, links = work.layers.diagonal, work.layers.links
    for j in range(n):
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        dual, share = belt.dual[j], belt.arc_share[j]
        element, ring = belt.element_mass / step, belt.ring_mass[j] / step
        slope = (w[b] - w[a]) / (belt.cell[a] + belt.cell[j])
        v_radial = u[j] + v0[j] * slope
        radial_slope, cross, along_slope, stiff, lever = 0.5 * damping, 0.0, 0.0, 0.0, 1.0
        if share > 0.0:
            lever = 1.0 + belt.ring_offset * belt.arc_curvature[j]
            driven = j >= belt.driven_start
            turning = state.scalars[DRIVEN_SPEED] if driven else driving_speed
            v_tangential = v0[j] - turning * ((belt.driven_radius if driven else belt.driving_radius) + w[j])
            speed, meridian = flank_sliding(v_radial, v_tangential, per_cosine)
            v_law = speed if belt.friction_memory == 0.0 else fields[V_FILTERED, j]
            speed = max(speed, LEAST_SHARE_OF_WIDTH * belt.friction_speed)
            coefficient, _ = friction_coefficient(belt.law, v_law, moved.force[j] * per_cosine)
            factor, steepness = saturation(speed, per_width)
            climb, run = meridian / speed, v_tangential / speed
            axial_share, _ = flank_shares(coefficient * factor, climb, sine, cosine)
            twice_normal = 2.0 * share * moved.force[j] / axial_share
            across = twice_normal * coefficient * factor / speed
            along = twice_normal * coefficient * steepness
            if stations[REVERSING, j] > 0.5:
                along = across
            along, across = implicit_shares(along, across, element)
            excess = along - across
            radial_slope += (across + excess * climb * climb) * per_cosine * per_cosine
            cross = excess * climb * run * per_cosine
            along_slope = across + excess * run * run
            drag, saddle = ring_drag(belt, j, a, eps, v0[j], v1[j], speed_share)
            grip, _ = saturation(saddle, 1.0 / belt.ring_friction_speed)
            if stations[RING_REVERSING, j] > 0.5:
                stiff = drag / saddle
            elif abs(grip) > 0.0:
                stiff = drag / grip * (1.0 - grip * grip) / belt.ring_friction_speed
            stiff *= 0.5 + stiff / (2.0 * stiff + 12.0 * ring)
            stations[RADIAL_SPEED, j], stations[TANGENTIAL_SPEED, j] = v_radial, v_tangential
            stations[SADDLE_SPEED, j] = saddle
        stations[RADIAL_SLOPE, j], stations[CROSS_SLOPE, j] = dual * radial_slope, dual * cross
        stations[TANGENTIAL_SLOPE, j] = dual * along_slope
        blocks[j, 0] = dual * (element + along_slope + lever * lever * stiff)
        blocks[j, 1], blocks[j, 2] = -dual * lever * stiff, dual * (ring + stiff)
        # the layers' stresses at the end of the step, with the speeds that it begins with, and their slopes
        length = belt.cell[j]
        lifted = 0.5 * belt.curvature[j] * length * (u[j] + u[b])
        closing = v0[b] - v0[j]
        outflow = closing - v0[j] * (eps[0, j] - eps[0, a]) / (1.0 + eps[0, a]) + lifted
        per_length = step / (length * fields[N_ELEMENT, j])
        ahead = eps[0, j] + per_length * outflow
        grip = belt.element_damping / length
        stress, links[0, j] = element_stress(
            belt.element_stiffness,
            grip,
            eps[0, j],
            closing,
            ahead,
            per_length,
            links[0, j],
            stations[MEETING, j],
        )
        stations[ELEMENT_STRAIN_AHEAD, j] = ahead
        stations[ELEMENT_STRESS, j] = stress
        pressed = links[0, j] > 0.0
        stations[ELEMENT_HOOP, j] = belt.element_stiffness * per_length if pressed else 0.0
        # beyond what the explicit force across the belt has of it
        hoop = belt.element_stiffness * (ahead if pressed else 0.0)
        stations[HOOP_STRESS, j] = hoop - belt.element_stiffness * min(eps[0, j], 0.0)
        grip = belt.ring_damping / length
        stations[RING_STRESS, j] = belt.ring_stiffness * eps[1, j] + grip * (v1[b] - v1[j])
        stations[RING_HOOP, j] = CENTRED * belt.ring_stiffness * step / (length * fields[N_ELEMENT + 1, j])
        links[1, j] = stations[RING_HOOP, j] + grip


@kernel
def _couple(model: SplitBelt, moved: Motion, work: Work) -> None:
    """Increments of the coordinates' rates into `found`, of the layers' speeds into the chain's column 0."""
    belt, stations, shapes, size = model.belt, work.stations, model.shapes, model.shapes.shape[1]
    n, slow, matrix = belt.cell.size, model.dynamic, work.matrix
    speed = speed_share_at(belt, moved.state.scalars[TIME]) * belt.belt_speed
    whole = size + 2 if model.steady_flow else size
    np.dot(model.inertia, moved.p, work.row)
    for i in range(size):
        for k in range(size):
            matrix[i, k] = model.inertia[i, k] + speed * model.gyration[i, k]
        matrix[i, whole] = -work.row[i] if i >= slow else 0.0
    for i in range(size, whole):
        matrix[i, : whole + 1] = 0.0
        matrix[:size, i] = 0.0
    if model.steady_flow:
        for j in range(n):
            cross, blocks = stations[CROSS_SLOPE, j], work.layers.diagonal
            matrix[size, size] += blocks[j, 0]
            matrix[size + 1, size + 1] += blocks[j, 2]
            matrix[size, size + 1] += blocks[j, 1]
            matrix[size + 1, size] += blocks[j, 1]
            matrix[size, whole] += stations[ALONG, j]
            matrix[size + 1, whole] += stations[ALONG_RING, j]
            for i in range(size):
                matrix[i, size] += shapes[j, i] * cross
                matrix[size, i] += shapes[j, i] * cross
    else:
        _fill_chain(model, work)
        solve_chain(work.layers)
    _reduce(model, work)
    solve_dense(matrix, whole, work.found)
    columns, vector = work.layers.columns, work.vector
    vector[:] = 0.0
    vector[:size] = work.found[:size]
    np.dot(shapes, vector, work.rate[U])
    if model.steady_flow:
        for j in range(n):
            columns[2 * j, 0], columns[2 * j + 1, 0] = work.found[size], work.found[size + 1]
        return
    # the solution for the right side less those for the coordinates
    closing = work.closing
    closing[:] = 0.0
    closing[0] = 1.0
    closing[1 : size + 1] = -work.found[:size]
    columns[:, 0] = np.dot(columns, closing)


@kernel
def _fill_chain(model: SplitBelt, work: Work) -> None:
    """Right side of the layers' system, and its coupling with the coordinates."""
    belt, stations, shapes, columns, size = (
        model.belt,
        work.stations,
        model.shapes,
        work.layers.columns,
        model.shapes.shape[1],
    )
    n = belt.cell.size
    columns[:] = 0.0
    for j in range(n):
        a = j - 1 if j > 0 else n - 1
        columns[2 * j, 0] = stations[ALONG, j] + stations[ELEMENT_STRESS, j] - stations[ELEMENT_STRESS, a]
        columns[2 * j + 1, 0] = stations[ALONG_RING, j] + stations[RING_STRESS, j] - stations[RING_STRESS, a]
        cross = stations[CROSS_SLOPE, j]
        if cross != 0.0:
            row = columns[2 * j]
            for k in range(size):
                row[1 + k] += cross * shapes[j, k]
    for j in range(n):
        if belt.curvature[j] == 0.0:
            continue
        # a cell that moves outwards is stretched, and pulls at the stations at both its ends
        b, half = j + 1 if j < n - 1 else 0, 0.5 * belt.curvature[j] * belt.cell[j]
        for layer in range(2):
            pull = half * stations[RING_HOOP if layer else ELEMENT_HOOP, j]
            here, ahead = columns[2 * j + layer], columns[2 * b + layer]
            for k in range(size):
                stretched = pull * (shapes[j, k] + shapes[b, k])
                here[1 + k] -= stretched
                ahead[1 + k] += stretched


@kernel
def _reduce(model: SplitBelt, work: Work) -> None:
    """Add the forces at the stations and their slopes to the dense system, with what the layers leave."""
    belt, stations, shapes, columns, size = (
        model.belt,
        work.stations,
        model.shapes,
        work.layers.columns,
        model.shapes.shape[1],
    )
    n, matrix = belt.cell.size, work.matrix
    whole = size + 2 if model.steady_flow else size
    row = work.row
    for j in range(n):
        cross, slope = stations[CROSS_SLOPE, j], stations[RADIAL_SLOPE, j]
        right = stations[ACROSS, j]
        for k in range(size):
            row[k] = slope * shapes[j, k]
        if not model.steady_flow and belt.arc_share[j] > 0.0:
            done = columns[2 * j]
            right -= cross * done[0]
            for k in range(size):
                row[k] -= cross * done[1 + k]
            for side in range(2):
                c = j if side == 0 else (j - 1 if j > 0 else n - 1)
                if belt.curvature[c] == 0.0:
                    continue
                b, half = c + 1 if c < n - 1 else 0, 0.5 * belt.curvature[c] * belt.cell[c]
                pull_0, pull_1 = half * stations[ELEMENT_HOOP, c], half * stations[RING_HOOP, c]
                stiff = half * (pull_0 + pull_1)
                e0, e1, e2, e3 = columns[2 * b], columns[2 * c], columns[2 * b + 1], columns[2 * c + 1]
                right -= half * stations[HOOP_STRESS, c]
                right -= pull_0 * (e0[0] - e1[0]) + pull_1 * (e2[0] - e3[0])
                for k in range(size):
                    row[k] += stiff * (shapes[c, k] + shapes[b, k])
                    row[k] -= pull_0 * (e0[1 + k] - e1[1 + k]) + pull_1 * (e2[1 + k] - e3[1 + k])
        for i in range(size):
            shape = shapes[j, i]
            if shape == 0.0:
                continue
            to = matrix[i]
            to[whole] += shape * right
            for k in range(size):
                to[k] += shape * row[k]


@kernel
def _again(model: SplitBelt, moved: Motion, work: Work) -> bool:
    """Mark where the step contradicts what it took for granted; whether anywhere newly. As `imex_system`."""
    belt, stations, columns = model.belt, work.stations, work.layers.columns
    n, found = belt.cell.size, False
    for j in range(n):
        dv0, dv1 = columns[2 * j, 0], columns[2 * j + 1, 0]
        if belt.arc_share[j] > 0.0:
            v_radial, v_tangential = stations[RADIAL_SPEED, j], stations[TANGENTIAL_SPEED, j]
            squared = v_radial * v_radial + v_tangential * v_tangential
            back = v_radial * work.rate[U, j] + v_tangential * dv0 < -squared
            back = back and squared > belt.friction_speed * belt.friction_speed
            if back and stations[REVERSING, j] < 0.5:
                stations[REVERSING, j], found = 1.0, True
            saddle = stations[SADDLE_SPEED, j]
            change = (1.0 + belt.ring_offset * belt.arc_curvature[j]) * dv0 - dv1
            back = abs(saddle) > belt.ring_friction_speed and saddle * (saddle + change) < 0.0
            if back and stations[RING_REVERSING, j] < 0.5:
                stations[RING_REVERSING, j], found = 1.0, True
        if model.steady_flow or work.layers.links[0, j] > 0.0:
            continue
        b = j + 1 if j < n - 1 else 0
        per_length = model.step / (belt.cell[j] * moved.state.fields[N_ELEMENT, j])
        overlap = stations[ELEMENT_STRAIN_AHEAD, j] + per_length * (columns[2 * b, 0] - dv0)
        if overlap < -LARGEST_OVERLAP and stations[MEETING, j] < 0.5:
            stations[MEETING, j], found = 1.0, True
    return found


@kernel
def _advance(model: SplitBelt, moved: Motion, work: Work) -> None:
    """Apply the increments."""
    belt, state, stations, step = model.belt, moved.state, work.stations, model.step
    n, fields, columns, size, slow = (
        belt.cell.size,
        state.fields,
        work.layers.columns,
        model.shapes.shape[1],
        model.dynamic,
    )
    scalars, count, shapes = state.scalars, model.shapes.shape[1], model.shapes
    moment = taken = 0.0
    for j in range(n):
        du, dv0 = work.rate[U, j], columns[2 * j, 0]
        if belt.arc_share[j] > 0.0:
            slopes = stations[TANGENTIAL_SLOPE, j] * dv0 + stations[CROSS_SLOPE, j] * du
            if j >= belt.driven_start:
                moment += work.moments[j] + slopes * (belt.driven_radius + fields[W, j])
            else:
                taken += work.moments[j] - slopes * (belt.driving_radius + fields[W, j])
    for k in range(size):
        moved.p[k] += work.found[k]
    work_done = 0.0
    np.dot(model.inertia, moved.p, work.row)
    for i in range(slow, count):
        work_done += moved.p[i] * work.row[i]
    if not model.steady_flow:
        for j in range(n):
            b = j + 1 if j < n - 1 else 0
            closing = fields[V_ELEMENT, b] - fields[V_ELEMENT, j]
            change = columns[2 * b, 0] - columns[2 * j, 0]
            grip, eps = belt.element_damping / belt.cell[j], moved.eps[0, j]
            damped = 0.0
            if work.layers.links[0, j] > 0.0:
                damped = grip * (closing + change)
                if eps > 0.0:
                    damped = min(belt.element_stiffness * eps + damped, 0.0)
                if grip * closing > -belt.element_stiffness * eps:
                    damped = -belt.element_stiffness * min(eps, 0.0)
            work_done += damped * (closing + 0.5 * change)
            closing = fields[V_RING, b] - fields[V_RING, j]
            change = columns[2 * b + 1, 0] - columns[2 * j + 1, 0]
            work_done += belt.ring_damping / belt.cell[j] * (closing + change) * (closing + 0.5 * change)
    for j in range(n):
        fields[V_ELEMENT, j] += columns[2 * j, 0]
        fields[V_RING, j] += columns[2 * j + 1, 0]
    if not model.steady_flow:
        for layer in range(2):
            v, eps = fields[V_ELEMENT + layer], moved.eps[layer]
            first = v[0] / (1.0 + eps[n - 1])
            inflow = first
            for c in range(n):
                outflow = v[c + 1] / (1.0 + eps[c]) if c < n - 1 else first
                fields[N_ELEMENT + layer, c] += step / belt.cell[c] * (inflow - outflow)
                inflow = outflow
    for k in range(count):
        moved.q[k] += step * moved.p[k]
    belt_speed = speed_share_at(belt, scalars[TIME]) * belt.belt_speed
    np.dot(shapes, moved.p, fields[U])
    np.dot(shapes, moved.q, work.rate[W])
    last = fields[V_FILTERED, n - 1]
    for j in range(n):
        before = last
        last = fields[V_FILTERED, j]
        if belt.friction_memory > 0.0 and belt.arc_share[j] > 0.0:
            speed = sliding_speed(belt, state, j)
            if j == 0 or j == belt.driven_start:
                fields[V_FILTERED, j] = speed
            else:
                carried, forget = (
                    memory_transport(belt, belt.cell[j - 1], belt_speed),
                    1.0 / belt.friction_memory,
                )
                target = (carried * before + forget * speed) / (carried + forget)
                fields[V_FILTERED, j] = target + (last - target) * np.exp(-(carried + forget) * step)
    for j in range(n):
        fields[W, j] = work.rate[W, j]
    if model.steady_flow:
        work_done += _settle(model, moved, work)
    if belt.pulleys.are_free:
        pull = pulled_by(belt, moved.force, work.moments)
        pull[0], pull[1] = taken, moment
        found = free_rates(belt, state, pull)
        scalars[DRIVEN_SPEED] += step * found[0]
        scalars[DRIVEN_POSITION] += step * found[1]
        scalars[FIRST_STATE:] += step * found[2:]
    else:
        thrust = driven_thrust(belt, moved.force) - belt.thrust
        load = belt.ratio * load_at(belt, scalars[TIME])
        scalars[DRIVEN_SPEED] += step * (moment - load) / belt.driven_inertia
        scalars[DRIVEN_POSITION] += step * thrust / belt.axial_damping
    scalars[LAYER_WORK] += step * work_done
    scalars[TIME] += step


@kernel
def _settle(model: SplitBelt, moved: Motion, work: Work) -> float:
    """Contents by the forces at the end of the step; the power that their drag takes [W]."""
    belt, stations, blocks = model.belt, work.stations, work.layers.diagonal
    columns, along = work.layers.columns, stations[ALONG : ALONG_RING + 1]
    for j in range(belt.cell.size):
        dv0, dv1, dual = columns[2 * j, 0], columns[2 * j + 1, 0], belt.dual[j]
        rubbed = (blocks[j, 0] - dual * belt.element_mass / model.step) * dv0 + blocks[j, 1] * dv1
        along[0, j] -= rubbed + stations[CROSS_SLOPE, j] * work.rate[U, j]
        along[1, j] -= (blocks[j, 2] - dual * belt.ring_mass[j] / model.step) * dv1 + blocks[j, 1] * dv0
    return settle_contents(belt, model.drag, model.share, moved.state.fields, moved.eps, along, model.step)
