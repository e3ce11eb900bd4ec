"""Two flows of ring material in lanes, one for each package, in the place of one for both.

Right and left package run at v + w and v - w: w is a ninth unknown of an element. With one flow both packages
have one tension T and one slip sigma. With two they have T / 2 + D / 2 and T / 2 - D / 2, sigma + delta and
sigma - delta. Everything of T, v and sigma stays as it is with one flow, and D, w and delta have laws of the
same form: a magnitude along half the difference of the directions of both packages, where T has their mean.

The linear system of the eight unknowns of one flow is assembled as for one flow, and then widened.
"""

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import absolute, ahead, around, behind, fma, like
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.border import add_to_totals
from cvt_hpc.models.pushbelt.chain import ring_share, turned_length
from cvt_hpc.models.pushbelt.friction import ring_friction
from cvt_hpc.models.spatial_pushbelt import chain
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import vectors as vec


@register_jitable
def _along(direction, state, j, share):
    """Product of a direction of a law of w with an element's speeds and a share of their changes."""
    w = fma(share, state[j, f.CHANGE_OF_HALF], state[j, f.HALF_SPEED])
    return vec.both_dot(direction, chain.motion(state, j, share)) + w


@register_jitable
def _drawn_apart(state, step, j, share):
    """Half of the rate at which the right package is shortened to the next element, less the left one's."""
    w = fma(share, ahead(state, j, f.CHANGE_OF_HALF), ahead(state, j, f.HALF_SPEED))
    there = vec.both_dot(vec.screw(step, j, f.DIFFERENCE_J), chain.motion_ahead(state, j, share)) + w
    return _along(vec.screw(step, j, f.DIFFERENCE_I), state, j, share) - there


@kernel
def predict_flows(belt, state, step, dt):
    """Predict what two flows need in a step beside what one needs; sets tension and its slope anew."""
    b = belt.package_distance
    half_stiffness = 0.5 * belt.ring_stiffness
    steep = ring_share(belt, dt) * half_stiffness
    for j in range(state.rows):
        right, left = chain.lines_at(belt, state, j)
        a = vec.cross(vec.at(state, j, f.OUTWARD), vec.at(state, j, f.HEADING))
        line = vec.screw(step, j, f.RING_LINE)
        half = vec.times(-0.5, vec.minus(right, left)), vec.times(-b, vec.cross(a, line[0]))
        vec.store_screw(step, j, f.SLIP_BY, vec.both_times(-1.0, line))
        vec.store_screw(step, j, f.HALF_SLIP_BY, half)
    for j in range(state.rows):
        ai, aj, chord, lines = chain.lines_to_next(state, j, f.POSITION, f.HEADING, f.OUTWARD, b)
        right, left, right_size, left_size = lines
        half, mean = vec.times(0.5, vec.minus(right, left)), vec.times(0.5 * b, vec.plus(right, left))
        own, next_one = vec.screw(step, j, f.HALF_SLIP_BY), vec.screw_ahead(step, j, f.HALF_SLIP_BY)
        vec.store_screw(step, j, f.DIFFERENCE_I, vec.both_plus((half, vec.cross(ai, mean)), own))
        vec.store_screw(step, j, f.DIFFERENCE_J, vec.both_plus((half, vec.cross(aj, mean)), next_one))

        length, other = state[j, f.LENGTH], state[j, f.HALF_LENGTH]
        per_right, per_left = 1.0 / (length + other), 1.0 / (length - other)
        e, size = vec.unit(chord)
        du = vec.minus(vec.ahead(state, j, f.SPEED), vec.at(state, j, f.SPEED))
        turned = turned_length(belt, size, chain.spin_of(e, 1.0 / size, du), dt)
        of_both, apart = chain.shortening(state, step, j, 0.0), _drawn_apart(state, step, j, 0.0)
        one = (right_size + turned - belt.ring_time * (of_both + apart)) * per_right - 1.0
        two = (left_size + turned - belt.ring_time * (of_both - apart)) * per_left - 1.0
        step[j, f.START_TENSION] = half_stiffness * (one + two)
        step[j, f.START_DIFFERENCE] = half_stiffness * (one - two)
        step[j, f.TENSION_SLOPE] = steep * (per_right + per_left)
        step[j, f.CROSS_SLOPE] = steep * (per_right - per_left)
    for j in range(state.rows):
        vec.store_screw(step, j, f.TENSION_BEHIND, vec.screw_behind(step, j, f.TENSION_J))
        vec.store_screw(step, j, f.DIFFERENCE_BEHIND, vec.screw_behind(step, j, f.DIFFERENCE_J))


