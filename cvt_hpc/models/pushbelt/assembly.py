"""Forces of an iterate, their residual, and the linear system of Newton's method, in lanes."""

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, behind, like, maximum
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.border import border_residuals, close_border, of_pulley
from cvt_hpc.models.pushbelt.chain import BETA, angle_slope, contact_shares, four, four_ahead, set_four
from cvt_hpc.models.pushbelt.friction import flank_friction, ring_friction
from cvt_hpc.models.pushbelt.local_bending import spread_bending
from cvt_hpc.physics.contact_laws import pressed
from cvt_hpc.solvers.linked_blocks import field_of_right

# Fields of a row of blocks at which right sides begin: the residual, then by the border's unknowns
RIGHT = field_of_right(f.UNKNOWNS)
RIGHT_SPEED = RIGHT + f.UNKNOWNS
RIGHT_OPENINGS = RIGHT_SPEED + f.UNKNOWNS


@kernel
def pair_forces(belt, state, work, dt):
    """Tension, forces of contacts and noses, moments of angles between neighbours, with slopes of contacts.

    Forces of noses take offsets back and are signed as these.
    """
    elements, step, iterate = state.elements, work.step, work.iterate
    steep, clearance = angle_slope(belt, dt), belt.nose_clearance
    stiffness = belt.contact_stiffness
    ahead_share, _, _ = contact_shares(belt, dt)
    pressing = ahead_share * dt
    for j in range(step.rows):
        iy, iz, iw, iv = four(elements, j, f.CHANGE)
        jy, jz, jw, jv = four_ahead(elements, j, f.CHANGE)

        stretch = step[j, f.TENSION_I_Y] * iy + step[j, f.TENSION_I_Z] * iz + iv
        stretch -= step[j, f.TENSION_J_Y] * jy + step[j, f.TENSION_J_Z] * jz + jv
        iterate[j, f.ITERATE_TENSION] = step[j, f.START_TENSION] - step[j, f.TENSION_SLOPE] * stretch

        turn = step[j, f.TURN_Y] * (jy - iy) + step[j, f.TURN_Z] * (jz - iz)
        iterate[j, f.MOMENT_I] = step[j, f.START_MOMENT_I] + steep * step[j, f.ANGLE_I] * (iw - turn)
        iterate[j, f.MOMENT_J] = step[j, f.START_MOMENT_J] + steep * step[j, f.ANGLE_J] * (jw - turn)

        x_y, x_z = ahead(elements, j, f.HEADING_Y), ahead(elements, j, f.HEADING_Z)
        closing = x_y * (jy - iy) + x_z * (jz - iz)
        a, b = step[j, f.EDGE_LEVER_I], step[j, f.EDGE_LEVER_J]
        gap = step[j, f.EDGE_GAP] + pressing * (closing + a * iw + b * jw)
        edge, k = pressed(gap, stiffness)
        iterate[j, f.EDGE_REACHED] = gap
        c, d = step[j, f.HEAD_LEVER_I], step[j, f.HEAD_LEVER_J]
        gap = step[j, f.HEAD_GAP] + pressing * (closing + c * iw + d * jw)
        head, m = pressed(gap, stiffness)
        iterate[j, f.HEAD_REACHED] = gap
        elements[j, f.EDGE], elements[j, f.HEAD] = edge, head
        iterate[j, f.CONTACT] = edge + head
        iterate[j, f.CONTACT_I], iterate[j, f.CONTACT_J] = edge * a + head * c, edge * b + head * d
        k, m = pressing * k, pressing * m
        iterate[j, f.STIFF] = k + m
        iterate[j, f.STIFF_I], iterate[j, f.STIFF_J] = k * a + m * c, k * b + m * d
        iterate[j, f.STIFF_II], iterate[j, f.STIFF_JJ] = k * a * a + m * c * c, k * b * b + m * d * d
        iterate[j, f.STIFF_IJ] = k * a * b + m * c * d

        if clearance < np.inf:
            rate = x_z * (iy - jy) - x_y * (iz - jz) + step[j, f.NOSE_LEVER_I] * iw
            offset = step[j, f.NOSE_OFFSET] + pressing * (rate + step[j, f.NOSE_LEVER_J] * jw)
            above, k = pressed(clearance - offset, belt.nose_stiffness)
            below, m = pressed(clearance + offset, belt.nose_stiffness)
            elements[j, f.NOSE], iterate[j, f.NOSE_SLOPE] = above - below, pressing * maximum(k, m)
            iterate[j, f.NOSE_REACHED] = offset


