"""Kinematics of elements that slide on the ring, and the forces that are functions of the state.

The saddle point of an element is a material point of the ring, r(s; q). With the tangent t and the normal n
of the ring there and J = dr/dq, its velocity is n (n.J u) + t v for any speed v along the ring, since n.dr/ds
= 0; and s' = (v - t.J u) / |dr/ds|.
"""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.beam_pushbelt.belt import (
    ACROSS,
    ALONG,
    COSINE,
    FLANK_BOUND,
    FLANK_IMPULSE_M,
    FLANK_IMPULSE_T,
    FREE_N,
    FREE_T,
    IMPULSE_N,
    IMPULSE_T,
    MID_ACROSS,
    MID_ALONG,
    MID_R_LEVER,
    MID_R_Y,
    MID_R_Z,
    MID_RADIUS,
    MID_STRETCH,
    MID_T_LEVER,
    MID_T_Y,
    MID_T_Z,
    PLACE,
    PLACE_RATE,
    R_LEVER,
    R_Y,
    R_Z,
    RING_IMPULSE,
    SPIN,
    T_LEVER,
    T_Y,
    T_Z,
    TANGENT,
)
from cvt_hpc.models.pushbelt.belt import (
    DAMPING_LOSS,
    DRIVEN,
    DRIVEN_RADIUS,
    DRIVEN_SPEED,
    DRIVING_RADIUS,
    EDGE,
    FLANK,
    HEAD,
    HEADING_Y,
    HEADING_Z,
    OMEGA,
    U_Y,
    U_Z,
    V_FILTERED,
    Y,
    Z,
)
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
        beam = min(int(e[j, PLACE] / length), ring.q.size // PER_ELEMENT - 1)
        first = beam * PER_ELEMENT
        work.beams[j] = beam
        s = e[j, PLACE] - (beam + 0.5) * length
        q = ring.q[first : first + 8]
        at = line_point(length, q, s, rows[j, ALONG], rows[j, ACROSS])
        q = work.middle[first : first + 8]
        s += 0.5 * dt * e[j, PLACE_RATE]
        mid = line_point(length, q, s, rows[j, MID_ALONG], rows[j, MID_ACROSS])
        e[j, Y], e[j, Z] = at.x, at.y
        step[j, T_Y], step[j, T_Z] = at.cos, at.sin
        step[j, MID_T_Y], step[j, MID_T_Z], step[j, MID_STRETCH] = mid.cos, mid.sin, mid.stretch
        cosine = at.cos * mid.cos + at.sin * mid.sin
        step[j, COSINE] = cosine
        step[j, TANGENT] = (at.cos * mid.sin - at.sin * mid.cos) / cosine
        step[j, FREE_T] = at.cos * e[j, U_Y] + at.sin * e[j, U_Z]
        step[j, FREE_N] = at.cos * e[j, U_Z] - at.sin * e[j, U_Y]
        step[j, IMPULSE_T] = step[j, IMPULSE_N] = 0.0
        step[j, SPIN] = e[j, OMEGA]

        x = e[j, HEADING_Y], e[j, HEADING_Z]
        driven = at.x > 0.5 * belt.centre_distance
        e[j, DRIVEN] = 1.0 if driven else 0.0
        centre = belt.centre_distance if driven else 0.0
        r_y, r_z, radius, r_lever, t_lever = radial((at.x, at.y), x, centre, belt.pitch_depth)
        step[j, R_Y], step[j, R_Z], step[j, R_LEVER], step[j, T_LEVER] = r_y, r_z, r_lever, t_lever
        groove = state.pulleys[DRIVEN_RADIUS if driven else DRIVING_RADIUS]
        e[j, FLANK] = max(belt.flank_stiffness * (groove - radius) * belt.sine, 0.0)
        x = turned(x[0], x[1], 0.5 * dt * e[j, OMEGA])
        r_y, r_z, radius, r_lever, t_lever = radial((mid.x, mid.y), x, centre, belt.pitch_depth)
        step[j, MID_R_Y], step[j, MID_R_Z], step[j, MID_RADIUS] = r_y, r_z, radius
        step[j, MID_R_LEVER], step[j, MID_T_LEVER] = r_lever, t_lever


@kernel
def push(belt, step, j, y, z, moment):
    """Give an element an impulse at its saddle [N s] and one of rotation [N m s]."""
    step[j, IMPULSE_T] += step[j, T_Y] * y + step[j, T_Z] * z
    step[j, IMPULSE_N] += step[j, T_Y] * z - step[j, T_Z] * y
    step[j, SPIN] += moment / belt.inertia


@kernel
def rub_flanks(belt, state, step, j, along_meridian, around):
    """Give an element impulses at each flank, and the driven pulley their reaction [N s]."""
    out, on = 2.0 * belt.cosine * along_meridian, 2.0 * around
    y, z = step[j, R_Y], step[j, R_Z]
    moment = out * step[j, R_LEVER] + on * step[j, T_LEVER]
    push(belt, step, j, out * y - on * z, out * z + on * y, moment)
    if state.elements[j, DRIVEN] > 0.0:
        state.pulleys[DRIVEN_SPEED] -= on * step[j, MID_RADIUS] / belt.driven_inertia


@kernel
def tilt(belt, state, step, i, j, dt):
    """Impulses by the angles of two neighbours to the segment between their saddles; law of `pushbelt`."""
    e = state.elements
    e_y, e_z = e[j, Y] - e[i, Y], e[j, Z] - e[i, Z]
    per_length = 1.0 / np.sqrt(e_y * e_y + e_z * e_z)
    e_y, e_z = e_y * per_length, e_z * per_length
    turn = (e_y * (e[j, U_Z] - e[i, U_Z]) - e_z * (e[j, U_Y] - e[i, U_Y])) * per_length
    both = 0.0
    for k in (i, j):
        cosine = e_y * e[k, HEADING_Y] + e_z * e[k, HEADING_Z]
        rate = cosine * (e[k, OMEGA] - turn)
        state.totals[DAMPING_LOSS] += 0.5 * dt * belt.angle_damping * rate * rate
        sine = e_y * e[k, HEADING_Z] - e_z * e[k, HEADING_Y]
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
        ri, xi = (e[i, Y], e[i, Z]), (e[i, HEADING_Y], e[i, HEADING_Z])
        rj, xj = (e[j, Y], e[j, Z]), (e[j, HEADING_Y], e[j, HEADING_Z])
        for head in range(2):
            height = belt.head_height if head else -belt.pitch_depth
            gap = contact_gap(ri, xi, rj, xj, belt.thickness, height)
            force = max(-belt.contact_stiffness * gap, 0.0)
            e[i, HEAD if head else EDGE] = force
            if force > 0.0:
                lever_i, lever_j = contact_levers(ri, xi, rj, xj, belt.thickness, height)
                given = dt * force
                push(belt, step, i, -given * xj[0], -given * xj[1], given * lever_i)
                push(belt, step, j, given * xj[0], given * xj[1], given * lever_j)
        tilt(belt, state, step, i, j, dt)
    for j in range(e.shape[0]):
        pressed = 2.0 * dt * e[j, FLANK] * belt.sine
        push(belt, step, j, pressed * step[j, R_Y], pressed * step[j, R_Z], pressed * step[j, R_LEVER])

        mu, _ = coefficient(
            belt.flank_law, belt.flank_kinetic, belt.flank_gradient, belt.flank_speed, e[j, V_FILTERED]
        )
        bound = dt * mu * e[j, FLANK]
        step[j, FLANK_BOUND] = bound
        size = np.hypot(e[j, FLANK_IMPULSE_M], e[j, FLANK_IMPULSE_T])
        if size > bound:
            e[j, FLANK_IMPULSE_M] *= bound / size
            e[j, FLANK_IMPULSE_T] *= bound / size
        rub_flanks(belt, state, step, j, e[j, FLANK_IMPULSE_M], e[j, FLANK_IMPULSE_T])
        step[j, IMPULSE_T] -= e[j, RING_IMPULSE]
        add_to_column(ring.columns, 0, work.beams[j], e[j, RING_IMPULSE], work.rows[j, ALONG])
