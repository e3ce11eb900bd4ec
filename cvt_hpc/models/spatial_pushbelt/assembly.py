"""Residuals of an iterate, and the linear system of Newton's method, in lanes.

Every law between two elements is a magnitude along a direction of 16 numbers, so that the block of an
element with the one behind is the transpose of that one's with it.

Lateral bending of the ring packages in lanes: shear and change of slope from element to element.

Shear (z_j - z_i) / h - (psi_i + psi_j) / 2 and change of slope psi_j - psi_i have constant directions. Both
laws act at the mean BETA q_{k+1} + (1 - 2 BETA) q_k + BETA q_{k-1}: with BETA 1/4 the step is stable for
any stiffness and damps nothing, and the frequency f of a mode errs by -(2 pi f dt)^2 / 12 of itself. So
does the spring that turns an element with the ring's slope.
"""

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, behind, fma, like
from cvt_hpc.models.pushbelt.border import border_residuals, close_border
from cvt_hpc.models.pushbelt.chain import BETA, angle_slope
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import vectors as vec
from cvt_hpc.models.spatial_pushbelt.chain import motion


@register_jitable
def _part(array, j, first):
    """A part of 3 x 3 of a block."""
    return vec.matrix(array, j, first, f.SIZE)


@register_jitable
def _store_row(array, j, first, v):
    """Set a part of a block that is a row."""
    array[j, first], array[j, first + f.SIZE], array[j, first + 2 * f.SIZE] = v


@register_jitable
def _store_link(array, j, first, link):
    """Set the parts of a block by velocities and angular velocities."""
    vec.store_matrix(array, j, first + f.UU, link[0], f.SIZE)
    vec.store_matrix(array, j, first + f.WU, link[1], f.SIZE)
    vec.store_matrix(array, j, first + f.UW, link[2], f.SIZE)
    vec.store_matrix(array, j, first + f.WW, link[3], f.SIZE)


@register_jitable
def _store_symmetric(array, j, first, block, by_v, by_p):
    """Set a symmetric block of 8 x 8: the part of 6 x 6, and the last columns, by V and by SLOPE_RATE."""
    uu, uw, ww = block
    uv, wv, vv = by_v
    up, wp, pp = by_p
    _store_link(array, j, first, (vec.full(uu), vec.transposed(uw), uw, vec.full(ww)))
    _store_row(array, j, first + f.VU, uv)
    _store_row(array, j, first + f.VW, wv)
    _store_row(array, j, first + f.PU, up)
    _store_row(array, j, first + f.PW, wp)
    vec.store(array, j, first + f.UV, uv)
    vec.store(array, j, first + f.WV, wv)
    vec.store(array, j, first + f.UP, up)
    vec.store(array, j, first + f.WP, wp)
    array[j, first + f.VV], array[j, first + f.PP] = vv, pp
    array[j, first + f.PV] = array[j, first + f.VP] = like(0.0, vv)


