"""The free chain in lanes: positions at q*, inertia, tension in two lines, pitch and yaw of elements.

Index i is an element and j the next one. Directions are those at q_k. Magnitudes are those at q* = q_k + dt
X_k, from where on they are linear in the change of the speeds X.

The packages lie on the lines r + b a and r - b a, b being `package_distance`. t is the direction of either
at an element, from the one behind to the one ahead, e that up to the next element. One material flows
through both.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, behind, fma, like, select
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt.rotations import (
    cross,
    dot,
    matrix_sum,
    minus,
    moved,
    of_symmetric,
    plus,
    plus_product,
    plus_square,
    store,
    store_matrix,
    store_symmetric,
    symmetric_sum,
    times,
    turned,
    turning,
    unit,
    vector,
    vector_ahead,
    vector_behind,
)


@register_jitable
def package_lines(d, turn, b):
    """Directions and sizes of d + b turn and d - b turn."""
    right, right_size = unit(moved(d, b, turn))
    left, left_size = unit(moved(d, -b, turn))
    return right, left, right_size, left_size


@register_jitable
def lines_at(belt, state, j):
    """Directions of the right and the left package at an element."""
    front = cross(vector_ahead(state, j, f.OUTWARD), vector_ahead(state, j, f.HEADING))
    back = cross(vector_behind(state, j, f.OUTWARD), vector_behind(state, j, f.HEADING))
    d = minus(vector_ahead(state, j, f.POSITION), vector_behind(state, j, f.POSITION))
    right, left, _, _ = package_lines(d, minus(front, back), belt.package_distance)
    return right, left


@register_jitable
def lines_to_next(array, j, position, heading, outward, b):
    """Axial directions of an element and the next one, chord, and packages up to there (`package_lines`).

    Position and directions are those at these fields of the array.
    """
    ai = cross(vector(array, j, outward), vector(array, j, heading))
    aj = cross(vector_ahead(array, j, outward), vector_ahead(array, j, heading))
    chord = minus(vector_ahead(array, j, position), vector(array, j, position))
    return ai, aj, chord, package_lines(chord, minus(aj, ai), b)


@kernel
def predict(belt, state, pulleys, step, dt):
    """Everything of the free chain that belongs to a single element."""
    b = belt.package_distance
    # of the strands, the common tangents of both pulleys
    sine = (pulleys[planar.DRIVEN_RADIUS] - pulleys[planar.DRIVING_RADIUS]) / belt.centre_distance
    cosine = np.sqrt(1.0 - sine * sine)
    half = 0.5 * belt.ring_mass / dt
    mass, roll = belt.mass / dt, belt.roll_inertia / dt
    yaw, pitch = belt.yaw_inertia / dt, belt.pitch_inertia / dt
    for j in range(state.rows):
        r, x, o = vector(state, j, f.POSITION), vector(state, j, f.HEADING), vector(state, j, f.OUTWARD)
        u, omega = vector(state, j, f.SPEED), vector(state, j, f.OMEGA)
        a = cross(o, x)
        store(step, j, f.PREDICTED_POSITION, moved(r, dt, u))
        factors = turning(omega, dt)
        store(step, j, f.PREDICTED_HEADING, turned(x, omega, factors))
        store(step, j, f.PREDICTED_OUTWARD, turned(o, omega, factors))
        factors = turning(omega, 0.5 * dt)
        middle_o = turned(o, omega, factors)
        store(step, j, f.MID_OUTWARD, middle_o)
        store(step, j, f.MID_AXIAL, turned(a, omega, factors))

        right, left = lines_at(belt, state, j)
        right_lever, left_lever = cross(times(b, a), right), cross(times(-b, a), left)
        line = times(0.5, plus(right, left))
        line_lever = times(0.5, plus(right_lever, left_lever))
        store(step, j, f.RING_LINE, line)
        store(step, j, f.RING_LINE + 3, line_lever)
        step[j, f.START_SLIP] = state[j, f.V] - dot(line, u) - dot(line_lever, omega)

        # ring mass goes with the element only across its lines
        none = like(0.0, r[0])
        total = like(mass + 2.0 * half, none)
        uu = total, none, total, none, none, total
        zero = none, none, none, none, none, none
        both = symmetric_sum(plus_square(zero, -half, right), plus_square(zero, -half, left))
        uu = symmetric_sum(uu, both)
        empty = none, none, none, none, none, none, none, none, none
        one, other = (
            plus_product(empty, -half, right, right_lever),
            plus_product(empty, -half, left, left_lever),
        )
        uw = matrix_sum(one, other)
        swing = like(2.0 * half * b * b, none)
        ww = swing, none, swing, none, none, swing
        ww = plus_square(ww, -2.0 * half * b * b, a)
        both = symmetric_sum(plus_square(zero, -half, right_lever), plus_square(zero, -half, left_lever))
        own = plus_square(plus_square(plus_square(zero, roll, x), yaw, o), pitch, a)
        # at the middle between the last two speeds and the next one
        spin = moved(omega, 0.5, vector(state, j, f.CHANGE + 3))
        store(step, j, f.GYROSCOPIC, times(-dt, cross(spin, of_symmetric(own, spin))))
        ww = symmetric_sum(symmetric_sum(ww, both), own)
        store_symmetric(step, j, f.INERTIA, uu)
        store_matrix(step, j, f.INERTIA + 6, uw)
        store_symmetric(step, j, f.INERTIA + 15, ww)

        # yaw x_3 - psi
        y = x[1], -x[0], none
        store(step, j, f.YAW, y)
        rate = dot(y, omega) - state[j, f.SLOPE_RATE]
        step[j, f.PREDICTED_YAW] = belt.yaw_stiffness * (x[2] - state[j, f.SLOPE]) + belt.yaw_damping * rate

        driven = r[0] > 0.5 * belt.centre_distance
        centre = select(driven, like(belt.centre_distance, none), 0.0)
        state[j, f.DRIVEN] = select(driven, like(1.0, none), 0.0)
        side = select(r[1] < 0.0, like(-1.0, none), 1.0)
        reach = cosine * r[0] + side * sine * r[1]
        strand = (reach > 0.0) & (reach < cosine * belt.centre_distance)
        p = moved(moved(r, 0.5 * dt, u), -belt.pitch_depth, middle_o)
        radial, _ = unit((p[0] - centre, p[1], none))
        step[j, f.NORMAL] = select(strand, like(-sine, none), radial[0])
        step[j, f.NORMAL + 1] = select(strand, side * cosine, radial[1])


@kernel
def link(belt, state, step, dt):
    """What the free chain needs of pairs of neighbours: tension and pitch."""
    b = belt.package_distance
    stiffness, damping = 0.5 * belt.angle_stiffness, 0.5 * belt.angle_damping
    for j in range(state.rows):
        oi, oj = vector(state, j, f.OUTWARD), vector_ahead(state, j, f.OUTWARD)
        ai, aj, chord, lines = lines_to_next(state, j, f.POSITION, f.HEADING, f.OUTWARD, b)
        right, left, _, _ = lines
        e = times(0.5, plus(right, left))
        roll = times(0.5 * b, minus(right, left))
        store(step, j, f.TENSION_I, minus(e, vector(step, j, f.RING_LINE)))
        store(step, j, f.TENSION_I + 3, minus(cross(ai, roll), vector(step, j, f.RING_LINE + 3)))
        store(step, j, f.TENSION_J, minus(e, vector_ahead(step, j, f.RING_LINE)))
        store(step, j, f.TENSION_J + 3, minus(cross(aj, roll), vector_ahead(step, j, f.RING_LINE + 3)))

        pi, pj = vector(step, j, f.PREDICTED_OUTWARD), vector_ahead(step, j, f.PREDICTED_OUTWARD)
        _, _, predicted, lines = lines_to_next(
            step, j, f.PREDICTED_POSITION, f.PREDICTED_HEADING, f.PREDICTED_OUTWARD, b
        )
        _, _, right_size, left_size = lines
        per_unstretched = 1.0 / (
            state[j, f.LENGTH] + dt * (step[j, f.START_SLIP] - ahead(step, j, f.START_SLIP))
        )
        mean = 0.5 * (right_size + left_size)
        step[j, f.PREDICTED_TENSION] = belt.ring_stiffness * (mean * per_unstretched - 1.0)
        step[j, f.TENSION_SLOPE] = dt * belt.ring_stiffness * per_unstretched

        # sine e . o of the angle between the chord and an element
        e, size = unit(chord)
        per_length = 1.0 / size
        chord_i = times(per_length, moved(oi, -dot(e, oi), e))
        chord_j = times(per_length, moved(oj, -dot(e, oj), e))
        turn_i, turn_j = cross(oi, e), cross(oj, e)
        store(step, j, f.CHORD_I, chord_i)
        store(step, j, f.CHORD_J, chord_j)
        store(step, j, f.TURN_I, turn_i)
        store(step, j, f.TURN_J, turn_j)
        line, _ = unit(predicted)
        du = minus(vector_ahead(state, j, f.SPEED), vector(state, j, f.SPEED))
        rate_i = dot(chord_i, du) + dot(turn_i, vector(state, j, f.OMEGA))
        rate_j = dot(chord_j, du) + dot(turn_j, vector_ahead(state, j, f.OMEGA))
        step[j, f.PREDICTED_MOMENT_I] = stiffness * dot(line, pi) + damping * rate_i
        step[j, f.PREDICTED_MOMENT_J] = stiffness * dot(line, pj) + damping * rate_j


@kernel
def chain_forces(belt, state, step, iterate, dt):
    """Tension and moments of pitch of an iterate; sets the pairs' forces."""
    steep = 0.5 * (dt * belt.angle_stiffness + belt.angle_damping)
    for j in range(step.rows):
        ui, uj = vector(state, j, f.CHANGE), vector_ahead(state, j, f.CHANGE)
        wi, wj = vector(state, j, f.CHANGE + 3), vector_ahead(state, j, f.CHANGE + 3)
        ti, tj = vector(step, j, f.TENSION_I), vector(step, j, f.TENSION_J)
        li, lj = vector(step, j, f.TENSION_I + 3), vector(step, j, f.TENSION_J + 3)
        stretch = dot(ti, ui) + dot(li, wi) + state[j, f.CHANGE + 6]
        stretch -= dot(tj, uj) + dot(lj, wj) + ahead(state, j, f.CHANGE + 6)
        tension = fma(-step[j, f.TENSION_SLOPE], stretch, step[j, f.PREDICTED_TENSION])
        iterate[j, f.ITERATE_TENSION] = tension

        du = minus(uj, ui)
        ci, cj = vector(step, j, f.CHORD_I), vector(step, j, f.CHORD_J)
        si, sj = vector(step, j, f.TURN_I), vector(step, j, f.TURN_J)
        moment_i = fma(steep, dot(ci, du) + dot(si, wi), step[j, f.PREDICTED_MOMENT_I])
        moment_j = fma(steep, dot(cj, du) + dot(sj, wj), step[j, f.PREDICTED_MOMENT_J])
        push = moved(times(moment_i, ci), moment_j, cj)
        store(iterate, j, f.PAIR_I, moved(push, tension, ti))
        store(iterate, j, f.PAIR_I + 3, moved(times(tension, li), -moment_i, si))
        iterate[j, f.PAIR_I + 6] = tension
        store(iterate, j, f.PAIR_J, moved(times(-tension, tj), -1.0, push))
        store(iterate, j, f.PAIR_J + 3, moved(times(-tension, lj), -moment_j, sj))
        iterate[j, f.PAIR_J + 6] = -tension


