"""Increments of all speeds in a step: the coordinates' dense system, into which the layers' is eliminated.

Forces at the stations, friction of flanks and saddles and stresses, and their changes with the speeds are as
in `elastic_belt/imex_stations.py`, and there are hoop stresses: a cell that moves outwards is stretched.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import rhs
from cvt_hpc.models.elastic_belt.imex import CENTRED, LARGEST_OVERLAP, element_stress
from cvt_hpc.models.elastic_belt.imex_stations import implicit_shares
from cvt_hpc.models.elastic_belt.lane_forces import LEAST_SHARE_OF_WIDTH
from cvt_hpc.models.elastic_belt.rhs import speed_share_at
from cvt_hpc.models.quasi_static_belt import fields as q
from cvt_hpc.models.quasi_static_belt.coupled import solve_chain, solve_dense
from cvt_hpc.models.quasi_static_belt.split_belt import Motion, SplitBelt, Work
from cvt_hpc.physics.flank import flank_shares, flank_sliding
from cvt_hpc.physics.friction import friction_coefficient, saturation
from cvt_hpc.solvers.arrays import copy


@kernel
def put_forces(model: SplitBelt, moved: Motion, work: Work) -> None:
    """Forces at the stations [N] without those of the layers' stresses."""
    belt, stations, fields = model.belt, work.stations, moved.state.fields
    n, u, v0, v1 = belt.cell.size, fields[f.U], fields[f.V_ELEMENT], fields[f.V_RING]
    for j in range(n):
        a, dual = j - 1 if j > 0 else n - 1, belt.dual[j]
        push_left = rhs.damped_push(belt, moved.eps[q.ELEMENT, a], rhs.lengthening(belt, v0, u, a))
        push_right = rhs.damped_push(belt, moved.eps[q.ELEMENT, j], rhs.lengthening(belt, v0, u, j))
        pull = belt.ring_stiffness * (moved.eps[q.RING, j] - moved.eps[q.RING, a])
        pull += belt.ring_damping * (rhs.lengthening(belt, v1, u, j) - rhs.lengthening(belt, v1, u, a))
        stations[q.ACROSS, j] = dual * belt.mass * work.rate[f.U, j]
        stations[q.ALONG, j] = dual * belt.element_mass * work.rate[f.V_ELEMENT, j] + (push_right - push_left)
        stations[q.ALONG_RING, j] = dual * belt.ring_mass[j] * work.rate[f.V_RING, j] - pull


