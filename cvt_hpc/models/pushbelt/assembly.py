"""Forces of an iterate, their residual, and the linear system of Newton's method, in lanes."""

from __future__ import annotations

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, behind, like
from cvt_hpc.models.pushbelt.belt import (
    ANGLE_I,
    ANGLE_J,
    CHANGE,
    CONTACT,
    CONTACT_I,
    CONTACT_J,
    DEPTH_REACHED,
    DIAGONAL,
    DRIVEN,
    DRIVEN_R,
    DRIVEN_SPEED,
    DRIVEN_T,
    DRIVING_SPEED,
    EDGE,
    EDGE_GAP,
    EDGE_LEVER_I,
    EDGE_LEVER_J,
    EDGE_REACHED,
    FLANK,
    FLANK_DUAL_M,
    FLANK_DUAL_T,
    FLANK_FRICTION_M,
    FLANK_FRICTION_T,
    FLANK_SLIP_M,
    FLANK_SLIP_T,
    FORCE_R,
    FORCE_T,
    HEAD,
    HEAD_GAP,
    HEAD_LEVER_I,
    HEAD_LEVER_J,
    HEAD_REACHED,
    HEADING_Y,
    HEADING_Z,
    ITERATE_TENSION,
    LINK,
    MID_R_LEVER,
    MID_R_Y,
    MID_R_Z,
    MID_RADIUS,
    MID_T_LEVER,
    MOMENT_I,
    MOMENT_J,
    NORMAL_Y,
    NORMAL_Z,
    NOSE,
    NOSE_LEVER_I,
    NOSE_LEVER_J,
    OMEGA,
    OPENING_N,
    OPENING_R,
    OPENING_T,
    PREDICTED_DEPTH,
    PREDICTED_MOMENT_I,
    PREDICTED_MOMENT_J,
    PREDICTED_TENSION,
    R_LEVER,
    R_Y,
    R_Z,
    RESIDUAL,
    RING_DUAL,
    RING_FRICTION,
    RING_SLIP,
    RING_SLOPE,
    SADDLE,
    SLOPE_R,
    SLOPE_T,
    STIFF,
    STIFF_I,
    STIFF_II,
    STIFF_IJ,
    STIFF_J,
    STIFF_JJ,
    T_LEVER,
    T_Y,
    T_Z,
    TENSION_I_Y,
    TENSION_I_Z,
    TENSION_J_Y,
    TENSION_J_Z,
    TENSION_SLOPE,
    TURN_Y,
    TURN_Z,
    U_Y,
    U_Z,
    V_FILTERED,
    V,
)
from cvt_hpc.models.pushbelt.border import border_residuals, of_pulley
from cvt_hpc.models.pushbelt.friction import flank_friction, ring_friction
from cvt_hpc.physics.contact_laws import pressed
from cvt_hpc.solvers.linked_blocks import field_of_right

RIGHT = field_of_right(4)


@kernel
def pair_forces(belt, state, step, iterate, dt):
    """Tension, contact forces and moments of angles between neighbours, with the slopes of contacts."""
    steep = 0.5 * (dt * belt.angle_stiffness + belt.angle_damping)
    stiffness = belt.contact_stiffness
    for j in range(step.rows):
        iy, iz = state[j, CHANGE], state[j, CHANGE + 1]
        iw, iv = state[j, CHANGE + 2], state[j, CHANGE + 3]
        jy, jz = ahead(state, j, CHANGE), ahead(state, j, CHANGE + 1)
        jw, jv = ahead(state, j, CHANGE + 2), ahead(state, j, CHANGE + 3)

        stretch = step[j, TENSION_I_Y] * iy + step[j, TENSION_I_Z] * iz + iv
        stretch -= step[j, TENSION_J_Y] * jy + step[j, TENSION_J_Z] * jz + jv
        iterate[j, ITERATE_TENSION] = step[j, PREDICTED_TENSION] - step[j, TENSION_SLOPE] * stretch

        turn = step[j, TURN_Y] * (jy - iy) + step[j, TURN_Z] * (jz - iz)
        iterate[j, MOMENT_I] = step[j, PREDICTED_MOMENT_I] + steep * step[j, ANGLE_I] * (iw - turn)
        iterate[j, MOMENT_J] = step[j, PREDICTED_MOMENT_J] + steep * step[j, ANGLE_J] * (jw - turn)

        x_y, x_z = ahead(state, j, HEADING_Y), ahead(state, j, HEADING_Z)
        closing = x_y * (jy - iy) + x_z * (jz - iz)
        a, b = step[j, EDGE_LEVER_I], step[j, EDGE_LEVER_J]
        gap = step[j, EDGE_GAP] + dt * (closing + a * iw + b * jw)
        edge, k = pressed(gap, stiffness)
        iterate[j, EDGE_REACHED] = gap
        c, d = step[j, HEAD_LEVER_I], step[j, HEAD_LEVER_J]
        gap = step[j, HEAD_GAP] + dt * (closing + c * iw + d * jw)
        head, m = pressed(gap, stiffness)
        iterate[j, HEAD_REACHED] = gap
        state[j, EDGE], state[j, HEAD] = edge, head
        iterate[j, CONTACT] = edge + head
        iterate[j, CONTACT_I], iterate[j, CONTACT_J] = edge * a + head * c, edge * b + head * d
        k, m = dt * k, dt * m
        iterate[j, STIFF] = k + m
        iterate[j, STIFF_I], iterate[j, STIFF_J] = k * a + m * c, k * b + m * d
        iterate[j, STIFF_II], iterate[j, STIFF_JJ] = k * a * a + m * c * c, k * b * b + m * d * d
        iterate[j, STIFF_IJ] = k * a * b + m * c * d


