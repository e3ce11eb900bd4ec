"""Two flows of ring material in lanes, one for each package, in the place of one for both.

Right and left package run at v + w and v - w: w is a ninth unknown of an element. With one flow both packages
have one tension T and one slip sigma. With two they have T / 2 + D / 2 and T / 2 - D / 2, sigma + delta and
sigma - delta. Everything of T, v and sigma stays as it is with one flow, and D, w and delta have laws of the
same form: a magnitude along half the difference of the directions of both packages, where T has their mean.

The linear system of the eight unknowns of one flow is assembled as for one flow, and then widened.
"""

from __future__ import annotations

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import absolute, ahead, around, behind, fma, like
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.friction import ring_friction
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt.chain import lines_at, lines_to_next, mean_stretch
from cvt_hpc.models.spatial_pushbelt.rotations import (
    accumulate,
    cross,
    dot,
    minus,
    moved,
    plus,
    store,
    times,
    vector,
    vector_ahead,
    vector_behind,
)
from cvt_hpc.models.spatial_pushbelt.saddle import ring_slip
from cvt_hpc.solvers.linked_blocks import field_of_right

_W = f.SIZE  # number of the ninth unknown
_V, _LAST = 6, 6  # that of v, and the last entry of the rows of seven (`belt`)
_WIDE_RIGHT = field_of_right(f.WIDE)


@register_jitable
def _along(array, first, state, j, share):
    """Product of a row of seven of an element with its speeds and a share of their changes."""
    u = moved(vector(state, j, f.SPEED), share, vector(state, j, f.CHANGE))
    omega = moved(vector(state, j, f.SPEED + 3), share, vector(state, j, f.CHANGE + 3))
    w = fma(share, state[j, f.CHANGE_OF_HALF], state[j, f.HALF_SPEED])
    return dot(vector(array, j, first), u) + dot(vector(array, j, first + 3), omega) + w


@register_jitable
def _change_along(array, first, state, j):
    """The same of the changes alone."""
    u, omega = vector(state, j, f.CHANGE), vector(state, j, f.CHANGE + 3)
    moving = dot(vector(array, j, first), u) + dot(vector(array, j, first + 3), omega)
    return moving + state[j, f.CHANGE_OF_HALF]


@register_jitable
def _change_ahead(array, first, state, j):
    """The same of the row of this element and the changes of the next one."""
    u, omega = vector_ahead(state, j, f.CHANGE), vector_ahead(state, j, f.CHANGE + 3)
    moving = dot(vector(array, j, first), u) + dot(vector(array, j, first + 3), omega)
    return moving + ahead(state, j, f.CHANGE_OF_HALF)