@register_jitable
def mean_stretch(state, step, j):
    """Mean rate within a step at which the ring between an element and the next one is shortened [m/s]."""
    u = moved(vector(state, j, f.SPEED), 0.5, vector(state, j, f.CHANGE))
    w = moved(vector(state, j, f.OMEGA), 0.5, vector(state, j, f.CHANGE + 3))
    next_u = moved(vector_ahead(state, j, f.SPEED), 0.5, vector_ahead(state, j, f.CHANGE))
    next_w = moved(vector_ahead(state, j, f.OMEGA), 0.5, vector_ahead(state, j, f.CHANGE + 3))
    v = state[j, f.V] + 0.5 * state[j, f.CHANGE + 6]
    next_v = ahead(state, j, f.V) + 0.5 * ahead(state, j, f.CHANGE + 6)
    here = dot(vector(step, j, f.TENSION_I), u) + dot(vector(step, j, f.TENSION_I + 3), w) + v
    return (
        here
        - dot(vector(step, j, f.TENSION_J), next_u)
        - dot(vector(step, j, f.TENSION_J + 3), next_w)
        - next_v
    )


@register_jitable
def pull_across(step, iterate, j, o):
    """Force of the ring's tension on an element along o [N]."""
    ahead_of_it, behind_it = iterate[j, f.ITERATE_TENSION], behind(iterate, j, f.ITERATE_TENSION)
    return ahead_of_it * dot(vector(step, j, f.TENSION_I), o) - behind_it * dot(
        vector_behind(step, j, f.TENSION_J), o
    )
