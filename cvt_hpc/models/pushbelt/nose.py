"""The nose of each element in the hole of the next one, in lanes: it holds neighbours side by side.

The nose's tip P lies at the front of element i, the hole's centre Q at the rear of element j, both
`nose_height` above the saddle. Their offset across the next element, (P - Q).o_j, is free up to the clearance
to either side; beyond, the hole pushes back elastically and without friction.

An offset grows by the speeds times (o_j, a, 0) of element i and (-o_j, b, 0) of j, a and b being levers.
"""

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, behind, maximum
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.physics.contact_laws import pressed


@register_jitable
def _offset(ri, xi, rj, xj, thickness, height):
    """(P - Q) along o_j and x_j [m]."""
    d_y = ri[0] - rj[0] + 0.5 * thickness * (xi[0] + xj[0]) + height * (xi[1] - xj[1])
    d_z = ri[1] - rj[1] + 0.5 * thickness * (xi[1] + xj[1]) - height * (xi[0] - xj[0])
    return d_y * xj[1] - d_z * xj[0], d_y * xj[0] + d_z * xj[1]


@kernel
def predict_noses(belt, state, step):
    """Offsets at q*, and levers at q_k."""
    thickness, height = belt.thickness, belt.nose_height
    for j in range(state.rows):
        ri, rj = (state[j, f.Y], state[j, f.Z]), (ahead(state, j, f.Y), ahead(state, j, f.Z))
        xi = (state[j, f.HEADING_Y], state[j, f.HEADING_Z])
        xj = (ahead(state, j, f.HEADING_Y), ahead(state, j, f.HEADING_Z))
        _, along = _offset(ri, xi, rj, xj, thickness, height)
        cosine, sine = xi[0] * xj[0] + xi[1] * xj[1], xi[0] * xj[1] - xi[1] * xj[0]
        step[j, f.NOSE_LEVER_I] = height * sine - 0.5 * thickness * cosine
        step[j, f.NOSE_LEVER_J] = along - 0.5 * thickness
        si = (step[j, f.PREDICTED_Y], step[j, f.PREDICTED_Z])
        sj = (ahead(step, j, f.PREDICTED_Y), ahead(step, j, f.PREDICTED_Z))
        zi = (step[j, f.PREDICTED_HEADING_Y], step[j, f.PREDICTED_HEADING_Z])
        zj = (ahead(step, j, f.PREDICTED_HEADING_Y), ahead(step, j, f.PREDICTED_HEADING_Z))
        step[j, f.NOSE_OFFSET], _ = _offset(si, zi, sj, zj, thickness, height)


@kernel
def nose_forces(belt, state, step, iterate, dt):
    """Forces that take the offsets back, signed as these, and their increase by the offsets' rates."""
    stiffness, clearance = belt.nose_stiffness, belt.nose_clearance
    for j in range(step.rows):
        x_y, x_z = ahead(state, j, f.HEADING_Y), ahead(state, j, f.HEADING_Z)
        y = state[j, f.CHANGE_Y] - ahead(state, j, f.CHANGE_Y)
        z = state[j, f.CHANGE_Z] - ahead(state, j, f.CHANGE_Z)
        rate = x_z * y - x_y * z + step[j, f.NOSE_LEVER_I] * state[j, f.CHANGE_W]
        offset = step[j, f.NOSE_OFFSET] + dt * (rate + step[j, f.NOSE_LEVER_J] * ahead(state, j, f.CHANGE_W))
        above, k = pressed(clearance - offset, stiffness)
        below, m = pressed(clearance + offset, stiffness)
        state[j, f.NOSE], iterate[j, f.NOSE_SLOPE] = above - below, dt * maximum(k, m)
        iterate[j, f.NOSE_REACHED] = offset


@kernel
def add_nose_blocks(state, step, iterate, blocks):
    """Add the slopes to the blocks of both elements, as `assembly.assemble` has left them."""
    for j in range(step.rows):
        o_y, o_z = ahead(state, j, f.HEADING_Z), -ahead(state, j, f.HEADING_Y)
        k, a, b = iterate[j, f.NOSE_SLOPE], step[j, f.NOSE_LEVER_I], step[j, f.NOSE_LEVER_J]
        yy, yz, zz = k * o_y * o_y, k * o_y * o_z, k * o_z * o_z
        yw, zw, ww = k * o_y * a, k * o_z * a, k * a * a
        blocks[j, f.LINKED + f.YY] -= yy
        blocks[j, f.LINKED + f.ZY] -= yz
        blocks[j, f.LINKED + f.WY] -= yw
        blocks[j, f.LINKED + f.YZ] -= yz
        blocks[j, f.LINKED + f.ZZ] -= zz
        blocks[j, f.LINKED + f.WZ] -= zw
        blocks[j, f.LINKED + f.YW] += k * o_y * b
        blocks[j, f.LINKED + f.ZW] += k * o_z * b
        blocks[j, f.LINKED + f.WW] += k * a * b

        o_y, o_z = state[j, f.HEADING_Z], -state[j, f.HEADING_Y]
        k, b = behind(iterate, j, f.NOSE_SLOPE), behind(step, j, f.NOSE_LEVER_J)
        yy, yz, zz = yy + k * o_y * o_y, yz + k * o_y * o_z, zz + k * o_z * o_z
        yw, zw, ww = yw - k * o_y * b, zw - k * o_z * b, ww + k * b * b
        blocks[j, f.YY] += yy
        blocks[j, f.ZY] += yz
        blocks[j, f.WY] += yw
        blocks[j, f.YZ] += yz
        blocks[j, f.ZZ] += zz
        blocks[j, f.WZ] += zw
        blocks[j, f.YW] += yw
        blocks[j, f.ZW] += zw
        blocks[j, f.WW] += ww
