"""Geometry of the chain of elements in lanes: predicted gaps and strains, and the directions of all forces.

Index i is an element and j the next one. x is the running direction of an element and o = (x_z, -x_y) its
outward normal; both turn as x' = -o, o' = x. Directions are those at q_k. Magnitudes of tension, tilt and
flanks are those at q_k, and of contacts between elements those of q_{k-1}, q_k and q* = q_k + dt X_k. From
there on they are linear in the change of the speeds X.

Slip speeds at the flanks take the radial direction and the lever of the contact point at mid step, and speeds
across the path that direction. At either end of a step the direction would add v phi' dt / 2 of false radial
motion, and the lever d omega^2 dt / 2.

The nose of each element in the hole of the next one, in lanes: it holds neighbours side by side.

The nose's tip P lies at the front of element i, the hole's centre Q at the rear of element j, both
`nose_height` above the saddle. Their offset across the next element, (P - Q).o_j, is free up to the clearance
to either side; beyond, the hole pushes back elastically and without friction.

An offset grows by the speeds times (o_j, a, 0) of element i and (-o_j, b, 0) of j, a and b being levers.
"""

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, behind, like, select, sqrt
from cvt_hpc.models.pushbelt import fields as f

# Springs and flanks act at the mean BETA q_{k+1} + (1 - 2 BETA) q_k + BETA q_{k-1} of positions: with 1/4 the
# step damps nothing and is stable at any stiffness
BETA = 0.25

# Contacts between elements have at least a damper of so many steps. With 3/4 an impact within a step returns
# at most a tenth of its energy; with less, contacts ring and return more than they take
LEAST_CONTACT_TIME = 0.75


# Four fields of a row, as of an element's unknowns, or of a column of a block


@register_jitable
def four(array, j, first):
    """Four fields of a row."""
    return array[j, first], array[j, first + 1], array[j, first + 2], array[j, first + 3]


@register_jitable
def four_ahead(array, j, first):
    """Four fields of the row ahead."""
    y, z = ahead(array, j, first), ahead(array, j, first + 1)
    return y, z, ahead(array, j, first + 2), ahead(array, j, first + 3)


@register_jitable
def set_four(array, j, first, values):
    """Set four fields of a row."""
    array[j, first], array[j, first + 1], array[j, first + 2], array[j, first + 3] = values


@register_jitable
def contact_shares(belt, dt):
    """Weights of the gaps at q_{k+1}, q_k and q_{k-1} in that by which a contact between elements presses.

    That is the mean gap, and the rate at the end of the step times the time of the damper.
    """
    share = max(belt.contact_time / dt, LEAST_CONTACT_TIME)
    return BETA + share, 1.0 - 2.0 * BETA - share, BETA


@register_jitable
def ring_share(belt, dt):
    """Increase of the ring's strain by its rate in a step, by which tension rises [s]."""
    return BETA * dt + belt.ring_time


@register_jitable
def turned_length(belt, length, spin, dt):
    """Add to a segment's mean length what its turning does, and by the rate of it to its tension [m].

    Rates along the directions at q_k leave out that the length grows by spin^2 dt / 2 within half a step.
    """
    return length * dt * (BETA * dt + 0.5 * belt.ring_time) * spin * spin


@register_jitable
def turned(x_y, x_z, angle):
    """A unit vector turned by a small angle [rad], and held at unit length."""
    square = angle * angle
    cosine = 1.0 - square * (0.5 - square * (1.0 / 24.0))
    sine = angle * (1.0 - square * (1.0 / 6.0 - square * (1.0 / 120.0)))
    y, z = cosine * x_y - sine * x_z, sine * x_y + cosine * x_z
    size = 1.5 - 0.5 * (y * y + z * z)
    return y * size, z * size


@register_jitable
def _before_step(r, x, speeds, dt):
    """Position and running direction at q_{k-1}, from those at q_k and the old speeds."""
    u_y, u_z, omega = speeds
    return (r[0] - dt * u_y, r[1] - dt * u_z), turned(x[0], x[1], -dt * omega)


@register_jitable
def contact_gap(ri, xi, rj, xj, thickness, height):
    """Gap [m] between the front of an element, at a height above its saddle, and the rear of the next one."""
    d_y = rj[0] - ri[0] - 0.5 * thickness * xi[0] - height * xi[1]
    d_z = rj[1] - ri[1] - 0.5 * thickness * xi[1] + height * xi[0]
    return d_y * xj[0] + d_z * xj[1] - 0.5 * thickness


