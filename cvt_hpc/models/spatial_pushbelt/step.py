"""Steps of the spatial pushbelt in time.

From q_k and X_{k-1/2} a step finds X_{k+1/2}. The magnitudes of stiff laws are those at q_{k+1} = q_k + dt
X_{k+1/2} and all directions those at q_k: implicit Euler along the direction of each law, symplectic Euler
for what is slow. Lateral bending of the rings has a law of its own that damps nothing (`bending`).
"""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import absolute, ahead, around, like, maximum
from cvt_hpc.models.pushbelt.faults import keep_states, most_corrected
from cvt_hpc.models.spatial_pushbelt.assembly import (
    assemble_pairs,
    border_system,
    linear_blocks,
    residuals,
    side_torque,
)
from cvt_hpc.models.spatial_pushbelt.belt import (
    CHANGE,
    CONVERGED,
    DRIVEN,
    DRIVEN_MIDDLE,
    DRIVEN_RADIUS,
    DRIVEN_SPEED,
    DRIVING_MIDDLE,
    DRIVING_RADIUS,
    DRIVING_SPEED,
    DRIVING_TORQUE,
    FAILED_CONTACT,
    FAILED_ELEMENT,
    FAILED_STEPS,
    FLANK,
    FLANK_FRICTION_M,
    FLANK_FRICTION_T,
    FLANK_GAP,
    HEADING,
    IN_A_ROW,
    IN_DRIVEN_DRIFT,
    IN_DRIVEN_THRUST,
    IN_DRIVING_DRIFT,
    IN_DRIVING_SHIFT,
    IN_DRIVING_THRUST,
    IN_LOAD,
    IN_SPEED,
    ITERATE_TENSION,
    ITERATIONS,
    LENGTH,
    NOT_CONVERGED,
    NOT_FINITE,
    OMEGA,
    OUTWARD,
    PIN,
    POINTS,
    POSITION,
    POWER_RESIDUAL,
    PUSH,
    RIGHT,
    RING_FRICTION,
    RING_LINE,
    RING_SLIP,
    SADDLE,
    SIZE,
    SLOPE,
    SPEED,
    STATUS,
    STEPS,
    TENSION,
    THRUST_WORK,
    TIME,
    WORK_IN,
    WORK_OUT,
)
from cvt_hpc.models.spatial_pushbelt.bending import bending_forces, predict_bending
from cvt_hpc.models.spatial_pushbelt.chain import chain_forces, link, predict, pull_across
from cvt_hpc.models.spatial_pushbelt.faces import face_forces, predict_faces
from cvt_hpc.models.spatial_pushbelt.flank import (
    add_flank_blocks,
    along_arc,
    filter_slips,
    flank_forces,
    predict_flanks,
)
from cvt_hpc.models.spatial_pushbelt.pin import pin_forces, predict_pins
from cvt_hpc.models.spatial_pushbelt.power import book_flanks, book_pairs
from cvt_hpc.models.spatial_pushbelt.rotations import (
    cross,
    dot,
    moved,
    squared_up,
    store,
    turned,
    turning,
    vector,
)
from cvt_hpc.models.spatial_pushbelt.saddle import saddle_forces
from cvt_hpc.solvers.cyclic_blocks import block_size
from cvt_hpc.solvers.linked_blocks import solve
from cvt_hpc.solvers.small_system import solve_small

_BLOCK = block_size(SIZE)
_LARGE = 1e100  # more than any speed or power that means something


@kernel
def _shapes(belt, state, leans, step, shapes):
    """psi_k at the elements, 1, cos, sin, cos 2, sin 2, ...; the sheaves' leans go into the gaps."""
    modes = belt.modal_stiffness.shape[1]
    for j in range(step.rows):
        driven = state[j, DRIVEN]
        c, s = along_arc(belt, state, j)
        cosine, sine = like(1.0, c), like(0.0, c)
        lean = like(0.0, c)
        for k in range(modes):
            if k % 2 == 1:
                cosine, sine = cosine * c - sine * s, sine * c + cosine * s
                shapes[j, k] = cosine
            elif k > 0:
                shapes[j, k] = sine
            else:
                shapes[j, k] = 1.0
            lean = lean + (leans[0, k] + driven * (leans[1, k] - leans[0, k])) * shapes[j, k]
        lean = belt.cosine * lean
        for p in range(POINTS):
            step[j, FLANK_GAP + p] += lean if p >= 2 else -lean


@kernel
def _weights(newton):
    """Lengths with which corrections of an element's speeds count."""
    roll = newton.roll_length
    return 1.0, 1.0, 1.0, roll, roll, newton.pitch_length, 1.0, newton.slope_length


