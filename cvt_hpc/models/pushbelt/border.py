"""The border of a belt's equations: unknowns that all elements share, of driven pulley and sheaves.

Sheaves of a pulley open by sum a_k psi_k(phi), psi 1, cos, sin, cos 2, sin 2, ..., each mode with its own
stiffness. Tilts (cos, sin) may lag: S_k (a_k + T_1 a_k') = s_k, the sum of psi_k times the axial forces
(Bullinger et al. 2005, eq. 9), with the rate of the parabola through the last three openings, of second order
and stable for any lag. Unknowns are the changes of the driven pulley's speed, and of a_k of the driving and
the driven sheaves.

Power that the laws of a step take from the motion, in lanes: losses, and numerical damping.

M (X - X_old) / dt = f times the mean speed (X + X_old) / 2, which belongs to q_k as the directions of all
forces do, is the change of kinetic energy without remainder. So a force takes its magnitude times the mean
rate along its direction: that is the loss of friction and dampers.

Springs of rings, tilt and flanks have their magnitude from the middle of the step: what they take from the
motion they store, but for flanks that close or open. So have contacts between elements, whose dampers take
all of the difference. What is not a damper's is the step's, neither physics nor an error in the balance of
power.
"""

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, around, like, maximum
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.chain import LEAST_CONTACT_TIME, contact_shares, four, four_ahead, ring_share
from cvt_hpc.physics.contact_laws import taken


@register_jitable
def of_pulley(driving, driven_one, driven):
    """The one of two numbers that belongs to the pulley of an element."""
    return driving + driven * (driven_one - driving)


@register_jitable
def set_shapes(belt, c, s, shapes, j):
    """psi_k at an element, from cosine and sine of its angle about its pulley."""
    cosine, sine = like(1.0, c), like(0.0, c)
    for k in range(belt.modal_stiffness.shape[1]):
        if k % 2 == 1:
            cosine, sine = cosine * c - sine * s, sine * c + cosine * s
            shapes[j, k] = cosine
        elif k > 0:
            shapes[j, k] = sine
        else:
            shapes[j, k] = 1.0


@register_jitable
def add_to_totals(state, scratch, total, share):
    """Add what each part of the ring has to one of the totals."""
    scratch[0, 0] = around(share)
    state.totals[total] += scratch.data[0, 0, 0]


@register_jitable
def book_contacts(belt, state, scratch, between, dt):
    """Add what contacts between elements take: their own damper's share is a loss, the rest is the step's."""
    own = belt.contact_time / max(belt.contact_time, LEAST_CONTACT_TIME * dt)
    add_to_totals(state, scratch, f.ELEMENT_LOSS, own * between)
    add_to_totals(state, scratch, f.ELEMENT_DAMPED, (1.0 - own) * between)


@register_jitable
def _lag_rate(increments, earlier, unknown, dt):
    """Rate of an opening at the end of a step [m/s], by its changes in this step and in the one before."""
    return (1.5 * increments[unknown] - 0.5 * earlier[unknown]) / dt


@kernel
def border_residuals(belt, changes, openings, load, torque, power, scratch, border, dt):
    """Set the last column of `border`; return the power residual of the belt [W].

    `changes` are two (1 + 2 modes,) arrays of the unknowns, in this step and in the one before; `torque` and
    `power` in lanes those of the elements on the driven pulley [N m], and what their residuals leave open
    [W]. A row of `scratch` holds the axial forces of the elements by the modes of both pulleys [N].
    """
    modes, last = belt.modal_stiffness.shape[1], border.shape[0]
    increments, earlier = changes
    for k in range(2 * modes):
        scratch[0, k] = around(scratch[0, k])
        pulley, mode = k // modes, k % modes
        opening = openings[pulley, mode] + increments[1 + k]
        held = belt.modal_stiffness[pulley, mode] * opening
        held += belt.modal_damping[pulley, mode] * _lag_rate(increments, earlier, 1 + k, dt)
        border[1 + k, last] = scratch.data[0, k, 0] - held
    scratch[0, 0], scratch[0, 1] = around(torque), around(power)
    border[0, last] = scratch.data[0, 0, 0] - load - belt.driven_inertia * increments[0] / dt
    return scratch.data[0, 1, 0]