@kernel
def flank_depths(belt, state, work, dt):
    """Depth of the flanks in the sheaves, less what local bending spreads."""
    elements, step, iterate = state.elements, work.step, work.iterate
    increments, openings, shapes = state.increments, state.openings, work.shapes
    modes, share = belt.modal_stiffness.shape[1], BETA * dt * belt.sine
    for j in range(step.rows):
        deep = step[j, f.R_Y] * elements[j, f.CHANGE_Y] + step[j, f.R_Z] * elements[j, f.CHANGE_Z]
        deep = step[j, f.DEPTH] - share * (deep + step[j, f.R_LEVER] * elements[j, f.CHANGE_W])
        driven = elements[j, f.DRIVEN]
        for k in range(modes):
            driving_one = openings[0, k] + increments[1 + k]
            driven_one = openings[1, k] + increments[1 + modes + k]
            deep = deep - belt.cosine * of_pulley(driving_one, driven_one, driven) * shapes[j, k]
        iterate[j, f.DEPTH_REACHED] = deep
    if belt.local_compliance > 0.0:
        depths = iterate.data[:, f.DEPTH_REACHED : f.DEPTH_REACHED + f.POINTS]
        bend = belt.local_compliance, belt.flank_stiffness, belt.local_decay
        spread_bending(elements.data[:, f.DRIVEN], depths, elements.data[:, f.SPREAD], work.bent, *bend)
        for j in range(step.rows):
            iterate[j, f.DEPTH_REACHED] -= elements[j, f.SPREAD]


@kernel
def element_forces(belt, state, work, dt):
    """Forces of sheaves and ring friction on elements, with their slopes, by the depths of the flanks."""
    elements, step, iterate = state.elements, work.step, work.iterate
    wide, share = 1.0 / belt.cosine, BETA * dt * belt.sine
    driving_speed = state.pulleys[f.DRIVING_SPEED]
    driven_speed = state.pulleys[f.DRIVEN_SPEED] + state.increments[0]
    for j in range(step.rows):
        dy, dz, dw, dv = four(elements, j, f.CHANGE)
        u_y, u_z, omega = elements[j, f.U_Y] + dy, elements[j, f.U_Z] + dz, elements[j, f.OMEGA] + dw
        driven = elements[j, f.DRIVEN]

        slip = elements[j, f.V] + dv - step[j, f.T_Y] * u_y - step[j, f.T_Z] * u_z
        grip, slope, dual = ring_friction(belt, slip, elements[j, f.RING_SLIP], elements[j, f.RING_DUAL])
        normal = elements[j, f.SADDLE]
        iterate[j, f.RING_SLOPE] = normal * slope
        elements[j, f.RING_SLIP], elements[j, f.RING_DUAL] = slip, dual
        elements[j, f.RING_FRICTION] = normal * grip

        # the pair of flanks
        r_y, r_z, r_lever = step[j, f.R_Y], step[j, f.R_Z], step[j, f.R_LEVER]
        normal, stiff = pressed(-iterate[j, f.DEPTH_REACHED], belt.flank_stiffness)
        m_y, m_z = step[j, f.MID_R_Y], step[j, f.MID_R_Z]
        mr_lever, mt_lever = step[j, f.MID_R_LEVER], step[j, f.MID_T_LEVER]
        radius = step[j, f.MID_RADIUS]
        along = (m_y * u_y + m_z * u_z + mr_lever * omega) * wide
        rotation = of_pulley(driving_speed, driven_speed, driven)
        around_it = m_y * u_z - m_z * u_y + mt_lever * omega - radius * rotation
        earlier = elements[j, f.FLANK_SLIP_M], elements[j, f.FLANK_SLIP_T]
        dual = elements[j, f.FLANK_DUAL_M], elements[j, f.FLANK_DUAL_T]
        dual, forces = flank_friction(belt, (along, around_it), earlier, dual, elements[j, f.V_FILTERED], dt)
        elements[j, f.FLANK_DUAL_M], elements[j, f.FLANK_DUAL_T] = dual
        elements[j, f.FLANK_SLIP_M], elements[j, f.FLANK_SLIP_T] = along, around_it
        grip_m, grip_t, mm, mt, tm, tt = forces
        elements[j, f.FLANK] = normal
        elements[j, f.FLANK_FRICTION_M], elements[j, f.FLANK_FRICTION_T] = normal * grip_m, normal * grip_t
        # both flanks together; the meridian leans by the half wedge angle against the radius
        by_normal_r = 2.0 * (belt.sine - belt.cosine * grip_m)
        by_normal_t = -2.0 * grip_t
        iterate[j, f.FORCE_R], iterate[j, f.FORCE_T] = by_normal_r * normal, by_normal_t * normal
        twice = 2.0 * normal
        # meridian slip has the factor `wide`, its force in radial direction the cosine
        rr, rt, tr, tt = twice * mm, twice * belt.cosine * mt, twice * wide * tm, twice * tt
        press = share * stiff
        lean_r, lean_t = press * by_normal_r, press * by_normal_t
        iterate[j, f.SLOPE_R] = lean_r * r_y + rr * m_y - rt * m_z
        iterate[j, f.SLOPE_R + f.ROW_Z] = lean_r * r_z + rr * m_z + rt * m_y
        iterate[j, f.SLOPE_R + f.ROW_W] = lean_r * r_lever + rr * mr_lever + rt * mt_lever
        iterate[j, f.SLOPE_T] = lean_t * r_y + tr * m_y - tt * m_z
        iterate[j, f.SLOPE_T + f.ROW_Z] = lean_t * r_z + tr * m_z + tt * m_y
        iterate[j, f.SLOPE_T + f.ROW_W] = lean_t * r_lever + tr * mr_lever + tt * mt_lever
        iterate[j, f.DRIVEN_R], iterate[j, f.DRIVEN_T] = driven * rt * radius, driven * tt * radius
        yielding = belt.cosine * stiff
        iterate[j, f.OPENING_N] = yielding
        iterate[j, f.OPENING_R], iterate[j, f.OPENING_T] = by_normal_r * yielding, by_normal_t * yielding