@kernel
def predict_flows(belt, state, step, dt):
    """What two flows need in a step beside what one needs; sets tension and its slope anew."""
    b = belt.package_distance
    half_stiffness = 0.5 * belt.ring_stiffness
    for j in range(state.rows):
        right, left = lines_at(belt, state, j)
        a = cross(vector(state, j, f.OUTWARD), vector(state, j, f.HEADING))
        for first in (0, 3):
            store(step, j, f.SLIP_BY + first, times(-1.0, vector(step, j, f.RING_LINE + first)))
        store(step, j, f.HALF_SLIP_BY, times(-0.5, minus(right, left)))
        store(step, j, f.HALF_SLIP_BY + 3, times(-b, cross(a, vector(step, j, f.RING_LINE))))
        step[j, f.SLIP_BY + _LAST], step[j, f.HALF_SLIP_BY + _LAST] = 1.0, 1.0
        step[j, f.START_HALF_SLIP] = _along(step, f.HALF_SLIP_BY, state, j, 0.0)
    for j in range(state.rows):
        ai, aj, _, lines = lines_to_next(state, j, f.POSITION, f.HEADING, f.OUTWARD, b)
        right, left, _, _ = lines
        half, mean = times(0.5, minus(right, left)), times(0.5 * b, plus(right, left))
        store(step, j, f.DIFFERENCE_I, plus(half, vector(step, j, f.HALF_SLIP_BY)))
        store(step, j, f.DIFFERENCE_I + 3, plus(cross(ai, mean), vector(step, j, f.HALF_SLIP_BY + 3)))
        store(step, j, f.DIFFERENCE_J, plus(half, vector_ahead(step, j, f.HALF_SLIP_BY)))
        store(step, j, f.DIFFERENCE_J + 3, plus(cross(aj, mean), vector_ahead(step, j, f.HALF_SLIP_BY + 3)))
        for first in (0, 3):
            store(step, j, f.MEAN_I + first, vector(step, j, f.TENSION_I + first))
            store(step, j, f.MEAN_J + first, vector(step, j, f.TENSION_J + first))
        step[j, f.MEAN_I + _LAST], step[j, f.MEAN_J + _LAST] = 1.0, 1.0
        step[j, f.DIFFERENCE_I + _LAST], step[j, f.DIFFERENCE_J + _LAST] = 1.0, 1.0

        _, _, _, lines = lines_to_next(
            step, j, f.PREDICTED_POSITION, f.PREDICTED_HEADING, f.PREDICTED_OUTWARD, b
        )
        _, _, right_size, left_size = lines
        length = state[j, f.LENGTH] + dt * (step[j, f.START_SLIP] - ahead(step, j, f.START_SLIP))
        other = state[j, f.HALF_LENGTH] + dt * (
            step[j, f.START_HALF_SLIP] - ahead(step, j, f.START_HALF_SLIP)
        )
        per_right, per_left = 1.0 / (length + other), 1.0 / (length - other)
        one, two = right_size * per_right - 1.0, left_size * per_left - 1.0
        step[j, f.PREDICTED_TENSION] = half_stiffness * (one + two)
        step[j, f.PREDICTED_DIFFERENCE] = half_stiffness * (one - two)
        step[j, f.TENSION_SLOPE] = dt * half_stiffness * (per_right + per_left)
        step[j, f.CROSS_SLOPE] = dt * half_stiffness * (per_right - per_left)
    for j in range(state.rows):
        for k in range(7):
            step[j, f.MEAN_BEHIND + k] = behind(step, j, f.MEAN_J + k)
            step[j, f.DIFFERENCE_BEHIND + k] = behind(step, j, f.DIFFERENCE_J + k)


@kernel
def difference_forces(belt, state, step, iterate):
    """D of an iterate, and what it leaves of T; adds to the pairs' forces."""
    for j in range(step.rows):
        slope, cross_slope = step[j, f.TENSION_SLOPE], step[j, f.CROSS_SLOPE]
        stretch = _change_along(step, f.DIFFERENCE_I, state, j) - _change_ahead(
            step, f.DIFFERENCE_J, state, j
        )
        of_both = (step[j, f.PREDICTED_TENSION] - iterate[j, f.ITERATE_TENSION]) / slope
        difference = fma(-slope, stretch, fma(-cross_slope, of_both, step[j, f.PREDICTED_DIFFERENCE]))
        more = -cross_slope * stretch
        iterate[j, f.ITERATE_DIFFERENCE] = difference
        iterate[j, f.ITERATE_TENSION] += more
        for first in (0, 3):
            ahead_of_it = times(difference, vector(step, j, f.DIFFERENCE_I + first))
            next_one = times(-difference, vector(step, j, f.DIFFERENCE_J + first))
            accumulate(
                iterate, j, f.PAIR_I + first, moved(ahead_of_it, more, vector(step, j, f.MEAN_I + first))
            )
            accumulate(
                iterate, j, f.PAIR_J + first, moved(next_one, -more, vector(step, j, f.MEAN_J + first))
            )
        iterate[j, f.PAIR_I + _V] += more
        iterate[j, f.PAIR_J + _V] -= more


@kernel
def saddle_forces_of_two(belt, state, step, iterate):
    """As `saddle.saddle_forces`, of either package by its own slip and its own normal force."""
    for j in range(step.rows):
        before, half_before = state[j, f.RING_SLIP], state[j, f.HALF_SLIP]
        slip, half = ring_slip(state, step, j, 1.0), _along(step, f.HALF_SLIP_BY, state, j, 1.0)
        right, right_slope, dual = ring_friction(
            belt, slip + half, before + half_before, state[j, f.DUAL_RIGHT]
        )
        state[j, f.DUAL_RIGHT] = dual
        left, left_slope, dual = ring_friction(belt, slip - half, before - half_before, state[j, f.DUAL_LEFT])
        state[j, f.DUAL_LEFT] = dual
        right, right_slope = state[j, f.SADDLE_RIGHT] * right, state[j, f.SADDLE_RIGHT] * right_slope
        left, left_slope = state[j, f.SADDLE_LEFT] * left, state[j, f.SADDLE_LEFT] * left_slope
        iterate[j, f.RING_SLOPE], iterate[j, f.SLOPE_DIFFERENCE] = (
            right_slope + left_slope,
            right_slope - left_slope,
        )
        force, difference = right + left, right - left
        state[j, f.RING_SLIP], state[j, f.HALF_SLIP] = slip, half
        state[j, f.RING_FRICTION], state[j, f.FRICTION_DIFFERENCE] = force, difference
        for first in (0, 3):
            along = times(force, vector(step, j, f.RING_LINE + first))
            along = moved(along, -difference, vector(step, j, f.HALF_SLIP_BY + first))
            accumulate(iterate, j, f.RESIDUAL + first, along)
        iterate[j, f.RESIDUAL + 6] -= force


