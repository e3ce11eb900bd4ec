"""The free chain in lanes: positions at q*, inertia, tension in two lines, pitch and yaw of elements.

Index i is an element and j the next one. Directions are those at q_k, and so are magnitudes of tension, pitch
and yaw, from where on they are linear in the change of the speeds X.

The packages lie on the lines r + b a and r - b a, b being `package_distance`. t is the direction of either
at an element, from the one behind to the one ahead, e that up to the next element. One material flows
through both.

Rings on the saddles, in lanes: friction along the belt, one law for both packages of an element.

The slip sigma = v - mean over both lines of t . p' grows by the speeds times (-t, -b a x t, 1). Along t
ring and element are free of each other but for friction, across it the ring goes with the element.
"""

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, behind, fma, like, select, sqrt
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.chain import angle_slope, ring_share, turned_length
from cvt_hpc.models.pushbelt.friction import ring_friction
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import vectors as vec


@register_jitable
def motion(state, j, share):
    """Velocity and angular velocity of an element before a step and a share of their changes in it."""
    return vec.both_moved(vec.screw(state, j, f.SPEED), share, vec.screw(state, j, f.CHANGE))


@register_jitable
def motion_ahead(state, j, share):
    """Motion of the next element, in the form of `motion`."""
    return vec.both_moved(vec.screw_ahead(state, j, f.SPEED), share, vec.screw_ahead(state, j, f.CHANGE))


@register_jitable
def shortening(state, step, j, share):
    """Rate at which the ring up to the next element is shortened [m/s], of speeds as of `motion`."""
    u, w = motion_ahead(state, j, share)
    v = state[j, f.V] + share * state[j, f.CHANGE + f.ROW_V]
    next_v = ahead(state, j, f.V) + share * ahead(state, j, f.CHANGE + f.ROW_V)
    here = vec.both_dot(vec.screw(step, j, f.TENSION_I), motion(state, j, share)) + v
    t, lever = vec.screw(step, j, f.TENSION_J)
    return here - vec.dot(t, u) - vec.dot(lever, w) - next_v


@register_jitable
def spin_of(e, per_length, du):
    """Angular velocity of a segment along e whose ends move apart by du [rad/s]."""
    across = vec.moved(du, -vec.dot(e, du), e)
    return per_length * sqrt(vec.dot(across, across))


@register_jitable
def _package_lines(d, turn, b):
    """Directions and sizes of d + b turn and d - b turn."""
    right, right_size = vec.unit(vec.moved(d, b, turn))
    left, left_size = vec.unit(vec.moved(d, -b, turn))
    return right, left, right_size, left_size


@register_jitable
def lines_at(belt, state, j):
    """Directions of the right and the left package at an element."""
    front = vec.cross(vec.ahead(state, j, f.OUTWARD), vec.ahead(state, j, f.HEADING))
    back = vec.cross(vec.behind(state, j, f.OUTWARD), vec.behind(state, j, f.HEADING))
    d = vec.minus(vec.ahead(state, j, f.POSITION), vec.behind(state, j, f.POSITION))
    right, left, _, _ = _package_lines(d, vec.minus(front, back), belt.package_distance)
    return right, left