@kernel
def difference_forces(state, step, iterate):
    """D of an iterate, and what it leaves of T; adds to the pairs' forces."""
    for j in range(step.rows):
        slope, cross_slope = step[j, f.TENSION_SLOPE], step[j, f.CROSS_SLOPE]
        here, there = vec.screw(step, j, f.DIFFERENCE_I), vec.screw(step, j, f.DIFFERENCE_J)
        stretch = vec.both_dot(here, vec.screw(state, j, f.CHANGE)) + state[j, f.CHANGE_OF_HALF]
        drawn = vec.both_dot(there, vec.screw_ahead(state, j, f.CHANGE)) + ahead(state, j, f.CHANGE_OF_HALF)
        stretch = stretch - drawn
        of_both = (step[j, f.START_TENSION] - iterate[j, f.ITERATE_TENSION]) / slope
        difference = fma(-slope, stretch, fma(-cross_slope, of_both, step[j, f.START_DIFFERENCE]))
        more = -cross_slope * stretch
        iterate[j, f.ITERATE_DIFFERENCE] = difference
        iterate[j, f.ITERATE_TENSION] += more
        own = vec.both_moved(vec.both_times(difference, here), more, vec.screw(step, j, f.TENSION_I))
        next_one = vec.both_moved(vec.both_times(-difference, there), -more, vec.screw(step, j, f.TENSION_J))
        vec.add_screw(iterate, j, f.PAIR_I, own)
        vec.add_screw(iterate, j, f.PAIR_J, next_one)
        iterate[j, f.PAIR_I + f.ROW_V] += more
        iterate[j, f.PAIR_J + f.ROW_V] -= more


@kernel
def saddle_forces_of_two(belt, state, step, iterate):
    """Set forces of `saddle.saddle_forces`, of either package by its own slip and its own normal force."""
    for j in range(step.rows):
        before, half_before = state[j, f.RING_SLIP], state[j, f.HALF_SLIP]
        by_half = vec.screw(step, j, f.HALF_SLIP_BY)
        slip, half = chain.ring_slip(state, step, j, 1.0), _along(by_half, state, j, 1.0)
        dual = state[j, f.DUAL_RIGHT]
        right, right_slope, dual = ring_friction(belt, slip + half, before + half_before, dual)
        state[j, f.DUAL_RIGHT] = dual
        left, left_slope, dual = ring_friction(belt, slip - half, before - half_before, state[j, f.DUAL_LEFT])
        state[j, f.DUAL_LEFT] = dual
        right, right_slope = state[j, f.SADDLE_RIGHT] * right, state[j, f.SADDLE_RIGHT] * right_slope
        left, left_slope = state[j, f.SADDLE_LEFT] * left, state[j, f.SADDLE_LEFT] * left_slope
        iterate[j, f.RING_SLOPE] = right_slope + left_slope
        iterate[j, f.SLOPE_DIFFERENCE] = right_slope - left_slope
        force, difference = right + left, right - left
        state[j, f.RING_SLIP], state[j, f.HALF_SLIP] = slip, half
        state[j, f.RING_FRICTION], state[j, f.FRICTION_DIFFERENCE] = force, difference
        along = vec.both_times(force, vec.screw(step, j, f.RING_LINE))
        vec.add_screw(iterate, j, f.RESIDUAL, vec.both_moved(along, -difference, by_half))
        iterate[j, f.RESIDUAL + f.ROW_V] -= force


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
def _add_column(blocks, j, column, factor, array, p, row):
    """Add a factor times a direction, and times 1 in a row, to a column of a block."""
    for r in range(f.ROW_V):
        blocks[j, column + r] = fma(factor, array[j, p + r], blocks[j, column + r])
    blocks[j, column + row] += factor