@kernel
def element_forces(belt, state, pulleys, increments, openings, shapes, step, iterate, dt):
    """Forces of sheaves and ring friction on elements, with their slopes.

    `increments` are the changes of the border's unknowns since the last step: of the driven pulley's speed,
    and of the openings of the driving and the driven sheaves.
    """
    modes = belt.modal_stiffness.shape[1]
    wide = 1.0 / belt.cosine
    driving_speed, driven_speed = pulleys[DRIVING_SPEED], pulleys[DRIVEN_SPEED] + increments[0]
    for j in range(step.rows):
        dy, dz = state[j, CHANGE], state[j, CHANGE + 1]
        dw, dv = state[j, CHANGE + 2], state[j, CHANGE + 3]
        u_y, u_z, omega = state[j, U_Y] + dy, state[j, U_Z] + dz, state[j, OMEGA] + dw
        driven = state[j, DRIVEN]

        slip = state[j, V] + dv - step[j, T_Y] * u_y - step[j, T_Z] * u_z
        grip, slope, dual = ring_friction(belt, slip, state[j, RING_SLIP], state[j, RING_DUAL])
        normal = state[j, SADDLE]
        iterate[j, RING_SLOPE] = normal * slope
        state[j, RING_SLIP], state[j, RING_FRICTION], state[j, RING_DUAL] = slip, normal * grip, dual

        # the pair of flanks
        r_y, r_z, r_lever = step[j, R_Y], step[j, R_Z], step[j, R_LEVER]
        deep = step[j, PREDICTED_DEPTH] - dt * belt.sine * (r_y * dy + r_z * dz + r_lever * dw)
        for k in range(modes):
            driving, driven_one = (
                openings[0, k] + increments[1 + k],
                openings[1, k] + increments[1 + modes + k],
            )
            deep = deep - belt.cosine * of_pulley(driving, driven_one, driven) * shapes[j, k]
        normal, stiff = pressed(-deep, belt.flank_stiffness)
        iterate[j, DEPTH_REACHED] = deep
        m_y, m_z = step[j, MID_R_Y], step[j, MID_R_Z]
        mr_lever, mt_lever = step[j, MID_R_LEVER], step[j, MID_T_LEVER]
        radius = step[j, MID_RADIUS]
        along = (m_y * u_y + m_z * u_z + mr_lever * omega) * wide
        rotation = of_pulley(driving_speed, driven_speed, driven)
        around_it = m_y * u_z - m_z * u_y + mt_lever * omega - radius * rotation
        earlier = state[j, FLANK_SLIP_M], state[j, FLANK_SLIP_T]
        dual = state[j, FLANK_DUAL_M], state[j, FLANK_DUAL_T]
        dual, forces = flank_friction(belt, (along, around_it), earlier, dual, state[j, V_FILTERED], dt)
        state[j, FLANK_DUAL_M], state[j, FLANK_DUAL_T] = dual
        state[j, FLANK_SLIP_M], state[j, FLANK_SLIP_T] = along, around_it
        grip_m, grip_t, mm, mt, tm, tt = forces
        state[j, FLANK] = normal
        state[j, FLANK_FRICTION_M], state[j, FLANK_FRICTION_T] = normal * grip_m, normal * grip_t
        # both flanks together; the meridian leans by the half wedge angle against the radius
        by_normal_r = 2.0 * (belt.sine - belt.cosine * grip_m)
        by_normal_t = -2.0 * grip_t
        iterate[j, FORCE_R], iterate[j, FORCE_T] = by_normal_r * normal, by_normal_t * normal
        twice = 2.0 * normal
        # meridian slip has the factor `wide`, its force in radial direction the cosine
        rr, rt, tr, tt = twice * mm, twice * belt.cosine * mt, twice * wide * tm, twice * tt
        press = dt * belt.sine * stiff
        lean_r, lean_t = press * by_normal_r, press * by_normal_t
        iterate[j, SLOPE_R] = lean_r * r_y + rr * m_y - rt * m_z
        iterate[j, SLOPE_R + 1] = lean_r * r_z + rr * m_z + rt * m_y
        iterate[j, SLOPE_R + 2] = lean_r * r_lever + rr * mr_lever + rt * mt_lever
        iterate[j, SLOPE_T] = lean_t * r_y + tr * m_y - tt * m_z
        iterate[j, SLOPE_T + 1] = lean_t * r_z + tr * m_z + tt * m_y
        iterate[j, SLOPE_T + 2] = lean_t * r_lever + tr * mr_lever + tt * mt_lever
        iterate[j, DRIVEN_R], iterate[j, DRIVEN_T] = driven * rt * radius, driven * tt * radius
        yielding = belt.cosine * stiff
        iterate[j, OPENING_N] = yielding
        iterate[j, OPENING_R], iterate[j, OPENING_T] = by_normal_r * yielding, by_normal_t * yielding