@register_jitable
def lines_to_next(array, j, position, heading, outward, b):
    """Axial directions of an element and the next one, chord, and packages up to there (`_package_lines`).

    Position and directions are those at these fields of the array.
    """
    ai = vec.cross(vec.at(array, j, outward), vec.at(array, j, heading))
    aj = vec.cross(vec.ahead(array, j, outward), vec.ahead(array, j, heading))
    chord = vec.minus(vec.ahead(array, j, position), vec.at(array, j, position))
    return ai, aj, chord, _package_lines(chord, vec.minus(aj, ai), b)


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
        r, x, o = vec.at(state, j, f.POSITION), vec.at(state, j, f.HEADING), vec.at(state, j, f.OUTWARD)
        u, omega = vec.at(state, j, f.SPEED), vec.at(state, j, f.OMEGA)
        a = vec.cross(o, x)
        vec.store(step, j, f.PREDICTED_POSITION, vec.moved(r, dt, u))
        factors = vec.turning(omega, dt)
        vec.store(step, j, f.PREDICTED_HEADING, vec.turned(x, omega, factors))
        vec.store(step, j, f.PREDICTED_OUTWARD, vec.turned(o, omega, factors))
        factors = vec.turning(omega, 0.5 * dt)
        middle_o = vec.turned(o, omega, factors)
        vec.store(step, j, f.MID_OUTWARD, middle_o)
        vec.store(step, j, f.MID_AXIAL, vec.turned(a, omega, factors))

        right, left = lines_at(belt, state, j)
        right, left = (right, vec.cross(vec.times(b, a), right)), (left, vec.cross(vec.times(-b, a), left))
        line = vec.both_times(0.5, vec.both_plus(right, left))
        vec.store_screw(step, j, f.RING_LINE, line)

        # ring mass goes with the element only across its lines
        none = like(0.0, r[0])
        total = like(mass + 2.0 * half, none)
        uu = total, none, total, none, none, total
        zero, empty = vec.zero6(none), (vec.zero6(none), vec.zero9(none), vec.zero6(none))
        one, other = vec.plus_law(empty, -half, right), vec.plus_law(empty, -half, left)
        swing = like(2.0 * half * b * b, none)
        ww = swing, none, swing, none, none, swing
        ww = vec.plus_square(ww, -2.0 * half * b * b, a)
        own = vec.plus_square(vec.plus_square(vec.plus_square(zero, roll, x), yaw, o), pitch, a)
        # at the middle between the last two speeds and the next one
        spin = vec.moved(omega, 0.5, vec.at(state, j, f.CHANGE + f.ROW_W))
        vec.store(step, j, f.GYROSCOPIC, vec.times(-dt, vec.cross(spin, vec.of_symmetric(own, spin))))
        ww = vec.symmetric_sum(vec.symmetric_sum(ww, vec.symmetric_sum(one[2], other[2])), own)
        uu = vec.symmetric_sum(uu, vec.symmetric_sum(one[0], other[0]))
        vec.store_symmetric(step, j, f.INERTIA, uu)
        vec.store_matrix(step, j, f.INERTIA_UW, vec.matrix_sum(one[1], other[1]))
        vec.store_symmetric(step, j, f.INERTIA_WW, ww)

        # yaw x_3 - psi
        y = x[1], -x[0], none
        vec.store(step, j, f.YAW, y)
        rate = vec.dot(y, omega) - state[j, f.SLOPE_RATE]
        step[j, f.PREDICTED_YAW] = belt.yaw_stiffness * (x[2] - state[j, f.SLOPE]) + belt.yaw_damping * rate

        driven = r[0] > 0.5 * belt.centre_distance
        centre = select(driven, like(belt.centre_distance, none), 0.0)
        state[j, f.DRIVEN] = select(driven, like(1.0, none), 0.0)
        side = select(r[1] < 0.0, like(-1.0, none), 1.0)
        reach = cosine * r[0] + side * sine * r[1]
        strand = (reach > 0.0) & (reach < cosine * belt.centre_distance)
        p = vec.moved(vec.moved(r, 0.5 * dt, u), -belt.pitch_depth, middle_o)
        radial, _ = vec.unit((p[0] - centre, p[1], none))
        step[j, f.NORMAL_Y] = select(strand, like(-sine, none), radial[0])
        step[j, f.NORMAL_Z] = select(strand, side * cosine, radial[1])


@kernel
def link(belt, state, step, dt):
    """Tension and pitch of pairs of neighbours, which the free chain needs."""
    b = belt.package_distance
    stiffness, damping = 0.5 * belt.angle_stiffness, 0.5 * belt.angle_damping
    for j in range(state.rows):
        oi, oj = vec.at(state, j, f.OUTWARD), vec.ahead(state, j, f.OUTWARD)
        ai, aj, chord, lines = lines_to_next(state, j, f.POSITION, f.HEADING, f.OUTWARD, b)
        right, left, right_size, left_size = lines
        e = vec.times(0.5, vec.plus(right, left))
        roll = vec.times(0.5 * b, vec.minus(right, left))
        own, next_one = vec.screw(step, j, f.RING_LINE), vec.screw_ahead(step, j, f.RING_LINE)
        vec.store_screw(step, j, f.TENSION_I, vec.both_minus((e, vec.cross(ai, roll)), own))
        vec.store_screw(step, j, f.TENSION_J, vec.both_minus((e, vec.cross(aj, roll)), next_one))

        # sine e . o of the angle between the chord and an element
        e, size = vec.unit(chord)
        per_length = 1.0 / size
        chord_i = vec.times(per_length, vec.moved(oi, -vec.dot(e, oi), e))
        chord_j = vec.times(per_length, vec.moved(oj, -vec.dot(e, oj), e))
        turn_i, turn_j = vec.cross(oi, e), vec.cross(oj, e)
        vec.store(step, j, f.CHORD_I, chord_i)
        vec.store(step, j, f.CHORD_J, chord_j)
        vec.store(step, j, f.TURN_I, turn_i)
        vec.store(step, j, f.TURN_J, turn_j)
        du = vec.minus(vec.ahead(state, j, f.SPEED), vec.at(state, j, f.SPEED))

        per_unstretched = 1.0 / state[j, f.LENGTH]
        length = 0.5 * (right_size + left_size) + turned_length(belt, size, spin_of(e, per_length, du), dt)
        length -= belt.ring_time * shortening(state, step, j, 0.0)
        step[j, f.START_TENSION] = belt.ring_stiffness * (length * per_unstretched - 1.0)
        step[j, f.TENSION_SLOPE] = ring_share(belt, dt) * belt.ring_stiffness * per_unstretched

        rate_i = vec.dot(chord_i, du) + vec.dot(turn_i, vec.at(state, j, f.OMEGA))
        rate_j = vec.dot(chord_j, du) + vec.dot(turn_j, vec.ahead(state, j, f.OMEGA))
        step[j, f.START_MOMENT_I] = stiffness * vec.dot(e, oi) + damping * rate_i
        step[j, f.START_MOMENT_J] = stiffness * vec.dot(e, oj) + damping * rate_j