@register_jitable
def _add_product(blocks, j, first, k, array, p, row, q, column):
    """Add k p q' to a block; p and q are directions of `array`, and 1 beside them of a row and a column."""
    for c in range(f.ROW_V):
        _add_column(blocks, j, first + f.WIDE * c, k * array[j, q + c], array, p, row)
    _add_column(blocks, j, first + f.WIDE * column, k, array, p, row)


@register_jitable
def _add_law(blocks, j, first, own, mixed, array, mean, other_mean, half, other_half):
    """Add the slopes of a law of two packages: its own along half differences, and mixed with the mean."""
    _add_product(blocks, j, first, own, array, half, f.ROW_HALF, other_half, f.ROW_HALF)
    _add_product(blocks, j, first, mixed, array, mean, f.ROW_V, other_half, f.ROW_HALF)
    _add_product(blocks, j, first, mixed, array, half, f.ROW_HALF, other_mean, f.ROW_V)


@kernel
def widen(belt, step, iterate, narrow, blocks, dt):
    """The system of nine unknowns from that of eight, and what the difference of the flows adds."""
    columns = (narrow.data.shape[1] - f.RIGHT) // f.SIZE
    for j in range(blocks.rows):
        for first, wide_first in ((0, 0), (f.LINKED, f.WIDE_LINKED)):
            for c in range(f.SIZE):
                for r in range(f.SIZE):
                    blocks[j, wide_first + r + f.WIDE * c] = narrow[j, first + r + f.SIZE * c]
            for k in range(f.WIDE):
                blocks[j, wide_first + f.ROW_HALF + f.WIDE * k] = 0.0
                blocks[j, wide_first + k + f.WIDE * f.ROW_HALF] = 0.0
        for c in range(columns):
            for r in range(f.SIZE):
                blocks[j, f.WIDE_RIGHT + r + f.WIDE * c] = narrow[j, f.RIGHT + r + f.SIZE * c]
            blocks[j, f.WIDE_RIGHT + f.ROW_HALF + f.WIDE * c] = 0.0
        blocks[j, f.WIDE_RIGHT + f.ROW_HALF] = iterate[j, f.HALF_RESIDUAL]

        blocks[j, f.ROW_HALF + f.WIDE * f.ROW_HALF] = like(belt.ring_mass / dt, step[j, f.TENSION_SLOPE])
        here, here_half, there, there_half = f.TENSION_I, f.DIFFERENCE_I, f.TENSION_J, f.DIFFERENCE_J
        k, m = step[j, f.TENSION_SLOPE], step[j, f.CROSS_SLOPE]
        _add_law(blocks, j, 0, k, m, step, here, here, here_half, here_half)
        _add_law(blocks, j, f.WIDE_LINKED, -k, -m, step, here, there, here_half, there_half)
        k, m = behind(step, j, f.TENSION_SLOPE), behind(step, j, f.CROSS_SLOPE)
        back, back_half = f.TENSION_BEHIND, f.DIFFERENCE_BEHIND
        _add_law(blocks, j, 0, k, m, step, back, back, back_half, back_half)
        k, m = iterate[j, f.RING_SLOPE], iterate[j, f.SLOPE_DIFFERENCE]
        _add_law(blocks, j, 0, k, m, step, f.SLIP_BY, f.SLIP_BY, f.HALF_SLIP_BY, f.HALF_SLIP_BY)