@kernel
def _correct(newton, elements, blocks, border, increments, scratch, share):
    """Take the iterate to the solution, or a share of the way; return the largest correction [m/s].

    Where any correction is not finite, nor is what is returned.
    """
    size = border.shape[0]
    weights = _weights(newton)
    largest = total = like(0.0, blocks[0, RIGHT])
    for j in range(blocks.rows):
        for r in range(SIZE):
            change = blocks[j, RIGHT + r]
            for k in range(size):
                change -= blocks[j, RIGHT + SIZE * (1 + k) + r] * border[k, size]
            blocks[j, RIGHT + r] = change
            elements[j, CHANGE + r] += share * change
            change = absolute(change * weights[r])
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
    elements, step = state.elements, work.step
    predict(belt, elements, state.pulleys, step, dt)
    link(belt, elements, step, dt)
    predict_bending(belt, elements, step)
    predict_faces(belt, elements, step)
    if belt.pin_clearance < np.inf:
        predict_pins(belt, elements, step)
    predict_flanks(belt, elements, state.pulleys, step, dt)
    _shapes(belt, elements, state.leans, step, work.shapes)
    linear_blocks(belt, step, dt)


@kernel
def _evaluate(belt, state, work, load, dt):
    """Forces of the iterate, and the residuals that they leave; return the power residual [W]."""
    elements, step, iterate = state.elements, work.step, work.iterate
    increments, openings, shapes = state.increments, state.openings, work.shapes
    chain_forces(belt, elements, step, iterate, dt)
    bending_forces(belt, elements, step, iterate, dt)
    face_forces(belt, elements, step, iterate, dt)
    if belt.pin_clearance < np.inf:
        pin_forces(belt, elements, step, iterate, dt)
    flank_forces(belt, elements, state.pulleys, increments, openings, shapes, step, iterate, dt)
    saddle_forces(belt, elements, step, iterate)
    return residuals(
        belt, elements, increments, openings, shapes, load, step, iterate, work.scratch, work.border, dt
    )


@kernel
def _assemble(belt, state, work, dt):
    """The linear system of the elements."""
    assemble_pairs(belt, state.elements, work.step, work.iterate, work.blocks)
    add_flank_blocks(belt, state.elements, work.shapes, work.step, work.iterate, work.blocks, dt)


@kernel
def _solve(belt, state, work, dt):
    """Solve for the correction: of the border in its last column, of elements without its part in blocks.

    Return whether the system was regular.
    """
    is_regular = solve(work.blocks, work.scratch, _BLOCK)
    border_system(belt, state.elements, work.shapes, work.iterate, work.blocks, work.sums, work.border, dt)
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
    largest, contact, behind_it = -1.0, 0, 0
    for k in range(2):
        for entry in range(10):
            if entry < 4:
                size = kept[k, PUSH + entry]
            elif entry == 4:
                size = kept[k, PIN]
            elif k == 1:
                size = 0.0
            elif entry < 9:
                p = entry - 5
                size = np.sqrt(
                    kept[0, FLANK + p] ** 2
                    + kept[0, FLANK_FRICTION_M + p] ** 2
                    + kept[0, FLANK_FRICTION_T + p] ** 2
                )
            else:
                size = kept[0, RING_FRICTION]
            if size > largest:
                largest, contact, behind_it = size, entry, k
    state.counters[FAILED_ELEMENT] = (element - behind_it) % (rows * parts)
    state.counters[FAILED_CONTACT] = contact


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
        _assemble(belt, state, work, dt)
        if not _solve(belt, state, work, dt):
            return iteration, np.inf, power
        share = 0.5 if iteration >= newton.first_half_step else 1.0
        change = _correct(
            newton, state.elements, work.blocks, work.border, state.increments, work.scratch, share
        )
        if iteration == newton.most_iterations - 1:
            element = most_corrected(work.blocks, RIGHT, _weights(newton))
            keep_states(state.elements, element, work.kept)
    return newton.most_iterations, change, power


@kernel
def _accept_elements(belt, state, work, dt):
    """Take the elements to the end of the step."""
    elements, step, iterate = state.elements, work.step, work.iterate
    per_dt = 1.0 / dt
    for j in range(step.rows):
        x, o = vector(elements, j, HEADING), vector(elements, j, OUTWARD)
        outward = cross(vector(step, j, RING_LINE), cross(o, x))
        pull = pull_across(step, iterate, j, outward)
        across = per_dt * dot(outward, vector(elements, j, CHANGE))
        elements[j, SADDLE] = absolute(belt.ring_mass * across - pull)
        elements[j, TENSION] = iterate[j, ITERATE_TENSION]
        elements[j, LENGTH] += dt * (elements[j, RING_SLIP] - ahead(elements, j, RING_SLIP))
        for r in range(SIZE):
            elements[j, SPEED + r] += elements[j, CHANGE + r]
        store(elements, j, POSITION, moved(vector(elements, j, POSITION), dt, vector(elements, j, SPEED)))
        omega = vector(elements, j, OMEGA)
        factors = turning(omega, dt)
        x, o = squared_up(turned(x, omega, factors), turned(o, omega, factors))
        store(elements, j, HEADING, x)
        store(elements, j, OUTWARD, o)
        elements[j, SLOPE] += dt * elements[j, SPEED + 7]
        for p in range(POINTS):
            filter_slips(belt, elements, j, p, dt)