@kernel
def close_border(belt, sums, border, dt):
    """Set the matrix of the border, and complete its right side, from sums over the elements.

    A row of `sums` for each unknown: the contribution of the elements' solutions without border, then by
    column.
    """
    unknowns, modes = border.shape[0], belt.modal_stiffness.shape[1]
    for row in range(unknowns):
        for column in range(unknowns + 1):
            place = (unknowns + 1) * row + column
            sums[0, place] = around(sums[0, place])
            found = sums.data[0, place, 0]
            if column == 0:
                border[row, unknowns] += found
            else:
                border[row, column - 1] = found
        if row == 0:
            border[row, row] += belt.driven_inertia / dt
        else:
            pulley, mode = (row - 1) // modes, (row - 1) % modes
            damping = 1.5 * belt.modal_damping[pulley, mode] / dt
            border[row, row] += belt.modal_stiffness[pulley, mode] + damping


@register_jitable
def opening_of(belt, state, work, j, driven):
    """Mean opening of each of the sheaves within a step at an element [m]."""
    modes = belt.modal_stiffness.shape[1]
    opening = like(0.0, driven)
    for k in range(modes):
        driving = 0.5 * (state.increments[1 + k] + work.increments[1 + k])
        driven_one = 0.5 * (state.increments[1 + modes + k] + work.increments[1 + modes + k])
        opening = opening + of_pulley(driving, driven_one, driven) * work.shapes[j, k]
    return opening