@kernel
def chain_forces(belt, state, step, iterate, dt):
    """Tension and moments of pitch of an iterate; sets the pairs' forces."""
    steep = angle_slope(belt, dt)
    for j in range(step.rows):
        own, next_one = vec.screw(state, j, f.CHANGE), vec.screw_ahead(state, j, f.CHANGE)
        (ui, wi), (uj, wj) = own, next_one
        ti, tj = vec.screw(step, j, f.TENSION_I), vec.screw(step, j, f.TENSION_J)
        stretch = vec.both_dot(ti, own) + state[j, f.CHANGE + f.ROW_V]
        stretch -= vec.both_dot(tj, next_one) + ahead(state, j, f.CHANGE + f.ROW_V)
        tension = fma(-step[j, f.TENSION_SLOPE], stretch, step[j, f.START_TENSION])
        iterate[j, f.ITERATE_TENSION] = tension

        du = vec.minus(uj, ui)
        ci, cj = vec.at(step, j, f.CHORD_I), vec.at(step, j, f.CHORD_J)
        si, sj = vec.at(step, j, f.TURN_I), vec.at(step, j, f.TURN_J)
        moment_i = fma(steep, vec.dot(ci, du) + vec.dot(si, wi), step[j, f.START_MOMENT_I])
        moment_j = fma(steep, vec.dot(cj, du) + vec.dot(sj, wj), step[j, f.START_MOMENT_J])
        push = vec.moved(vec.times(moment_i, ci), moment_j, cj)
        turn = vec.moved(vec.times(tension, ti[1]), -moment_i, si)
        vec.store_screw(iterate, j, f.PAIR_I, (vec.moved(push, tension, ti[0]), turn))
        force, turn = vec.both_times(-tension, tj)
        force, turn = vec.moved(force, -1.0, push), vec.moved(turn, -moment_j, sj)
        vec.store_screw(iterate, j, f.PAIR_J, (force, turn))
        iterate[j, f.PAIR_I + f.ROW_V], iterate[j, f.PAIR_J + f.ROW_V] = tension, -tension


@register_jitable
def pull_across(step, iterate, j, o):
    """Force of the ring's tension and of its bending in the plane on an element along o [N]."""
    pull = step[j, f.BENT_Y] * o[0] + step[j, f.BENT_Z] * o[1]
    pull += iterate[j, f.ITERATE_TENSION] * vec.dot(vec.at(step, j, f.TENSION_I), o)
    return pull - behind(iterate, j, f.ITERATE_TENSION) * vec.dot(vec.behind(step, j, f.TENSION_J), o)


@register_jitable
def ring_slip(state, step, j, share):
    """Slip at the old speeds and a share of their change [m/s]."""
    (u, omega), (line, lever) = motion(state, j, share), vec.screw(step, j, f.RING_LINE)
    v = state[j, f.V] + share * state[j, f.CHANGE + f.ROW_V]
    return v - vec.dot(line, u) - vec.dot(lever, omega)


@kernel
def saddle_forces(belt, state, step, iterate):
    """Friction of an iterate, by the normal force of the last step; adds to the residuals."""
    for j in range(step.rows):
        slip = ring_slip(state, step, j, 1.0)
        grip, slope, dual = ring_friction(belt, slip, state[j, f.RING_SLIP], state[j, f.RING_DUAL])
        normal = state[j, f.SADDLE]
        force = normal * grip
        iterate[j, f.RING_SLOPE] = normal * slope
        state[j, f.RING_SLIP], state[j, f.RING_FRICTION], state[j, f.RING_DUAL] = slip, force, dual
        vec.add_screw(iterate, j, f.RESIDUAL, vec.both_times(force, vec.screw(step, j, f.RING_LINE)))
        iterate[j, f.RESIDUAL + f.ROW_V] -= force
