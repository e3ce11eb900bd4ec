"""Front of each element against the rear of the next one, in lanes: four one-sided points without friction.

A point P of the front, at height h and half width b, has the gap g = (r_j - P) . x_j - t / 2 to the rear
plane. It grows by the speeds times (-x_j, x_j x (P - r_i)) of element i and (x_j, (P - r_j) x x_j) of j.

The pin of each element in the hole of the next one, in lanes: what holds neighbours side by side.

The pin's centre P lies at the front of element i, the hole's centre at the rear of element j, both
`pin_height` above the saddle. Their offset across x_j is free up to the clearance in all directions;
beyond, the hole pushes back elastically and without friction, along the offset.

Its size grows by the speeds times (n, (P - r_i) x n) of element i and -(n, (P - r_j) x n) of j, n being its
direction. This is the contact of a circle with the ellipse in which its plane cuts the hole (Schindler
2008, eq. 25), but for the clearance times 1 - cos of the tilt between both: a nanometre at 3 mrad.
"""

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import fma, like, maximum, sqrt
from cvt_hpc.models.pushbelt.chain import contact_shares
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import vectors as vec
from cvt_hpc.physics.contact_laws import pressed

_LEAST = 1e-12  # offset that has a direction [m]


@register_jitable
def _front_point(belt, p):
    """Height above the saddle and side of a point of the front: edge left, edge right, head left, right."""
    side = 2.0 * (p % 2) - 1.0
    if p < 2:
        return -belt.pitch_depth, side * belt.edge_width
    return belt.head_height, side * belt.head_width


@register_jitable
def face_gap(ri, xi, oi, rj, xj, thickness, height, side):
    """Gap [m], and P - r_i."""
    arm = vec.moved(vec.moved(vec.times(0.0, xi), 0.5 * thickness, xi), height, oi)
    arm = vec.moved(arm, side, vec.cross(oi, xi))
    return vec.dot(vec.minus(vec.minus(rj, ri), arm), xj) - 0.5 * thickness, arm


@register_jitable
def _before_step(screw, r, x, o, dt):
    """Position and directions of an element at q_{k-1}, from those at q_k and its old speeds."""
    u, omega = screw
    factors = vec.turning(omega, -dt)
    return vec.moved(r, -dt, u), vec.turned(x, omega, factors), vec.turned(o, omega, factors)


@register_jitable
def pin_offset(ri, xi, oi, rj, xj, oj, thickness, height):
    """Offset of pin and hole across x_j, its size [m], and P - r_i."""
    arm = vec.moved(vec.times(0.5 * thickness, xi), height, oi)
    d = vec.moved(vec.moved(vec.plus(vec.minus(ri, rj), arm), 0.5 * thickness, xj), -height, oj)
    d = vec.moved(d, -vec.dot(d, xj), xj)
    return d, sqrt(vec.dot(d, d)), arm


@kernel
def predict_faces(belt, state, step, dt):
    """Gaps by which elements and their pins press at the old speeds, directions and levers at q_k."""
    thickness, pin_height = belt.thickness, belt.pin_height
    has_pins = belt.pin_clearance < np.inf
    ahead_share, share, behind_share = contact_shares(belt, dt)
    for j in range(state.rows):
        ri, rj = vec.at(state, j, f.POSITION), vec.ahead(state, j, f.POSITION)
        xi, xj = vec.at(state, j, f.HEADING), vec.ahead(state, j, f.HEADING)
        oi, oj = vec.at(state, j, f.OUTWARD), vec.ahead(state, j, f.OUTWARD)
        si, sj = vec.at(step, j, f.PREDICTED_POSITION), vec.ahead(step, j, f.PREDICTED_POSITION)
        yi, yj = vec.at(step, j, f.PREDICTED_HEADING), vec.ahead(step, j, f.PREDICTED_HEADING)
        pi, pj = vec.at(step, j, f.PREDICTED_OUTWARD), vec.ahead(step, j, f.PREDICTED_OUTWARD)
        bi, zi, qi = _before_step(vec.screw(state, j, f.SPEED), ri, xi, oi, dt)
        bj, zj, qj = _before_step(vec.screw_ahead(state, j, f.SPEED), rj, xj, oj, dt)
        for p in range(f.POINTS):
            height, side = _front_point(belt, p)
            now, arm = face_gap(ri, xi, oi, rj, xj, thickness, height, side)
            vec.store(step, j, f.PUSH_LEVER_I + 3 * p, vec.cross(xj, arm))
            vec.store(step, j, f.PUSH_LEVER_J + 3 * p, vec.cross(vec.minus(arm, vec.minus(rj, ri)), xj))
            reached, _ = face_gap(si, yi, pi, sj, yj, thickness, height, side)
            before, _ = face_gap(bi, zi, qi, bj, zj, thickness, height, side)
            step[j, f.PUSH_GAP + p] = ahead_share * reached + share * now + behind_share * before
            step[j, f.PUSH_MEAN + p] = 0.5 * (reached + now)
        if has_pins:
            d, now, arm = pin_offset(ri, xi, oi, rj, xj, oj, thickness, pin_height)
            n = vec.times(1.0 / maximum(now, _LEAST), d)
            vec.store(step, j, f.PIN_NORMAL, n)
            vec.store(step, j, f.PIN_LEVER_I, vec.cross(arm, n))
            vec.store(step, j, f.PIN_LEVER_J, vec.cross(vec.plus(vec.minus(ri, rj), arm), n))
            _, reached, _ = pin_offset(si, yi, pi, sj, yj, pj, thickness, pin_height)
            _, before, _ = pin_offset(bi, zi, qi, bj, zj, qj, thickness, pin_height)
            offset = ahead_share * reached + share * now + behind_share * before
            step[j, f.PIN_GAP] = belt.pin_clearance - offset
            step[j, f.PIN_MEAN] = belt.pin_clearance - 0.5 * (reached + now)