@kernel
def residuals(belt, state, pulleys, increments, openings, shapes, load, step, iterate, scratch, border, dt):
    """Residuals of all equations: of elements in `iterate`, of the border in the last column of `border`.

    Returns
    -------
    float
        Power residual of the belt [W].
    """
    modes = belt.modal_stiffness.shape[1]
    per_dt = 1.0 / dt
    power = torque = like(0.0, state[0, FLANK])
    for k in range(2 * modes):
        scratch[0, k] = 0.0
    for j in range(step.rows):
        t_y, t_z = step[j, T_Y], step[j, T_Z]
        dy, dz = state[j, CHANGE], state[j, CHANGE + 1]
        dw, dv = state[j, CHANGE + 2], state[j, CHANGE + 3]
        across = belt.ring_mass * (t_z * dy - t_y * dz)
        n_y, n_z = step[j, NORMAL_Y], step[j, NORMAL_Z]
        drag = belt.transverse_damping * (n_y * (state[j, U_Y] + dy) + n_z * (state[j, U_Z] + dz))
        f_y = -per_dt * (belt.mass * dy + across * t_z) - drag * n_y
        f_z = -per_dt * (belt.mass * dz - across * t_y) - drag * n_z
        f_w, f_v = -per_dt * belt.inertia * dw, -per_dt * belt.ring_mass * dv

        tension = iterate[j, ITERATE_TENSION]
        f_y, f_z, f_v = (
            f_y + tension * step[j, TENSION_I_Y],
            f_z + tension * step[j, TENSION_I_Z],
            f_v + tension,
        )
        moment = iterate[j, MOMENT_I] * step[j, ANGLE_I]
        both = moment + iterate[j, MOMENT_J] * step[j, ANGLE_J]
        f_y, f_z, f_w = f_y - both * step[j, TURN_Y], f_z - both * step[j, TURN_Z], f_w - moment
        contact = iterate[j, CONTACT]
        f_y, f_z = f_y - contact * ahead(state, j, HEADING_Y), f_z - contact * ahead(state, j, HEADING_Z)
        f_w += iterate[j, CONTACT_I]
        nose = state[j, NOSE]
        f_y, f_z = f_y - nose * ahead(state, j, HEADING_Z), f_z + nose * ahead(state, j, HEADING_Y)
        f_w -= nose * step[j, NOSE_LEVER_I]

        tension = behind(iterate, j, ITERATE_TENSION)
        f_y -= tension * behind(step, j, TENSION_J_Y)
        f_z -= tension * behind(step, j, TENSION_J_Z)
        f_v -= tension
        moment = behind(iterate, j, MOMENT_J) * behind(step, j, ANGLE_J)
        both = moment + behind(iterate, j, MOMENT_I) * behind(step, j, ANGLE_I)
        f_y, f_z = f_y + both * behind(step, j, TURN_Y), f_z + both * behind(step, j, TURN_Z)
        f_w -= moment
        contact = behind(iterate, j, CONTACT)
        f_y, f_z = f_y + contact * state[j, HEADING_Y], f_z + contact * state[j, HEADING_Z]
        f_w += behind(iterate, j, CONTACT_J)
        nose = behind(state, j, NOSE)
        f_y, f_z = f_y + nose * state[j, HEADING_Z], f_z - nose * state[j, HEADING_Y]
        f_w -= nose * behind(step, j, NOSE_LEVER_J)

        radial, tangential = iterate[j, FORCE_R], iterate[j, FORCE_T]
        r_y, r_z = step[j, R_Y], step[j, R_Z]
        f_y += radial * r_y - tangential * r_z
        f_z += radial * r_z + tangential * r_y
        f_w += radial * step[j, R_LEVER] + tangential * step[j, T_LEVER]
        grip = state[j, RING_FRICTION]
        f_y, f_z, f_v = f_y + grip * t_y, f_z + grip * t_z, f_v - grip
        iterate[j, RESIDUAL], iterate[j, RESIDUAL + 1] = f_y, f_z
        iterate[j, RESIDUAL + 2], iterate[j, RESIDUAL + 3] = f_w, f_v

        power += (state[j, U_Y] + dy) * f_y + (state[j, U_Z] + dz) * f_z
        power += (state[j, OMEGA] + dw) * f_w + (state[j, V] + dv) * f_v
        torque -= state[j, DRIVEN] * step[j, MID_RADIUS] * tangential
        for k in range(modes):
            axial = belt.cosine * state[j, FLANK] * shapes[j, k]
            scratch[0, modes + k] += state[j, DRIVEN] * axial
            scratch[0, k] += (1.0 - state[j, DRIVEN]) * axial
    return border_residuals(belt, increments, openings, load, torque, power, scratch, border, dt)