@register_jitable
def contact_levers(ri, xi, rj, xj, thickness, height):
    """Rate of `contact_gap` by the angular velocities of both elements [m]; by speeds it is -xj, xj."""
    along, across = xi[0] * xj[0] + xi[1] * xj[1], xi[1] * xj[0] - xi[0] * xj[1]
    lever_i = 0.5 * thickness * across - height * along
    # (Q - P) . o_j, of which the part of Q along x_j vanishes
    d_y = rj[0] - ri[0] - 0.5 * thickness * xi[0] - height * xi[1]
    d_z = rj[1] - ri[1] - 0.5 * thickness * xi[1] + height * xi[0]
    return lever_i, d_z * xj[0] - d_y * xj[1]


@register_jitable
def radial(r, x, centre, pitch_depth):
    """e_r and rho of a flank's contact point, and the rates of its two components of velocity by omega."""
    y = r[0] - pitch_depth * x[1] - centre
    z = r[1] + pitch_depth * x[0]
    radius = sqrt(y * y + z * z)
    per_radius = 1.0 / radius
    y, z = y * per_radius, z * per_radius
    r_lever = -pitch_depth * (x[0] * y + x[1] * z)
    t_lever = -pitch_depth * (x[1] * y - x[0] * z)
    return y, z, radius, r_lever, t_lever


@register_jitable
def _nose_offset(ri, xi, rj, xj, thickness, height):
    """(P - Q) of a nose's tip and the hole's centre, along o_j and x_j [m]."""
    d_y = ri[0] - rj[0] + 0.5 * thickness * (xi[0] + xj[0]) + height * (xi[1] - xj[1])
    d_z = ri[1] - rj[1] + 0.5 * thickness * (xi[1] + xj[1]) - height * (xi[0] - xj[0])
    return d_y * xj[1] - d_z * xj[0], d_y * xj[0] + d_z * xj[1]


@kernel
def predict(belt, state, pulleys, step, dt):
    """Everything of a step that belongs to a single element: q*, the ring's direction, normal, the flanks."""
    # of the strands, the common tangents of both pulleys
    sine = (pulleys[f.DRIVEN_RADIUS] - pulleys[f.DRIVING_RADIUS]) / belt.centre_distance
    cosine = np.sqrt(1.0 - sine * sine)
    for j in range(state.rows):
        y, z = state[j, f.Y], state[j, f.Z]
        x = (state[j, f.HEADING_Y], state[j, f.HEADING_Z])
        u_y, u_z, omega = state[j, f.U_Y], state[j, f.U_Z], state[j, f.OMEGA]
        predicted = (y + dt * u_y, z + dt * u_z)
        turned_y, turned_z = turned(x[0], x[1], dt * omega)
        step[j, f.PREDICTED_Y], step[j, f.PREDICTED_Z] = predicted
        step[j, f.PREDICTED_HEADING_Y], step[j, f.PREDICTED_HEADING_Z] = turned_y, turned_z
        t_y, t_z = ahead(state, j, f.Y) - behind(state, j, f.Y), ahead(state, j, f.Z) - behind(state, j, f.Z)
        per_size = 1.0 / sqrt(t_y * t_y + t_z * t_z)
        t_y, t_z = t_y * per_size, t_z * per_size
        step[j, f.T_Y], step[j, f.T_Z] = t_y, t_z

        driven = y > 0.5 * belt.centre_distance
        centre = select(driven, like(belt.centre_distance, y), 0.0)
        state[j, f.DRIVEN] = select(driven, like(1.0, y), 0.0)
        r_y, r_z, radius, r_lever, t_lever = radial((y, z), x, centre, belt.pitch_depth)
        step[j, f.R_Y], step[j, f.R_Z], step[j, f.R_LEVER], step[j, f.T_LEVER] = r_y, r_z, r_lever, t_lever
        groove = select(driven, like(pulleys[f.DRIVEN_RADIUS], y), pulleys[f.DRIVING_RADIUS])
        step[j, f.DEPTH] = (groove - radius) * belt.sine
        side = select(z < 0.0, like(-1.0, y), 1.0)
        reach = cosine * y + side * sine * z
        strand = (reach > 0.0) & (reach < cosine * belt.centre_distance)
        middle = (y + 0.5 * dt * u_y, z + 0.5 * dt * u_z)
        mid_x = turned(x[0], x[1], 0.5 * dt * omega)
        r_y, r_z, radius, r_lever, t_lever = radial(middle, mid_x, centre, belt.pitch_depth)
        step[j, f.MID_R_Y], step[j, f.MID_R_Z], step[j, f.MID_RADIUS] = r_y, r_z, radius
        step[j, f.MID_R_LEVER], step[j, f.MID_T_LEVER] = r_lever, t_lever
        step[j, f.NORMAL_Y] = select(strand, like(-sine, y), r_y)
        step[j, f.NORMAL_Z] = select(strand, side * cosine, r_z)


