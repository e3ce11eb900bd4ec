"""Increments of all speeds in a step: the coordinates' dense system, into which the layers' is eliminated."""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.imex_system import LARGEST_OVERLAP
from cvt_hpc.models.elastic_belt.rhs import speed_share_at
from cvt_hpc.models.quasi_static_belt import fields as q
from cvt_hpc.models.quasi_static_belt.coupled import solve_chain, solve_dense
from cvt_hpc.models.quasi_static_belt.split_belt import Motion, SplitBelt, Work
from cvt_hpc.solvers.arrays import copy


@kernel
def solve_increments(model: SplitBelt, moved: Motion, work: Work) -> None:
    """Increments of the coordinates' rates into `found`, of the layers' speeds into RIGHT of the chain."""
    belt, stations, shapes, size = model.belt, work.stations, model.shapes, model.shapes.shape[1]
    n, slow, matrix = belt.cell.size, model.dynamic, work.matrix
    speed = speed_share_at(belt, moved.state.scalars[f.TIME]) * belt.belt_speed
    element, ring = size + q.ELEMENT, size + q.RING  # with the steady flow each layer has one speed
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
            cross, blocks = stations[q.CROSS_SLOPE, j], work.layers.diagonal
            matrix[element, element] += blocks[j, q.ELEMENT_ELEMENT]
            matrix[ring, ring] += blocks[j, q.RING_RING]
            matrix[element, ring] += blocks[j, q.ELEMENT_RING]
            matrix[ring, element] += blocks[j, q.ELEMENT_RING]
            matrix[element, whole] += stations[q.ALONG, j]
            matrix[ring, whole] += stations[q.ALONG_RING, j]
            for i in range(size):
                matrix[i, element] += shapes[j, i] * cross
                matrix[element, i] += shapes[j, i] * cross
    else:
        _fill_chain(model, work)
        solve_chain(work.layers)
    _reduce(model, work)
    solve_dense(matrix, whole, work.found)
    columns, vector = work.layers.columns, work.vector
    vector[:] = 0.0
    copy(work.found, vector[:size])
    np.dot(shapes, vector, work.rate[f.U])
    if model.steady_flow:
        for j in range(n):
            columns[j, q.ELEMENT, q.RIGHT], columns[j, q.RING, q.RIGHT] = (
                work.found[element],
                work.found[ring],
            )
        return
    # the solution for the right side less those for the coordinates
    closing = work.closing
    closing[:] = 0.0
    closing[q.RIGHT] = 1.0
    for k in range(size):
        closing[q.BY_COORDINATE + k] = -work.found[k]
    flat = columns.reshape(-1, columns.shape[2])
    copy(np.dot(flat, closing), flat[:, q.RIGHT])


@kernel
def _fill_chain(model: SplitBelt, work: Work) -> None:
    """Right side of the layers' system, and its coupling with the coordinates."""
    belt, shapes, size = model.belt, model.shapes, model.shapes.shape[1]
    stations, columns = work.stations, work.layers.columns
    n = belt.cell.size
    columns[:] = 0.0
    for j in range(n):
        a = j - 1 if j > 0 else n - 1
        stress, ring_stress = stations[q.ELEMENT_STRESS, j], stations[q.RING_STRESS, j]
        columns[j, q.ELEMENT, q.RIGHT] = stations[q.ALONG, j] + stress - stations[q.ELEMENT_STRESS, a]
        columns[j, q.RING, q.RIGHT] = stations[q.ALONG_RING, j] + ring_stress - stations[q.RING_STRESS, a]
        cross = stations[q.CROSS_SLOPE, j]
        if cross != 0.0:
            row = columns[j, q.ELEMENT]
            for k in range(size):
                row[q.BY_COORDINATE + k] += cross * shapes[j, k]
    for j in range(n):
        if belt.curvature[j] == 0.0:
            continue
        # a cell that moves outwards is stretched, and pulls at the stations at both its ends
        b, half = j + 1 if j < n - 1 else 0, 0.5 * belt.curvature[j] * belt.cell[j]
        for layer in range(2):
            pull = half * work.layers.links[layer, j]
            here, ahead = columns[j, layer], columns[b, layer]
            for k in range(size):
                stretched = pull * (shapes[j, k] + shapes[b, k])
                here[q.BY_COORDINATE + k] -= stretched
                ahead[q.BY_COORDINATE + k] += stretched


