"""Steps in time of a belt of rigid elements in linked lanes, whatever its equations.

A step finds the speeds at its end by Newton's method, for the elements and for a border of unknowns that all
elements act on. A model gives its equations.

Which element a step that is not solved is at fault with, for belts of rigid elements in linked lanes.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import absolute, like, maximum
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.solvers.linked_blocks import solve, solve_small

_FALLS = 0.95  # of the smallest correction so far: one that is larger does not fall
_LARGE = 1e100  # more than any speed or power that means something


class Equations(NamedTuple):
    """A model's equations of a step: kernels, which take `belt, state, work` first and `dt` last."""

    # values that all iterates of a step have in common: geometry, directions, linear laws
    prepare: Callable[..., None]
    # forces of the iterate, and the residuals that they leave, that of the border in its last column. Takes
    # the load [N m] before `dt`, and returns the power residual [W].
    evaluate: Callable[..., float]
    # the linear system of the elements, with a column for the residual and one for each unknown of the border
    assemble: Callable[..., None]
    close: Callable[..., None]  # that of the border, once the elements' is solved (`solvers.linked_blocks`)
    # advances the state to the end of the step, and adds up the works. Takes the inputs before `dt`.
    accept: Callable[..., None]
    # by how much contact forces have changed, in the order of `CONTACTS` (`name_fault`)
    changes: Callable[..., tuple[float, ...]]
    # field of an element at which the changes of its speeds in the step begin, as many as it has unknowns
    first_change: int


@kernel
def solve_bordered(equations, belt, state, work, size, dt):
    """Solve for the correction: of the border in its last column, of elements without its part in blocks.

    Returns whether the elements' system is regular.
    """
    is_regular = solve(work.blocks, work.scratch, size)
    equations.close(belt, state, work, dt)
    solve_small(work.border)
    return is_regular


@kernel
def correct(state, work, weights, first_change, share):
    """Take the iterate to the solution, or a share of the way; return the largest correction [m/s].

    If any correction is not finite, nor is the result.
    """
    elements, blocks, border, scratch = state.elements, work.blocks, work.border, work.scratch
    b, unknowns = len(weights), border.shape[0]
    right = 3 * b * b
    largest = total = like(0.0, blocks[0, right])
    for j in range(blocks.rows):
        for r in range(b):
            change = blocks[j, right + r]
            for k in range(unknowns):
                change -= blocks[j, right + b * (1 + k) + r] * border[k, unknowns]
            blocks[j, right + r] = change
            elements[j, first_change + r] += share * change
            change = absolute(change * weights[r])
            largest = maximum(change, largest)
            total += change
    for k in range(unknowns):
        state.increments[k] += share * border[k, unknowns]
    scratch[0, 0], scratch[0, 1] = largest, total
    found, total_found = 0.0, 0.0
    for part in range(scratch.data.shape[2]):
        found = max(found, scratch.data[0, 0, part])
        total_found += scratch.data[0, 1, part]
    # a maximum ignores entries that are not numbers, a sum does not
    return found if total_found < np.inf else total_found


@kernel
def _newton(equations, belt, newton, state, work, load, dt):
    """Find the speeds of a step; iterations, the last correction [m/s] and the power residual [W].

    A step that is not solved leaves its fault in the counters.
    """
    change, power = 0.0, 0.0
    least, share = np.inf, 1.0
    element, weights = 0, newton.weights
    for iteration in range(newton.most_iterations + 1):
        power = equations.evaluate(belt, state, work, load, dt)
        is_finite = abs(power) < _LARGE and change < _LARGE
        enough = iteration > 0 and change < newton.tolerance and abs(power) < newton.power_tolerance
        if enough or not is_finite:
            return iteration, change, power
        if iteration == newton.most_iterations:
            name_fault(equations.changes, state, element, work.kept)
            return iteration, change, power
        equations.assemble(belt, state, work, dt)
        if not solve_bordered(equations, belt, state, work, weights, dt):
            return iteration, np.inf, power
        change = correct(state, work, weights, equations.first_change, share)
        # Contacts that close one after the other along the belt take an iteration each, with corrections that
        # fall. Sets of contacts that take turns do not let them fall.
        share = 0.5 if iteration + 1 >= newton.first_half_step and change > _FALLS * least else 1.0
        least = min(least, change)
        if iteration == newton.most_iterations - 1:
            element = most_corrected(work.blocks, weights)
            keep_states(state.elements, element, work.kept)
    return newton.most_iterations, change, power