@kernel
def linear_blocks(belt, step, dt):
    """Blocks of inertia, dampers, tension, pitch, yaw and bending: DIAGONAL and LINK of each element."""
    steep = angle_slope(belt, dt)
    yawing = BETA * dt * belt.yaw_stiffness + belt.yaw_damping
    shear, bend = _bending_slopes(belt, dt)
    per_pitch = 1.0 / belt.pitch
    for j in range(step.rows):
        uu, uw = vec.symmetric(step, j, f.INERTIA), vec.matrix(step, j, f.INERTIA_UW)
        none = like(0.0, uu[0])
        n = step[j, f.NORMAL_Y], step[j, f.NORMAL_Z], none
        uu = vec.plus_square(uu, like(belt.transverse_damping, none), n)
        axial = like(belt.lateral_damping + 2.0 * shear * per_pitch * per_pitch, none)
        y = vec.at(step, j, f.YAW)
        ww = vec.plus_square(vec.symmetric(step, j, f.INERTIA_WW), like(yawing, none), y)
        pp = like(belt.ring_rotary_inertia / dt + yawing + 0.5 * shear + 2.0 * bend, none)
        by_p = (none, none, none), vec.times(like(-yawing, none), y), pp

        # the segment ahead, of which this element is i
        k, a, b = step[j, f.TENSION_SLOPE], vec.screw(step, j, f.TENSION_I), vec.screw(step, j, f.TENSION_J)
        uu = vec.joined(uu[:3], (uu[3], uu[4], uu[5] + axial))
        uu, uw, ww = vec.plus_law((uu, uw, ww), k, a)
        v = vec.both_times(k, a)
        vv = like(belt.ring_mass / dt, none) + k
        p, q = vec.at(step, j, f.CHORD_I), vec.at(step, j, f.CHORD_J)
        s, t = vec.at(step, j, f.TURN_I), vec.at(step, j, f.TURN_J)
        d = like(steep, none)
        uu = vec.plus_square(vec.plus_square(uu, d, p), d, q)
        uw, ww = vec.plus_product(uw, -d, p, s), vec.plus_square(ww, d, s)

        zero = vec.zero9(none)
        link_uu, link_wu, link_uw, link_ww = vec.plus_link((zero, zero, zero, zero), -k, a, b)
        link_uu = vec.plus_product(vec.plus_product(link_uu, -d, p, p), -d, q, q)
        link_wu, link_uw = vec.plus_product(link_wu, d, s, p), vec.plus_product(link_uw, -d, q, t)
        _store_link(step, j, f.LINK, (link_uu, link_wu, link_uw, link_ww))
        step[j, f.LINK + f.UU + f.AXIAL + f.SIZE * f.AXIAL] -= shear * per_pitch * per_pitch
        for column in range(f.SIZE):
            step[j, f.LINK + f.PU + f.SIZE * column] = 0.0
            step[j, f.LINK + f.UP + column] = 0.0
        _store_row(step, j, f.LINK + f.VU, vec.times(-k, b[0]))
        _store_row(step, j, f.LINK + f.VW, vec.times(-k, b[1]))
        vec.store_screw(step, j, f.LINK + f.UV, vec.both_times(-k, a))
        step[j, f.LINK + f.VV] = -k
        half = 0.5 * shear * per_pitch
        step[j, f.LINK + f.PU + f.SIZE * f.AXIAL], step[j, f.LINK + f.UP + f.AXIAL] = -half, half
        step[j, f.LINK + f.PP] = 0.25 * shear - bend

        # the segment behind, of which it is j
        k, a = behind(step, j, f.TENSION_SLOPE), vec.screw_behind(step, j, f.TENSION_J)
        uu, uw, ww = vec.plus_law((uu, uw, ww), k, a)
        uv, wv = vec.both_moved(v, k, a)
        p, q = vec.behind(step, j, f.CHORD_I), vec.behind(step, j, f.CHORD_J)
        t = vec.behind(step, j, f.TURN_J)
        uu = vec.plus_square(vec.plus_square(uu, d, p), d, q)
        uw, ww = vec.plus_product(uw, d, q, t), vec.plus_square(ww, d, t)
        _store_symmetric(step, j, f.DIAGONAL, (uu, uw, ww), (uv, wv, vv + k), by_p)


@register_jitable
def side_torque(state, step, j, p):
    """Torque of the two points of a side from p on, about the axis of their pulley [N m]."""
    low, high = f.LEFT_LOW + p, f.LEFT_HIGH + p
    torque = step[j, f.MID_RADIUS + low] * state[j, f.FLANK_FRICTION_T + low]
    return fma(step[j, f.MID_RADIUS + high], state[j, f.FLANK_FRICTION_T + high], torque)