@kernel
def half_residuals(belt, state, step, iterate, scratch, dt):
    """Residuals of the equations of w; return what they have of the power residual [W]."""
    ring, power = belt.ring_mass / dt, like(0.0, state[0, f.HALF_SPEED])
    for j in range(step.rows):
        change = state[j, f.CHANGE_OF_HALF]
        pulled = iterate[j, f.ITERATE_DIFFERENCE] - behind(iterate, j, f.ITERATE_DIFFERENCE)
        residual = pulled - state[j, f.FRICTION_DIFFERENCE] - ring * change
        iterate[j, f.HALF_RESIDUAL] = residual
        power += (state[j, f.HALF_SPEED] + change) * residual
    scratch[0, 0] = around(power)
    return scratch.data[0, 0, 0]


@register_jitable
def _add_product(blocks, j, first, k, array, p, p_last, q, q_last):
    """Add k p q' to a block; p and q are rows of seven of `array`, whose last entries belong to v or to w."""
    for c in range(7):
        column = first + f.WIDE * (c if c < _LAST else q_last)
        factor = k * array[j, q + c]
        for r in range(7):
            place = column + (r if r < _LAST else p_last)
            blocks[j, place] = fma(factor, array[j, p + r], blocks[j, place])


@register_jitable
def _add_law(blocks, j, first, own, mixed, array, mean, other_mean, half, other_half):
    """Add the slopes of a law of two packages: its own along half differences, and mixed with the mean."""
    _add_product(blocks, j, first, own, array, half, _W, other_half, _W)
    _add_product(blocks, j, first, mixed, array, mean, _V, other_half, _W)
    _add_product(blocks, j, first, mixed, array, half, _W, other_mean, _V)


@kernel
def widen(belt, step, iterate, narrow, blocks, dt):
    """The system of nine unknowns from that of eight, and what the difference of the flows adds."""
    columns = (narrow.data.shape[1] - f.RIGHT) // f.SIZE
    for j in range(blocks.rows):
        for c in range(f.SIZE):
            for r in range(f.SIZE):
                for block in range(2):
                    field = block * f.WIDE * f.WIDE + r + f.WIDE * c
                    blocks[j, field] = narrow[j, block * f.SIZE * f.SIZE + r + f.SIZE * c]
        for k in range(f.WIDE):
            for block in range(2):
                first = block * f.WIDE * f.WIDE
                blocks[j, first + _W + f.WIDE * k] = 0.0
                blocks[j, first + k + f.WIDE * _W] = 0.0
        for c in range(columns):
            for r in range(f.SIZE):
                blocks[j, _WIDE_RIGHT + r + f.WIDE * c] = narrow[j, f.RIGHT + r + f.SIZE * c]
            blocks[j, _WIDE_RIGHT + _W + f.WIDE * c] = 0.0
        blocks[j, _WIDE_RIGHT + _W] = iterate[j, f.HALF_RESIDUAL]

        blocks[j, _W + f.WIDE * _W] = like(belt.ring_mass / dt, blocks[j, 0])
        k, m, next_one = step[j, f.TENSION_SLOPE], step[j, f.CROSS_SLOPE], f.WIDE * f.WIDE
        _add_law(blocks, j, 0, k, m, step, f.MEAN_I, f.MEAN_I, f.DIFFERENCE_I, f.DIFFERENCE_I)
        _add_law(blocks, j, next_one, -k, -m, step, f.MEAN_I, f.MEAN_J, f.DIFFERENCE_I, f.DIFFERENCE_J)
        k, m = behind(step, j, f.TENSION_SLOPE), behind(step, j, f.CROSS_SLOPE)
        _add_law(
            blocks, j, 0, k, m, step, f.MEAN_BEHIND, f.MEAN_BEHIND, f.DIFFERENCE_BEHIND, f.DIFFERENCE_BEHIND
        )
        k, m = iterate[j, f.RING_SLOPE], iterate[j, f.SLOPE_DIFFERENCE]
        _add_law(blocks, j, 0, k, m, step, f.SLIP_BY, f.SLIP_BY, f.HALF_SLIP_BY, f.HALF_SLIP_BY)