@kernel
def residuals(belt, state, work, load, dt):
    """Set residuals: of elements in `iterate`, of the border in its last column; return the power's [W].

    Weight has no term of its own: masses resist the change of their speeds beyond that of free fall.
    """
    elements, step, iterate = state.elements, work.step, work.iterate
    scratch, shapes = work.scratch, work.shapes
    modes = belt.modal_stiffness.shape[1]
    per_dt, fall = 1.0 / dt, dt * belt.gravity
    power = torque = like(0.0, elements[0, f.FLANK])
    for k in range(2 * modes):
        scratch[0, k] = 0.0
    for j in range(step.rows):
        t_y, t_z = step[j, f.T_Y], step[j, f.T_Z]
        dy, dz, dw, dv = four(elements, j, f.CHANGE)
        dz_beyond = dz + fall
        across = belt.ring_mass * (t_z * dy - t_y * dz_beyond)
        n_y, n_z = step[j, f.NORMAL_Y], step[j, f.NORMAL_Z]
        drag = belt.transverse_damping * (n_y * (elements[j, f.U_Y] + dy) + n_z * (elements[j, f.U_Z] + dz))
        f_y = -per_dt * (belt.mass * dy + across * t_z) - drag * n_y + step[j, f.BENT_Y]
        f_z = -per_dt * (belt.mass * dz_beyond - across * t_y) - drag * n_z + step[j, f.BENT_Z]
        f_w, f_v = -per_dt * belt.inertia * dw, -per_dt * belt.ring_mass * (dv + fall * t_z)

        tension = iterate[j, f.ITERATE_TENSION]
        f_y += tension * step[j, f.TENSION_I_Y]
        f_z += tension * step[j, f.TENSION_I_Z]
        f_v += tension
        moment = iterate[j, f.MOMENT_I] * step[j, f.ANGLE_I]
        both = moment + iterate[j, f.MOMENT_J] * step[j, f.ANGLE_J]
        f_y, f_z, f_w = f_y - both * step[j, f.TURN_Y], f_z - both * step[j, f.TURN_Z], f_w - moment
        contact = iterate[j, f.CONTACT]
        x_y, x_z = ahead(elements, j, f.HEADING_Y), ahead(elements, j, f.HEADING_Z)
        f_y, f_z = f_y - contact * x_y, f_z - contact * x_z
        f_w += iterate[j, f.CONTACT_I]
        nose = elements[j, f.NOSE]
        f_y, f_z = f_y - nose * x_z, f_z + nose * x_y
        f_w -= nose * step[j, f.NOSE_LEVER_I]

        tension = behind(iterate, j, f.ITERATE_TENSION)
        f_y -= tension * behind(step, j, f.TENSION_J_Y)
        f_z -= tension * behind(step, j, f.TENSION_J_Z)
        f_v -= tension
        moment = behind(iterate, j, f.MOMENT_J) * behind(step, j, f.ANGLE_J)
        both = moment + behind(iterate, j, f.MOMENT_I) * behind(step, j, f.ANGLE_I)
        f_y, f_z = f_y + both * behind(step, j, f.TURN_Y), f_z + both * behind(step, j, f.TURN_Z)
        f_w -= moment
        contact = behind(iterate, j, f.CONTACT)
        f_y, f_z = f_y + contact * elements[j, f.HEADING_Y], f_z + contact * elements[j, f.HEADING_Z]
        f_w += behind(iterate, j, f.CONTACT_J)
        nose = behind(elements, j, f.NOSE)
        f_y, f_z = f_y + nose * elements[j, f.HEADING_Z], f_z - nose * elements[j, f.HEADING_Y]
        f_w -= nose * behind(step, j, f.NOSE_LEVER_J)

        radial, tangential = iterate[j, f.FORCE_R], iterate[j, f.FORCE_T]
        r_y, r_z = step[j, f.R_Y], step[j, f.R_Z]
        f_y += radial * r_y - tangential * r_z
        f_z += radial * r_z + tangential * r_y
        f_w += radial * step[j, f.R_LEVER] + tangential * step[j, f.T_LEVER]
        grip = elements[j, f.RING_FRICTION]
        f_y, f_z, f_v = f_y + grip * t_y, f_z + grip * t_z, f_v - grip
        set_four(iterate, j, f.RESIDUAL, (f_y, f_z, f_w, f_v))

        power += (elements[j, f.U_Y] + dy) * f_y + (elements[j, f.U_Z] + dz) * f_z
        power += (elements[j, f.OMEGA] + dw) * f_w + (elements[j, f.V] + dv) * f_v
        torque -= elements[j, f.DRIVEN] * step[j, f.MID_RADIUS] * tangential
        for k in range(modes):
            axial = belt.cosine * elements[j, f.FLANK] * shapes[j, k]
            scratch[0, modes + k] += elements[j, f.DRIVEN] * axial
            scratch[0, k] += (1.0 - elements[j, f.DRIVEN]) * axial
    changes = state.increments, work.increments
    return border_residuals(belt, changes, state.openings, load, torque, power, scratch, work.border, dt)