@kernel
def residuals(belt, state, work, load, dt):
    """Set residuals: of elements in `iterate`, of the border in its last column; return the power's [W].

    Forces of flanks and saddles stand in the residuals already. Weight acts as in the plane.
    """
    elements, step, iterate = state.elements, work.step, work.iterate
    scratch, shapes = work.scratch, work.shapes
    modes = belt.modal_stiffness.shape[1]
    fall = dt * belt.gravity
    ring, rotary = belt.ring_mass / dt, belt.ring_rotary_inertia / dt
    yawing = BETA * dt * belt.yaw_stiffness + belt.yaw_damping
    power = torque = like(0.0, elements[0, f.FLANK])
    for k in range(2 * modes):
        scratch[0, k] = 0.0
    for j in range(step.rows):
        du, dw = vec.screw(elements, j, f.CHANGE)
        du = du[0], du[1] + fall, du[2]
        dv, dp = elements[j, f.CHANGE + f.ROW_V], elements[j, f.CHANGE + f.ROW_P]
        u, omega = motion(elements, j, 1.0)
        mass, coupling = vec.symmetric(step, j, f.INERTIA), vec.matrix(step, j, f.INERTIA_UW)
        force, g = vec.both_plus(vec.screw(iterate, j, f.RESIDUAL), vec.screw(iterate, j, f.PAIR_I))
        force, g = vec.both_plus((force, g), vec.screw_behind(iterate, j, f.PAIR_J))
        force = vec.minus(force, vec.plus(vec.of_symmetric(mass, du), vec.of_matrix(coupling, dw)))
        n_y, n_z = step[j, f.NORMAL_Y], step[j, f.NORMAL_Z]
        drag = belt.transverse_damping * fma(n_y, u[0], n_z * u[1])
        f_y = force[0] - drag * n_y + step[j, f.BENT_Y]
        f_z = force[1] - drag * n_z + step[j, f.BENT_Z]
        force = f_y, f_z, force[2] - belt.lateral_damping * u[2]
        y = vec.at(step, j, f.YAW)
        moment = step[j, f.PREDICTED_YAW] + yawing * (vec.dot(y, dw) - dp)
        swing = vec.of_symmetric(vec.symmetric(step, j, f.INERTIA_WW), dw)
        g = vec.plus(g, vec.at(step, j, f.GYROSCOPIC))
        g = vec.minus(g, vec.plus(vec.of_transposed(coupling, du), swing))
        g = vec.moved(g, -moment, y)
        h = iterate[j, f.RESIDUAL + f.ROW_V] + iterate[j, f.PAIR_I + f.ROW_V]
        h = h + behind(iterate, j, f.PAIR_J + f.ROW_V)
        h = h - ring * (dv + fall * vec.at(step, j, f.RING_LINE)[1])
        s = iterate[j, f.PAIR_I + f.ROW_P] + behind(iterate, j, f.PAIR_J + f.ROW_P) - rotary * dp + moment
        vec.store_screw(iterate, j, f.RESIDUAL, (force, g))
        iterate[j, f.RESIDUAL + f.ROW_V], iterate[j, f.RESIDUAL + f.ROW_P] = h, s

        v, slope_rate = elements[j, f.V] + dv, elements[j, f.SLOPE_RATE] + dp
        power += vec.both_dot((u, omega), (force, g)) + v * h + slope_rate * s
        driven = elements[j, f.DRIVEN]
        left, right = f.LEFT_LOW, f.RIGHT_LOW
        torque += driven * (side_torque(elements, step, j, left) + side_torque(elements, step, j, right))
        if modes > 0:
            axial = 0.5 * belt.cosine * (elements[j, f.FLANK + left] + elements[j, f.FLANK + f.LEFT_HIGH])
            axial += 0.5 * belt.cosine * (elements[j, f.FLANK + right] + elements[j, f.FLANK + f.RIGHT_HIGH])
            for k in range(modes):
                scratch[0, modes + k] += driven * axial * shapes[j, k]
                scratch[0, k] += (1.0 - driven) * axial * shapes[j, k]
    changes = state.increments, work.increments
    return border_residuals(belt, changes, state.openings, load, torque, power, scratch, work.border, dt)


