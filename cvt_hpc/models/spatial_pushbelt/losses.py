"""Power that the laws of a step take from the motion, in lanes: losses, and numerical damping.

As in the planar pushbelt (`models.pushbelt.border`, which derives it) a force takes its magnitude times the
mean rate (X + X_old) / 2 along its direction. Bending of the rings and springs of pitch and yaw damp nothing.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import like
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.border import add_to_totals, book_contacts, of_pulley, opening_of
from cvt_hpc.models.pushbelt.chain import contact_shares, ring_share
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import flank
from cvt_hpc.models.spatial_pushbelt import vectors as vec
from cvt_hpc.models.spatial_pushbelt.chain import motion, motion_ahead, ring_slip, shortening
from cvt_hpc.physics.contact_laws import taken


@kernel
def book_pairs(belt, state, work, dt):
    """Add to the totals what a solved step takes between elements and in the rings, before it is accepted."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    has_pins = belt.pin_clearance < np.inf
    contact = 0.5 * belt.contact_stiffness
    ahead_share, _, _ = contact_shares(belt, dt)
    half_ahead = 0.5 / ahead_share
    damper = belt.ring_time / ring_share(belt, dt)
    ring = tilt = drag = between = stretching = falling = like(0.0, elements[0, f.FLANK])
    for j in range(step.rows):
        (du, dw), (ju, jw) = vec.screw(elements, j, f.CHANGE), vec.screw_ahead(elements, j, f.CHANGE)
        (u, w), (next_u, next_w) = motion(elements, j, 0.5), motion_ahead(elements, j, 0.5)
        stretch = shortening(elements, step, j, 0.5)
        more = 0.5 * (step[j, f.START_TENSION] - iterate[j, f.ITERATE_TENSION])
        stretching += damper * stretch * (step[j, f.TENSION_SLOPE] * stretch + more)

        apart, more = vec.minus(next_u, u), vec.minus(ju, du)
        chord_i, chord_j = vec.at(step, j, f.CHORD_I), vec.at(step, j, f.CHORD_J)
        turn_i, turn_j = vec.at(step, j, f.TURN_I), vec.at(step, j, f.TURN_J)
        rate_i = vec.dot(chord_i, apart) + vec.dot(turn_i, w)
        rate_j = vec.dot(chord_j, apart) + vec.dot(turn_j, next_w)
        last_i = rate_i + 0.5 * (vec.dot(chord_i, more) + vec.dot(turn_i, dw))
        last_j = rate_j + 0.5 * (vec.dot(chord_j, more) + vec.dot(turn_j, jw))
        tilt += 0.5 * belt.angle_damping * (last_i * rate_i + last_j * rate_j)
        y = vec.at(step, j, f.YAW)
        yaw = vec.dot(y, w) - elements[j, f.SLOPE_RATE] - 0.5 * elements[j, f.CHANGE + f.ROW_P]
        last = yaw + 0.5 * (vec.dot(y, dw) - elements[j, f.CHANGE + f.ROW_P])
        tilt += belt.yaw_damping * yaw * last

        closing = vec.dot(vec.ahead(elements, j, f.HEADING), apart)
        for p in range(f.POINTS):
            a, b = vec.at(step, j, f.PUSH_LEVER_I + 3 * p), vec.at(step, j, f.PUSH_LEVER_J + 3 * p)
            change = dt * (closing + vec.dot(a, w) + vec.dot(b, next_w))
            gap = half_ahead * (iterate[j, f.PUSH_REACHED + p] - step[j, f.PUSH_GAP + p])
            gap = step[j, f.PUSH_MEAN + p] + gap - 0.5 * change
            between += taken(gap, change, contact, elements[j, f.PUSH + p])
        if has_pins:
            a, b = vec.at(step, j, f.PIN_LEVER_I), vec.at(step, j, f.PIN_LEVER_J)
            change = dt * (vec.dot(vec.at(step, j, f.PIN_NORMAL), apart) - vec.dot(a, w) + vec.dot(b, next_w))
            gap = half_ahead * (iterate[j, f.PIN_REACHED] - step[j, f.PIN_GAP])
            gap = step[j, f.PIN_MEAN] + gap - 0.5 * change
            between += taken(gap, change, belt.pin_stiffness, elements[j, f.PIN])

        ring += elements[j, f.RING_FRICTION] * ring_slip(elements, step, j, 0.5)
        v = elements[j, f.V] + 0.5 * elements[j, f.CHANGE + f.ROW_V]
        mass, coupling = vec.symmetric(step, j, f.INERTIA), vec.matrix(step, j, f.INERTIA_UW)
        falling -= vec.of_symmetric(mass, u)[1] + vec.of_matrix(coupling, w)[1]
        falling -= belt.ring_mass / dt * vec.at(step, j, f.RING_LINE)[1] * v
        n_y, n_z = step[j, f.NORMAL_Y], step[j, f.NORMAL_Z]
        across = n_y * u[0] + n_z * u[1]
        drag += belt.transverse_damping * across * (across + 0.5 * (n_y * du[0] + n_z * du[1]))
        drag += belt.lateral_damping * u[2] * (u[2] + 0.5 * du[2])
    add_to_totals(state, scratch, planar.RING_LOSS, dt * ring)
    add_to_totals(state, scratch, planar.DAMPING_LOSS, dt * tilt)
    add_to_totals(state, scratch, planar.BELT_LOSS, dt * drag)
    book_contacts(belt, state, scratch, between, dt)
    add_to_totals(state, scratch, planar.STRETCH_LOSS, dt * stretching)
    # inertia is that of a step, divided by it
    add_to_totals(state, scratch, planar.GRAVITY_WORK, dt * dt * belt.gravity * falling)