@register_jitable
def angle_slope(belt, dt):
    """Increase of the moment at one end of a segment by the change of the angle's rate in a step [N m s]."""
    return 0.5 * (BETA * dt * belt.angle_stiffness + belt.angle_damping)


@kernel
def link(belt, state, step, dt):
    """Data of pairs of neighbours for a step: tension, contacts, angles, noses."""
    stiffness, has_noses = 0.5 * belt.angle_stiffness, belt.nose_clearance < np.inf
    ahead_share, share, behind_share = contact_shares(belt, dt)
    for j in range(state.rows):
        ri, rj = (state[j, f.Y], state[j, f.Z]), (ahead(state, j, f.Y), ahead(state, j, f.Z))
        xi = (state[j, f.HEADING_Y], state[j, f.HEADING_Z])
        xj = (ahead(state, j, f.HEADING_Y), ahead(state, j, f.HEADING_Z))
        si = (step[j, f.PREDICTED_Y], step[j, f.PREDICTED_Z])
        sj = (ahead(step, j, f.PREDICTED_Y), ahead(step, j, f.PREDICTED_Z))
        zi = (step[j, f.PREDICTED_HEADING_Y], step[j, f.PREDICTED_HEADING_Z])
        zj = (ahead(step, j, f.PREDICTED_HEADING_Y), ahead(step, j, f.PREDICTED_HEADING_Z))

        e_y, e_z = rj[0] - ri[0], rj[1] - ri[1]
        length = sqrt(e_y * e_y + e_z * e_z)
        per_length = 1.0 / length
        e_y, e_z = e_y * per_length, e_z * per_length
        step[j, f.TENSION_I_Y], step[j, f.TENSION_I_Z] = e_y - step[j, f.T_Y], e_z - step[j, f.T_Z]
        step[j, f.TENSION_J_Y] = e_y - ahead(step, j, f.T_Y)
        step[j, f.TENSION_J_Z] = e_z - ahead(step, j, f.T_Z)
        shortened = step[j, f.TENSION_I_Y] * state[j, f.U_Y] + step[j, f.TENSION_I_Z] * state[j, f.U_Z]
        shortened -= step[j, f.TENSION_J_Y] * ahead(state, j, f.U_Y)
        shortened -= step[j, f.TENSION_J_Z] * ahead(state, j, f.U_Z)
        shortened += state[j, f.V] - ahead(state, j, f.V)
        turn_y, turn_z = -e_z * per_length, e_y * per_length
        angle_i, angle_j = e_y * xi[0] + e_z * xi[1], e_y * xj[0] + e_z * xj[1]
        step[j, f.TURN_Y], step[j, f.TURN_Z] = turn_y, turn_z
        step[j, f.ANGLE_I], step[j, f.ANGLE_J] = angle_i, angle_j
        turn = turn_y * (ahead(state, j, f.U_Y) - state[j, f.U_Y])
        turn += turn_z * (ahead(state, j, f.U_Z) - state[j, f.U_Z])

        per_unstretched = 1.0 / state[j, f.LENGTH]
        length += turned_length(belt, length, turn, dt) - belt.ring_time * shortened
        step[j, f.START_TENSION] = belt.ring_stiffness * (length * per_unstretched - 1.0)
        step[j, f.TENSION_SLOPE] = ring_share(belt, dt) * belt.ring_stiffness * per_unstretched

        rate_i, rate_j = angle_i * (state[j, f.OMEGA] - turn), angle_j * (ahead(state, j, f.OMEGA) - turn)
        damping = 0.5 * belt.angle_damping
        step[j, f.START_MOMENT_I] = stiffness * (e_y * xi[1] - e_z * xi[0]) + damping * rate_i
        step[j, f.START_MOMENT_J] = stiffness * (e_y * xj[1] - e_z * xj[0]) + damping * rate_j

        edge, head = -belt.pitch_depth, belt.head_height
        bi, yi = _before_step(ri, xi, (state[j, f.U_Y], state[j, f.U_Z], state[j, f.OMEGA]), dt)
        speeds = ahead(state, j, f.U_Y), ahead(state, j, f.U_Z), ahead(state, j, f.OMEGA)
        bj, yj = _before_step(rj, xj, speeds, dt)
        for height, gap, mean in ((edge, f.EDGE_GAP, f.EDGE_MEAN), (head, f.HEAD_GAP, f.HEAD_MEAN)):
            reached = contact_gap(si, zi, sj, zj, belt.thickness, height)
            now = contact_gap(ri, xi, rj, xj, belt.thickness, height)
            before = contact_gap(bi, yi, bj, yj, belt.thickness, height)
            step[j, gap] = ahead_share * reached + share * now + behind_share * before
            step[j, mean] = 0.5 * (reached + now)
        lever_i, lever_j = contact_levers(ri, xi, rj, xj, belt.thickness, edge)
        step[j, f.EDGE_LEVER_I], step[j, f.EDGE_LEVER_J] = lever_i, lever_j
        lever_i, lever_j = contact_levers(ri, xi, rj, xj, belt.thickness, head)
        step[j, f.HEAD_LEVER_I], step[j, f.HEAD_LEVER_J] = lever_i, lever_j

        if has_noses:
            height = belt.nose_height
            now, along = _nose_offset(ri, xi, rj, xj, belt.thickness, height)
            cosine, sine = xi[0] * xj[0] + xi[1] * xj[1], xi[0] * xj[1] - xi[1] * xj[0]
            step[j, f.NOSE_LEVER_I] = height * sine - 0.5 * belt.thickness * cosine
            step[j, f.NOSE_LEVER_J] = along - 0.5 * belt.thickness
            reached, _ = _nose_offset(si, zi, sj, zj, belt.thickness, height)
            before, _ = _nose_offset(bi, yi, bj, yj, belt.thickness, height)
            step[j, f.NOSE_OFFSET] = ahead_share * reached + share * now + behind_share * before
            step[j, f.NOSE_MEAN] = 0.5 * (reached + now)