@kernel
def assemble_pairs(belt, state, work):
    """Blocks of all but the flanks, and the first right side: what takes the residuals to zero."""
    elements, step, iterate = state.elements, work.step, work.iterate
    blocks = work.narrow
    has_pins = belt.pin_clearance < np.inf
    for j in range(step.rows):
        x = vec.ahead(elements, j, f.HEADING)
        k, i, jj = iterate[j, f.STIFF], vec.at(iterate, j, f.STIFF_I), vec.at(iterate, j, f.STIFF_J)
        one, ahead_of_it = like(1.0, k), k
        uu = vec.plus_product(_part(step, j, f.LINK + f.UU), -k, x, x)
        wu = vec.plus_product(_part(step, j, f.LINK + f.WU), one, i, x)
        uw = vec.plus_product(_part(step, j, f.LINK + f.UW), -one, x, jj)
        ww = vec.matrix_sum(_part(step, j, f.LINK + f.WW), vec.matrix(iterate, j, f.STIFF_IJ))
        link = uu, wu, uw, ww
        if has_pins:
            n, k = vec.at(step, j, f.PIN_NORMAL), iterate[j, f.PIN_SLOPE]
            a, b = vec.at(step, j, f.PIN_LEVER_I), vec.at(step, j, f.PIN_LEVER_J)
            link = vec.plus_link(link, -k, (n, a), (n, b))
        _store_link(blocks, j, f.LINKED, link)
        for column in range(f.ROW_V):
            v, p = f.VU + f.SIZE * column, f.PU + f.SIZE * column
            blocks[j, f.LINKED + v], blocks[j, f.LINKED + p] = step[j, f.LINK + v], step[j, f.LINK + p]
        for field in range(f.UV, f.SIZE * f.SIZE):
            blocks[j, f.LINKED + field] = step[j, f.LINK + field]

        uu = vec.upper(_part(step, j, f.DIAGONAL + f.UU))
        uw = _part(step, j, f.DIAGONAL + f.UW)
        ww = vec.upper(_part(step, j, f.DIAGONAL + f.WW))
        # the contacts ahead, of which this element is i
        uu, uw = vec.plus_square(uu, ahead_of_it, x), vec.plus_product(uw, -one, x, i)
        block = uu, uw, vec.symmetric_sum(ww, vec.symmetric(iterate, j, f.STIFF_II))
        if has_pins:
            n, a = vec.at(step, j, f.PIN_NORMAL), vec.at(step, j, f.PIN_LEVER_I)
            block = vec.plus_law(block, iterate[j, f.PIN_SLOPE], (n, a))
        # those behind, of which it is j
        uu, uw, ww = block
        x, k = vec.at(elements, j, f.HEADING), behind(iterate, j, f.STIFF)
        uu, uw = vec.plus_square(uu, k, x), vec.plus_product(uw, one, x, vec.behind(iterate, j, f.STIFF_J))
        block = uu, uw, vec.symmetric_sum(ww, vec.joined(*vec.screw_behind(iterate, j, f.STIFF_JJ)))
        if has_pins:
            n, b = vec.behind(step, j, f.PIN_NORMAL), vec.behind(step, j, f.PIN_LEVER_J)
            block = vec.plus_law(block, behind(iterate, j, f.PIN_SLOPE), (n, b))
        # friction of the ring
        k, line = iterate[j, f.RING_SLOPE], vec.screw(step, j, f.RING_LINE)
        block = vec.plus_law(block, k, line)
        uv, wv = vec.both_moved(vec.screw(step, j, f.DIAGONAL + f.UV), -k, line)
        up, wp = vec.screw(step, j, f.DIAGONAL + f.UP)
        by_v = uv, wv, step[j, f.DIAGONAL + f.VV] + k
        _store_symmetric(blocks, j, 0, block, by_v, (up, wp, step[j, f.DIAGONAL + f.PP]))
        for row in range(f.SIZE):
            blocks[j, f.RIGHT + row] = iterate[j, f.RESIDUAL + row]


