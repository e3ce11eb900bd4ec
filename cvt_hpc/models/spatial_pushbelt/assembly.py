"""Residuals of an iterate, and the linear system of Newton's method, in lanes.

Every law between two elements is a magnitude along a direction of 16 numbers, so that the block of an
element with the one behind is the transpose of that one's with it.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import behind, fma, like
from cvt_hpc.models.pushbelt.border import border_residuals
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt.bending import BETA, bending_slopes
from cvt_hpc.models.spatial_pushbelt.rotations import (
    dot,
    joined,
    matrix,
    minus,
    moved,
    of_matrix,
    of_symmetric,
    of_transposed,
    plus,
    plus_product,
    plus_square,
    store,
    symmetric,
    symmetric_sum,
    three,
    times,
    vector,
    vector_ahead,
    vector_behind,
)

_U = 64  # field of a row of blocks at which the block with the next element begins


@register_jitable
def _store_upper(array, j, first, uu, uw, ww, uv, wv, vv, up, wp, pp):
    """Set the upper half of a symmetric block by columns: u, omega, v, psi."""
    store(array, j, first, (uu[0], uu[1], uu[2]))
    store(array, j, first + 3, (uu[3], uu[4], uu[5]))
    store(array, j, first + 6, (uw[0], uw[1], uw[2]))
    array[j, first + 9] = ww[0]
    store(array, j, first + 10, (uw[3], uw[4], uw[5]))
    array[j, first + 13], array[j, first + 14] = ww[1], ww[2]
    store(array, j, first + 15, (uw[6], uw[7], uw[8]))
    store(array, j, first + 18, (ww[3], ww[4], ww[5]))
    store(array, j, first + 21, uv)
    store(array, j, first + 24, wv)
    array[j, first + 27] = vv
    store(array, j, first + 28, up)
    store(array, j, first + 31, wp)
    array[j, first + 34], array[j, first + 35] = like(0.0, vv), pp


@register_jitable
def _store_columns(array, j, first, m, row, column):
    """Set a part of 3 x 3 of a block of 8 x 8."""
    store(array, j, first + 8 * column + row, (m[0], m[1], m[2]))
    store(array, j, first + 8 * column + 8 + row, (m[3], m[4], m[5]))
    store(array, j, first + 8 * column + 16 + row, (m[6], m[7], m[8]))


@register_jitable
def _columns(array, j, first, row, column):
    """A part of 3 x 3 of a block of 8 x 8."""
    first += 8 * column + row
    return three(vector(array, j, first), vector(array, j, first + 8), vector(array, j, first + 16))


@kernel
def linear_blocks(belt, step, dt):
    """Blocks of inertia, dampers, tension, pitch, yaw and bending: DIAGONAL and LINK of each element."""
    steep = 0.5 * (dt * belt.angle_stiffness + belt.angle_damping)
    yawing = BETA * dt * belt.yaw_stiffness + belt.yaw_damping
    shear, bend = bending_slopes(belt, dt)
    per_pitch = 1.0 / belt.pitch
    for j in range(step.rows):
        uu, uw, ww = (
            symmetric(step, j, f.INERTIA),
            matrix(step, j, f.INERTIA + 6),
            symmetric(step, j, f.INERTIA + 15),
        )
        none = like(0.0, uu[0])
        n = step[j, f.NORMAL], step[j, f.NORMAL + 1], none
        uu = plus_square(uu, like(belt.transverse_damping, none), n)
        axial = like(belt.lateral_damping + 2.0 * shear * per_pitch * per_pitch, none)
        uu = uu[0], uu[1], uu[2], uu[3], uu[4], uu[5] + axial
        y = vector(step, j, f.YAW)
        ww = plus_square(ww, like(yawing, none), y)
        wp = times(like(-yawing, none), y)
        up = none, none, none
        pp = like(belt.ring_rotary_inertia / dt + yawing + 0.5 * shear + 2.0 * bend, none)

        # the segment ahead, of which this element is i
        k, a, b = step[j, f.TENSION_SLOPE], vector(step, j, f.TENSION_I), vector(step, j, f.TENSION_I + 3)
        uu, uw, ww = plus_square(uu, k, a), plus_product(uw, k, a, b), plus_square(ww, k, b)
        uv, wv, vv = times(k, a), times(k, b), like(belt.ring_mass / dt, none) + k
        p, q = vector(step, j, f.CHORD_I), vector(step, j, f.CHORD_J)
        s, t = vector(step, j, f.TURN_I), vector(step, j, f.TURN_J)
        d = like(steep, none)
        uu = plus_square(plus_square(uu, d, p), d, q)
        uw, ww = plus_product(uw, -d, p, s), plus_square(ww, d, s)

        e, h = vector(step, j, f.TENSION_J), vector(step, j, f.TENSION_J + 3)
        nothing = none, none, none, none, none, none, none, none, none
        link = plus_product(plus_product(plus_product(nothing, -k, a, e), -d, p, p), -d, q, q)
        link = (
            link[0],
            link[1],
            link[2],
            link[3],
            link[4],
            link[5],
            link[6],
            link[7],
            link[8] - shear * per_pitch * per_pitch,
        )
        _store_columns(step, j, f.LINK, link, 0, 0)
        _store_columns(step, j, f.LINK, plus_product(plus_product(nothing, -k, b, e), d, s, p), 3, 0)
        _store_columns(step, j, f.LINK, plus_product(plus_product(nothing, -k, a, h), -d, q, t), 0, 3)
        _store_columns(step, j, f.LINK, plus_product(nothing, -k, b, h), 3, 3)
        for c in range(3):
            step[j, f.LINK + 8 * c + 6] = -k * step[j, f.TENSION_J + c]
            step[j, f.LINK + 8 * c + 30] = -k * step[j, f.TENSION_J + 3 + c]
            step[j, f.LINK + 8 * c + 7] = 0.0
            step[j, f.LINK + 8 * c + 31] = 0.0
        half = 0.5 * shear * per_pitch
        step[j, f.LINK + 23] = -half
        store(step, j, f.LINK + 48, times(-k, a))
        store(step, j, f.LINK + 51, times(-k, b))
        step[j, f.LINK + 54] = -k
        for row in range(7):
            step[j, f.LINK + 56 + row] = 0.0
        step[j, f.LINK + 55] = 0.0
        step[j, f.LINK + 58] = half
        step[j, f.LINK + 63] = 0.25 * shear - bend

        # the segment behind, of which it is j
        k, a, b = (
            behind(step, j, f.TENSION_SLOPE),
            vector_behind(step, j, f.TENSION_J),
            vector_behind(step, j, f.TENSION_J + 3),
        )
        uu, uw, ww = plus_square(uu, k, a), plus_product(uw, k, a, b), plus_square(ww, k, b)
        uv, wv, vv = moved(uv, k, a), moved(wv, k, b), vv + k
        p, q = vector_behind(step, j, f.CHORD_I), vector_behind(step, j, f.CHORD_J)
        t = vector_behind(step, j, f.TURN_J)
        uu = plus_square(plus_square(uu, d, p), d, q)
        uw, ww = plus_product(uw, d, q, t), plus_square(ww, d, t)
        _store_upper(step, j, f.DIAGONAL, uu, uw, ww, uv, wv, vv, up, wp, pp)


@register_jitable
def side_torque(state, step, j, p):
    """Torque of the two points of a side from p on, about the axis of their pulley [N m]."""
    low = step[j, f.MID_RADIUS + p] * state[j, f.FLANK_FRICTION_T + p]
    return fma(step[j, f.MID_RADIUS + p + 1], state[j, f.FLANK_FRICTION_T + p + 1], low)


@kernel
def residuals(belt, state, increments, openings, shapes, load, step, iterate, scratch, border, dt):
    """Residuals of all equations: of elements in `iterate`, of the border in the last column of `border`.

    Forces of flanks and saddles stand in the residuals already.

    Returns
    -------
    float
        Power residual of the belt [W].
    """
    modes = belt.modal_stiffness.shape[1]
    ring, rotary = belt.ring_mass / dt, belt.ring_rotary_inertia / dt
    yawing = BETA * dt * belt.yaw_stiffness + belt.yaw_damping
    power = torque = like(0.0, state[0, f.FLANK])
    for k in range(2 * modes):
        scratch[0, k] = 0.0
    for j in range(step.rows):
        du, dw = vector(state, j, f.CHANGE), vector(state, j, f.CHANGE + 3)
        dv, dp = state[j, f.CHANGE + 6], state[j, f.CHANGE + 7]
        u, omega = plus(vector(state, j, f.SPEED), du), plus(vector(state, j, f.OMEGA), dw)
        mass = symmetric(step, j, f.INERTIA)
        coupling = matrix(step, j, f.INERTIA + 6)
        force = plus(vector(iterate, j, f.RESIDUAL), vector(iterate, j, f.PAIR_I))
        force = minus(
            plus(force, vector_behind(iterate, j, f.PAIR_J)),
            plus(of_symmetric(mass, du), of_matrix(coupling, dw)),
        )
        drag = belt.transverse_damping * fma(step[j, f.NORMAL], u[0], step[j, f.NORMAL + 1] * u[1])
        force = (
            force[0] - drag * step[j, f.NORMAL],
            force[1] - drag * step[j, f.NORMAL + 1],
            force[2] - belt.lateral_damping * u[2],
        )
        y = vector(step, j, f.YAW)
        moment = step[j, f.PREDICTED_YAW] + yawing * (dot(y, dw) - dp)
        g = plus(vector(iterate, j, f.RESIDUAL + 3), vector(iterate, j, f.PAIR_I + 3))
        g = plus(plus(g, vector_behind(iterate, j, f.PAIR_J + 3)), vector(step, j, f.GYROSCOPIC))
        g = minus(g, plus(of_transposed(coupling, du), of_symmetric(symmetric(step, j, f.INERTIA + 15), dw)))
        g = moved(g, -moment, y)
        h = (
            iterate[j, f.RESIDUAL + 6]
            + iterate[j, f.PAIR_I + 6]
            + behind(iterate, j, f.PAIR_J + 6)
            - ring * dv
        )
        s = iterate[j, f.PAIR_I + 7] + behind(iterate, j, f.PAIR_J + 7) - rotary * dp + moment
        store(iterate, j, f.RESIDUAL, force)
        store(iterate, j, f.RESIDUAL + 3, g)
        iterate[j, f.RESIDUAL + 6], iterate[j, f.RESIDUAL + 7] = h, s

        power += (
            dot(u, force)
            + dot(omega, g)
            + (state[j, f.SPEED + 6] + dv) * h
            + (state[j, f.SPEED + 7] + dp) * s
        )
        driven = state[j, f.DRIVEN]
        torque += driven * (side_torque(state, step, j, 0) + side_torque(state, step, j, 2))
        if modes > 0:
            axial = 0.5 * belt.cosine * (state[j, f.FLANK] + state[j, f.FLANK + 1])
            axial = axial + 0.5 * belt.cosine * (state[j, f.FLANK + 2] + state[j, f.FLANK + 3])
            for k in range(modes):
                scratch[0, modes + k] += driven * axial * shapes[j, k]
                scratch[0, k] += (1.0 - driven) * axial * shapes[j, k]
    return border_residuals(belt, increments, openings, load, torque, power, scratch, border, dt)


@kernel
def assemble_pairs(belt, state, step, iterate, blocks):
    """Blocks of all but the flanks, and the first right side: what takes the residuals to zero."""
    has_pins = belt.pin_clearance < np.inf
    for j in range(step.rows):
        x = vector_ahead(state, j, f.HEADING)
        k, i, jj = iterate[j, f.STIFF], vector(iterate, j, f.STIFF_I), vector(iterate, j, f.STIFF_J)
        uu = plus_product(_columns(step, j, f.LINK, 0, 0), -k, x, x)
        wu = plus_product(_columns(step, j, f.LINK, 3, 0), like(1.0, k), i, x)
        uw = plus_product(_columns(step, j, f.LINK, 0, 3), like(-1.0, k), x, jj)
        ww = _columns(step, j, f.LINK, 3, 3)
        ww = three(
            plus((ww[0], ww[1], ww[2]), vector(iterate, j, f.STIFF_IJ)),
            plus((ww[3], ww[4], ww[5]), vector(iterate, j, f.STIFF_IJ + 3)),
            plus((ww[6], ww[7], ww[8]), vector(iterate, j, f.STIFF_IJ + 6)),
        )
        if has_pins:
            n, k = vector(step, j, f.PIN_NORMAL), iterate[j, f.PIN_SLOPE]
            a, b = vector(step, j, f.PIN_LEVER_I), vector(step, j, f.PIN_LEVER_J)
            uu, wu = plus_product(uu, -k, n, n), plus_product(wu, -k, a, n)
            uw, ww = plus_product(uw, -k, n, b), plus_product(ww, -k, a, b)
        _store_columns(blocks, j, _U, uu, 0, 0)
        _store_columns(blocks, j, _U, wu, 3, 0)
        _store_columns(blocks, j, _U, uw, 0, 3)
        _store_columns(blocks, j, _U, ww, 3, 3)
        for c in range(6):
            blocks[j, _U + 8 * c + 6], blocks[j, _U + 8 * c + 7] = (
                step[j, f.LINK + 8 * c + 6],
                step[j, f.LINK + 8 * c + 7],
            )
        for field in range(48, 64):
            blocks[j, _U + field] = step[j, f.LINK + field]

        d = f.DIAGONAL
        uu = symmetric(step, j, d)
        uw = three(vector(step, j, d + 6), vector(step, j, d + 10), vector(step, j, d + 15))
        ww = joined((step[j, d + 9], step[j, d + 13], step[j, d + 14]), vector(step, j, d + 18))
        # the contacts ahead, of which this element is i
        k = iterate[j, f.STIFF]
        uu, uw = plus_square(uu, k, x), plus_product(uw, like(-1.0, k), x, i)
        ww = symmetric_sum(ww, symmetric(iterate, j, f.STIFF_II))
        if has_pins:
            n, k, a = vector(step, j, f.PIN_NORMAL), iterate[j, f.PIN_SLOPE], vector(step, j, f.PIN_LEVER_I)
            uu, uw, ww = plus_square(uu, k, n), plus_product(uw, k, n, a), plus_square(ww, k, a)
        # those behind, of which it is j
        x, k = vector(state, j, f.HEADING), behind(iterate, j, f.STIFF)
        uu = plus_square(uu, k, x)
        uw = plus_product(uw, like(1.0, k), x, vector_behind(iterate, j, f.STIFF_J))
        own = joined(vector_behind(iterate, j, f.STIFF_JJ), vector_behind(iterate, j, f.STIFF_JJ + 3))
        ww = symmetric_sum(ww, own)
        if has_pins:
            n, k = vector_behind(step, j, f.PIN_NORMAL), behind(iterate, j, f.PIN_SLOPE)
            b = vector_behind(step, j, f.PIN_LEVER_J)
            uu, uw, ww = plus_square(uu, k, n), plus_product(uw, k, n, b), plus_square(ww, k, b)
        # friction of the ring
        k, t, s = iterate[j, f.RING_SLOPE], vector(step, j, f.RING_LINE), vector(step, j, f.RING_LINE + 3)
        uu, uw, ww = plus_square(uu, k, t), plus_product(uw, k, t, s), plus_square(ww, k, s)
        uv, wv = moved(vector(step, j, d + 21), -k, t), moved(vector(step, j, d + 24), -k, s)

        store(blocks, j, 0, (uu[0], uu[1], uu[3]))
        store(blocks, j, 8, (uu[1], uu[2], uu[4]))
        store(blocks, j, 16, (uu[3], uu[4], uu[5]))
        store(blocks, j, 3, (uw[0], uw[3], uw[6]))
        store(blocks, j, 11, (uw[1], uw[4], uw[7]))
        store(blocks, j, 19, (uw[2], uw[5], uw[8]))
        _store_columns(blocks, j, 0, uw, 0, 3)
        store(blocks, j, 27, (ww[0], ww[1], ww[3]))
        store(blocks, j, 35, (ww[1], ww[2], ww[4]))
        store(blocks, j, 43, (ww[3], ww[4], ww[5]))
        up, wp = vector(step, j, d + 28), vector(step, j, d + 31)
        blocks[j, 6], blocks[j, 14], blocks[j, 22] = uv
        blocks[j, 30], blocks[j, 38], blocks[j, 46] = wv
        blocks[j, 7], blocks[j, 15], blocks[j, 23] = up
        blocks[j, 31], blocks[j, 39], blocks[j, 47] = wp
        store(blocks, j, 48, uv)
        store(blocks, j, 51, wv)
        blocks[j, 54], blocks[j, 55] = step[j, d + 27] + k, step[j, d + 34]
        store(blocks, j, 56, up)
        store(blocks, j, 59, wp)
        blocks[j, 62], blocks[j, 63] = step[j, d + 34], step[j, d + 35]
        for field in range(8):
            blocks[j, f.RIGHT + field] = iterate[j, f.RESIDUAL + field]


@kernel
def border_sums(belt, state, shapes, iterate, blocks, sums):
    """Slopes of the border's equations by its unknowns, less what the elements contribute to them.

    As `border.close_border` takes them. The right sides of `blocks` hold the solution without border, then
    those for its columns.
    """
    modes = belt.modal_stiffness.shape[1]
    width = 2 + 2 * modes
    for field in range((width - 1) * width):
        sums[0, field] = 0.0
    for j in range(iterate.rows):
        driven = state[j, f.DRIVEN]
        driving = 1.0 - driven
        a, b = vector(iterate, j, f.TORQUE_ROW), vector(iterate, j, f.TORQUE_ROW + 3)
        c, d = vector(iterate, j, f.NORMAL_ROW), vector(iterate, j, f.NORMAL_ROW + 3)
        for column in range(width):
            at = f.RIGHT + 8 * column
            u, omega = vector(blocks, j, at), vector(blocks, j, at + 3)
            sums[0, column] -= dot(a, u) + dot(b, omega)
            if modes > 0:
                push = dot(c, u) + dot(d, omega)
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