@kernel
def _reduce(model: SplitBelt, work: Work) -> None:
    """Add the forces at the stations and their slopes to the dense system, with the layers' remainder."""
    belt, shapes, size = model.belt, model.shapes, model.shapes.shape[1]
    stations, columns = work.stations, work.layers.columns
    n, matrix, links = belt.cell.size, work.matrix, work.layers.links
    whole = size + 2 if model.steady_flow else size
    row = work.row
    for j in range(n):
        cross, slope = stations[q.CROSS_SLOPE, j], stations[q.RADIAL_SLOPE, j]
        right = stations[q.ACROSS, j]
        for k in range(size):
            row[k] = slope * shapes[j, k]
        if not model.steady_flow and belt.touches[j] > 0.0:
            done = columns[j, q.ELEMENT]
            right -= cross * done[q.RIGHT]
            for k in range(size):
                row[k] -= cross * done[q.BY_COORDINATE + k]
            for side in range(2):
                c = j if side == 0 else (j - 1 if j > 0 else n - 1)
                if belt.curvature[c] == 0.0:
                    continue
                b, half = c + 1 if c < n - 1 else 0, 0.5 * belt.curvature[c] * belt.cell[c]
                pull_0, pull_1 = half * links[q.ELEMENT, c], half * links[q.RING, c]
                stiff = half * (pull_0 + pull_1)
                e0, e1 = columns[b, q.ELEMENT], columns[c, q.ELEMENT]
                e2, e3 = columns[b, q.RING], columns[c, q.RING]
                right -= half * stations[q.HOOP_STRESS, c]
                right -= pull_0 * (e0[q.RIGHT] - e1[q.RIGHT]) + pull_1 * (e2[q.RIGHT] - e3[q.RIGHT])
                for k in range(size):
                    row[k] += stiff * (shapes[c, k] + shapes[b, k])
                    i = q.BY_COORDINATE + k
                    row[k] -= pull_0 * (e0[i] - e1[i]) + pull_1 * (e2[i] - e3[i])
        for i in range(size):
            shape = shapes[j, i]
            if shape == 0.0:
                continue
            to = matrix[i]
            to[whole] += shape * right
            for k in range(size):
                to[k] += shape * row[k]


@kernel
def contradicts(model: SplitBelt, moved: Motion, work: Work) -> bool:
    """Mark where the step contradicts its assumptions; whether anywhere newly. As `imex_system`."""
    belt, stations, columns = model.belt, work.stations, work.layers.columns
    n, found = belt.cell.size, False
    for j in range(n):
        dv0, dv1 = columns[j, q.ELEMENT, q.RIGHT], columns[j, q.RING, q.RIGHT]
        if moved.force[j] > 0.0:
            v_radial, v_tangential = stations[q.RADIAL_SPEED, j], stations[q.TANGENTIAL_SPEED, j]
            squared = v_radial * v_radial + v_tangential * v_tangential
            du, upright, lean = work.rate[f.U, j], belt.upright[j], belt.lean[j]
            turned = v_radial * (upright * du + lean * dv0) + v_tangential * (upright * dv0 - lean * du)
            back = turned < -squared
            back = back and squared > belt.friction_speed * belt.friction_speed
            if back and stations[q.REVERSING, j] < 0.5:
                stations[q.REVERSING, j], found = 1.0, True
        if belt.arc_curvature[j] > 0.0:
            saddle = stations[q.SADDLE_SPEED, j]
            change = (1.0 + belt.ring_offset * belt.arc_curvature[j]) * dv0 - dv1
            back = abs(saddle) > belt.ring_friction_speed and saddle * (saddle + change) < 0.0
            if back and stations[q.RING_REVERSING, j] < 0.5:
                stations[q.RING_REVERSING, j], found = 1.0, True
        if model.steady_flow or work.layers.links[q.ELEMENT, j] > 0.0:
            continue
        b = j + 1 if j < n - 1 else 0
        per_length = model.step / (belt.cell[j] * moved.state.fields[f.N_ELEMENT, j])
        overlap = stations[q.ELEMENT_STRAIN_AHEAD, j] + per_length * (columns[b, q.ELEMENT, q.RIGHT] - dv0)
        if overlap < -LARGEST_OVERLAP and stations[q.MEETING, j] < 0.5:
            stations[q.MEETING, j], found = 1.0, True
    return found
