"""Power that the laws of a step take from the motion, in lanes: losses, and numerical damping.

M (X - X_old) / dt = f times the mean speed (X + X_old) / 2, which belongs to q_k as the directions of all
forces do, is the change of kinetic energy without remainder. So a force takes its magnitude times the mean
rate along its direction: that is the loss of friction and dampers.

An elastic law has its magnitude -V'(g) from the end of the step. It takes -V'(g) r for the change r within a
step at the mean rate, and stores (V(g) - V(g - 2 r)) / 2: potentials half a step later and earlier, which add
up. The difference is >= 0, as V is convex: c r^2 where a contact stays closed, as of a damper c dt. The step
damps by that, and it is neither physics nor an error in the balance of power.
"""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, around, like
from cvt_hpc.models.pushbelt.belt import (
    ANGLE_I,
    ANGLE_J,
    BELT_LOSS,
    CHANGE,
    DAMPING_LOSS,
    DEPTH_REACHED,
    DRIVEN,
    DRIVEN_SPEED,
    DRIVING_SPEED,
    EDGE_LEVER_I,
    EDGE_LEVER_J,
    EDGE_REACHED,
    ELEMENT_DAMPED,
    FLANK,
    FLANK_DAMPED,
    FLANK_FRICTION_M,
    FLANK_FRICTION_T,
    FLANK_LOSS,
    HEAD_LEVER_I,
    HEAD_LEVER_J,
    HEAD_REACHED,
    HEADING_Y,
    HEADING_Z,
    MID_RADIUS,
    NORMAL_Y,
    NORMAL_Z,
    NOSE_LEVER_I,
    NOSE_LEVER_J,
    NOSE_REACHED,
    OMEGA,
    R_LEVER,
    R_Y,
    R_Z,
    RING_DAMPED,
    RING_FRICTION,
    RING_LOSS,
    T_LEVER,
    T_Y,
    T_Z,
    TENSION_I_Y,
    TENSION_I_Z,
    TENSION_J_Y,
    TENSION_J_Z,
    TENSION_SLOPE,
    TILT_DAMPED,
    TURN_Y,
    TURN_Z,
    U_Y,
    U_Z,
    V,
)
from cvt_hpc.models.pushbelt.border import book_openings, groove_of, of_pulley
from cvt_hpc.physics.contact_laws import damped

_FIRST, _COUNT = FLANK_LOSS, TILT_DAMPED + 1 - FLANK_LOSS  # totals that are added up here


