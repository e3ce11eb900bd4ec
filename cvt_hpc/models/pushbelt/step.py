"""Steps of the planar pushbelt in time.

From q_k and X_{k-1/2} a step finds X_{k+1/2}. The magnitudes of stiff laws are those at q_{k+1} = q_k +
dt X_{k+1/2} and all directions those at q_k: implicit Euler along the direction of each law, symplectic Euler
for what is slow.
"""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import absolute, ahead, around, behind, like, maximum, select, sqrt
from cvt_hpc.models.pushbelt.assembly import (
    RIGHT,
    assemble,
    border_system,
    element_forces,
    pair_forces,
    residuals,
)
from cvt_hpc.models.pushbelt.belt import (
    CHANGE,
    CONVERGED,
    DRIVEN,
    DRIVEN_RADIUS,
    DRIVEN_SPEED,
    DRIVING_RADIUS,
    DRIVING_SPEED,
    EDGE,
    FAILED_CONTACT,
    FAILED_ELEMENT,
    FAILED_STEPS,
    FLANK,
    FLANK_FRICTION_M,
    FLANK_FRICTION_T,
    FLANK_SLIP_M,
    FLANK_SLIP_T,
    FORCE_T,
    HEAD,
    HEADING_Y,
    HEADING_Z,
    IN_A_ROW,
    IN_DRIVEN_THRUST,
    IN_DRIVING_SHIFT,
    IN_DRIVING_THRUST,
    IN_LOAD,
    IN_SPEED,
    ITERATE_TENSION,
    ITERATIONS,
    LENGTH,
    MID_RADIUS,
    NOSE,
    NOT_CONVERGED,
    NOT_FINITE,
    OMEGA,
    POWER_RESIDUAL,
    R_Y,
    R_Z,
    RING_FRICTION,
    RING_SLIP,
    SADDLE,
    STATUS,
    STEPS,
    T_Y,
    T_Z,
    TENSION,
    TENSION_I_Y,
    TENSION_I_Z,
    TENSION_J_Y,
    TENSION_J_Z,
    THRUST_WORK,
    TIME,
    U_Y,
    U_Z,
    V_FILTERED,
    WORK_IN,
    WORK_OUT,
    V,
    Y,
    Z,
)
from cvt_hpc.models.pushbelt.chain import linear_blocks, link, predict, turned
from cvt_hpc.models.pushbelt.faults import keep_states, most_corrected
from cvt_hpc.models.pushbelt.nose import add_nose_blocks, nose_forces, predict_noses
from cvt_hpc.models.pushbelt.power import book
from cvt_hpc.physics.contact_laws import remembered
from cvt_hpc.solvers.cyclic_blocks import block_size
from cvt_hpc.solvers.linked_blocks import solve
from cvt_hpc.solvers.small_system import solve_small

_SIZE = block_size(4)  # unknowns of an element: both speeds, rotation, speed of the ring
_LARGE = 1e100  # more than any speed or power that means something


@kernel
def _shapes(belt, step, shapes):
    """psi_k at the elements: 1, cos, sin, cos 2, sin 2, ..."""
    modes = shapes.data.shape[1] if belt.modal_stiffness.shape[1] > 0 else 0
    for j in range(step.rows):
        c, s = step[j, R_Y], step[j, R_Z]
        cosine, sine = like(1.0, c), like(0.0, c)
        for k in range(modes):
            if k % 2 == 1:
                cosine, sine = cosine * c - sine * s, sine * c + cosine * s
                shapes[j, k] = cosine
            elif k > 0:
                shapes[j, k] = sine
            else:
                shapes[j, k] = 1.0


@kernel
def _correct(elements, blocks, border, increments, scratch, share, omega_length):
    """Take the iterate to the solution, or a share of the way; return the largest correction [m/s].

    Where any correction is not finite, nor is what is returned.
    """
    size = border.shape[0]
    largest = total = like(0.0, blocks[0, RIGHT])
    for j in range(blocks.rows):
        for r in range(4):
            change = blocks[j, RIGHT + r]
            for k in range(size):
                change -= blocks[j, RIGHT + 4 * (1 + k) + r] * border[k, size]
            blocks[j, RIGHT + r] = change
            elements[j, CHANGE + r] += share * change
            change = absolute(change * omega_length) if r == 2 else absolute(change)
            largest = maximum(change, largest)
            total += change
    for k in range(size):
        increments[k] += share * border[k, size]
    scratch[0, 0], scratch[0, 1] = largest, total
    found, total_found = 0.0, 0.0
    for part in range(scratch.data.shape[2]):
        found = max(found, scratch.data[0, 0, part])
        total_found += scratch.data[0, 1, part]
    # a maximum passes over what is not a number, a sum does not
    return found if total_found < np.inf else total_found


@kernel
def _prepare(belt, state, work, dt):
    """What all iterates of a step have in common: geometry, directions, linear laws."""
    predict(belt, state.elements, state.pulleys, work.step, dt)
    link(belt, state.elements, work.step, dt)
    if belt.nose_clearance < np.inf:
        predict_noses(belt, state.elements, work.step)
    linear_blocks(belt, work.step, dt)
    _shapes(belt, work.step, work.shapes)


