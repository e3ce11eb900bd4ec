"""Half-explicit steps of a pushbelt on a ring of beams, with set-valued friction by proximal points.

From q_k and u_{k-1/2} a step finds u_{k+1/2} by the forces at q_k and the impulses of the set-valued laws
(Moreau's time stepping), and q_{k+1} = q_k + dt u_{k+1/2}. The saddle point of an element is a material point
of the ring, r(s; q), with J = dr/dq. The bilateral contact is no unknown: its force is N along the ring's
normal n at q_k, and the velocity of the element after the step

    U = t_m v + n_m (n_m.J_m u),    s' = (v - t_m.J_m u) / |dr/ds|,

with the directions at mid step, so that the step moves the element along the ring. Eliminating N and v gives

    (M + sum m / cos(x) b b_m^T) du = dt h + sum b p,
    p = m n.U_old + I_n - tan(x) (m t.U_old + I_t) - m / cos(x) b_m.u,

b = n.J, b_m = n_m.J_m, x the angle from t to t_m, and I the impulse of all other forces on the element. So
Cartesian momentum is kept, the turn of the ring under an element (centrifugal and Coriolis force) needs no
curvature, and the place of an element on the ring cannot drift. Directions of forces are those at q_k;
sliding velocities are in the directions of mid step, by the speeds of the last one. At either end they would
add v phi' dt / 2 of false sliding.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.beam_pushbelt import friction, rcm
from cvt_hpc.models.beam_pushbelt.ring import PER_BEAM, SIZE, add_matrix, add_to_column, assemble
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.border import move_sheaves
from cvt_hpc.models.pushbelt.chain import contact_gap, contact_levers, radial, turned
from cvt_hpc.physics.contact_laws import coefficient, remembered
from cvt_hpc.solvers.cyclic_blocks import factor

_MOST_FAILURES = 20  # unsolved steps in a row with which a run ends
_LARGEST = 1e100  # more than any speed that means something


@kernel
def _locate(belt, state, work, dt):
    """Set the places of elements at the start of a step and, by their speeds, at its middle."""
    ring, e, step, rows = state.ring, state.elements, work.step, work.rows
    length = ring.beam.length
    for k in range(ring.q.size):
        work.middle[k] = ring.q[k] + 0.5 * dt * ring.u[k]
    for j in range(e.shape[0]):
        beam = min(int(e[j, b.PLACE] / length), ring.q.size // PER_BEAM - 1)
        first, work.beams[j] = beam * PER_BEAM, beam
        s = e[j, b.PLACE] - (beam + 0.5) * length
        at = rcm.line_point(length, ring.q[first : first + 8], s, rows[j, b.ALONG], rows[j, b.ACROSS])
        q = work.middle[first : first + 8]
        s += 0.5 * dt * e[j, b.PLACE_RATE]
        mid = rcm.line_point(length, q, s, rows[j, b.MID_ALONG], rows[j, b.MID_ACROSS])
        e[j, f.Y], e[j, f.Z] = at.x, at.y
        step[j, b.T_Y], step[j, b.T_Z] = at.cos, at.sin
        step[j, b.MID_T_Y], step[j, b.MID_T_Z], step[j, b.MID_STRETCH] = mid.cos, mid.sin, mid.stretch
        cosine = at.cos * mid.cos + at.sin * mid.sin
        step[j, b.COSINE], step[j, b.TANGENT] = cosine, (at.cos * mid.sin - at.sin * mid.cos) / cosine
        step[j, b.FREE_T] = at.cos * e[j, f.U_Y] + at.sin * e[j, f.U_Z]
        step[j, b.FREE_N] = at.cos * e[j, f.U_Z] - at.sin * e[j, f.U_Y]
        step[j, b.IMPULSE_T], step[j, b.IMPULSE_N], step[j, b.SPIN] = 0.0, 0.0, e[j, f.OMEGA]

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
def _tilt(belt, state, step, i, j, dt):
    """Impulses by the angles of two neighbours to the segment between their saddles; law of `pushbelt`."""
    e = state.elements
    e_y, e_z = e[j, f.Y] - e[i, f.Y], e[j, f.Z] - e[i, f.Z]
    per_length = 1.0 / np.sqrt(e_y * e_y + e_z * e_z)
    e_y, e_z = e_y * per_length, e_z * per_length
    turn = (e_y * (e[j, f.U_Z] - e[i, f.U_Z]) - e_z * (e[j, f.U_Y] - e[i, f.U_Y])) * per_length
    both = 0.0
    for k in (i, j):
        cosine = e_y * e[k, f.HEADING_Y] + e_z * e[k, f.HEADING_Z]
        sine = e_y * e[k, f.HEADING_Z] - e_z * e[k, f.HEADING_Y]
        rate = cosine * (e[k, f.OMEGA] - turn)
        state.totals[f.DAMPING_LOSS] += 0.5 * dt * belt.angle_damping * rate * rate
        moment = 0.5 * dt * cosine * (belt.angle_stiffness * sine + belt.angle_damping * rate)
        friction.push(belt, step, k, 0.0, 0.0, -moment)
        both += moment * per_length
    friction.push(belt, step, i, both * e_z, -both * e_y, 0.0)
    friction.push(belt, step, j, -both * e_z, both * e_y, 0.0)


@kernel
def _apply_forces(belt, state, work, dt):
    """Impulses of contact between elements, of tilt, of flanks, and of friction as in the last step."""
    ring, e, step = state.ring, state.elements, work.step
    for i in range(e.shape[0]):
        j = (i + 1) % e.shape[0]
        ri, xi = (e[i, f.Y], e[i, f.Z]), (e[i, f.HEADING_Y], e[i, f.HEADING_Z])
        rj, xj = (e[j, f.Y], e[j, f.Z]), (e[j, f.HEADING_Y], e[j, f.HEADING_Z])
        for contact, height in ((f.EDGE, -belt.pitch_depth), (f.HEAD, belt.head_height)):
            gap = contact_gap(ri, xi, rj, xj, belt.thickness, height)
            e[i, contact] = max(-belt.contact_stiffness * gap, 0.0)
            if e[i, contact] > 0.0:
                lever_i, lever_j = contact_levers(ri, xi, rj, xj, belt.thickness, height)
                given = dt * e[i, contact]
                friction.push(belt, step, i, -given * xj[0], -given * xj[1], given * lever_i)
                friction.push(belt, step, j, given * xj[0], given * xj[1], given * lever_j)
        _tilt(belt, state, step, i, j, dt)
    for j in range(e.shape[0]):
        pressed = 2.0 * dt * e[j, f.FLANK] * belt.sine
        y, z, moment = pressed * step[j, b.R_Y], pressed * step[j, b.R_Z], pressed * step[j, b.R_LEVER]
        friction.push(belt, step, j, y, z, moment)
        speed = e[j, f.V_FILTERED]
        mu, _ = coefficient(belt.flank_law, belt.flank_kinetic, belt.flank_gradient, belt.flank_speed, speed)
        bound = step[j, b.FLANK_BOUND] = dt * mu * e[j, f.FLANK]
        size = np.hypot(e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T])
        if size > bound:
            e[j, b.FLANK_IMPULSE_M] *= bound / size
            e[j, b.FLANK_IMPULSE_T] *= bound / size
        friction.rub_flanks(belt, state, step, j, e[j, b.FLANK_IMPULSE_M], e[j, b.FLANK_IMPULSE_T])
        step[j, b.IMPULSE_T] -= e[j, b.RING_IMPULSE]
        add_to_column(ring.columns, 0, work.beams[j], e[j, b.RING_IMPULSE], work.rows[j, b.ALONG])


@kernel
def _dot(row, values):
    """Product of a row (8,) with the values of a beam."""
    total = 0.0
    for k in range(8):
        total += row[k] * values[k]
    return total


@kernel
def _free_speeds(belt, state, work, dt):
    """Speeds after the step with friction as in the last one; False where the matrix is singular."""
    ring, step, outer = state.ring, work.step, state.ring.mass
    assemble(ring, (0.5 * dt) ** 2)  # the ring's elasticity is linearly implicit, without damping
    for i in range(ring.columns.rows):
        for k in range(PER_BEAM):
            ring.columns.data[i, k, 0] *= dt
    _apply_forces(belt, state, work, dt)
    for j in range(step.shape[0]):
        beam, rows = work.beams[j], work.rows[j]
        tangent, mass = step[j, b.TANGENT], belt.mass / step[j, b.COSINE]
        u = ring.u[beam * PER_BEAM : beam * PER_BEAM + 8]
        before = step[j, b.RING_ACROSS] = _dot(rows[b.MID_ACROSS], u)
        step[j, b.RING_ALONG] = _dot(rows[b.MID_ALONG], u)
        across = belt.mass * step[j, b.FREE_N] + step[j, b.IMPULSE_N] - mass * before
        across -= tangent * (belt.mass * step[j, b.FREE_T] + step[j, b.IMPULSE_T])
        for r in range(8):
            for c in range(8):
                outer[r, c] = mass * rows[b.ACROSS, r] * rows[b.MID_ACROSS, c]
        add_matrix(ring.blocks, beam, outer)
        add_to_column(ring.columns, 0, beam, across, rows[b.ACROSS])
    regular = factor(ring.blocks, SIZE)
    if regular:
        friction.take(state, work)
    return regular


@kernel
def _accept(belt, state, work, inputs, dt):
    """Advance the state to the end of the step, and add up the works; return the sum of all speeds."""
    ring, e, step, totals, pulleys = state.ring, state.elements, work.step, state.totals, state.pulleys
    length = ring.beam.length
    around = length * (ring.blocks.rows - 1)
    driving_thrust = driven_thrust = total = 0.0
    n = e.shape[0]
    for j in range(n):
        first = work.beams[j] * PER_BEAM
        e[j, f.TENSION] = ring.beam.axial_stiffness * rcm.mean_strain(length, ring.q[first : first + 8])
        e[j, f.SADDLE] = abs(friction.saddle_impulse(belt, step, j)) / dt
        c, w = friction.element_speed(belt, step, j), step[j, b.RING_ACROSS]
        t_y, t_z = step[j, b.MID_T_Y], step[j, b.MID_T_Z]
        slip = step[j, b.RING_ALONG] - c
        e[j, f.V], e[j, f.RING_SLIP] = step[j, b.RING_ALONG], slip
        e[j, f.RING_FRICTION] = -e[j, b.RING_IMPULSE] / dt
        totals[f.RING_LOSS] -= e[j, b.RING_IMPULSE] * slip

        slip_m, slip_t = friction.flank_slip(belt, state, step, j)
        grip_m, grip_t = -e[j, b.FLANK_IMPULSE_M] / dt, -e[j, b.FLANK_IMPULSE_T] / dt
        e[j, f.FLANK_SLIP_M], e[j, f.FLANK_SLIP_T] = slip_m, slip_t
        e[j, f.FLANK_FRICTION_M], e[j, f.FLANK_FRICTION_T] = grip_m, grip_t
        loss = belt.cosine * belt.cosine * grip_m * slip_m + grip_t * slip_t
        totals[f.FLANK_LOSS] += 2.0 * dt * loss
        size = np.hypot(slip_m, slip_t)
        filtered, _ = remembered(e[j, f.V_FILTERED], size, belt.friction_memory, dt)
        e[j, f.V_FILTERED] = filtered if e[j, f.FLANK] > 0.0 else size
        thrust = e[j, f.FLANK] * belt.cosine + grip_m * belt.sine
        if e[j, f.DRIVEN] > 0.0:
            driven_thrust += thrust
        else:
            driving_thrust += thrust
            totals[f.WORK_IN] -= 2.0 * dt * grip_t * step[j, b.MID_RADIUS] * pulleys[f.DRIVING_SPEED]

        e[j, f.U_Y], e[j, f.U_Z], e[j, f.OMEGA] = c * t_y - w * t_z, c * t_z + w * t_y, step[j, b.SPIN]
        x = turned(e[j, f.HEADING_Y], e[j, f.HEADING_Z], dt * e[j, f.OMEGA])
        e[j, f.HEADING_Y], e[j, f.HEADING_Z] = x
        e[j, b.PLACE_RATE] = -slip / step[j, b.MID_STRETCH]
        e[j, b.PLACE] = (e[j, b.PLACE] + dt * e[j, b.PLACE_RATE]) % around
        total += abs(e[j, f.U_Y]) + abs(e[j, f.U_Z]) + abs(e[j, f.OMEGA])
    for j in range(n):
        e[j, f.LENGTH] = (e[(j + 1) % n, b.PLACE] - e[j, b.PLACE]) % around
    for k in range(ring.q.size):
        ring.q[k] += dt * ring.u[k]
    move_sheaves(belt, state, inputs, driving_thrust, driven_thrust, dt)
    totals[f.TIME] += dt
    totals[f.WORK_OUT] += dt * inputs[f.IN_LOAD] * pulleys[f.DRIVEN_SPEED]
    return total


@kernel
def _step(belt, tolerance, state, work, inputs, dt):
    """One step; CONVERGED, NOT_CONVERGED where a set-valued law does not hold, or NOT_FINITE."""
    state.pulleys[f.DRIVING_SPEED] = inputs[f.IN_SPEED]
    state.pulleys[f.DRIVEN_SPEED] -= dt * inputs[f.IN_LOAD] / belt.driven_inertia
    _locate(belt, state, work, dt)
    if not _free_speeds(belt, state, work, dt):
        return f.NOT_FINITE
    solved = True
    if belt.ring_friction > 0.0 or belt.flank_kinetic > 0.0:
        solved = friction.rub(belt, tolerance, state, work)
    if not _accept(belt, state, work, inputs, dt) < _LARGEST:
        return f.NOT_FINITE
    return f.CONVERGED if solved else f.NOT_CONVERGED


@kernel
def advance(belt, tolerance, state, work, inputs, steps, dt):
    """Advance a pushbelt by a number of steps of dt [s], in place.

    Parameters
    ----------
    belt : pushbelt.belt.Belt
        Constants.
    tolerance : float
        Speed up to which a law counts as fulfilled [m/s]; impulses count by the speed that they change.
    state, work : BeltState, Workspace
        The state at the start, at the end of the last step; work space.
    inputs : (2, INPUTS) array
        Inputs at the start and at the end, between which they change linearly.

    Returns
    -------
    int
        CONVERGED; NOT_CONVERGED where in _MOST_FAILURES steps in a row a set-valued law did not hold;
        NOT_FINITE. The counters then name the element and the contact at fault.
    """
    counters = state.counters
    for k in range(steps):
        share = (k + 1.0) / steps
        for entry in range(work.inputs.size):
            work.inputs[entry] = inputs[0, entry] + share * (inputs[1, entry] - inputs[0, entry])
        outcome = _step(belt, tolerance, state, work, work.inputs, dt)
        counters[f.STEPS] += 1
        counters[f.IN_A_ROW] = counters[f.IN_A_ROW] + 1 if outcome == f.NOT_CONVERGED else 0
        counters[f.FAILED_STEPS] += outcome == f.NOT_CONVERGED
        if outcome == f.NOT_FINITE or counters[f.IN_A_ROW] == _MOST_FAILURES:
            counters[f.STATUS] = outcome
            return outcome
    counters[f.STATUS] = f.CONVERGED
    return f.CONVERGED