@register_jitable
def _add_three(array, j, first, values):
    """Add to three fields of a row."""
    for k in range(3):
        array[j, first + k] += values[k]


@kernel
def _add_noses(state, work):
    """Add the slopes of noses to the blocks of both elements."""
    elements, step, iterate = state.elements, work.step, work.iterate
    blocks = work.blocks
    for j in range(step.rows):
        o_y, o_z = ahead(elements, j, f.HEADING_Z), -ahead(elements, j, f.HEADING_Y)
        k, a, b = iterate[j, f.NOSE_SLOPE], step[j, f.NOSE_LEVER_I], step[j, f.NOSE_LEVER_J]
        yy, yz, zz = k * o_y * o_y, k * o_y * o_z, k * o_z * o_z
        yw, zw, ww = k * o_y * a, k * o_z * a, k * a * a
        _add_three(blocks, j, f.LINKED + f.YY, (-yy, -yz, -yw))
        _add_three(blocks, j, f.LINKED + f.YZ, (-yz, -zz, -zw))
        _add_three(blocks, j, f.LINKED + f.YW, (k * o_y * b, k * o_z * b, k * a * b))

        o_y, o_z = elements[j, f.HEADING_Z], -elements[j, f.HEADING_Y]
        k, b = behind(iterate, j, f.NOSE_SLOPE), behind(step, j, f.NOSE_LEVER_J)
        yy, yz, zz = yy + k * o_y * o_y, yz + k * o_y * o_z, zz + k * o_z * o_z
        yw, zw, ww = yw - k * o_y * b, zw - k * o_z * b, ww + k * b * b
        _add_three(blocks, j, f.YY, (yy, yz, yw))
        _add_three(blocks, j, f.YZ, (yz, zz, zw))
        _add_three(blocks, j, f.YW, (yw, zw, ww))