@kernel
def narrow_solutions(blocks, narrow):
    """Take the solutions for all right sides to the system of eight unknowns for the border."""
    columns = (narrow.data.shape[1] - f.RIGHT) // f.SIZE
    for j in range(blocks.rows):
        for c in range(columns):
            for r in range(f.SIZE):
                narrow[j, f.RIGHT + r + f.SIZE * c] = blocks[j, _WIDE_RIGHT + r + f.WIDE * c]


@kernel
def book_difference(state, work, dt):
    """Add to the totals what the difference of the flows takes in a solved step, before it is accepted."""
    elements, step, scratch = state.elements, work.step, work.scratch
    ring = stretching = like(0.0, elements[0, f.HALF_SPEED])
    for j in range(step.rows):
        ring += elements[j, f.FRICTION_DIFFERENCE] * _along(step, f.HALF_SLIP_BY, elements, j, 0.5)
        u = moved(vector_ahead(elements, j, f.SPEED), 0.5, vector_ahead(elements, j, f.CHANGE))
        omega = moved(vector_ahead(elements, j, f.SPEED + 3), 0.5, vector_ahead(elements, j, f.CHANGE + 3))
        w = ahead(elements, j, f.HALF_SPEED) + 0.5 * ahead(elements, j, f.CHANGE_OF_HALF)
        next_one = (
            dot(vector(step, j, f.DIFFERENCE_J), u) + dot(vector(step, j, f.DIFFERENCE_J + 3), omega) + w
        )
        stretch = _along(step, f.DIFFERENCE_I, elements, j, 0.5) - next_one
        of_both = mean_stretch(elements, step, j)
        stretching += stretch * (step[j, f.TENSION_SLOPE] * stretch + 2.0 * step[j, f.CROSS_SLOPE] * of_both)
    scratch[0, 0], scratch[0, 1] = around(dt * ring), around(dt * stretching)
    state.totals[planar.RING_LOSS] += scratch.data[0, 0, 0]
    state.totals[planar.RING_DAMPED] += scratch.data[0, 1, 0]


@kernel
def accept_difference(belt, state, work, dt):
    """Take the difference of the flows to the end of the step, before the elements are taken there."""
    elements, step, iterate = state.elements, work.step, work.iterate
    half_mass = 0.5 * belt.ring_mass / dt
    for j in range(step.rows):
        o = vector(elements, j, f.OUTWARD)
        a = cross(o, vector(elements, j, f.HEADING))
        outward = cross(vector(step, j, f.RING_LINE), a)
        u, omega = vector(elements, j, f.CHANGE), vector(elements, j, f.CHANGE + 3)
        tension, difference = iterate[j, f.ITERATE_TENSION], iterate[j, f.ITERATE_DIFFERENCE]
        tension_behind = behind(iterate, j, f.ITERATE_TENSION)
        difference_behind = behind(iterate, j, f.ITERATE_DIFFERENCE)
        for side in (1.0, -1.0):
            ahead_of_it = moved(vector(step, j, f.TENSION_I), side, vector(step, j, f.DIFFERENCE_I))
            behind_it = moved(
                vector_behind(step, j, f.TENSION_J), side, vector_behind(step, j, f.DIFFERENCE_J)
            )
            pull = 0.5 * (tension + side * difference) * dot(ahead_of_it, outward)
            pull -= 0.5 * (tension_behind + side * difference_behind) * dot(behind_it, outward)
            rising = dot(outward, plus(u, times(side * belt.package_distance, cross(omega, a))))
            normal = absolute(half_mass * rising - pull)
            if side > 0.0:
                elements[j, f.SADDLE_RIGHT] = normal
            else:
                elements[j, f.SADDLE_LEFT] = normal
        elements[j, f.TENSION_DIFFERENCE] = difference
        elements[j, f.HALF_LENGTH] += dt * (elements[j, f.HALF_SLIP] - ahead(elements, j, f.HALF_SLIP))
        elements[j, f.HALF_SPEED] += elements[j, f.CHANGE_OF_HALF]