@kernel
def close_pairs(belt, state, work, dt):
    """Close the system of the border: its slopes by its unknowns, less what the elements contribute to them.

    The right sides of `blocks` hold the solution without border, then those for its columns.
    """
    elements, iterate, blocks = state.elements, work.iterate, work.narrow
    shapes, sums = work.shapes, work.sums
    modes = belt.modal_stiffness.shape[1]
    width = 2 + 2 * modes
    for field in range((width - 1) * width):
        sums[0, field] = 0.0
    for j in range(iterate.rows):
        driven = elements[j, f.DRIVEN]
        driving = 1.0 - driven
        torque, normal = vec.screw(iterate, j, f.TORQUE_ROW), vec.screw(iterate, j, f.NORMAL_ROW)
        for column in range(width):
            solution = vec.screw(blocks, j, f.RIGHT + f.SIZE * column)
            sums[0, column] -= vec.both_dot(torque, solution)
            if modes > 0:
                push = vec.both_dot(normal, solution)
                one, other = driving * push, driven * push
                for m in range(modes):
                    shape = shapes[j, m]
                    sums[0, width * (1 + m) + column] -= one * shape
                    sums[0, width * (1 + modes + m) + column] -= other * shape
        sums[0, 1] += iterate[j, f.TORQUE_OWN]
        by_opening, give = iterate[j, f.TORQUE_OPENING], iterate[j, f.NORMAL_YIELD]
        for m in range(modes):
            one, other = driving * shapes[j, m], driven * shapes[j, m]
            sums[0, 2 + m] += by_opening * one
            sums[0, 2 + modes + m] += by_opening * other
            for k in range(modes):
                sums[0, width * (1 + k) + 2 + m] += give * shapes[j, k] * one
                sums[0, width * (1 + modes + k) + 2 + modes + m] += give * shapes[j, k] * other
    close_border(belt, sums, work.border, dt)


@register_jitable
def _bending_slopes(belt, dt):
    """Increase of the shear force by the rate of shear, and of the moment by the rate of change of slope."""
    return BETA * dt * belt.ring_shear * belt.pitch, BETA * dt * belt.ring_bending / belt.pitch


@kernel
def predict_bending(belt, state, step):
    """Shear and change of slope at q_k."""
    per_pitch = 1.0 / belt.pitch
    for j in range(state.rows):
        here, there = state[j, f.SLOPE], ahead(state, j, f.SLOPE)
        rise = ahead(state, j, f.POSITION + f.AXIAL) - state[j, f.POSITION + f.AXIAL]
        step[j, f.SHEAR] = per_pitch * rise - 0.5 * (here + there)
        step[j, f.BEND] = there - here


@kernel
def bending_forces(belt, state, step, iterate, dt):
    """Add to the pairs' forces."""
    per_pitch = 1.0 / belt.pitch
    for_shear, for_bend = belt.ring_shear * belt.pitch, belt.ring_bending / belt.pitch
    steep, steep_bend = _bending_slopes(belt, dt)
    for j in range(step.rows):
        here, there = state[j, f.CHANGE + f.ROW_P], ahead(state, j, f.CHANGE + f.ROW_P)
        rise = ahead(state, j, f.CHANGE + f.AXIAL) - state[j, f.CHANGE + f.AXIAL]
        shear = for_shear * step[j, f.SHEAR] + steep * (per_pitch * rise - 0.5 * (here + there))
        moment = for_bend * step[j, f.BEND] + steep_bend * (there - here)
        force = per_pitch * shear
        iterate[j, f.PAIR_I + f.AXIAL] += force
        iterate[j, f.PAIR_J + f.AXIAL] -= force
        iterate[j, f.PAIR_I + f.ROW_P] = 0.5 * shear + moment
        iterate[j, f.PAIR_J + f.ROW_P] = 0.5 * shear - moment