@kernel
def assemble(belt, state, work, dt):
    """Blocks and right sides of the elements' equations: the corrections that take the residuals to zero.

    The right sides are the residuals, and the columns of the border's unknowns: the driven pulley's speed and
    the openings of the sheaves.
    """
    elements, step, iterate = state.elements, work.step, work.iterate
    blocks, shapes = work.blocks, work.shapes
    modes = belt.modal_stiffness.shape[1]
    for j in range(step.rows):
        x_y, x_z = ahead(elements, j, f.HEADING_Y), ahead(elements, j, f.HEADING_Z)
        k, ki, kj = iterate[j, f.STIFF], iterate[j, f.STIFF_I], iterate[j, f.STIFF_J]
        none = like(0.0, k)
        yy, yz, zz = k * x_y * x_y, k * x_y * x_z, k * x_z * x_z
        yw, zw, ww = -ki * x_y, -ki * x_z, iterate[j, f.STIFF_II]
        y, z, w, v = four(step, j, f.LINK + f.YY)
        set_four(blocks, j, f.LINKED + f.YY, (y - yy, z - yz, w - yw, v))
        y, z, w, v = four(step, j, f.LINK + f.YZ)
        set_four(blocks, j, f.LINKED + f.YZ, (y - yz, z - zz, w - zw, v))
        y, z, w, v = four(step, j, f.LINK + f.YW)
        set_four(blocks, j, f.LINKED + f.YW, (y - kj * x_y, z - kj * x_z, iterate[j, f.STIFF_IJ], none))
        set_four(blocks, j, f.LINKED + f.YV, four(step, j, f.LINK + f.YV))

        x_y, x_z = elements[j, f.HEADING_Y], elements[j, f.HEADING_Z]
        k, kj = behind(iterate, j, f.STIFF), behind(iterate, j, f.STIFF_J)
        yy, yz, zz = yy + k * x_y * x_y, yz + k * x_y * x_z, zz + k * x_z * x_z
        yw, zw, ww = yw + kj * x_y, zw + kj * x_z, ww + behind(iterate, j, f.STIFF_JJ)
        t_y, t_z, k = step[j, f.T_Y], step[j, f.T_Z], iterate[j, f.RING_SLOPE]
        yy, yz, zz = yy + k * t_y * t_y, yz + k * t_y * t_z, zz + k * t_z * t_z

        r_y, r_z, r_w = step[j, f.R_Y], step[j, f.R_Z], step[j, f.R_LEVER]
        t_w = step[j, f.T_LEVER]
        a, b = iterate[j, f.SLOPE_R], iterate[j, f.SLOPE_T]
        y, z, w, v = four(step, j, f.DIAGONAL + f.YY)
        y, z, w = y + yy + r_y * a - r_z * b, z + yz + r_z * a + r_y * b, w + yw + r_w * a + t_w * b
        yv = v - k * t_y
        set_four(blocks, j, f.YY, (y, z, w, yv))
        a, b = iterate[j, f.SLOPE_R + f.ROW_Z], iterate[j, f.SLOPE_T + f.ROW_Z]
        y, z, w, v = four(step, j, f.DIAGONAL + f.YZ)
        y, z, w = y + yz + r_y * a - r_z * b, z + zz + r_z * a + r_y * b, w + zw + r_w * a + t_w * b
        zv = v - k * t_z
        set_four(blocks, j, f.YZ, (y, z, w, zv))
        a, b = iterate[j, f.SLOPE_R + f.ROW_W], iterate[j, f.SLOPE_T + f.ROW_W]
        y, z, w, v = four(step, j, f.DIAGONAL + f.YW)
        y, z, w = y + yw + r_y * a - r_z * b, z + zw + r_z * a + r_y * b, w + ww + r_w * a + t_w * b
        set_four(blocks, j, f.YW, (y, z, w, none))
        set_four(blocks, j, f.YV, (yv, zv, none, step[j, f.DIAGONAL + f.VV] + k))

        set_four(blocks, j, RIGHT, four(iterate, j, f.RESIDUAL))
        a, b = iterate[j, f.DRIVEN_R], iterate[j, f.DRIVEN_T]
        y, z, w = r_z * b - r_y * a, -(r_z * a + r_y * b), -(r_w * a + t_w * b)
        set_four(blocks, j, RIGHT_SPEED, (y, z, w, none))
        a, b = iterate[j, f.OPENING_R], iterate[j, f.OPENING_T]
        f_y, f_z, f_w = r_y * a - r_z * b, r_z * a + r_y * b, r_w * a + t_w * b
        driven = elements[j, f.DRIVEN]
        for m in range(modes):
            one, other = (1.0 - driven) * shapes[j, m], driven * shapes[j, m]
            first = RIGHT_OPENINGS + f.UNKNOWNS * m
            set_four(blocks, j, first, (f_y * one, f_z * one, f_w * one, none))
            first += f.UNKNOWNS * modes
            set_four(blocks, j, first, (f_y * other, f_z * other, f_w * other, none))
    if belt.nose_clearance < np.inf:
        _add_noses(state, work)


