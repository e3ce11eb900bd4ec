"""Front of each element against the rear of the next one, in lanes: four one-sided points without friction.

A point P of the front, at height h and half width b, has the gap g = (r_j - P) . x_j - t / 2 to the rear
plane. It grows by the speeds times (-x_j, x_j x (P - r_i)) of element i and (x_j, (P - r_j) x x_j) of j.
"""

from __future__ import annotations

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import fma, like
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt.rotations import (
    accumulate,
    cross,
    dot,
    matrix_sum,
    minus,
    moved,
    plus,
    plus_product,
    plus_square,
    store,
    store_matrix,
    store_symmetric,
    symmetric_sum,
    times,
    vector,
    vector_ahead,
)
from cvt_hpc.physics.contact_laws import pressed


@register_jitable
def front_point(belt, p):
    """Height above the saddle and side of a point of the front: edge left, edge right, head left, right."""
    side = 2.0 * (p % 2) - 1.0
    if p < 2:
        return -belt.pitch_depth, side * belt.edge_width
    return belt.head_height, side * belt.head_width


@register_jitable
def face_gap(ri, xi, oi, rj, xj, thickness, height, side):
    """Gap [m], and P - r_i."""
    arm = moved(moved(moved(times(0.0, xi), 0.5 * thickness, xi), height, oi), side, cross(oi, xi))
    return dot(minus(minus(rj, ri), arm), xj) - 0.5 * thickness, arm


@kernel
def predict_faces(belt, state, step):
    """Gaps at q*, and levers at q_k."""
    thickness = belt.thickness
    for j in range(state.rows):
        ri, rj = vector(state, j, f.POSITION), vector_ahead(state, j, f.POSITION)
        xi, xj = vector(state, j, f.HEADING), vector_ahead(state, j, f.HEADING)
        oi = vector(state, j, f.OUTWARD)
        si, sj = vector(step, j, f.PREDICTED_POSITION), vector_ahead(step, j, f.PREDICTED_POSITION)
        yi, yj = vector(step, j, f.PREDICTED_HEADING), vector_ahead(step, j, f.PREDICTED_HEADING)
        pi = vector(step, j, f.PREDICTED_OUTWARD)
        for p in range(f.POINTS):
            height, side = front_point(belt, p)
            _, arm = face_gap(ri, xi, oi, rj, xj, thickness, height, side)
            store(step, j, f.PUSH_LEVER_I + 3 * p, cross(xj, arm))
            store(step, j, f.PUSH_LEVER_J + 3 * p, cross(minus(arm, minus(rj, ri)), xj))
            gap, _ = face_gap(si, yi, pi, sj, yj, thickness, height, side)
            step[j, f.PUSH_GAP + p] = gap


@register_jitable
def _pressed_point(state, step, iterate, j, p, motion, stiffness, dt):
    """Force and slope of a point, those times its levers, and the slope times products of levers."""
    closing, wi, wj = motion
    a, b = vector(step, j, f.PUSH_LEVER_I + 3 * p), vector(step, j, f.PUSH_LEVER_J + 3 * p)
    gap = fma(dt, closing + dot(a, wi) + dot(b, wj), step[j, f.PUSH_GAP + p])
    push, k = pressed(gap, stiffness)
    state[j, f.PUSH + p], iterate[j, f.PUSH_REACHED + p] = push, gap
    k = dt * k
    none = like(0.0, k)
    zero = none, none, none, none, none, none
    empty = none, none, none, none, none, none, none, none, none
    products = plus_square(zero, k, a), plus_square(zero, k, b), plus_product(empty, k, a, b)
    return (push, k), (times(push, a), times(push, b), times(k, a), times(k, b)), products


@kernel
def face_forces(belt, state, step, iterate, dt):
    """Forces and sums of their slopes of an iterate; adds to the pairs' forces."""
    stiffness = 0.5 * belt.contact_stiffness
    for j in range(step.rows):
        x = vector_ahead(state, j, f.HEADING)
        closing = dot(x, minus(vector_ahead(state, j, f.CHANGE), vector(state, j, f.CHANGE)))
        motion = closing, vector(state, j, f.CHANGE + 3), vector_ahead(state, j, f.CHANGE + 3)
        none = like(0.0, closing)
        force = slope = none
        turn_i = turn_j = slope_i = slope_j = none, none, none
        ii = jj = none, none, none, none, none, none
        ij = none, none, none, none, none, none, none, none, none
        for p in range(0, f.POINTS, 2):
            left, levers, products = _pressed_point(state, step, iterate, j, p, motion, stiffness, dt)
            right, others, more = _pressed_point(state, step, iterate, j, p + 1, motion, stiffness, dt)
            force, slope = force + (left[0] + right[0]), slope + (left[1] + right[1])
            turn_i = plus(turn_i, plus(levers[0], others[0]))
            turn_j = plus(turn_j, plus(levers[1], others[1]))
            slope_i = plus(slope_i, plus(levers[2], others[2]))
            slope_j = plus(slope_j, plus(levers[3], others[3]))
            ii = symmetric_sum(ii, symmetric_sum(products[0], more[0]))
            jj = symmetric_sum(jj, symmetric_sum(products[1], more[1]))
            ij = matrix_sum(ij, matrix_sum(products[2], more[2]))
        iterate[j, f.STIFF] = slope
        store(iterate, j, f.STIFF_I, slope_i)
        store(iterate, j, f.STIFF_J, slope_j)
        store_symmetric(iterate, j, f.STIFF_II, ii)
        store_symmetric(iterate, j, f.STIFF_JJ, jj)
        store_matrix(iterate, j, f.STIFF_IJ, ij)
        accumulate(iterate, j, f.PAIR_I, times(-force, x))
        accumulate(iterate, j, f.PAIR_I + 3, turn_i)
        accumulate(iterate, j, f.PAIR_J, times(force, x))
        accumulate(iterate, j, f.PAIR_J + 3, turn_j)