@kernel
def _evaluate(belt, state, work, load, dt):
    """Forces of the iterate, and the residuals that they leave; return the power residual [W]."""
    elements, step, iterate = state.elements, work.step, work.iterate
    pulleys, increments, openings, shapes = state.pulleys, state.increments, state.openings, work.shapes
    pair_forces(belt, elements, step, iterate, dt)
    if belt.nose_clearance < np.inf:
        nose_forces(belt, elements, step, iterate, dt)
    element_forces(belt, elements, pulleys, increments, openings, shapes, step, iterate, dt)
    return residuals(
        belt,
        elements,
        pulleys,
        increments,
        openings,
        shapes,
        load,
        step,
        iterate,
        work.scratch,
        work.border,
        dt,
    )


@kernel
def _solve(belt, state, work, dt):
    """Solve for the correction: of the border in its last column, of elements without its part in blocks.

    Returns
    -------
    bool
        Whether the elements' system is regular.
    """
    elements, step, iterate = state.elements, work.step, work.iterate
    assemble(belt, elements, work.shapes, step, iterate, work.blocks)
    if belt.nose_clearance < np.inf:
        add_nose_blocks(elements, step, iterate, work.blocks)
    is_regular = solve(work.blocks, work.scratch, _SIZE)
    border_system(belt, elements, work.shapes, step, iterate, work.blocks, work.scratch, work.border, dt)
    solve_small(work.border)
    return is_regular