@register_jitable
def _pressed_point(state, step, iterate, j, p, motion, stiffness, pressing):
    """Force and slope of a point, those times its levers, and the slope times products of levers."""
    closing, wi, wj = motion
    a, b = vec.at(step, j, f.PUSH_LEVER_I + 3 * p), vec.at(step, j, f.PUSH_LEVER_J + 3 * p)
    gap = fma(pressing, closing + vec.dot(a, wi) + vec.dot(b, wj), step[j, f.PUSH_GAP + p])
    push, k = pressed(gap, stiffness)
    state[j, f.PUSH + p], iterate[j, f.PUSH_REACHED + p] = push, gap
    k = pressing * k
    zero = vec.zero6(like(0.0, k))
    product = vec.plus_product(vec.zero9(like(0.0, k)), k, a, b)
    products = vec.plus_square(zero, k, a), vec.plus_square(zero, k, b), product
    return (push, k), (vec.times(push, a), vec.times(push, b), vec.times(k, a), vec.times(k, b)), products


@kernel
def face_forces(belt, state, step, iterate, dt):
    """Forces of elements and pins and sums of their slopes of an iterate; adds to the pairs' forces."""
    stiffness, has_pins = 0.5 * belt.contact_stiffness, belt.pin_clearance < np.inf
    ahead_share, _, _ = contact_shares(belt, dt)
    pressing = ahead_share * dt
    for j in range(step.rows):
        x = vec.ahead(state, j, f.HEADING)
        closing = vec.dot(x, vec.minus(vec.ahead(state, j, f.CHANGE), vec.at(state, j, f.CHANGE)))
        motion = closing, vec.at(state, j, f.CHANGE + f.ROW_W), vec.ahead(state, j, f.CHANGE + f.ROW_W)
        none = like(0.0, closing)
        force = slope = none
        turn_i = turn_j = slope_i = slope_j = none, none, none
        ii = jj = vec.zero6(none)
        ij = vec.zero9(none)
        for p in range(0, f.POINTS, 2):
            left, levers, products = _pressed_point(state, step, iterate, j, p, motion, stiffness, pressing)
            right, others, more = _pressed_point(state, step, iterate, j, p + 1, motion, stiffness, pressing)
            force, slope = force + (left[0] + right[0]), slope + (left[1] + right[1])
            turn_i = vec.plus(turn_i, vec.plus(levers[0], others[0]))
            turn_j = vec.plus(turn_j, vec.plus(levers[1], others[1]))
            slope_i = vec.plus(slope_i, vec.plus(levers[2], others[2]))
            slope_j = vec.plus(slope_j, vec.plus(levers[3], others[3]))
            ii = vec.symmetric_sum(ii, vec.symmetric_sum(products[0], more[0]))
            jj = vec.symmetric_sum(jj, vec.symmetric_sum(products[1], more[1]))
            ij = vec.matrix_sum(ij, vec.matrix_sum(products[2], more[2]))
        iterate[j, f.STIFF] = slope
        vec.store(iterate, j, f.STIFF_I, slope_i)
        vec.store(iterate, j, f.STIFF_J, slope_j)
        vec.store_symmetric(iterate, j, f.STIFF_II, ii)
        vec.store_symmetric(iterate, j, f.STIFF_JJ, jj)
        vec.store_matrix(iterate, j, f.STIFF_IJ, ij)
        vec.add_screw(iterate, j, f.PAIR_I, (vec.times(-force, x), turn_i))
        vec.add_screw(iterate, j, f.PAIR_J, (vec.times(force, x), turn_j))
        if has_pins:
            n = vec.at(step, j, f.PIN_NORMAL)
            a, b = vec.at(step, j, f.PIN_LEVER_I), vec.at(step, j, f.PIN_LEVER_J)
            du = vec.minus(vec.at(state, j, f.CHANGE), vec.ahead(state, j, f.CHANGE))
            parting = vec.dot(n, du) + vec.dot(a, motion[1]) - vec.dot(b, motion[2])
            gap = fma(-pressing, parting, step[j, f.PIN_GAP])
            force, k = pressed(gap, belt.pin_stiffness)
            state[j, f.PIN], iterate[j, f.PIN_REACHED], iterate[j, f.PIN_SLOPE] = force, gap, pressing * k
            vec.add_screw(iterate, j, f.PAIR_I, vec.both_times(-force, (n, a)))
            vec.add_screw(iterate, j, f.PAIR_J, vec.both_times(force, (n, b)))
