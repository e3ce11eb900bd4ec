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
from cvt_hpc.models.pushbelt.belt import RING_DAMPED, RING_LOSS
from cvt_hpc.models.pushbelt.friction import ring_friction
from cvt_hpc.models.spatial_pushbelt.belt import (
    CHANGE,
    CHANGE_OF_HALF,
    CROSS_SLOPE,
    DIFFERENCE_BEHIND,
    DIFFERENCE_I,
    DIFFERENCE_J,
    DUAL_LEFT,
    DUAL_RIGHT,
    FRICTION_DIFFERENCE,
    HALF_LENGTH,
    HALF_RESIDUAL,
    HALF_SLIP,
    HALF_SLIP_BY,
    HALF_SPEED,
    HEADING,
    ITERATE_DIFFERENCE,
    ITERATE_TENSION,
    LENGTH,
    MEAN_BEHIND,
    MEAN_I,
    MEAN_J,
    OUTWARD,
    PAIR_I,
    PAIR_J,
    POSITION,
    PREDICTED_DIFFERENCE,
    PREDICTED_HEADING,
    PREDICTED_OUTWARD,
    PREDICTED_POSITION,
    PREDICTED_TENSION,
    RESIDUAL,
    RIGHT,
    RING_FRICTION,
    RING_LINE,
    RING_SLIP,
    RING_SLOPE,
    SADDLE_LEFT,
    SADDLE_RIGHT,
    SIZE,
    SLIP_BY,
    SLOPE_DIFFERENCE,
    SPEED,
    START_HALF_SLIP,
    START_SLIP,
    TENSION_DIFFERENCE,
    TENSION_I,
    TENSION_J,
    TENSION_SLOPE,
    WIDE,
)
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

_W = SIZE  # number of the ninth unknown
_V, _LAST = 6, 6  # that of v, and the last entry of the rows of seven (`belt`)
_WIDE_RIGHT = field_of_right(WIDE)


@register_jitable
def _along(array, first, state, j, share):
    """Product of a row of seven of an element with its speeds and a share of their changes."""
    u = moved(vector(state, j, SPEED), share, vector(state, j, CHANGE))
    omega = moved(vector(state, j, SPEED + 3), share, vector(state, j, CHANGE + 3))
    w = fma(share, state[j, CHANGE_OF_HALF], state[j, HALF_SPEED])
    return dot(vector(array, j, first), u) + dot(vector(array, j, first + 3), omega) + w


@register_jitable
def _change_along(array, first, state, j):
    """The same of the changes alone."""
    u, omega = vector(state, j, CHANGE), vector(state, j, CHANGE + 3)
    moving = dot(vector(array, j, first), u) + dot(vector(array, j, first + 3), omega)
    return moving + state[j, CHANGE_OF_HALF]


@register_jitable
def _change_ahead(array, first, state, j):
    """The same of the row of this element and the changes of the next one."""
    u, omega = vector_ahead(state, j, CHANGE), vector_ahead(state, j, CHANGE + 3)
    moving = dot(vector(array, j, first), u) + dot(vector(array, j, first + 3), omega)
    return moving + ahead(state, j, CHANGE_OF_HALF)