@kernel
def _name_fault(state, element, kept):
    """Enter the contact of an element whose force has changed most since its state was kept.

    Contacts with the next element and with the one behind count, the latter as those of that element.
    """
    rows, fields, parts = state.elements.data.shape
    for k in range(2):
        place = (element - k) % (rows * parts)
        for field in range(fields):
            kept[k, field] = abs(state.elements.data[place % rows, field, place // rows] - kept[k, field])
    flank = kept[0, FLANK] ** 2 + kept[0, FLANK_FRICTION_M] ** 2 + kept[0, FLANK_FRICTION_T] ** 2
    of_itself = kept[0, EDGE], kept[0, HEAD], np.sqrt(flank), kept[0, RING_FRICTION], kept[0, NOSE]
    changes = (*of_itself, kept[1, EDGE], kept[1, HEAD], 0.0, 0.0, kept[1, NOSE])  # as in CONTACTS
    largest = 0
    for k in range(len(changes)):
        if changes[k] > changes[largest]:
            largest = k
    contacts = len(of_itself)
    state.counters[FAILED_ELEMENT] = (element - largest // contacts) % (rows * parts)
    state.counters[FAILED_CONTACT] = largest % contacts


@kernel
def _newton(belt, newton, state, work, load, dt):
    """Find the speeds of a step; iterations, the last correction [m/s] and the power residual [W].

    A step that is not solved leaves its fault in the counters.
    """
    change, power = 0.0, 0.0
    element = 0
    for iteration in range(newton.most_iterations + 1):
        power = _evaluate(belt, state, work, load, dt)
        is_finite = abs(power) < _LARGE and change < _LARGE
        enough = iteration > 0 and change < newton.tolerance and abs(power) < newton.power_tolerance
        if enough or not is_finite:
            return iteration, change, power
        if iteration == newton.most_iterations:
            _name_fault(state, element, work.kept)
            return iteration, change, power
        if not _solve(belt, state, work, dt):
            return iteration, np.inf, power
        share = 0.5 if iteration >= newton.first_half_step else 1.0
        change = _correct(
            state.elements,
            work.blocks,
            work.border,
            state.increments,
            work.scratch,
            share,
            newton.omega_length,
        )
        if iteration == newton.most_iterations - 1:
            element = most_corrected(work.blocks, RIGHT, (1.0, 1.0, newton.omega_length, 1.0))
            keep_states(state.elements, element, work.kept)
    return newton.most_iterations, change, power


@kernel
def _accept(belt, state, work, inputs, dt):
    """Take the state to the end of the step, and add up what it has done."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    totals, pulleys = state.totals, state.pulleys
    book(belt, state, work, dt)
    for k in range(3):
        scratch[0, k] = 0.0
    per_dt = 1.0 / dt
    for j in range(step.rows):
        t_y, t_z = step[j, T_Y], step[j, T_Z]
        ahead_of_it, tension = iterate[j, ITERATE_TENSION], behind(iterate, j, ITERATE_TENSION)
        pull = ahead_of_it * (t_z * step[j, TENSION_I_Y] - t_y * step[j, TENSION_I_Z])
        pull -= tension * (t_z * behind(step, j, TENSION_J_Y) - t_y * behind(step, j, TENSION_J_Z))
        across = per_dt * (t_z * elements[j, CHANGE] - t_y * elements[j, CHANGE + 1])
        elements[j, SADDLE] = absolute(belt.ring_mass * across - pull)
        elements[j, TENSION] = ahead_of_it
        elements[j, LENGTH] += dt * (elements[j, RING_SLIP] - ahead(elements, j, RING_SLIP))

        u_y, u_z = elements[j, U_Y] + elements[j, CHANGE], elements[j, U_Z] + elements[j, CHANGE + 1]
        omega = elements[j, OMEGA] + elements[j, CHANGE + 2]
        elements[j, U_Y], elements[j, U_Z], elements[j, OMEGA] = u_y, u_z, omega
        elements[j, V] += elements[j, CHANGE + 3]
        elements[j, Y] += dt * u_y
        elements[j, Z] += dt * u_z
        x_y, x_z = turned(elements[j, HEADING_Y], elements[j, HEADING_Z], dt * omega)
        elements[j, HEADING_Y], elements[j, HEADING_Z] = x_y, x_z

        driven = elements[j, DRIVEN]
        thrust = elements[j, FLANK] * belt.cosine + elements[j, FLANK_FRICTION_M] * belt.sine
        scratch[0, 0] += (1.0 - driven) * thrust
        scratch[0, 1] += driven * thrust
        scratch[0, 2] += (1.0 - driven) * step[j, MID_RADIUS] * iterate[j, FORCE_T]
        slip_m, slip_t = elements[j, FLANK_SLIP_M], elements[j, FLANK_SLIP_T]
        size = sqrt(slip_m * slip_m + slip_t * slip_t)
        filtered, _ = remembered(elements[j, V_FILTERED], size, belt.friction_memory, dt)
        elements[j, V_FILTERED] = select(elements[j, FLANK] > 0.0, filtered, size)
    for k in range(3):
        scratch[0, k] = around(scratch[0, k])
    driving_thrust, driven_thrust = scratch.data[0, 0, 0], scratch.data[0, 1, 0]
    pulleys[DRIVEN_SPEED] += state.increments[0]
    modes = belt.modal_stiffness.shape[1]
    for k in range(2 * modes):
        state.openings[k // modes, k % modes] += state.increments[1 + k]
    driving = dt * belt.driving_rate * (inputs[IN_DRIVING_THRUST] - driving_thrust)
    driving += dt * inputs[IN_DRIVING_SHIFT]
    driven = dt * belt.driven_rate * (inputs[IN_DRIVEN_THRUST] - driven_thrust)
    pulleys[DRIVING_RADIUS] += driving
    pulleys[DRIVEN_RADIUS] += driven
    totals[TIME] += dt
    totals[WORK_IN] += dt * scratch.data[0, 2, 0] * pulleys[DRIVING_SPEED]
    totals[WORK_OUT] += dt * inputs[IN_LOAD] * (pulleys[DRIVEN_SPEED] - 0.5 * state.increments[0])
    # both sheaves of a pulley close by the tangent of the wedge angle
    closing = 2.0 * belt.sine / belt.cosine
    totals[THRUST_WORK] -= closing * (driving_thrust * driving + driven_thrust * driven)


@kernel
def advance(belt, newton, state, work, inputs, steps, dt):
    """Advance a pushbelt by a number of steps, in place.

    Parameters
    ----------
    belt : Belt
        Constants.
    newton : Newton
        How steps are solved.
    state : BeltState
        The state at the start; at the end, of its last step.
    work : Workspace
        Work space.
    inputs : (2, INPUTS) array
        Speed of the driving pulley [rad/s], thrust on a sheave of both pulleys [N], torque of the load [N m],
        and speed of the driving radius by what moves the driving sheave [m/s], at the start and at the end:
        between, they change linearly.
    steps : int
        Number of steps.
    dt : float
        Step [s].

    Returns
    -------
    int
        CONVERGED; NOT_CONVERGED where `most_failures` steps in a row had not converged; NOT_FINITE, or where
        the system of an iteration is singular. Of the
        last step that had not converged the counters name the contact at fault, and its element.
    """
    counters = state.counters
    for k in range(steps):
        share = (k + 1.0) / steps
        for entry in range(work.inputs.size):
            work.inputs[entry] = inputs[0, entry] + share * (inputs[1, entry] - inputs[0, entry])
        state.pulleys[DRIVING_SPEED] = work.inputs[IN_SPEED]
        for entry in range(work.increments.size):
            work.increments[entry] = state.increments[entry]
        _prepare(belt, state, work, dt)
        iterations, change, power = _newton(belt, newton, state, work, work.inputs[IN_LOAD], dt)
        counters[STEPS] += 1
        counters[ITERATIONS] += iterations
        finite = abs(power) < _LARGE and change < _LARGE
        failed = not (finite and change < newton.tolerance and abs(power) < newton.power_tolerance)
        counters[IN_A_ROW] = counters[IN_A_ROW] + 1 if failed else 0
        if failed:
            counters[FAILED_STEPS] += 1
        if not finite or counters[IN_A_ROW] == newton.most_failures:
            counters[STATUS] = NOT_CONVERGED if finite else NOT_FINITE
            return counters[STATUS]
        state.totals[POWER_RESIDUAL] += dt * power
        _accept(belt, state, work, work.inputs, dt)
    counters[STATUS] = CONVERGED
    return counters[STATUS]
