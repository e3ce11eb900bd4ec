"""The nose of each element in the hole of the next one, in lanes: it holds neighbours side by side.

The nose's tip P lies at the front of element i, the hole's centre Q at the rear of element j, both
`nose_height` above the saddle. Their offset across the next element, (P - Q).o_j, is free up to the clearance
to either side; beyond, the hole pushes back elastically and without friction.

An offset grows by the speeds times (o_j, a, 0) of element i and (-o_j, b, 0) of j, a and b being levers.
"""

from __future__ import annotations

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead, behind, maximum
from cvt_hpc.models.pushbelt.belt import (
    CHANGE,
    HEADING_Y,
    HEADING_Z,
    NOSE,
    NOSE_LEVER_I,
    NOSE_LEVER_J,
    NOSE_OFFSET,
    NOSE_REACHED,
    NOSE_SLOPE,
    PREDICTED_HEADING_Y,
    PREDICTED_HEADING_Z,
    PREDICTED_Y,
    PREDICTED_Z,
    Y,
    Z,
)
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
        ri, rj = (state[j, Y], state[j, Z]), (ahead(state, j, Y), ahead(state, j, Z))
        xi = (state[j, HEADING_Y], state[j, HEADING_Z])
        xj = (ahead(state, j, HEADING_Y), ahead(state, j, HEADING_Z))
        _, along = _offset(ri, xi, rj, xj, thickness, height)
        cosine, sine = xi[0] * xj[0] + xi[1] * xj[1], xi[0] * xj[1] - xi[1] * xj[0]
        step[j, NOSE_LEVER_I] = height * sine - 0.5 * thickness * cosine
        step[j, NOSE_LEVER_J] = along - 0.5 * thickness
        si = (step[j, PREDICTED_Y], step[j, PREDICTED_Z])
        sj = (ahead(step, j, PREDICTED_Y), ahead(step, j, PREDICTED_Z))
        zi = (step[j, PREDICTED_HEADING_Y], step[j, PREDICTED_HEADING_Z])
        zj = (ahead(step, j, PREDICTED_HEADING_Y), ahead(step, j, PREDICTED_HEADING_Z))
        step[j, NOSE_OFFSET], _ = _offset(si, zi, sj, zj, thickness, height)


@kernel
def nose_forces(belt, state, step, iterate, dt):
    """Forces that take the offsets back, signed as these, and their increase by the offsets' rates."""
    stiffness, clearance = belt.nose_stiffness, belt.nose_clearance
    for j in range(step.rows):
        x_y, x_z = ahead(state, j, HEADING_Y), ahead(state, j, HEADING_Z)
        y, z = state[j, CHANGE] - ahead(state, j, CHANGE), state[j, CHANGE + 1] - ahead(state, j, CHANGE + 1)
        rate = x_z * y - x_y * z + step[j, NOSE_LEVER_I] * state[j, CHANGE + 2]
        offset = step[j, NOSE_OFFSET] + dt * (rate + step[j, NOSE_LEVER_J] * ahead(state, j, CHANGE + 2))
        above, k = pressed(clearance - offset, stiffness)
        below, m = pressed(clearance + offset, stiffness)
        state[j, NOSE], iterate[j, NOSE_SLOPE] = above - below, dt * maximum(k, m)
        iterate[j, NOSE_REACHED] = offset


@kernel
def add_nose_blocks(state, step, iterate, blocks):
    """Add the slopes to the blocks of both elements, as `assembly.assemble` has left them."""
    for j in range(step.rows):
        o_y, o_z = ahead(state, j, HEADING_Z), -ahead(state, j, HEADING_Y)
        k, a, b = iterate[j, NOSE_SLOPE], step[j, NOSE_LEVER_I], step[j, NOSE_LEVER_J]
        yy, yz, zz = k * o_y * o_y, k * o_y * o_z, k * o_z * o_z
        yw, zw, ww = k * o_y * a, k * o_z * a, k * a * a
        blocks[j, 16], blocks[j, 17], blocks[j, 18] = (
            blocks[j, 16] - yy,
            blocks[j, 17] - yz,
            blocks[j, 18] - yw,
        )
        blocks[j, 20], blocks[j, 21], blocks[j, 22] = (
            blocks[j, 20] - yz,
            blocks[j, 21] - zz,
            blocks[j, 22] - zw,
        )
        blocks[j, 24], blocks[j, 25] = blocks[j, 24] + k * o_y * b, blocks[j, 25] + k * o_z * b
        blocks[j, 26] = blocks[j, 26] + k * a * b

        o_y, o_z = state[j, HEADING_Z], -state[j, HEADING_Y]
        k, b = behind(iterate, j, NOSE_SLOPE), behind(step, j, NOSE_LEVER_J)
        yy, yz, zz = yy + k * o_y * o_y, yz + k * o_y * o_z, zz + k * o_z * o_z
        yw, zw, ww = yw - k * o_y * b, zw - k * o_z * b, ww + k * b * b
        blocks[j, 0], blocks[j, 1], blocks[j, 2] = blocks[j, 0] + yy, blocks[j, 1] + yz, blocks[j, 2] + yw
        blocks[j, 4], blocks[j, 5], blocks[j, 6] = blocks[j, 4] + yz, blocks[j, 5] + zz, blocks[j, 6] + zw
        blocks[j, 8], blocks[j, 9], blocks[j, 10] = blocks[j, 8] + yw, blocks[j, 9] + zw, blocks[j, 10] + ww