@kernel
def predict_flows(belt, state, step, dt):
    """What two flows need in a step beside what one needs; sets tension and its slope anew."""
    b = belt.package_distance
    half_stiffness = 0.5 * belt.ring_stiffness
    for j in range(state.rows):
        right, left = lines_at(belt, state, j)
        a = cross(vector(state, j, OUTWARD), vector(state, j, HEADING))
        for first in (0, 3):
            store(step, j, SLIP_BY + first, times(-1.0, vector(step, j, RING_LINE + first)))
        store(step, j, HALF_SLIP_BY, times(-0.5, minus(right, left)))
        store(step, j, HALF_SLIP_BY + 3, times(-b, cross(a, vector(step, j, RING_LINE))))
        step[j, SLIP_BY + _LAST], step[j, HALF_SLIP_BY + _LAST] = 1.0, 1.0
        step[j, START_HALF_SLIP] = _along(step, HALF_SLIP_BY, state, j, 0.0)
    for j in range(state.rows):
        ai, aj, _, lines = lines_to_next(state, j, POSITION, HEADING, OUTWARD, b)
        right, left, _, _ = lines
        half, mean = times(0.5, minus(right, left)), times(0.5 * b, plus(right, left))
        store(step, j, DIFFERENCE_I, plus(half, vector(step, j, HALF_SLIP_BY)))
        store(step, j, DIFFERENCE_I + 3, plus(cross(ai, mean), vector(step, j, HALF_SLIP_BY + 3)))
        store(step, j, DIFFERENCE_J, plus(half, vector_ahead(step, j, HALF_SLIP_BY)))
        store(step, j, DIFFERENCE_J + 3, plus(cross(aj, mean), vector_ahead(step, j, HALF_SLIP_BY + 3)))
        for first in (0, 3):
            store(step, j, MEAN_I + first, vector(step, j, TENSION_I + first))
            store(step, j, MEAN_J + first, vector(step, j, TENSION_J + first))
        step[j, MEAN_I + _LAST], step[j, MEAN_J + _LAST] = 1.0, 1.0
        step[j, DIFFERENCE_I + _LAST], step[j, DIFFERENCE_J + _LAST] = 1.0, 1.0

        _, _, _, lines = lines_to_next(step, j, PREDICTED_POSITION, PREDICTED_HEADING, PREDICTED_OUTWARD, b)
        _, _, right_size, left_size = lines
        length = state[j, LENGTH] + dt * (step[j, START_SLIP] - ahead(step, j, START_SLIP))
        other = state[j, HALF_LENGTH] + dt * (step[j, START_HALF_SLIP] - ahead(step, j, START_HALF_SLIP))
        per_right, per_left = 1.0 / (length + other), 1.0 / (length - other)
        one, two = right_size * per_right - 1.0, left_size * per_left - 1.0
        step[j, PREDICTED_TENSION] = half_stiffness * (one + two)
        step[j, PREDICTED_DIFFERENCE] = half_stiffness * (one - two)
        step[j, TENSION_SLOPE] = dt * half_stiffness * (per_right + per_left)
        step[j, CROSS_SLOPE] = dt * half_stiffness * (per_right - per_left)
    for j in range(state.rows):
        for k in range(7):
            step[j, MEAN_BEHIND + k] = behind(step, j, MEAN_J + k)
            step[j, DIFFERENCE_BEHIND + k] = behind(step, j, DIFFERENCE_J + k)


@kernel
def difference_forces(belt, state, step, iterate):
    """D of an iterate, and what it leaves of T; adds to the pairs' forces."""
    for j in range(step.rows):
        slope, cross_slope = step[j, TENSION_SLOPE], step[j, CROSS_SLOPE]
        stretch = _change_along(step, DIFFERENCE_I, state, j) - _change_ahead(step, DIFFERENCE_J, state, j)
        of_both = (step[j, PREDICTED_TENSION] - iterate[j, ITERATE_TENSION]) / slope
        difference = fma(-slope, stretch, fma(-cross_slope, of_both, step[j, PREDICTED_DIFFERENCE]))
        more = -cross_slope * stretch
        iterate[j, ITERATE_DIFFERENCE] = difference
        iterate[j, ITERATE_TENSION] += more
        for first in (0, 3):
            ahead_of_it = times(difference, vector(step, j, DIFFERENCE_I + first))
            next_one = times(-difference, vector(step, j, DIFFERENCE_J + first))
            accumulate(iterate, j, PAIR_I + first, moved(ahead_of_it, more, vector(step, j, MEAN_I + first)))
            accumulate(iterate, j, PAIR_J + first, moved(next_one, -more, vector(step, j, MEAN_J + first)))
        iterate[j, PAIR_I + _V] += more
        iterate[j, PAIR_J + _V] -= more