@kernel
def book_flanks(belt, state, work, dt):
    """Add to the totals what a solved step takes at the flanks, before it is accepted."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    driving_speed = state.pulleys[planar.DRIVING_SPEED]
    driven_speed = state.pulleys[planar.DRIVEN_SPEED] + 0.5 * state.increments[0]
    rubbed = sheaves = like(0.0, elements[0, f.FLANK])
    for j in range(step.rows):
        u, w = motion(elements, j, 0.5)
        driven = elements[j, f.DRIVEN]
        axis = flank.pulley_axis(belt, driven)
        rotation = of_pulley(driving_speed, driven_speed, driven)
        o = vec.at(elements, j, f.OUTWARD)
        a = vec.cross(o, vec.at(elements, j, f.HEADING))
        opening = opening_of(belt, state, work, j, driven)
        for p in range(f.POINTS):
            side, height, width = flank.flank_point(belt, p)
            lever = flank.lever_of(o, a, side, height, width)
            n, m, t = flank.flank_directions(belt, vec.at(step, j, f.RADIAL + 3 * p), axis, side)
            q = vec.plus(u, vec.cross(w, lever))
            around_it, radius = vec.dot(t, q), step[j, f.MID_RADIUS + p]
            rubbed += elements[j, f.FLANK_FRICTION_M + p] * vec.dot(m, q)
            rubbed += elements[j, f.FLANK_FRICTION_T + p] * (around_it - radius * rotation)
            change = dt * vec.dot(n, q) + belt.cosine * opening
            change += elements[j, f.SPREAD + p // 2] - step[j, f.LAST_SPREAD + p // 2]
            # the mean gap, of which the axial part that is reached is ahead
            gap = iterate[j, f.FLANK_REACHED + p] + dt * side * belt.cosine * vec.dot(axis, q)
            sheaves += taken(gap, change, 0.5 * belt.flank_stiffness, elements[j, f.FLANK + p])
    add_to_totals(state, scratch, planar.FLANK_LOSS, dt * rubbed)
    add_to_totals(state, scratch, planar.FLANK_DAMPED, sheaves)
