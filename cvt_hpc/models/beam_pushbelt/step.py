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

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.beam_pushbelt.belt import (
    ACROSS,
    COSINE,
    FLANK_IMPULSE_M,
    FLANK_IMPULSE_T,
    FREE_N,
    FREE_T,
    IMPULSE_N,
    IMPULSE_T,
    MID_ACROSS,
    MID_ALONG,
    MID_RADIUS,
    MID_STRETCH,
    MID_T_Y,
    MID_T_Z,
    PLACE,
    PLACE_RATE,
    RING_ACROSS,
    RING_ALONG,
    RING_IMPULSE,
    SPIN,
    TANGENT,
)
from cvt_hpc.models.beam_pushbelt.forces import apply_forces, dot, locate
from cvt_hpc.models.beam_pushbelt.friction import (
    couple,
    element_speed,
    flank_slip,
    rub,
    saddle_impulse,
)
from cvt_hpc.models.pushbelt.belt import (
    CONVERGED,
    DRIVEN,
    DRIVEN_RADIUS,
    DRIVEN_SPEED,
    DRIVING_RADIUS,
    DRIVING_SPEED,
    FAILED_STEPS,
    FLANK,
    FLANK_FRICTION_M,
    FLANK_FRICTION_T,
    FLANK_LOSS,
    FLANK_SLIP_M,
    FLANK_SLIP_T,
    HEADING_Y,
    HEADING_Z,
    IN_A_ROW,
    IN_DRIVEN_THRUST,
    IN_DRIVING_SHIFT,
    IN_DRIVING_THRUST,
    IN_LOAD,
    IN_SPEED,
    LENGTH,
    NOT_CONVERGED,
    NOT_FINITE,
    OMEGA,
    RING_FRICTION,
    RING_LOSS,
    RING_SLIP,
    SADDLE,
    STATUS,
    STEPS,
    TENSION,
    THRUST_WORK,
    TIME,
    U_Y,
    U_Z,
    V_FILTERED,
    WORK_IN,
    WORK_OUT,
    V,
)
from cvt_hpc.models.pushbelt.chain import turned
from cvt_hpc.multibody.rcm_beam import mean_strain
from cvt_hpc.multibody.rcm_chain import (
    PER_ELEMENT,
    SIZE,
    add_product,
    add_to_column,
    along_row,
    assemble,
)
from cvt_hpc.physics.contact_laws import remembered
from cvt_hpc.solvers.cyclic_blocks import factor, solve

_LARGE = 1e100  # more than any speed that means something


@kernel
def _free_speeds(belt, proximal, state, work, dt):
    """Speeds after the step with friction as in the last one; False where the matrix is singular."""
    ring, step = state.ring, work.step
    theta = proximal.theta
    assemble(ring, max(2.0 * theta - 1.0, 0.0) * dt, (theta * dt) ** 2, theta * dt)
    for i in range(ring.columns.rows):
        for k in range(PER_ELEMENT):
            ring.columns.data[i, k, 0] *= dt
    apply_forces(belt, state, work, dt)
    for j in range(step.shape[0]):
        beam, rows, tangent = work.beams[j], work.rows[j], step[j, TANGENT]
        mass = belt.mass / step[j, COSINE]
        before = dot(rows[MID_ACROSS], ring.u, beam * PER_ELEMENT)
        step[j, RING_ACROSS] = before
        step[j, RING_ALONG] = dot(rows[MID_ALONG], ring.u, beam * PER_ELEMENT)
        across = belt.mass * step[j, FREE_N] + step[j, IMPULSE_N] - mass * before
        across -= tangent * (belt.mass * step[j, FREE_T] + step[j, IMPULSE_T])
        add_product(ring, beam, mass, rows[ACROSS], rows[MID_ACROSS])
        add_to_column(ring.columns, 0, beam, across, rows[ACROSS])
    return factor(ring.blocks, SIZE)