@kernel
def linear_blocks(belt, step, dt):
    """Blocks of inertia, transverse damping, tension and angles: DIAGONAL and LINK of each element."""
    steep = angle_slope(belt, dt)
    for j in range(step.rows):
        # o of the ring: with it ring mass moves only across
        o_y, o_z = step[j, f.T_Z], -step[j, f.T_Y]
        mass, ring = belt.mass / dt, belt.ring_mass / dt
        yy, yz, zz = mass + ring * o_y * o_y, ring * o_y * o_z, mass + ring * o_z * o_z
        n_y, n_z = step[j, f.NORMAL_Y], step[j, f.NORMAL_Z]
        drag = belt.transverse_damping
        yy, yz, zz = yy + drag * n_y * n_y, yz + drag * n_y * n_z, zz + drag * n_z * n_z
        ww, vv, none = like(belt.inertia / dt, o_y), like(ring, o_y), like(0.0, o_y)

        # the segment ahead, of which this element is i
        k, a, b = step[j, f.TENSION_SLOPE], step[j, f.TENSION_I_Y], step[j, f.TENSION_I_Z]
        c, d = step[j, f.TENSION_J_Y], step[j, f.TENSION_J_Z]
        yy, yz, zz, vv = yy + k * a * a, yz + k * a * b, zz + k * b * b, vv + k
        yv, zv = k * a, k * b
        p, q = step[j, f.TURN_Y], step[j, f.TURN_Z]
        ii = steep * step[j, f.ANGLE_I] * step[j, f.ANGLE_I]
        jj = steep * step[j, f.ANGLE_J] * step[j, f.ANGLE_J]
        both = ii + jj
        yy, yz, zz, ww = yy + both * p * p, yz + both * p * q, zz + both * q * q, ww + ii
        yw, zw = ii * p, ii * q

        y, z = -(k * a * c + both * p * p), -(k * b * c + both * p * q)
        set_four(step, j, f.LINK + f.YY, (y, z, -ii * p, -k * c))
        y, z = -(k * a * d + both * p * q), -(k * b * d + both * q * q)
        set_four(step, j, f.LINK + f.YZ, (y, z, -ii * q, -k * d))
        set_four(step, j, f.LINK + f.YW, (jj * p, jj * q, none, none))
        set_four(step, j, f.LINK + f.YV, (-k * a, -k * b, none, -k))

        # the segment behind, of which it is j
        k = behind(step, j, f.TENSION_SLOPE)
        c, d = behind(step, j, f.TENSION_J_Y), behind(step, j, f.TENSION_J_Z)
        yy, yz, zz, vv = yy + k * c * c, yz + k * c * d, zz + k * d * d, vv + k
        yv, zv = yv + k * c, zv + k * d
        p, q = behind(step, j, f.TURN_Y), behind(step, j, f.TURN_Z)
        at_i, at_j = behind(step, j, f.ANGLE_I), behind(step, j, f.ANGLE_J)
        jj = steep * at_j * at_j
        both = steep * at_i * at_i + jj
        yy, yz, zz, ww = yy + both * p * p, yz + both * p * q, zz + both * q * q, ww + jj
        yw, zw = yw - jj * p, zw - jj * q
        set_four(step, j, f.DIAGONAL + f.YY, (yy, yz, yw, yv))
        set_four(step, j, f.DIAGONAL + f.YZ, (yz, zz, zw, zv))
        set_four(step, j, f.DIAGONAL + f.YW, (yw, zw, ww, none))
        set_four(step, j, f.DIAGONAL + f.YV, (yv, zv, none, vv))