@kernel
def advance_by(equations, belt, newton, state, work, inputs, steps, dt):
    """Advance a belt by a number of steps of `dt` [s], in place; return how its last step ended.

    The model has `equations`, their steps are solved as `newton` tells. Inputs, (2, INPUTS) at the start and
    at the end (`fields.IN_SPEED` and so on), change linearly between. Returns CONVERGED; NOT_CONVERGED where
    `most_failures` steps in a row had not converged; NOT_FINITE, or where the system of an iteration is
    singular. Of the last step that had not converged the counters name the contact at fault, and its element.
    """
    counters = state.counters
    for k in range(steps):
        share = (k + 1.0) / steps
        for entry in range(work.inputs.size):
            work.inputs[entry] = inputs[0, entry] + share * (inputs[1, entry] - inputs[0, entry])
        state.pulleys[f.DRIVING_SPEED] = work.inputs[f.IN_SPEED]
        for entry in range(work.increments.size):
            work.increments[entry] = state.increments[entry]
        equations.prepare(belt, state, work, dt)
        iterations, change, power = _newton(equations, belt, newton, state, work, work.inputs[f.IN_LOAD], dt)
        counters[f.STEPS] += 1
        counters[f.ITERATIONS] += iterations
        finite = abs(power) < _LARGE and change < _LARGE
        failed = not (finite and change < newton.tolerance and abs(power) < newton.power_tolerance)
        counters[f.IN_A_ROW] = counters[f.IN_A_ROW] + 1 if failed else 0
        if failed:
            counters[f.FAILED_STEPS] += 1
        if not finite or counters[f.IN_A_ROW] == newton.most_failures:
            counters[f.STATUS] = f.NOT_CONVERGED if finite else f.NOT_FINITE
            return counters[f.STATUS]
        state.totals[f.POWER_RESIDUAL] += dt * power
        equations.accept(belt, state, work, work.inputs, dt)
    counters[f.STATUS] = f.CONVERGED
    return counters[f.STATUS]


@kernel
def most_corrected(blocks, weights):
    """The element with the largest correction.

    Corrections of its speeds stand in the right side of `blocks`, and count with `weights`, the lengths that
    make angular velocities speeds.
    """
    corrections = blocks.data
    rows, parts, right = corrections.shape[0], corrections.shape[2], 3 * len(weights) ** 2
    largest, element = -1.0, 0
    for part in range(parts):
        for j in range(rows):
            for r in range(len(weights)):
                size = abs(corrections[j, right + r, part]) * weights[r]
                if size > largest:
                    largest, element = size, part * rows + j
    return element


@kernel
def keep_states(elements, element, kept):
    """Keep the state of an element, and of the one behind it."""
    rows, fields, parts = elements.data.shape
    for k in range(2):
        place = (element - k) % (rows * parts)
        for field in range(fields):
            kept[k, field] = elements.data[place % rows, field, place // rows]


@kernel
def name_fault(changes, state, element, kept):
    """Enter the contact of an element whose force has changed most since its state was kept.

    Contacts with the next element and with the one behind count, the latter as those of that element:
    `changes(kept, k)` returns by how much forces of the element (k = 0) and of the one behind it (k = 1) have
    changed, in the order of `CONTACTS`, and 0 for those of the latter that the element has no part in.
    """
    rows, fields, parts = state.elements.data.shape
    largest, contact, behind_it = -1.0, 0, 0
    for k in range(2):
        place = (element - k) % (rows * parts)
        for field in range(fields):
            kept[k, field] = abs(state.elements.data[place % rows, field, place // rows] - kept[k, field])
        sizes = changes(kept, k)
        for entry in range(len(sizes)):
            if sizes[entry] > largest:
                largest, contact, behind_it = sizes[entry], entry, k
    state.counters[f.FAILED_ELEMENT] = (element - behind_it) % (rows * parts)
    state.counters[f.FAILED_CONTACT] = contact