@kernel
def book(belt, state, work, dt):
    """Add to the totals the work of a solved step, before it is accepted."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    driving_speed = state.pulleys[DRIVING_SPEED]
    driven_speed = state.pulleys[DRIVEN_SPEED] + 0.5 * state.increments[0]
    flank = ring = tilt = drag = between = sheaves = stretching = turning = like(0.0, elements[0, U_Y])
    for j in range(step.rows):
        dy, dz = elements[j, CHANGE], elements[j, CHANGE + 1]
        dw = elements[j, CHANGE + 2]
        next_dy, next_dz, next_dw = (
            ahead(elements, j, CHANGE),
            ahead(elements, j, CHANGE + 1),
            ahead(elements, j, CHANGE + 2),
        )
        y, z, w = elements[j, U_Y] + 0.5 * dy, elements[j, U_Z] + 0.5 * dz, elements[j, OMEGA] + 0.5 * dw
        v = elements[j, V] + 0.5 * elements[j, CHANGE + 3]
        next_y, next_z = ahead(elements, j, U_Y) + 0.5 * next_dy, ahead(elements, j, U_Z) + 0.5 * next_dz
        next_w = ahead(elements, j, OMEGA) + 0.5 * next_dw
        next_v = ahead(elements, j, V) + 0.5 * ahead(elements, j, CHANGE + 3)

        stretch = step[j, TENSION_I_Y] * y + step[j, TENSION_I_Z] * z + v
        stretch -= step[j, TENSION_J_Y] * next_y + step[j, TENSION_J_Z] * next_z + next_v
        stretching += step[j, TENSION_SLOPE] * stretch * stretch

        turn = step[j, TURN_Y] * (next_y - y) + step[j, TURN_Z] * (next_z - z)
        more = 0.5 * (step[j, TURN_Y] * (next_dy - dy) + step[j, TURN_Z] * (next_dz - dz))
        rate_i, rate_j = step[j, ANGLE_I] * (w - turn), step[j, ANGLE_J] * (next_w - turn)
        last_i = rate_i + step[j, ANGLE_I] * (0.5 * dw - more)
        last_j = rate_j + step[j, ANGLE_J] * (0.5 * next_dw - more)
        tilt += 0.5 * belt.angle_damping * (last_i * rate_i + last_j * rate_j)
        turning += 0.5 * dt * belt.angle_stiffness * (rate_i * rate_i + rate_j * rate_j)

        x_y, x_z = ahead(elements, j, HEADING_Y), ahead(elements, j, HEADING_Z)
        opening = x_y * (next_y - y) + x_z * (next_z - z)
        change = dt * (opening + step[j, EDGE_LEVER_I] * w + step[j, EDGE_LEVER_J] * next_w)
        between += damped(iterate[j, EDGE_REACHED], change, belt.contact_stiffness)
        change = dt * (opening + step[j, HEAD_LEVER_I] * w + step[j, HEAD_LEVER_J] * next_w)
        between += damped(iterate[j, HEAD_REACHED], change, belt.contact_stiffness)
        if belt.nose_clearance < np.inf:
            rate = x_z * (y - next_y) - x_y * (z - next_z)
            change = dt * (rate + step[j, NOSE_LEVER_I] * w + step[j, NOSE_LEVER_J] * next_w)
            offset, clearance = iterate[j, NOSE_REACHED], belt.nose_clearance
            between += damped(clearance - offset, -change, belt.nose_stiffness)
            between += damped(clearance + offset, change, belt.nose_stiffness)

        r_y, r_z, driven = step[j, R_Y], step[j, R_Z], elements[j, DRIVEN]
        radial = r_y * y + r_z * z + step[j, R_LEVER] * w
        rotation = of_pulley(driving_speed, driven_speed, driven)
        around_it = r_y * z - r_z * y + step[j, T_LEVER] * w
        sliding = around_it - step[j, MID_RADIUS] * rotation
        grip_m, grip_t = elements[j, FLANK_FRICTION_M], elements[j, FLANK_FRICTION_T]
        flank += 2.0 * (belt.cosine * grip_m * radial + grip_t * sliding)
        # the groove opens where an element is, and is another where it gets to
        opening, lean, bend = groove_of(belt, state, work, j, r_y, r_z, driven)
        angle = dt * around_it / step[j, MID_RADIUS]
        opening = opening + angle * lean
        change = dt * belt.sine * radial + belt.cosine * opening
        sheaves += 2.0 * damped(-iterate[j, DEPTH_REACHED], change, belt.flank_stiffness)
        # an element presses at the step's end where it was at its start: modes lag by that angle
        sheaves += 2.0 * belt.cosine * elements[j, FLANK] * angle * angle * bend

        slip = v - step[j, T_Y] * y - step[j, T_Z] * z
        ring += elements[j, RING_FRICTION] * slip
        n_y, n_z = step[j, NORMAL_Y], step[j, NORMAL_Z]
        across = n_y * y + n_z * z
        drag += belt.transverse_damping * across * (across + 0.5 * (n_y * dy + n_z * dz))
    scratch[0, FLANK_LOSS - _FIRST], scratch[0, RING_LOSS - _FIRST] = dt * flank, dt * ring
    scratch[0, DAMPING_LOSS - _FIRST], scratch[0, BELT_LOSS - _FIRST] = dt * tilt, dt * drag
    scratch[0, ELEMENT_DAMPED - _FIRST], scratch[0, FLANK_DAMPED - _FIRST] = between, sheaves
    scratch[0, RING_DAMPED - _FIRST], scratch[0, TILT_DAMPED - _FIRST] = dt * stretching, dt * turning
    for k in range(_COUNT):
        scratch[0, k] = around(scratch[0, k])
        state.totals[_FIRST + k] += scratch.data[0, k, 0]
    book_openings(belt, state, work)
