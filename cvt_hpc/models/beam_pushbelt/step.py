"""Half-explicit steps of a pushbelt on a ring of beams.

From q_k and u_{k-1/2} a step finds u_{k+1/2} by the forces at q_k and the impulses of the set-valued laws
(Moreau's time stepping), and q_{k+1} = q_k + dt u_{k+1/2}. The bilateral contact of an element with the ring
is no unknown: its force is N along the ring's normal n at q_k, and the velocity of the element after the step

    U = t_m v + n_m (n_m.J_m u),

with the directions at mid step, so that the step moves the element along the ring. Eliminating N and v gives

    (M + sum m / cos(x) b b_m^T) du = dt h + sum b p,
    p = m n.U_old + I_n - tan(x) (m t.U_old + I_t) - m / cos(x) b_m.u,

b = n.J, b_m = n_m.J_m, x the angle from t to t_m, and I the impulse of all other forces on the element. So
Cartesian momentum is kept, the turn of the ring under an element (centrifugal and Coriolis force) needs no
curvature, and the place of an element on the ring cannot drift.

Directions of forces are those at q_k; sliding velocities are in the directions of mid step, by the speeds of
the last one. At either end they would add v phi' dt / 2 of false sliding.
"""

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.beam_pushbelt import fields as b
from cvt_hpc.models.beam_pushbelt import forces
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.chain import turned
from cvt_hpc.multibody import rcm_chain
from cvt_hpc.multibody.rcm_beam import mean_strain
from cvt_hpc.physics.contact_laws import remembered
from cvt_hpc.solvers.cyclic_blocks import factor, solve

_LARGE = 1e100  # more than any speed that means something


@kernel
def _free_speeds(belt, proximal, state, work, dt):
    """Speeds after the step with friction as in the last one; False where the matrix is singular."""
    ring, step = state.ring, work.step
    theta = proximal.theta
    rcm_chain.assemble(ring, max(2.0 * theta - 1.0, 0.0) * dt, (theta * dt) ** 2, theta * dt)
    for i in range(ring.columns.rows):
        for k in range(rcm_chain.PER_ELEMENT):
            ring.columns.data[i, k, 0] *= dt
    forces.apply_forces(belt, state, work, dt)
    for j in range(step.shape[0]):
        beam, rows, tangent = work.beams[j], work.rows[j], step[j, b.TANGENT]
        mass = belt.mass / step[j, b.COSINE]
        before = forces.dot(rows[b.MID_ACROSS], ring.u, beam * rcm_chain.PER_ELEMENT)
        step[j, b.RING_ACROSS] = before
        step[j, b.RING_ALONG] = forces.dot(rows[b.MID_ALONG], ring.u, beam * rcm_chain.PER_ELEMENT)
        across = belt.mass * step[j, b.FREE_N] + step[j, b.IMPULSE_N] - mass * before
        across -= tangent * (belt.mass * step[j, b.FREE_T] + step[j, b.IMPULSE_T])
        rcm_chain.add_product(ring, beam, mass, rows[b.ACROSS], rows[b.MID_ACROSS])
        rcm_chain.add_to_column(ring.columns, 0, beam, across, rows[b.ACROSS])
    return factor(ring.blocks, rcm_chain.SIZE)