@kernel
def saddle_forces_of_two(belt, state, step, iterate):
    """As `saddle.saddle_forces`, of either package by its own slip and its own normal force."""
    for j in range(step.rows):
        before, half_before = state[j, RING_SLIP], state[j, HALF_SLIP]
        slip, half = ring_slip(state, step, j, 1.0), _along(step, HALF_SLIP_BY, state, j, 1.0)
        right, right_slope, dual = ring_friction(
            belt, slip + half, before + half_before, state[j, DUAL_RIGHT]
        )
        state[j, DUAL_RIGHT] = dual
        left, left_slope, dual = ring_friction(belt, slip - half, before - half_before, state[j, DUAL_LEFT])
        state[j, DUAL_LEFT] = dual
        right, right_slope = state[j, SADDLE_RIGHT] * right, state[j, SADDLE_RIGHT] * right_slope
        left, left_slope = state[j, SADDLE_LEFT] * left, state[j, SADDLE_LEFT] * left_slope
        iterate[j, RING_SLOPE], iterate[j, SLOPE_DIFFERENCE] = (
            right_slope + left_slope,
            right_slope - left_slope,
        )
        force, difference = right + left, right - left
        state[j, RING_SLIP], state[j, HALF_SLIP] = slip, half
        state[j, RING_FRICTION], state[j, FRICTION_DIFFERENCE] = force, difference
        for first in (0, 3):
            along = times(force, vector(step, j, RING_LINE + first))
            along = moved(along, -difference, vector(step, j, HALF_SLIP_BY + first))
            accumulate(iterate, j, RESIDUAL + first, along)
        iterate[j, RESIDUAL + 6] -= force


@kernel
def half_residuals(belt, state, step, iterate, scratch, dt):
    """Residuals of the equations of w; return what they have of the power residual [W]."""
    ring, power = belt.ring_mass / dt, like(0.0, state[0, HALF_SPEED])
    for j in range(step.rows):
        change = state[j, CHANGE_OF_HALF]
        pulled = iterate[j, ITERATE_DIFFERENCE] - behind(iterate, j, ITERATE_DIFFERENCE)
        residual = pulled - state[j, FRICTION_DIFFERENCE] - ring * change
        iterate[j, HALF_RESIDUAL] = residual
        power += (state[j, HALF_SPEED] + change) * residual
    scratch[0, 0] = around(power)
    return scratch.data[0, 0, 0]


@register_jitable
def _add_product(blocks, j, first, k, array, p, p_last, q, q_last):
    """Add k p q' to a block; p and q are rows of seven of `array`, whose last entries belong to v or to w."""
    for c in range(7):
        column = first + WIDE * (c if c < _LAST else q_last)
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
    columns = (narrow.data.shape[1] - RIGHT) // SIZE
    for j in range(blocks.rows):
        for c in range(SIZE):
            for r in range(SIZE):
                for block in range(2):
                    field = block * WIDE * WIDE + r + WIDE * c
                    blocks[j, field] = narrow[j, block * SIZE * SIZE + r + SIZE * c]
        for k in range(WIDE):
            for block in range(2):
                first = block * WIDE * WIDE
                blocks[j, first + _W + WIDE * k] = 0.0
                blocks[j, first + k + WIDE * _W] = 0.0
        for c in range(columns):
            for r in range(SIZE):
                blocks[j, _WIDE_RIGHT + r + WIDE * c] = narrow[j, RIGHT + r + SIZE * c]
            blocks[j, _WIDE_RIGHT + _W + WIDE * c] = 0.0
        blocks[j, _WIDE_RIGHT + _W] = iterate[j, HALF_RESIDUAL]

        blocks[j, _W + WIDE * _W] = like(belt.ring_mass / dt, blocks[j, 0])
        k, m, next_one = step[j, TENSION_SLOPE], step[j, CROSS_SLOPE], WIDE * WIDE
        _add_law(blocks, j, 0, k, m, step, MEAN_I, MEAN_I, DIFFERENCE_I, DIFFERENCE_I)
        _add_law(blocks, j, next_one, -k, -m, step, MEAN_I, MEAN_J, DIFFERENCE_I, DIFFERENCE_J)
        k, m = behind(step, j, TENSION_SLOPE), behind(step, j, CROSS_SLOPE)
        _add_law(blocks, j, 0, k, m, step, MEAN_BEHIND, MEAN_BEHIND, DIFFERENCE_BEHIND, DIFFERENCE_BEHIND)
        k, m = iterate[j, RING_SLOPE], iterate[j, SLOPE_DIFFERENCE]
        _add_law(blocks, j, 0, k, m, step, SLIP_BY, SLIP_BY, HALF_SLIP_BY, HALF_SLIP_BY)