@kernel
def put_slopes(model: SplitBelt, moved: Motion, work: Work) -> None:
    """Slopes of friction with the speeds [N s/m], and the layers' blocks, links and stresses."""
    belt, state, stations, step = model.belt, moved.state, work.stations, model.step
    n, fields, eps = belt.cell.size, state.fields, moved.eps
    w, u, v0, v1 = fields[f.W], fields[f.U], fields[f.V_ELEMENT], fields[f.V_RING]
    sine, cosine = np.sin(belt.half_wedge_angle), np.cos(belt.half_wedge_angle)
    per_cosine, per_width = 1.0 / cosine, 1.0 / belt.friction_speed
    damping = rhs.damping_at(belt, state.scalars[f.TIME])
    speed_share = rhs.speed_share_at(belt, state.scalars[f.TIME])
    driving_speed = rhs.driving_speed_at(belt, state)
    blocks, links = work.layers.diagonal, work.layers.links
    for j in range(n):
        a, b = j - 1 if j > 0 else n - 1, j + 1 if j < n - 1 else 0
        dual = belt.dual[j]
        element, ring = belt.element_mass / step, belt.ring_mass[j] / step
        slope = (w[b] - w[a]) / (belt.cell[a] + belt.cell[j])
        radial_slope, cross, along_slope, stiff, lever = 0.5 * damping, 0.0, 0.0, 0.0, 1.0
        tangential_slope = tangential_cross = 0.0
        if moved.force[j] > 0.0:
            v_radial, v_tangential, _ = rhs.sliding_speeds(
                belt, state, j, u[j] + v0[j] * slope, driving_speed
            )
            speed, meridian = flank_sliding(v_radial, v_tangential, per_cosine)
            v_law = speed if belt.friction_memory == 0.0 else fields[f.V_FILTERED, j]
            speed = max(speed, LEAST_SHARE_OF_WIDTH * belt.friction_speed)
            coefficient, _ = friction_coefficient(belt.law, v_law, moved.force[j] * per_cosine)
            factor, steepness = saturation(speed, per_width)
            climb, run = meridian / speed, v_tangential / speed
            axial_share, _ = flank_shares(coefficient * factor, climb, sine, cosine)
            twice_normal = 2.0 * moved.force[j] / axial_share
            across = twice_normal * coefficient * factor / speed
            along = twice_normal * coefficient * steepness
            if stations[q.REVERSING, j] > 0.5:
                along = across
            along, across = implicit_shares(along, across, element)
            excess = along - across
            # with radial and tangential sliding, turned into slopes across and along the path
            radial = (across + excess * climb * climb) * per_cosine * per_cosine
            mixed, tangential = excess * climb * run * per_cosine, across + excess * run * run
            upright, lean = belt.upright[j], rhs.leaning(belt, j, w[j])
            radial_slope += upright**2 * radial - 2.0 * upright * lean * mixed + lean**2 * tangential
            cross = upright * lean * (radial - tangential) + (upright**2 - lean**2) * mixed
            along_slope = lean**2 * radial + 2.0 * upright * lean * mixed + upright**2 * tangential
            tangential_slope = upright * tangential + lean * mixed
            tangential_cross = upright * mixed - lean * tangential
            stations[q.RADIAL_SPEED, j], stations[q.TANGENTIAL_SPEED, j] = v_radial, v_tangential
        if belt.arc_curvature[j] > 0.0:
            lever = 1.0 + belt.ring_offset * belt.arc_curvature[j]
            drag, saddle = rhs.ring_drag(belt, j, a, eps, v0[j], v1[j], speed_share, 0.0)
            grip, _ = saturation(saddle, 1.0 / belt.ring_friction_speed)
            if stations[q.RING_REVERSING, j] > 0.5:
                stiff = drag / saddle
            elif abs(grip) > 0.0:
                stiff = drag / grip * (1.0 - grip * grip) / belt.ring_friction_speed
            stiff *= 0.5 + stiff / (2.0 * stiff + 12.0 * ring)
            stations[q.SADDLE_SPEED, j] = saddle
        stations[q.RADIAL_SLOPE, j], stations[q.CROSS_SLOPE, j] = dual * radial_slope, dual * cross
        stations[q.TANGENTIAL_SLOPE, j] = dual * tangential_slope
        stations[q.TANGENTIAL_CROSS, j] = dual * tangential_cross
        blocks[j, q.ELEMENT_ELEMENT] = dual * (element + along_slope + lever * lever * stiff)
        blocks[j, q.ELEMENT_RING], blocks[j, q.RING_RING] = -dual * lever * stiff, dual * (ring + stiff)
        # the layers' stresses at the end of the step, with the speeds that it begins with, and their slopes
        length = belt.cell[j]
        lifted = 0.5 * belt.curvature[j] * length * (u[j] + u[b])
        closing = v0[b] - v0[j]
        outflow = (
            closing - v0[j] * (eps[q.ELEMENT, j] - eps[q.ELEMENT, a]) / (1.0 + eps[q.ELEMENT, a]) + lifted
        )
        per_length = step / (length * fields[f.N_ELEMENT, j])
        ahead = eps[q.ELEMENT, j] + per_length * outflow
        grip = belt.element_damping / length
        strain, link, meet = eps[q.ELEMENT, j], links[q.ELEMENT, j], stations[q.MEETING, j]
        stress, links[q.ELEMENT, j] = element_stress(
            belt.element_stiffness, grip, strain, closing + lifted, ahead, per_length, link, meet
        )
        stations[q.ELEMENT_STRAIN_AHEAD, j] = ahead
        stations[q.ELEMENT_STRESS, j] = stress
        # beyond its part in the explicit force across the belt
        push = rhs.damped_push(belt, eps[q.ELEMENT, j], (closing + lifted) / length)
        stations[q.HOOP_STRESS, j] = stress + push
        grip = belt.ring_damping / length
        stations[q.RING_STRESS, j] = belt.ring_stiffness * eps[q.RING, j] + grip * (v1[b] - v1[j] + lifted)
        per_content = step / (length * fields[f.N_ELEMENT + q.RING, j])
        links[q.RING, j] = CENTRED * belt.ring_stiffness * per_content + grip


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
            columns[j, q.ELEMENT, q.RIGHT] = work.found[element]
            columns[j, q.RING, q.RIGHT] = work.found[ring]
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
    """Mark where the step contradicts its assumptions; whether anywhere newly. As `elastic_belt/imex.py`."""
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