@kernel
def _take(state, work):
    """Take the ring's speeds, and those of its points under the elements, on by a solution."""
    ring, step = state.ring, work.step
    nodes = ring.blocks.rows - 1
    for k in range(ring.u.size):
        ring.u[k] += ring.columns.data[k // rcm_chain.PER_ELEMENT % nodes, k % rcm_chain.PER_ELEMENT, 0]
    for j in range(step.shape[0]):
        beam, rows = work.beams[j], work.rows[j]
        step[j, b.RING_ACROSS] += rcm_chain.along_row(ring.columns, 0, beam, rows[b.MID_ACROSS])
        step[j, b.RING_ALONG] += rcm_chain.along_row(ring.columns, 0, beam, rows[b.MID_ALONG])


@kernel
def _accept(belt, state, work, inputs, dt):
    """Advance the state to the end of the step, and add up the works."""
    ring, e, step, totals, pulleys = state.ring, state.elements, work.step, state.totals, state.pulleys
    length = ring.beam.length
    around = length * ((ring.q.size - 3) // rcm_chain.PER_ELEMENT)
    driving_thrust = driven_thrust = 0.0
    n = e.shape[0]
    for j in range(n):
        first = work.beams[j] * rcm_chain.PER_ELEMENT
        e[j, f.TENSION] = ring.beam.axial_stiffness * mean_strain(length, ring.q[first : first + 8])
        e[j, f.SADDLE] = abs(forces.saddle_impulse(belt, step, j)) / dt
        c, w = forces.element_speed(belt, step, j), step[j, b.RING_ACROSS]
        t_y, t_z = step[j, b.MID_T_Y], step[j, b.MID_T_Z]
        e[j, f.V] = step[j, b.RING_ALONG]
        slip = step[j, b.RING_ALONG] - c
        e[j, f.RING_SLIP], e[j, f.RING_FRICTION] = slip, -e[j, b.RING_IMPULSE] / dt
        totals[f.RING_LOSS] -= e[j, b.RING_IMPULSE] * slip

        slip_m, slip_t = forces.flank_slip(belt, pulleys, e, step, j)
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
        e[j, f.HEADING_Y], e[j, f.HEADING_Z] = turned(
            e[j, f.HEADING_Y], e[j, f.HEADING_Z], dt * e[j, f.OMEGA]
        )
        e[j, b.PLACE_RATE] = -slip / step[j, b.MID_STRETCH]
        e[j, b.PLACE] = (e[j, b.PLACE] + dt * e[j, b.PLACE_RATE]) % around
    for j in range(n):
        e[j, f.LENGTH] = (e[(j + 1) % n, b.PLACE] - e[j, b.PLACE]) % around
    for k in range(ring.q.size):
        ring.q[k] += dt * ring.u[k]
    driving = dt * belt.driving_rate * (inputs[f.IN_DRIVING_THRUST] - driving_thrust)
    driving += dt * inputs[f.IN_DRIVING_SHIFT]
    driven = dt * belt.driven_rate * (inputs[f.IN_DRIVEN_THRUST] - driven_thrust)
    pulleys[f.DRIVING_RADIUS] += driving
    pulleys[f.DRIVEN_RADIUS] += driven
    totals[f.TIME] += dt
    totals[f.WORK_OUT] += dt * inputs[f.IN_LOAD] * pulleys[f.DRIVEN_SPEED]
    closing = 2.0 * belt.sine / belt.cosine
    totals[f.THRUST_WORK] -= closing * (driving_thrust * driving + driven_thrust * driven)


@kernel
def _step(belt, proximal, state, work, inputs, dt):
    """One step; CONVERGED, NOT_CONVERGED where a set-valued law does not hold, or NOT_FINITE."""
    ring, e = state.ring, state.elements
    rubs = belt.ring_friction > 0.0 or belt.flank_kinetic > 0.0
    state.pulleys[f.DRIVING_SPEED] = inputs[f.IN_SPEED]
    state.pulleys[f.DRIVEN_SPEED] -= dt * inputs[f.IN_LOAD] / belt.driven_inertia
    forces.locate(belt, state, work, dt)
    if not _free_speeds(belt, proximal, state, work, dt):
        return f.NOT_FINITE
    solve(ring.blocks, ring.columns, rcm_chain.SIZE)
    _take(state, work)
    solved = True
    if rubs:
        forces.couple(state, work)
        for j in range(e.shape[0]):
            work.free[j, 0], work.free[j, 1] = work.step[j, b.RING_ACROSS], work.step[j, b.RING_ALONG]
        solved = forces.rub(belt, proximal, state, work)
        solve(ring.blocks, ring.columns, rcm_chain.SIZE)
        for j in range(e.shape[0]):
            work.step[j, b.RING_ACROSS], work.step[j, b.RING_ALONG] = work.free[j, 0], work.free[j, 1]
        _take(state, work)
    _accept(belt, state, work, inputs, dt)
    total = 0.0
    for j in range(e.shape[0]):
        total += abs(e[j, f.U_Y]) + abs(e[j, f.U_Z]) + abs(e[j, f.OMEGA])
    if not total < _LARGE:
        return f.NOT_FINITE
    return f.CONVERGED if solved else f.NOT_CONVERGED


@kernel
def advance(belt, proximal, state, work, inputs, steps, dt):
    """Advance a pushbelt by a number of steps, in place.

    Parameters
    ----------
    belt : pushbelt.belt.Belt
        Constants.
    proximal : Proximal
        How steps are solved.
    state : BeltState
        The state at the start; at the end, of its last step.
    work : Workspace
        Work space.
    inputs : (2, INPUTS) array
        As `pushbelt.step.advance` takes them.
    steps : int
        Number of steps.
    dt : float
        Step [s].

    Returns
    -------
    int
        CONVERGED; NOT_CONVERGED where in `most_failures` steps in a row a set-valued law did not hold;
        NOT_FINITE. The counters then name the element and the contact at fault.
    """
    counters = state.counters
    for k in range(steps):
        share = (k + 1.0) / steps
        for entry in range(work.inputs.size):
            work.inputs[entry] = inputs[0, entry] + share * (inputs[1, entry] - inputs[0, entry])
        outcome = _step(belt, proximal, state, work, work.inputs, dt)
        counters[f.STEPS] += 1
        counters[f.IN_A_ROW] = counters[f.IN_A_ROW] + 1 if outcome == f.NOT_CONVERGED else 0
        counters[f.FAILED_STEPS] += outcome == f.NOT_CONVERGED
        if outcome == f.NOT_FINITE or counters[f.IN_A_ROW] == proximal.most_failures:
            counters[f.STATUS] = outcome
            return outcome
    counters[f.STATUS] = f.CONVERGED
    return f.CONVERGED