@register_jitable
def _add_to_border(belt, sums, row, slopes, by_opening, driven, shapes, blocks, j):
    """Add an element's part to a row: by openings, less by its speeds in all solutions."""
    modes = belt.modal_stiffness.shape[1]
    width = 2 + 2 * modes
    first = width * row
    a, b, c = slopes
    for m in range(modes):
        sums[0, first + 2 + m] += (1.0 - driven) * by_opening * shapes[j, m]
        sums[0, first + 2 + modes + m] += driven * by_opening * shapes[j, m]
    for column in range(width):
        at = RIGHT + f.UNKNOWNS * column
        y, z = blocks[j, at + f.ROW_Y], blocks[j, at + f.ROW_Z]
        sums[0, first + column] -= a * y + b * z + c * blocks[j, at + f.ROW_W]


@kernel
def close(belt, state, work, dt):
    """Close the system of the border: its slopes by its unknowns, less the contribution of the elements.

    The right sides of `blocks` hold the solution without border, then those for its columns.
    """
    elements, step, iterate = state.elements, work.step, work.iterate
    blocks, shapes, sums = work.blocks, work.shapes, work.sums
    modes = belt.modal_stiffness.shape[1]
    width = 2 + 2 * modes
    pressing = BETA * dt * belt.sine
    for field in range((width - 1) * width):
        sums[0, field] = 0.0
    for j in range(step.rows):
        driven = elements[j, f.DRIVEN]
        weight = -driven * step[j, f.MID_RADIUS]
        a, b, c = iterate[j, f.SLOPE_T], iterate[j, f.SLOPE_T + f.ROW_Z], iterate[j, f.SLOPE_T + f.ROW_W]
        sums[0, 1] += step[j, f.MID_RADIUS] * iterate[j, f.DRIVEN_T]
        by_opening = weight * iterate[j, f.OPENING_T]
        slopes = weight * a, weight * b, weight * c
        _add_to_border(belt, sums, 0, slopes, by_opening, driven, shapes, blocks, j)
        a, b, c = pressing * step[j, f.R_Y], pressing * step[j, f.R_Z], pressing * step[j, f.R_LEVER]
        for k in range(2 * modes):
            weight = shapes[j, k % modes] * (driven if k >= modes else 1.0 - driven) * iterate[j, f.OPENING_N]
            slopes = weight * a, weight * b, weight * c
            _add_to_border(belt, sums, 1 + k, slopes, belt.cosine * weight, driven, shapes, blocks, j)
    close_border(belt, sums, work.border, dt)
