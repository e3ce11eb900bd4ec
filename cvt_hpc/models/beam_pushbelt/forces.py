"""Kinematics of elements that slide on the ring, and the forces that are functions of the state.

The saddle point of an element is a material point of the ring, r(s; q). With the tangent t and the normal n
of the ring there and J = dr/dq, its velocity is n (n.J u) + t v for any speed v along the ring, since n.dr/ds
= 0; and s' = (v - t.J u) / |dr/ds|.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.chain import contact_gap, contact_levers, radial, turned
from cvt_hpc.multibody.rcm_beam import line_point
from cvt_hpc.multibody.rcm_chain import PER_ELEMENT, add_to_column
from cvt_hpc.physics.contact_laws import coefficient


@kernel
def dot(row: np.ndarray, values: np.ndarray, first: int) -> float:
    """Product of a row (8,) with the values of an element from `first` on."""
    total = 0.0
    for k in range(8):
        total += row[k] * values[first + k]
    return total


@kernel
def locate(belt, state, work, dt):
    """Where elements are at the start of a step and, by their speeds, at its middle."""
    ring, e, step, rows = state.ring, state.elements, work.step, work.rows
    length = ring.beam.length
    for k in range(ring.q.size):
        work.middle[k] = ring.q[k] + 0.5 * dt * ring.u[k]
    for j in range(e.shape[0]):
        beam = min(int(e[j, b.PLACE] / length), ring.q.size // PER_ELEMENT - 1)
        first = beam * PER_ELEMENT
        work.beams[j] = beam
        s = e[j, b.PLACE] - (beam + 0.5) * length
        q = ring.q[first : first + 8]
        at = line_point(length, q, s, rows[j, b.ALONG], rows[j, b.ACROSS])
        q = work.middle[first : first + 8]
        s += 0.5 * dt * e[j, b.PLACE_RATE]
        mid = line_point(length, q, s, rows[j, b.MID_ALONG], rows[j, b.MID_ACROSS])
        e[j, f.Y], e[j, f.Z] = at.x, at.y
        step[j, b.T_Y], step[j, b.T_Z] = at.cos, at.sin
        step[j, b.MID_T_Y], step[j, b.MID_T_Z], step[j, b.MID_STRETCH] = mid.cos, mid.sin, mid.stretch
        cosine = at.cos * mid.cos + at.sin * mid.sin
        step[j, b.COSINE] = cosine
        step[j, b.TANGENT] = (at.cos * mid.sin - at.sin * mid.cos) / cosine
        step[j, b.FREE_T] = at.cos * e[j, f.U_Y] + at.sin * e[j, f.U_Z]
        step[j, b.FREE_N] = at.cos * e[j, f.U_Z] - at.sin * e[j, f.U_Y]
        step[j, b.IMPULSE_T] = step[j, b.IMPULSE_N] = 0.0
        step[j, b.SPIN] = e[j, f.OMEGA]

        x = e[j, f.HEADING_Y], e[j, f.HEADING_Z]
        driven = at.x > 0.5 * belt.centre_distance
        e[j, f.DRIVEN] = 1.0 if driven else 0.0
        centre = belt.centre_distance if driven else 0.0
        r_y, r_z, radius, r_lever, t_lever = radial((at.x, at.y), x, centre, belt.pitch_depth)
        step[j, b.R_Y], step[j, b.R_Z], step[j, b.R_LEVER], step[j, b.T_LEVER] = r_y, r_z, r_lever, t_lever
        groove = state.pulleys[f.DRIVEN_RADIUS if driven else f.DRIVING_RADIUS]
        e[j, f.FLANK] = max(belt.flank_stiffness * (groove - radius) * belt.sine, 0.0)
        x = turned(x[0], x[1], 0.5 * dt * e[j, f.OMEGA])
        r_y, r_z, radius, r_lever, t_lever = radial((mid.x, mid.y), x, centre, belt.pitch_depth)
        step[j, b.MID_R_Y], step[j, b.MID_R_Z], step[j, b.MID_RADIUS] = r_y, r_z, radius
        step[j, b.MID_R_LEVER], step[j, b.MID_T_LEVER] = r_lever, t_lever


@kernel
def push(belt, step, j, y, z, moment):
    """Give an element an impulse at its saddle [N s] and one of rotation [N m s]."""
    step[j, b.IMPULSE_T] += step[j, b.T_Y] * y + step[j, b.T_Z] * z
    step[j, b.IMPULSE_N] += step[j, b.T_Y] * z - step[j, b.T_Z] * y
    step[j, b.SPIN] += moment / belt.inertia


@kernel
def rub_flanks(belt, state, step, j, along_meridian, around):
    """Give an element impulses at each flank, and the driven pulley their reaction [N s]."""
    out, on = 2.0 * belt.cosine * along_meridian, 2.0 * around
    y, z = step[j, b.R_Y], step[j, b.R_Z]
    moment = out * step[j, b.R_LEVER] + on * step[j, b.T_LEVER]
    push(belt, step, j, out * y - on * z, out * z + on * y, moment)
    if state.elements[j, f.DRIVEN] > 0.0:
        state.pulleys[f.DRIVEN_SPEED] -= on * step[j, b.MID_RADIUS] / belt.driven_inertia


@kernel
def tilt(belt, state, step, i, j, dt):
    """Impulses by the angles of two neighbours to the segment between their saddles; law of `pushbelt`."""
    e = state.elements
    e_y, e_z = e[j, f.Y] - e[i, f.Y], e[j, f.Z] - e[i, f.Z]
    per_length = 1.0 / np.sqrt(e_y * e_y + e_z * e_z)
    e_y, e_z = e_y * per_length, e_z * per_length
    turn = (e_y * (e[j, f.U_Z] - e[i, f.U_Z]) - e_z * (e[j, f.U_Y] - e[i, f.U_Y])) * per_length
    both = 0.0
    for k in (i, j):
        cosine = e_y * e[k, f.HEADING_Y] + e_z * e[k, f.HEADING_Z]
        rate = cosine * (e[k, f.OMEGA] - turn)
        state.totals[f.DAMPING_LOSS] += 0.5 * dt * belt.angle_damping * rate * rate
        sine = e_y * e[k, f.HEADING_Z] - e_z * e[k, f.HEADING_Y]
        moment = 0.5 * dt * cosine * (belt.angle_stiffness * sine + belt.angle_damping * rate)
        push(belt, step, k, 0.0, 0.0, -moment)
        both += moment * per_length
    push(belt, step, i, both * e_z, -both * e_y, 0.0)
    push(belt, step, j, -both * e_z, both * e_y, 0.0)


@kernel
def apply_forces(belt, state, work, dt):
    """Impulses of contact between elements, of tilt, of flanks, and of friction as in the last step.

    Those on the ring go into its right-hand side.
    """
    ring, e, step = state.ring, state.elements, work.step
    for i in range(e.shape[0]):
        j = (i + 1) % e.shape[0]
        ri, xi = (e[i, f.Y], e[i, f.Z]), (e[i, f.HEADING_Y], e[i, f.HEADING_Z])
        rj, xj = (e[j, f.Y], e[j, f.Z]), (e[j, f.HEADING_Y], e[j, f.HEADING_Z])
        for head in range(2):
            height = belt.head_height if head else -belt.pitch_depth
            gap = contact_gap(ri, xi, rj, xj, belt.thickness, height)
            force = max(-belt.contact_stiffness * gap, 0.0)
            e[i, f.HEAD if head else f.EDGE] = force
            if force > 0.0:
                lever_i, lever_j = contact_levers(ri, xi, rj, xj, belt.thickness, height)
                given = dt * force
                push(belt, step, i, -given * xj[0], -given * xj[1], given * lever_i)
                push(belt, step, j, given * xj[0], given * xj[1], given * lever_j)
        tilt(belt, state, step, i, j, dt)
    for j in range(e.shape[0]):
        pressed = 2.0 * dt * e[j, f.FLANK] * belt.sine
        push(belt, step, j, pressed * step[j, b.R_Y], pressed * step[j, b.R_Z], pressed * step[j, b.R_LEVER])

        mu, _ = coefficient(
            belt.flank_law, belt.flank_kinetic, belt.flank_gradient, belt.flank_speed, e[j, f.V_FILTERED]
        )
        bound = dt * mu * e[j, f.FLANK]
        step[j, b.FLANK_BOUND] = bound
        size = np.hypot(e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T])
        if size > bound:
            e[j, b.FLANK_IMPULSE_M] *= bound / size
            e[j, b.FLANK_IMPULSE_T] *= bound / size
        rub_flanks(belt, state, step, j, e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T])
        step[j, b.IMPULSE_T] -= e[j, b.RING_IMPULSE]
        add_to_column(ring.columns, 0, work.beams[j], e[j, b.RING_IMPULSE], work.rows[j, b.ALONG])