@kernel
def assemble(belt, state, shapes, step, iterate, blocks):
    """Blocks and right sides of the elements' equations: the corrections that take the residuals to zero.

    The right sides are the residuals, and the columns of the border's unknowns: the driven pulley's speed and
    the openings of the sheaves.
    """
    modes = belt.modal_stiffness.shape[1]
    for j in range(step.rows):
        x_y, x_z = ahead(state, j, HEADING_Y), ahead(state, j, HEADING_Z)
        k, ki, kj = iterate[j, STIFF], iterate[j, STIFF_I], iterate[j, STIFF_J]
        yy, yz, zz = k * x_y * x_y, k * x_y * x_z, k * x_z * x_z
        yw, zw, ww = -ki * x_y, -ki * x_z, iterate[j, STIFF_II]
        blocks[j, 16], blocks[j, 17], blocks[j, 18] = (
            step[j, LINK] - yy,
            step[j, LINK + 1] - yz,
            step[j, LINK + 2] - yw,
        )
        blocks[j, 19] = step[j, LINK + 3]
        blocks[j, 20], blocks[j, 21], blocks[j, 22] = (
            step[j, LINK + 4] - yz,
            step[j, LINK + 5] - zz,
            step[j, LINK + 6] - zw,
        )
        blocks[j, 23] = step[j, LINK + 7]
        blocks[j, 24], blocks[j, 25] = step[j, LINK + 8] - kj * x_y, step[j, LINK + 9] - kj * x_z
        blocks[j, 26], blocks[j, 27] = iterate[j, STIFF_IJ], 0.0
        blocks[j, 28], blocks[j, 29] = step[j, LINK + 12], step[j, LINK + 13]
        blocks[j, 30], blocks[j, 31] = 0.0, step[j, LINK + 15]

        x_y, x_z = state[j, HEADING_Y], state[j, HEADING_Z]
        k, kj = behind(iterate, j, STIFF), behind(iterate, j, STIFF_J)
        yy, yz, zz = yy + k * x_y * x_y, yz + k * x_y * x_z, zz + k * x_z * x_z
        yw, zw, ww = yw + kj * x_y, zw + kj * x_z, ww + behind(iterate, j, STIFF_JJ)
        t_y, t_z, k = step[j, T_Y], step[j, T_Z], iterate[j, RING_SLOPE]
        yy, yz, zz = yy + k * t_y * t_y, yz + k * t_y * t_z, zz + k * t_z * t_z

        r_y, r_z, r_w = step[j, R_Y], step[j, R_Z], step[j, R_LEVER]
        t_w = step[j, T_LEVER]
        a, b = iterate[j, SLOPE_R], iterate[j, SLOPE_T]
        blocks[j, 0] = step[j, DIAGONAL] + yy + r_y * a - r_z * b
        blocks[j, 1] = step[j, DIAGONAL + 1] + yz + r_z * a + r_y * b
        blocks[j, 2] = step[j, DIAGONAL + 2] + yw + r_w * a + t_w * b
        a, b = iterate[j, SLOPE_R + 1], iterate[j, SLOPE_T + 1]
        blocks[j, 4] = step[j, DIAGONAL + 4] + yz + r_y * a - r_z * b
        blocks[j, 5] = step[j, DIAGONAL + 5] + zz + r_z * a + r_y * b
        blocks[j, 6] = step[j, DIAGONAL + 6] + zw + r_w * a + t_w * b
        a, b = iterate[j, SLOPE_R + 2], iterate[j, SLOPE_T + 2]
        blocks[j, 8] = step[j, DIAGONAL + 8] + yw + r_y * a - r_z * b
        blocks[j, 9] = step[j, DIAGONAL + 9] + zw + r_z * a + r_y * b
        blocks[j, 10] = step[j, DIAGONAL + 10] + ww + r_w * a + t_w * b
        yv, zv = step[j, DIAGONAL + 3] - k * t_y, step[j, DIAGONAL + 7] - k * t_z
        blocks[j, 3], blocks[j, 7], blocks[j, 11] = yv, zv, 0.0
        blocks[j, 12], blocks[j, 13], blocks[j, 14], blocks[j, 15] = yv, zv, 0.0, step[j, DIAGONAL + 15] + k

        for field in range(4):
            blocks[j, RIGHT + field] = iterate[j, RESIDUAL + field]
        a, b = iterate[j, DRIVEN_R], iterate[j, DRIVEN_T]
        blocks[j, RIGHT + 4], blocks[j, RIGHT + 5] = r_z * b - r_y * a, -(r_z * a + r_y * b)
        blocks[j, RIGHT + 6], blocks[j, RIGHT + 7] = -(r_w * a + t_w * b), 0.0
        a, b = iterate[j, OPENING_R], iterate[j, OPENING_T]
        f_y, f_z, f_w = r_y * a - r_z * b, r_z * a + r_y * b, r_w * a + t_w * b
        driven = state[j, DRIVEN]
        for m in range(modes):
            one, other = (1.0 - driven) * shapes[j, m], driven * shapes[j, m]
            first, second = RIGHT + 8 + 4 * m, RIGHT + 8 + 4 * (modes + m)
            blocks[j, first], blocks[j, first + 1] = f_y * one, f_z * one
            blocks[j, first + 2], blocks[j, first + 3] = f_w * one, 0.0
            blocks[j, second], blocks[j, second + 1] = f_y * other, f_z * other
            blocks[j, second + 2], blocks[j, second + 3] = f_w * other, 0.0


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
        at = RIGHT + 4 * column
        sums[0, first + column] -= a * blocks[j, at] + b * blocks[j, at + 1] + c * blocks[j, at + 2]