@kernel
def narrow_solutions(blocks, narrow):
    """Take the solutions for all right sides to the system of eight unknowns for the border."""
    columns = (narrow.data.shape[1] - f.RIGHT) // f.SIZE
    for j in range(blocks.rows):
        for c in range(columns):
            for r in range(f.SIZE):
                narrow[j, f.RIGHT + r + f.SIZE * c] = blocks[j, f.WIDE_RIGHT + r + f.WIDE * c]


@kernel
def book_difference(belt, state, work, dt):
    """Add to the totals what the difference of the flows takes in a solved step, before it is accepted."""
    elements, step, iterate, scratch = state.elements, work.step, work.iterate, work.scratch
    damper = belt.ring_time / ring_share(belt, dt)
    ring = stretching = like(0.0, elements[0, f.HALF_SPEED])
    for j in range(step.rows):
        half_slip = _along(vec.screw(step, j, f.HALF_SLIP_BY), elements, j, 0.5)
        ring += elements[j, f.FRICTION_DIFFERENCE] * half_slip
        of_both, apart = chain.shortening(elements, step, j, 0.5), _drawn_apart(elements, step, j, 0.5)
        more = 0.5 * (step[j, f.START_DIFFERENCE] - iterate[j, f.ITERATE_DIFFERENCE])
        more = more + 2.0 * step[j, f.CROSS_SLOPE] * of_both
        stretching += damper * apart * (step[j, f.TENSION_SLOPE] * apart + more)
    add_to_totals(state, scratch, planar.RING_LOSS, dt * ring)
    add_to_totals(state, scratch, planar.STRETCH_LOSS, dt * stretching)


@kernel
def accept_difference(belt, state, work, dt):
    """Take the difference of the flows to the end of the step, before the elements are taken there."""
    elements, step, iterate = state.elements, work.step, work.iterate
    half_mass, fall = 0.5 * belt.ring_mass / dt, dt * belt.gravity
    for j in range(step.rows):
        o = vec.at(elements, j, f.OUTWARD)
        a = vec.cross(o, vec.at(elements, j, f.HEADING))
        outward = vec.cross(vec.at(step, j, f.RING_LINE), a)
        u, omega = vec.screw(elements, j, f.CHANGE)
        u = u[0], u[1] + fall, u[2]
        tension, difference = iterate[j, f.ITERATE_TENSION], iterate[j, f.ITERATE_DIFFERENCE]
        tension_behind = behind(iterate, j, f.ITERATE_TENSION)
        difference_behind = behind(iterate, j, f.ITERATE_DIFFERENCE)
        turning = vec.cross(omega, a)
        for k in range(2):
            side = 1.0 - 2.0 * k
            ahead_of_it = vec.moved(vec.at(step, j, f.TENSION_I), side, vec.at(step, j, f.DIFFERENCE_I))
            behind_it = vec.moved(vec.behind(step, j, f.TENSION_J), side, vec.behind(step, j, f.DIFFERENCE_J))
            pull = 0.5 * (step[j, f.BENT_Y] * outward[0] + step[j, f.BENT_Z] * outward[1])
            pull += 0.5 * (tension + side * difference) * vec.dot(ahead_of_it, outward)
            pull -= 0.5 * (tension_behind + side * difference_behind) * vec.dot(behind_it, outward)
            rising = vec.dot(outward, vec.plus(u, vec.times(side * belt.package_distance, turning)))
            elements[j, f.SADDLE_RIGHT + k] = absolute(half_mass * rising - pull)
        elements[j, f.TENSION_DIFFERENCE] = difference
        elements[j, f.HALF_LENGTH] += dt * (elements[j, f.HALF_SLIP] - ahead(elements, j, f.HALF_SLIP))
        elements[j, f.HALF_SPEED] += elements[j, f.CHANGE_OF_HALF]