@kernel
def _add_loads(belt, state, work):
    """Axial forces on the sheaves and torques on the pulleys, and how far sheaves would lean under them."""
    elements, step, scratch, loads = state.elements, work.step, work.scratch, state.loads
    modes = belt.modal_stiffness.shape[1]
    sums = loads.size + 2 * modes
    for k in range(sums):
        scratch[0, k] = 0.0
    for j in range(step.rows):
        driven = elements[j, DRIVEN]
        driving = 1.0 - driven
        for p in range(POINTS):
            side = p // 2
            axial = elements[j, FLANK + p] * belt.cosine + elements[j, FLANK_FRICTION_M + p] * belt.sine
            scratch[0, side] += driving * axial
            scratch[0, 2 + side] += driven * axial
        torque = side_torque(elements, step, j, 0) + side_torque(elements, step, j, 2)
        scratch[0, DRIVING_TORQUE] += driving * torque
        scratch[0, DRIVING_TORQUE + 1] += driven * torque
        if modes > 0:
            left = elements[j, FLANK] + elements[j, FLANK + 1]
            right = elements[j, FLANK + 2] + elements[j, FLANK + 3]
            lean = 0.5 * belt.cosine * (right - left)
            for k in range(modes):
                scratch[0, loads.size + k] += driving * lean * work.shapes[j, k]
                scratch[0, loads.size + modes + k] += driven * lean * work.shapes[j, k]
    for k in range(sums):
        scratch[0, k] = around(scratch[0, k])
    for k in range(loads.size):
        loads[k] = scratch.data[0, k, 0]


@kernel
def _accept(belt, state, work, inputs, dt):
    """Take the state to the end of the step, and add up what it has done."""
    totals, pulleys, loads = state.totals, state.pulleys, state.loads
    book_pairs(belt, state, work, dt)
    book_flanks(belt, state, work, dt)
    _accept_elements(belt, state, work, dt)
    _add_loads(belt, state, work)
    modes = belt.modal_stiffness.shape[1]
    follow = dt / belt.lean_lag
    for k in range(2 * modes):
        pulley, mode = k // modes, k % modes
        state.openings[pulley, mode] += state.increments[1 + k]
        target = work.scratch.data[0, loads.size + k, 0] / belt.modal_stiffness[pulley, mode]
        state.leans[pulley, mode] += follow * (target - state.leans[pulley, mode])

    pulleys[DRIVEN_SPEED] += state.increments[0]
    totals[TIME] += dt
    totals[WORK_IN] -= dt * loads[DRIVING_TORQUE] * pulleys[DRIVING_SPEED]
    totals[WORK_OUT] += dt * inputs[IN_LOAD] * (pulleys[DRIVEN_SPEED] - 0.5 * state.increments[0])
    tangent = belt.sine / belt.cosine
    for pulley in range(2):
        left, right = loads[2 * pulley], loads[2 * pulley + 1]
        side = belt.loose_side[pulley]
        pressed = 0.5 * ((1.0 - side) * left + (1.0 + side) * right)  # on what moves
        if pulley == 0:
            closing = dt * (
                belt.driving_rate * (inputs[IN_DRIVING_THRUST] - pressed) + inputs[IN_DRIVING_SHIFT]
            )
            drift = dt * inputs[IN_DRIVING_DRIFT]
            pulleys[DRIVING_RADIUS] += closing
            pulleys[DRIVING_MIDDLE] += drift - side * tangent * closing
        else:
            closing = dt * belt.driven_rate * (inputs[IN_DRIVEN_THRUST] - pressed)
            drift = dt * inputs[IN_DRIVEN_DRIFT]
            pulleys[DRIVEN_RADIUS] += closing
            pulleys[DRIVEN_MIDDLE] += drift - side * tangent * closing
        totals[THRUST_WORK] += (right - left) * drift - 2.0 * tangent * pressed * closing


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
        Speed of the driving pulley, thrusts on the loose sheaves, torque of the load, speed of the driving
        radius by what moves the driving sheave, and axial speeds of both mid planes, at the start and at
        the end (`belt.IN_SPEED` and so on): between, they change linearly.
    steps : int
        Number of steps.
    dt : float
        Step [s].

    Returns
    -------
    int
        CONVERGED; NOT_CONVERGED where `most_failures` steps in a row had not converged; NOT_FINITE. Of the
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
