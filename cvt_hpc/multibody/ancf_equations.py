"""Equations of a correction of the speeds of ANCF elements, several elements at a time.

Of an element with ends r1, r2, gradients g1, g2 and length l all forces but those of mass and alpha follow
from z = (d, a, b) = (r2 - r1, l g1, l g2) and its rate. Strains and curvatures are quadratic in z,

    m = z . H z / 2 + const,    dm/dt = h . dz/dt,    h = H z,

with constant H, so that forces are sums of h, and the slopes of dm/dt by the speeds are H (z + tau dz/dt).
They are the strain at both ends and its mean, and the curvature r' x r'' at both Gauss points.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, fma
from cvt_hpc.multibody.ancf_beam import PER_NODE, AncfBeam, shapes
from cvt_hpc.solvers.cyclic_blocks import DIAGONAL, LOWER, UPPER

SIDE_BY_SIDE = 8  # elements in lanes
# Fields of an element: what it is called with, then what becomes of that
EXTENT, Z, RATE, SPEED, ACCELERATION = 0, 4, 10, 16, 24
GRADIENTS, LATER, SLOPES = 32, 50, 68  # of three measures by z, those at z + tau dz/dt, and their slopes
INNER = 98  # slopes of the forces on z, (6, 6)
FORCE, MATRIX = 134, 142  # on r1, g1, r2, g2, and its slopes, (8, 8)
LOST = 206

GAUSS = 0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0)
VALUE = shapes(np.array(GAUSS))[0]  # (point, shape)
MASS = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) / 420.0
# l^3 r' x r'' = FIRST d x a + SECOND d x b - a x b at the Gauss points
FIRST, SECOND = (-2.0 - np.sqrt(3.0), -2.0 + np.sqrt(3.0)), (2.0 - np.sqrt(3.0), 2.0 + np.sqrt(3.0))


def empty_work() -> LaneArray:
    """Room for what is computed of some elements."""
    return LaneArray(1, LOST + 1, SIDE_BY_SIDE)


@kernel
def assemble(
    beam: AncfBeam,
    work: LaneArray,
    q: np.ndarray,
    u: np.ndarray,
    start: np.ndarray,
    tau: float,
    blocks: LaneArray,
    columns: LaneArray,
    column: int,
) -> float:
    """Set up a correction of speeds, (M / tau + D + tau K) du = F - M (u - start) / tau.

    That is Newton's method for an implicit Euler step tau from `start`, at speeds u and positions q = q_a +
    tau u. Strains are the mean of those at both ends of a step 2 tau with q in its middle, which makes the
    midpoint rule conserve energy (Simo and Tarnow 1992) and changes others by their order. K leaves out how
    alpha's direction turns.

    Parameters
    ----------
    beam : AncfBeam
        k elements.
    work : LaneArray
        `empty_work()`; overwritten.
    q, u, start : (n, 4) arrays
        Positions [m, 1], speeds and speeds at the start [m/s, 1/s]; n = k of a closed chain, k + 1 of an open
        one.
    tau : float
        [s]
    blocks, columns : LaneArrays
        Of `cyclic_blocks`; overwritten.
    column : int
        Which of the right-hand sides it is; the others become 0.

    Returns
    -------
    float
        Power that damping takes [W].
    """
    k, n = beam.lengths.size, q.shape[0]
    side_by_side = work.data.shape[2]
    for row in range(PER_NODE):
        blocks[0, DIAGONAL * PER_NODE + row] = 0.0
        blocks[0, LOWER * PER_NODE + row] = 0.0
        blocks[n - 1, UPPER * PER_NODE + row] = 0.0
    columns.data[:] = 0.0
    lost = 0.0
    for first in range(0, k, side_by_side):
        _gather(beam, work.data[0], q, u, start, tau, first)
        _compute(beam, work, tau)
        for lane in range(min(side_by_side, k - first)):
            lost += work.data[0, LOST, lane]
            _scatter(work.data[0], lane, first + lane, (first + lane + 1) % n, blocks, columns, column)
    return lost


@kernel
def _gather(beam, into, q, u, start, tau, first):
    """Put elements from one on side by side; the last one also where there are no more."""
    k, n, per = beam.lengths.size, q.shape[0], 1.0 / tau
    for lane in range(into.shape[1]):
        i = min(first + lane, k - 1)
        j = (i + 1) % n
        l0 = beam.lengths[i]
        into[EXTENT, lane], into[EXTENT + 1, lane] = 1.0, l0
        into[EXTENT + 2, lane], into[EXTENT + 3, lane] = 1.0, l0
        for x in range(2):
            into[Z + x, lane] = q[j, x] - q[i, x]
            into[Z + 2 + x, lane] = l0 * q[i, 2 + x]
            into[Z + 4 + x, lane] = l0 * q[j, 2 + x]
            into[RATE + x, lane] = u[j, x] - u[i, x]
            into[RATE + 2 + x, lane] = l0 * u[i, 2 + x]
            into[RATE + 4 + x, lane] = l0 * u[j, 2 + x]
            into[SPEED + x, lane] = u[i, x]
            into[SPEED + 2 + x, lane] = l0 * u[i, 2 + x]
            into[SPEED + 4 + x, lane] = u[j, x]
            into[SPEED + 6 + x, lane] = l0 * u[j, 2 + x]
            into[ACCELERATION + x, lane] = per * (u[i, x] - start[i, x]) - beam.gravity[x]
            into[ACCELERATION + 2 + x, lane] = per * l0 * (u[i, 2 + x] - start[i, 2 + x])
            into[ACCELERATION + 4 + x, lane] = per * (u[j, x] - start[j, x]) - beam.gravity[x]
            into[ACCELERATION + 6 + x, lane] = per * l0 * (u[j, 2 + x] - start[j, 2 + x])


@kernel
def _compute(beam, w, tau):
    """Forces of elements and their slopes, from what `_gather` has put there."""
    m, ea, ei, ca = beam.line_mass, beam.axial_stiffness, beam.bending_stiffness, beam.axial_damping
    l0 = w[0, EXTENT + 1]
    per = 1.0 / l0
    per_square = per * per
    _gradients(w, Z, GRADIENTS, per)
    _gradients(w, RATE, LATER, per)
    # strains: mean, and at both ends
    ax, ay, bx, by = w[0, Z + 2], w[0, Z + 3], w[0, Z + 4], w[0, Z + 5]
    ux, uy, vx, vy = w[0, RATE + 2], w[0, RATE + 3], w[0, RATE + 4], w[0, RATE + 5]
    mean, later, rate = _dot(w, Z, GRADIENTS), _dot(w, RATE, LATER), _dot(w, RATE, GRADIENTS)
    mean = 0.5 * (mean + tau * tau * later - 1.0)
    strain_1 = 0.5 * (per_square * (ax * ax + ay * ay + tau * tau * (ux * ux + uy * uy)) - 1.0)
    strain_2 = 0.5 * (per_square * (bx * bx + by * by + tau * tau * (vx * vx + vy * vy)) - 1.0)
    rate_1, rate_2 = per_square * (ax * ux + ay * uy), per_square * (bx * vx + by * vy)
    elastic, viscous = _weighted(l0, mean, strain_1, strain_2), _weighted(l0, rate, rate_1, rate_2)
    normal = ea * elastic[0] + ca * viscous[0]
    normal_1, normal_2 = ea * elastic[1] + ca * viscous[1], ea * elastic[2] + ca * viscous[2]
    lost = ca * (rate * viscous[0] + rate_1 * viscous[1] + rate_2 * viscous[2])
    # curvatures
    damped = 0.5 * l0 * beam.bending_damping * ei
    turn_1, turn_2 = _dot(w, RATE, GRADIENTS + 6), _dot(w, RATE, GRADIENTS + 12)
    moment_1, moment_2 = damped * turn_1, damped * turn_2
    lost = lost + moment_1 * turn_1 + moment_2 * turn_2
    # slopes of normal forces and moments by the rate of z, with h at z + tau dz/dt
    stretch = (tau * ea + ca) * l0
    for c in range(6):
        for measure in range(3):
            field = LATER + 6 * measure + c
            w[0, field] = fma(tau, w[0, field], w[0, GRADIENTS + 6 * measure + c])
        w[0, SLOPES + 6 + c] = damped * w[0, LATER + 6 + c]
        w[0, SLOPES + 12 + c] = damped * w[0, LATER + 12 + c]
        w[0, SLOPES + c] = 1.2 * stretch * w[0, LATER + c]
        of_ends = -0.1 * stretch * w[0, LATER + c]
        w[0, SLOPES + 18 + c] = of_ends
        w[0, SLOPES + 24 + c] = of_ends
    for x in range(2):
        of_1 = stretch * per_square * fma(tau, w[0, RATE + 2 + x], w[0, Z + 2 + x])
        of_2 = stretch * per_square * fma(tau, w[0, RATE + 4 + x], w[0, Z + 4 + x])
        w[0, SLOPES + 2 + x] = w[0, SLOPES + 2 + x] - 0.1 * of_1
        w[0, SLOPES + 4 + x] = w[0, SLOPES + 4 + x] - 0.1 * of_2
        w[0, SLOPES + 20 + x] = w[0, SLOPES + 20 + x] + 2.0 / 15.0 * of_1
        w[0, SLOPES + 22 + x] = w[0, SLOPES + 22 + x] - 1.0 / 30.0 * of_2
        w[0, SLOPES + 26 + x] = w[0, SLOPES + 26 + x] - 1.0 / 30.0 * of_1
        w[0, SLOPES + 28 + x] = w[0, SLOPES + 28 + x] + 2.0 / 15.0 * of_2
    for r in range(6):
        h0, h1, h2 = w[0, GRADIENTS + r], w[0, GRADIENTS + 6 + r], w[0, GRADIENTS + 12 + r]
        for c in range(6):
            total = h0 * w[0, SLOPES + c]
            total = fma(h1, w[0, SLOPES + 6 + c], fma(h2, w[0, SLOPES + 12 + c], total))
            w[0, INNER + 6 * r + c] = total
    for r in range(2, 6):
        end = per_square * w[0, Z + r]
        for c in range(6):
            slope = w[0, SLOPES + 18 + 6 * ((r - 2) // 2) + c]
            w[0, INNER + 6 * r + c] = fma(end, slope, w[0, INNER + 6 * r + c])
    # slopes at constant normal forces and moments, and the linear part of bending
    bend, tight = ei * per * per_square, per_square * normal
    first = tau * per * per_square * (FIRST[0] * moment_1 + FIRST[1] * moment_2)
    second = tau * per * per_square * (SECOND[0] * moment_1 + SECOND[1] * moment_2)
    third = tau * per * per_square * (moment_1 + moment_2)
    _add_even(w, 0, 0, tau * (1.2 * tight + 12.0 * bend))
    _add_even(w, 1, 1, tau * (2.0 / 15.0 * tight + per_square * normal_1 + 4.0 * bend))
    _add_even(w, 2, 2, tau * (2.0 / 15.0 * tight + per_square * normal_2 + 4.0 * bend))
    for end in range(1, 3):
        coupling = -tau * (0.1 * tight + 6.0 * bend)
        _add_even(w, 0, end, coupling)
        _add_even(w, end, 0, coupling)
        _add_even(w, end, 3 - end, tau * (2.0 * bend - 1.0 / 30.0 * tight))
    _add_odd(w, 0, 1, first)
    _add_odd(w, 0, 2, second)
    _add_odd(w, 1, 2, -third)
    # of mass; then of what is inside the element
    for r in range(PER_NODE):
        for x in range(2):
            total = -l0 * m * MASS[r, 0] * w[0, ACCELERATION + x]
            for c in range(1, PER_NODE):
                total = fma(-l0 * m * MASS[r, c], w[0, ACCELERATION + 2 * c + x], total)
            w[0, FORCE + 2 * r + x] = total
    lost = lost + _damp_across(w, 0.5 * beam.mass_damping * m * l0)
    w[0, LOST] = lost
    for x in range(2):
        dx, gx, hx = w[0, Z + x], w[0, Z + 2 + x], w[0, Z + 4 + x]
        on_d = bend * (12.0 * dx - 6.0 * (gx + hx))
        on_a = bend * (4.0 * gx + 2.0 * hx - 6.0 * dx) + normal_1 * per_square * gx
        on_b = bend * (4.0 * hx + 2.0 * gx - 6.0 * dx) + normal_2 * per_square * hx
        on_d = on_d + _pull(w, x, normal, moment_1, moment_2)
        w[0, FORCE + x] = w[0, FORCE + x] + on_d
        w[0, FORCE + 4 + x] = w[0, FORCE + 4 + x] - on_d
        w[0, FORCE + 2 + x] = l0 * (w[0, FORCE + 2 + x] - on_a - _pull(w, 2 + x, normal, moment_1, moment_2))
        w[0, FORCE + 6 + x] = l0 * (w[0, FORCE + 6 + x] - on_b - _pull(w, 4 + x, normal, moment_1, moment_2))
    for r in range(PER_NODE):
        of_r = 0 if r % 2 == 0 else r - r // 2
        for c in range(PER_NODE):
            of_c = 0 if c % 2 == 0 else c - c // 2
            sign = -1.0 if (r == 0) != (c == 0) else 1.0
            scale = w[0, EXTENT + r] * w[0, EXTENT + c]
            inertia = l0 * m / tau * MASS[r, c]
            for x in range(2):
                for y in range(2):
                    field = MATRIX + 8 * (2 * r + x) + 2 * c + y
                    total = w[0, field] + sign * w[0, INNER + 6 * (2 * of_r + x) + 2 * of_c + y]
                    if x == y:
                        total = total + inertia
                    w[0, field] = scale * total


@register_jitable
def _gradients(w, z, to, per):
    """H z of the mean strain and of both curvatures."""
    dx, dy, ax, ay, bx, by = w[0, z], w[0, z + 1], w[0, z + 2], w[0, z + 3], w[0, z + 4], w[0, z + 5]
    square = per * per
    for x in range(2):
        d, a, b = w[0, z + x], w[0, z + 2 + x], w[0, z + 4 + x]
        w[0, to + x] = square * (1.2 * d - 0.1 * (a + b))
        w[0, to + 2 + x] = square * (2.0 / 15.0 * a - 1.0 / 30.0 * b - 0.1 * d)
        w[0, to + 4 + x] = square * (2.0 / 15.0 * b - 1.0 / 30.0 * a - 0.1 * d)
    cube = square * per
    for point in range(2):
        at = to + 6 + 6 * point
        first, second = FIRST[point] * cube, SECOND[point] * cube
        w[0, at], w[0, at + 1] = first * ay + second * by, -(first * ax + second * bx)
        w[0, at + 2], w[0, at + 3] = -first * dy - cube * by, first * dx + cube * bx
        w[0, at + 4], w[0, at + 5] = -second * dy + cube * ay, second * dx - cube * ax


@register_jitable
def _dot(w, one, other):
    total = w[0, one] * w[0, other]
    for c in range(1, 6):
        total = fma(w[0, one + c], w[0, other + c], total)
    return total


@register_jitable
def _weighted(l0, mean, first, second):
    """Slopes of l/2 times the mean square of a parabola, by its mean and its values at both ends."""
    ends = 0.1 * (first + second)
    return (
        l0 * (1.2 * mean - ends),
        l0 * (2.0 / 15.0 * first - 1.0 / 30.0 * second - 0.1 * mean),
        l0 * (2.0 / 15.0 * second - 1.0 / 30.0 * first - 0.1 * mean),
    )


@register_jitable
def _pull(w, c, normal, moment_1, moment_2):
    total = normal * w[0, GRADIENTS + c]
    return fma(moment_1, w[0, GRADIENTS + 6 + c], fma(moment_2, w[0, GRADIENTS + 12 + c], total))


@register_jitable
def _add_even(w, r, c, value):
    for x in range(2):
        field = INNER + 6 * (2 * r + x) + 2 * c + x
        w[0, field] = w[0, field] + value


@register_jitable
def _add_odd(w, r, c, value):
    """Slopes of a cross product of two of z."""
    for x in range(2):
        sign = 1.0 - 2.0 * x
        field = INNER + 6 * (2 * r + x) + 2 * c + 1 - x
        w[0, field] = w[0, field] + sign * value
        field = INNER + 6 * (2 * c + x) + 2 * r + 1 - x
        w[0, field] = w[0, field] - sign * value


@register_jitable
def _damp_across(w, weight):
    """Begin slopes with those of alpha's damping, and add its forces; the power that it takes."""
    lost = 0.0 * weight
    for field in range(64):
        w[0, MATRIX + field] = 0.0 * weight
    for p in range(2):
        side = (0.5 - p) / np.sqrt(0.75)
        px = w[0, Z] + side * 0.5 * (w[0, Z + 2] - w[0, Z + 4])
        py = w[0, Z + 1] + side * 0.5 * (w[0, Z + 3] - w[0, Z + 5])
        vx, vy = VALUE[p, 0] * w[0, SPEED], VALUE[p, 0] * w[0, SPEED + 1]
        for c in range(1, PER_NODE):
            vx = fma(VALUE[p, c], w[0, SPEED + 2 * c], vx)
            vy = fma(VALUE[p, c], w[0, SPEED + 2 * c + 1], vy)
        damped = weight / (px * px + py * py)
        across = px * vy - py * vx
        lost = lost + damped * across * across
        xx, xy, yy = damped * py * py, -damped * px * py, damped * px * px
        fx, fy = -damped * across * py, damped * across * px
        for r in range(PER_NODE):
            w[0, FORCE + 2 * r] = fma(-VALUE[p, r], fx, w[0, FORCE + 2 * r])
            w[0, FORCE + 2 * r + 1] = fma(-VALUE[p, r], fy, w[0, FORCE + 2 * r + 1])
            for c in range(PER_NODE):
                both, field = VALUE[p, r] * VALUE[p, c], MATRIX + 16 * r + 2 * c
                w[0, field] = fma(both, xx, w[0, field])
                w[0, field + 1] = fma(both, xy, w[0, field + 1])
                w[0, field + 8] = fma(both, xy, w[0, field + 8])
                w[0, field + 9] = fma(both, yy, w[0, field + 9])
    return lost


@kernel
def _scatter(found, lane, i, j, blocks, columns, column):
    """Hand over what was computed of an element between nodes i and j; elements in order."""
    matrix = blocks.data
    for r in range(PER_NODE):
        columns.data[i, r, column] += found[FORCE + r, lane]
        columns.data[j, r, column] += found[FORCE + 4 + r, lane]
        for c in range(PER_NODE):
            field = MATRIX + 8 * r + c
            matrix[i, DIAGONAL * PER_NODE + r, c] += found[field, lane]
            matrix[i, UPPER * PER_NODE + r, c] = found[field + 4, lane]
            matrix[j, LOWER * PER_NODE + r, c] = found[field + 32, lane]
            if j > i:
                matrix[j, DIAGONAL * PER_NODE + r, c] = found[field + 36, lane]
            else:
                matrix[j, DIAGONAL * PER_NODE + r, c] += found[field + 36, lane]