@kernel
def narrow_solutions(blocks, narrow):
    """Take the solutions for all right sides to the system of eight unknowns for the border."""
    columns = (narrow.data.shape[1] - RIGHT) // SIZE
    for j in range(blocks.rows):
        for c in range(columns):
            for r in range(SIZE):
                narrow[j, RIGHT + r + SIZE * c] = blocks[j, _WIDE_RIGHT + r + WIDE * c]


@kernel
def book_difference(state, work, dt):
    """Add to the totals what the difference of the flows takes in a solved step, before it is accepted."""
    elements, step, scratch = state.elements, work.step, work.scratch
    ring = stretching = like(0.0, elements[0, HALF_SPEED])
    for j in range(step.rows):
        ring += elements[j, FRICTION_DIFFERENCE] * _along(step, HALF_SLIP_BY, elements, j, 0.5)
        u = moved(vector_ahead(elements, j, SPEED), 0.5, vector_ahead(elements, j, CHANGE))
        omega = moved(vector_ahead(elements, j, SPEED + 3), 0.5, vector_ahead(elements, j, CHANGE + 3))
        w = ahead(elements, j, HALF_SPEED) + 0.5 * ahead(elements, j, CHANGE_OF_HALF)
        next_one = dot(vector(step, j, DIFFERENCE_J), u) + dot(vector(step, j, DIFFERENCE_J + 3), omega) + w
        stretch = _along(step, DIFFERENCE_I, elements, j, 0.5) - next_one
        of_both = mean_stretch(elements, step, j)
        stretching += stretch * (step[j, TENSION_SLOPE] * stretch + 2.0 * step[j, CROSS_SLOPE] * of_both)
    scratch[0, 0], scratch[0, 1] = around(dt * ring), around(dt * stretching)
    state.totals[RING_LOSS] += scratch.data[0, 0, 0]
    state.totals[RING_DAMPED] += scratch.data[0, 1, 0]


@kernel
def accept_difference(belt, state, work, dt):
    """Take the difference of the flows to the end of the step, before the elements are taken there."""
    elements, step, iterate = state.elements, work.step, work.iterate
    half_mass = 0.5 * belt.ring_mass / dt
    for j in range(step.rows):
        o = vector(elements, j, OUTWARD)
        a = cross(o, vector(elements, j, HEADING))
        outward = cross(vector(step, j, RING_LINE), a)
        u, omega = vector(elements, j, CHANGE), vector(elements, j, CHANGE + 3)
        tension, difference = iterate[j, ITERATE_TENSION], iterate[j, ITERATE_DIFFERENCE]
        tension_behind = behind(iterate, j, ITERATE_TENSION)
        difference_behind = behind(iterate, j, ITERATE_DIFFERENCE)
        for side in (1.0, -1.0):
            ahead_of_it = moved(vector(step, j, TENSION_I), side, vector(step, j, DIFFERENCE_I))
            behind_it = moved(vector_behind(step, j, TENSION_J), side, vector_behind(step, j, DIFFERENCE_J))
            pull = 0.5 * (tension + side * difference) * dot(ahead_of_it, outward)
            pull -= 0.5 * (tension_behind + side * difference_behind) * dot(behind_it, outward)
            rising = dot(outward, plus(u, times(side * belt.package_distance, cross(omega, a))))
            normal = absolute(half_mass * rising - pull)
            if side > 0.0:
                elements[j, SADDLE_RIGHT] = normal
            else:
                elements[j, SADDLE_LEFT] = normal
        elements[j, TENSION_DIFFERENCE] = difference
        elements[j, HALF_LENGTH] += dt * (elements[j, HALF_SLIP] - ahead(elements, j, HALF_SLIP))
        elements[j, HALF_SPEED] += elements[j, CHANGE_OF_HALF]