@kernel
def accept_border(belt, state, work, inputs, dt):
    """Take driven pulley, sheaves and time to the end of the step."""
    modes = belt.modal_stiffness.shape[1]
    for k in range(2 * modes):
        rate = _lag_rate(state.increments, work.increments, 1 + k, dt)
        # of both sheaves of a pulley
        state.totals[f.LAG_LOSS] += 2.0 * dt * belt.modal_damping[k // modes, k % modes] * rate * rate
        state.openings[k // modes, k % modes] += state.increments[1 + k]
    state.pulleys[f.DRIVEN_SPEED] += state.increments[0]
    state.totals[f.TIME] += dt
    speed = state.pulleys[f.DRIVEN_SPEED] - 0.5 * state.increments[0]
    state.totals[f.WORK_OUT] += dt * inputs[f.IN_LOAD] * speed


@kernel
def move_sheaves(belt, state, inputs, driving_thrust, driven_thrust, dt):
    """Take the radii to the end of the step, by the axial forces of the belt [N]."""
    driving = dt * belt.driving_rate * (inputs[f.IN_DRIVING_THRUST] - driving_thrust)
    driving += dt * inputs[f.IN_DRIVING_SHIFT]
    driven = dt * belt.driven_rate * (inputs[f.IN_DRIVEN_THRUST] - driven_thrust)
    state.pulleys[f.DRIVING_RADIUS] += driving
    state.pulleys[f.DRIVEN_RADIUS] += driven
    # both sheaves of a pulley close by the tangent of the wedge angle
    closing = 2.0 * belt.sine / belt.cosine
    state.totals[f.THRUST_WORK] -= closing * (driving_thrust * driving + driven_thrust * driven)


@kernel
def book(belt, state, work, dt):
    """Add to the totals the work of a solved step, before it is accepted."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    driving_speed = state.pulleys[f.DRIVING_SPEED]
    driven_speed = state.pulleys[f.DRIVEN_SPEED] + 0.5 * state.increments[0]
    ahead_share, _, _ = contact_shares(belt, dt)
    half_ahead = 0.5 / ahead_share
    damper = belt.ring_time / ring_share(belt, dt)
    flank = ring = tilt = drag = between = sheaves = stretching = falling = like(0.0, elements[0, f.U_Y])
    for j in range(step.rows):
        dy, dz, dw, dv = four(elements, j, f.CHANGE)
        y, z, w, v = four(elements, j, f.U_Y)
        y, z, w, v = y + 0.5 * dy, z + 0.5 * dz, w + 0.5 * dw, v + 0.5 * dv
        next_dy, next_dz, next_dw, next_dv = four_ahead(elements, j, f.CHANGE)
        next_y, next_z, next_w, next_v = four_ahead(elements, j, f.U_Y)
        next_y, next_z = next_y + 0.5 * next_dy, next_z + 0.5 * next_dz
        next_w, next_v = next_w + 0.5 * next_dw, next_v + 0.5 * next_dv

        stretch = step[j, f.TENSION_I_Y] * y + step[j, f.TENSION_I_Z] * z + v
        stretch -= step[j, f.TENSION_J_Y] * next_y + step[j, f.TENSION_J_Z] * next_z + next_v
        more = 0.5 * (step[j, f.START_TENSION] - iterate[j, f.ITERATE_TENSION])
        stretching += damper * stretch * (step[j, f.TENSION_SLOPE] * stretch + more)

        turn = step[j, f.TURN_Y] * (next_y - y) + step[j, f.TURN_Z] * (next_z - z)
        more = 0.5 * (step[j, f.TURN_Y] * (next_dy - dy) + step[j, f.TURN_Z] * (next_dz - dz))
        rate_i, rate_j = step[j, f.ANGLE_I] * (w - turn), step[j, f.ANGLE_J] * (next_w - turn)
        last_i = rate_i + step[j, f.ANGLE_I] * (0.5 * dw - more)
        last_j = rate_j + step[j, f.ANGLE_J] * (0.5 * next_dw - more)
        tilt += 0.5 * belt.angle_damping * (last_i * rate_i + last_j * rate_j)

        x_y, x_z = ahead(elements, j, f.HEADING_Y), ahead(elements, j, f.HEADING_Z)
        opening = x_y * (next_y - y) + x_z * (next_z - z)
        change = dt * (opening + step[j, f.EDGE_LEVER_I] * w + step[j, f.EDGE_LEVER_J] * next_w)
        gap = step[j, f.EDGE_MEAN] + half_ahead * (iterate[j, f.EDGE_REACHED] - step[j, f.EDGE_GAP])
        between += taken(gap - 0.5 * change, change, belt.contact_stiffness, elements[j, f.EDGE])
        change = dt * (opening + step[j, f.HEAD_LEVER_I] * w + step[j, f.HEAD_LEVER_J] * next_w)
        gap = step[j, f.HEAD_MEAN] + half_ahead * (iterate[j, f.HEAD_REACHED] - step[j, f.HEAD_GAP])
        between += taken(gap - 0.5 * change, change, belt.contact_stiffness, elements[j, f.HEAD])
        if belt.nose_clearance < np.inf:
            rate = x_z * (y - next_y) - x_y * (z - next_z)
            change = dt * (rate + step[j, f.NOSE_LEVER_I] * w + step[j, f.NOSE_LEVER_J] * next_w)
            offset = step[j, f.NOSE_MEAN] + half_ahead * (iterate[j, f.NOSE_REACHED] - step[j, f.NOSE_OFFSET])
            offset, clearance = offset - 0.5 * change, belt.nose_clearance
            above, below = maximum(elements[j, f.NOSE], 0.0), maximum(-elements[j, f.NOSE], 0.0)
            between += taken(clearance - offset, -change, belt.nose_stiffness, above)
            between += taken(clearance + offset, change, belt.nose_stiffness, below)

        r_y, r_z, driven = step[j, f.R_Y], step[j, f.R_Z], elements[j, f.DRIVEN]
        radial = r_y * y + r_z * z + step[j, f.R_LEVER] * w
        rotation = of_pulley(driving_speed, driven_speed, driven)
        around_it = r_y * z - r_z * y + step[j, f.T_LEVER] * w
        sliding = around_it - step[j, f.MID_RADIUS] * rotation
        grip_m, grip_t = elements[j, f.FLANK_FRICTION_M], elements[j, f.FLANK_FRICTION_T]
        flank += 2.0 * (belt.cosine * grip_m * radial + grip_t * sliding)
        opening = opening_of(belt, state, work, j, driven)
        change = dt * belt.sine * radial + belt.cosine * opening
        change += elements[j, f.SPREAD] - step[j, f.LAST_SPREAD]
        gap = -iterate[j, f.DEPTH_REACHED]
        sheaves += 2.0 * taken(gap, change, belt.flank_stiffness, elements[j, f.FLANK])

        slip = v - step[j, f.T_Y] * y - step[j, f.T_Z] * z
        ring += elements[j, f.RING_FRICTION] * slip
        falling -= belt.mass * z + belt.ring_mass * (z + step[j, f.T_Z] * slip)
        n_y, n_z = step[j, f.NORMAL_Y], step[j, f.NORMAL_Z]
        across = n_y * y + n_z * z
        drag += belt.transverse_damping * across * (across + 0.5 * (n_y * dy + n_z * dz))
    add_to_totals(state, scratch, f.FLANK_LOSS, dt * flank)
    add_to_totals(state, scratch, f.RING_LOSS, dt * ring)
    add_to_totals(state, scratch, f.DAMPING_LOSS, dt * tilt)
    add_to_totals(state, scratch, f.BELT_LOSS, dt * drag)
    book_contacts(belt, state, scratch, between, dt)
    add_to_totals(state, scratch, f.FLANK_DAMPED, sheaves)
    add_to_totals(state, scratch, f.STRETCH_LOSS, dt * stretching)
    add_to_totals(state, scratch, f.GRAVITY_WORK, dt * belt.gravity * falling)