@kernel
def border_sums(belt, state, shapes, step, iterate, blocks, sums, dt):
    """Slopes of the border's equations by its unknowns, less the contribution of the elements.

    As `border.close_border` takes them. The right sides of `blocks` hold the solution without border, then
    those for its columns.
    """
    modes = belt.modal_stiffness.shape[1]
    width = 2 + 2 * modes
    pressing = dt * belt.sine
    for field in range((width - 1) * width):
        sums[0, field] = 0.0
    for j in range(step.rows):
        driven = state[j, DRIVEN]
        weight = -driven * step[j, MID_RADIUS]
        a, b, c = iterate[j, SLOPE_T], iterate[j, SLOPE_T + 1], iterate[j, SLOPE_T + 2]
        sums[0, 1] += step[j, MID_RADIUS] * iterate[j, DRIVEN_T]
        by_opening = weight * iterate[j, OPENING_T]
        slopes = weight * a, weight * b, weight * c
        _add_to_border(belt, sums, 0, slopes, by_opening, driven, shapes, blocks, j)
        a, b, c = pressing * step[j, R_Y], pressing * step[j, R_Z], pressing * step[j, R_LEVER]
        for k in range(2 * modes):
            weight = shapes[j, k % modes] * (driven if k >= modes else 1.0 - driven) * iterate[j, OPENING_N]
            slopes = weight * a, weight * b, weight * c
            _add_to_border(belt, sums, 1 + k, slopes, belt.cosine * weight, driven, shapes, blocks, j)