@kernel
def _take(state, work):
    """Take the ring's speeds, and those of its points under the elements, on by a solution."""
    ring, step = state.ring, work.step
    nodes = ring.blocks.rows - 1
    for k in range(ring.u.size):
        ring.u[k] += ring.columns.data[k // PER_ELEMENT % nodes, k % PER_ELEMENT, 0]
    for j in range(step.shape[0]):
        step[j, RING_ACROSS] += along_row(ring.columns, 0, work.beams[j], work.rows[j, MID_ACROSS])
        step[j, RING_ALONG] += along_row(ring.columns, 0, work.beams[j], work.rows[j, MID_ALONG])


@kernel
def _accept(belt, state, work, inputs, dt):
    """Advance the state to the end of the step, and add up the works."""
    ring, e, step, totals, pulleys = state.ring, state.elements, work.step, state.totals, state.pulleys
    length = ring.beam.length
    around = length * ((ring.q.size - 3) // PER_ELEMENT)
    driving_thrust = driven_thrust = 0.0
    n = e.shape[0]
    for j in range(n):
        first = work.beams[j] * PER_ELEMENT
        e[j, TENSION] = ring.beam.axial_stiffness * mean_strain(length, ring.q[first : first + 8])
        e[j, SADDLE] = abs(saddle_impulse(belt, step, j)) / dt
        c, w = element_speed(belt, step, j), step[j, RING_ACROSS]
        t_y, t_z = step[j, MID_T_Y], step[j, MID_T_Z]
        e[j, V] = step[j, RING_ALONG]
        slip = step[j, RING_ALONG] - c
        e[j, RING_SLIP], e[j, RING_FRICTION] = slip, -e[j, RING_IMPULSE] / dt
        totals[RING_LOSS] -= e[j, RING_IMPULSE] * slip

        slip_m, slip_t = flank_slip(belt, pulleys, e, step, j)
        grip_m, grip_t = -e[j, FLANK_IMPULSE_M] / dt, -e[j, FLANK_IMPULSE_T] / dt
        e[j, FLANK_SLIP_M], e[j, FLANK_SLIP_T] = slip_m, slip_t
        e[j, FLANK_FRICTION_M], e[j, FLANK_FRICTION_T] = grip_m, grip_t
        loss = belt.cosine * belt.cosine * grip_m * slip_m + grip_t * slip_t
        totals[FLANK_LOSS] += 2.0 * dt * loss
        size = np.hypot(slip_m, slip_t)
        filtered, _ = remembered(e[j, V_FILTERED], size, belt.friction_memory, dt)
        e[j, V_FILTERED] = filtered if e[j, FLANK] > 0.0 else size
        thrust = e[j, FLANK] * belt.cosine + grip_m * belt.sine
        if e[j, DRIVEN] > 0.0:
            driven_thrust += thrust
        else:
            driving_thrust += thrust
            totals[WORK_IN] -= 2.0 * dt * grip_t * step[j, MID_RADIUS] * pulleys[DRIVING_SPEED]

        e[j, U_Y], e[j, U_Z], e[j, OMEGA] = c * t_y - w * t_z, c * t_z + w * t_y, step[j, SPIN]
        e[j, HEADING_Y], e[j, HEADING_Z] = turned(e[j, HEADING_Y], e[j, HEADING_Z], dt * e[j, OMEGA])
        e[j, PLACE_RATE] = -slip / step[j, MID_STRETCH]
        e[j, PLACE] = (e[j, PLACE] + dt * e[j, PLACE_RATE]) % around
    for j in range(n):
        e[j, LENGTH] = (e[(j + 1) % n, PLACE] - e[j, PLACE]) % around
    for k in range(ring.q.size):
        ring.q[k] += dt * ring.u[k]
    driving = dt * belt.driving_rate * (inputs[IN_DRIVING_THRUST] - driving_thrust)
    driving += dt * inputs[IN_DRIVING_SHIFT]
    driven = dt * belt.driven_rate * (inputs[IN_DRIVEN_THRUST] - driven_thrust)
    pulleys[DRIVING_RADIUS] += driving
    pulleys[DRIVEN_RADIUS] += driven
    totals[TIME] += dt
    totals[WORK_OUT] += dt * inputs[IN_LOAD] * pulleys[DRIVEN_SPEED]
    closing = 2.0 * belt.sine / belt.cosine
    totals[THRUST_WORK] -= closing * (driving_thrust * driving + driven_thrust * driven)


@kernel
def _step(belt, proximal, state, work, inputs, dt):
    """One step; CONVERGED, NOT_CONVERGED where a set-valued law does not hold, or NOT_FINITE."""
    ring, e = state.ring, state.elements
    rubs = belt.ring_friction > 0.0 or belt.flank_kinetic > 0.0
    state.pulleys[DRIVING_SPEED] = inputs[IN_SPEED]
    state.pulleys[DRIVEN_SPEED] -= dt * inputs[IN_LOAD] / belt.driven_inertia
    locate(belt, state, work, dt)
    if not _free_speeds(belt, proximal, state, work, dt):
        return NOT_FINITE
    solve(ring.blocks, ring.columns, SIZE)
    _take(state, work)
    solved = True
    if rubs:
        couple(state, work)
        for j in range(e.shape[0]):
            work.free[j, 0], work.free[j, 1] = work.step[j, RING_ACROSS], work.step[j, RING_ALONG]
        solved = rub(belt, proximal, state, work)
        solve(ring.blocks, ring.columns, SIZE)
        for j in range(e.shape[0]):
            work.step[j, RING_ACROSS], work.step[j, RING_ALONG] = work.free[j, 0], work.free[j, 1]
        _take(state, work)
    _accept(belt, state, work, inputs, dt)
    total = 0.0
    for j in range(e.shape[0]):
        total += abs(e[j, U_Y]) + abs(e[j, U_Z]) + abs(e[j, OMEGA])
    if not total < _LARGE:
        return NOT_FINITE
    return CONVERGED if solved else NOT_CONVERGED


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
        counters[STEPS] += 1
        counters[IN_A_ROW] = counters[IN_A_ROW] + 1 if outcome == NOT_CONVERGED else 0
        counters[FAILED_STEPS] += outcome == NOT_CONVERGED
        if outcome == NOT_FINITE or counters[IN_A_ROW] == proximal.most_failures:
            counters[STATUS] = outcome
            return outcome
    counters[STATUS] = CONVERGED
    return CONVERGED
