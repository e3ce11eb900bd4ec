"""Equations of a correction of the speeds of ANCF elements, several elements at a time.

Of an element with ends r1, r2, gradients g1, g2 and length l all forces but those of mass and alpha follow
from z = (d, a, b) = (r2 - r1, l g1, l g2) and its rate. Strain and curvature at a point are quadratic in z,

    m = z . H z / 2 + const,    dm/dt = h . dz/dt,    h = H z,

with constant H, so that forces are sums of h, and the slopes of dm/dt by the speeds are H (z + tau dz/dt).

`Chain` is a chain of planar elements, open or closed; below are the stages of its steps in time.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, fma
from cvt_hpc.multibody.ancf_beam import PER_NODE, POINTS, SHAPES, WEIGHTS, AncfBeam, shapes
from cvt_hpc.solvers.cyclic_blocks import DIAGONAL, LOWER, UPPER, block_size, empty_blocks, empty_columns
from cvt_hpc.solvers.generalised_alpha import Scheme, begin, finish, stage_length

_SIDE_BY_SIDE = 8  # elements in lanes
# Fields of an element: its input, then its results
_EXTENT, Z, RATE, SPEED, _ACCELERATION = 0, 4, 10, 16, 24
GRADIENTS, _LATER = 32, 44  # of both curvatures by z, and those at z + tau dz/dt
INNER = 56  # slopes of the forces on z, (6, 6)
PULL = 92  # of the inside on z
FORCE, MATRIX = 98, 106  # on r1, g1, r2, g2, and its slopes, (8, 8)
LOST = 170
_GAUSS = 0.5 - 0.5 / np.sqrt(3.0), 0.5 + 0.5 / np.sqrt(3.0)
VALUE = shapes(np.array(_GAUSS))[0]  # (point, shape)
MASS = np.array([[156, 22, 54, -13], [22, 4, 13, -3], [54, 13, 156, -22], [-13, -3, -22, 4]]) / 420.0
# l^3 r' x r'' = FIRST d x a + _SECOND d x b - a x b at the Gauss points
FIRST, _SECOND = (-2.0 - np.sqrt(3.0), -2.0 + np.sqrt(3.0)), (2.0 - np.sqrt(3.0), 2.0 + np.sqrt(3.0))

SIZE = block_size(PER_NODE)


def _empty_work() -> LaneArray:
    """Work space for the forces of some elements."""
    return LaneArray(1, LOST + 1, _SIDE_BY_SIDE)


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

    That is Newton's method for an implicit Euler step tau [s] from `start`, at speeds u and positions q = q_a
    + tau u. Strains are the mean of those at both ends of a step 2 tau with q in its middle, which makes the
    midpoint rule conserve energy (Simo and Tarnow 1992) and changes others by their order. K leaves out how
    alpha's direction turns. Returns the power that damping takes [W].

    Of k elements, positions q [m, 1], speeds u and speeds at the start [m/s, 1/s] are (n, 4): n = k of a
    closed chain, k + 1 of an open one. `_empty_work()`, `blocks` and `columns` of `cyclic_blocks` are
    overwritten; `column` tells which of the right-hand sides it is, the others become 0.
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
        into[_EXTENT, lane], into[_EXTENT + 1, lane] = 1.0, l0
        into[_EXTENT + 2, lane], into[_EXTENT + 3, lane] = 1.0, l0
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
            into[_ACCELERATION + x, lane] = per * (u[i, x] - start[i, x]) - beam.gravity[x]
            into[_ACCELERATION + 2 + x, lane] = per * l0 * (u[i, 2 + x] - start[i, 2 + x])
            into[_ACCELERATION + 4 + x, lane] = per * (u[j, x] - start[j, x]) - beam.gravity[x]
            into[_ACCELERATION + 6 + x, lane] = per * l0 * (u[j, 2 + x] - start[j, 2 + x])


@kernel
def _compute(beam, w, tau):
    """Forces of elements and their slopes, from the input of `_gather`."""
    m, ea, ei, ca = beam.line_mass, beam.axial_stiffness, beam.bending_stiffness, beam.axial_damping
    l0 = w[0, _EXTENT + 1]
    per = 1.0 / l0
    cube = per * per * per
    _curve(w, Z, GRADIENTS, cube)
    _curve(w, RATE, _LATER, cube)
    # bending: its linear part, and damping of both curvatures
    damped, bend = 0.5 * l0 * beam.bending_damping * ei, ei * cube
    turn_1, turn_2 = _dot(w, RATE, GRADIENTS), _dot(w, RATE, GRADIENTS + 6)
    moment_1, moment_2 = damped * turn_1, damped * turn_2
    lost = moment_1 * turn_1 + moment_2 * turn_2
    for x in range(2):
        d, a, b = w[0, Z + x], w[0, Z + 2 + x], w[0, Z + 4 + x]
        w[0, PULL + x] = bend * (12.0 * d - 6.0 * (a + b))
        w[0, PULL + 2 + x] = bend * (4.0 * a + 2.0 * b - 6.0 * d)
        w[0, PULL + 4 + x] = bend * (4.0 * b + 2.0 * a - 6.0 * d)
    for r in range(6):
        h1, h2 = w[0, GRADIENTS + r], w[0, GRADIENTS + 6 + r]
        w[0, PULL + r] = fma(moment_1, h1, fma(moment_2, h2, w[0, PULL + r]))
        h1, h2 = damped * h1, damped * h2
        for c in range(6):
            later_1 = fma(tau, w[0, _LATER + c], w[0, GRADIENTS + c])
            later_2 = fma(tau, w[0, _LATER + 6 + c], w[0, GRADIENTS + 6 + c])
            w[0, INNER + 6 * r + c] = fma(h1, later_1, h2 * later_2)
    bend = tau * bend
    _add_even(w, 0, 0, 12.0 * bend)
    for end in range(1, 3):
        _add_even(w, end, end, 4.0 * bend)
        _add_even(w, end, 3 - end, 2.0 * bend)
        _add_even(w, 0, end, -6.0 * bend)
        _add_even(w, end, 0, -6.0 * bend)
    _add_odd(w, 0, 1, tau * cube * (FIRST[0] * moment_1 + FIRST[1] * moment_2))
    _add_odd(w, 0, 2, tau * cube * (_SECOND[0] * moment_1 + _SECOND[1] * moment_2))
    _add_odd(w, 1, 2, -tau * cube * (moment_1 + moment_2))
    # strain
    for p in range(POINTS):
        s0, s1, s2 = SHAPES[p, 1, 2], SHAPES[p, 1, 1], SHAPES[p, 1, 3]
        slopes = (s0, s1, s2)
        px = per * fma(s0, w[0, Z], fma(s1, w[0, Z + 2], s2 * w[0, Z + 4]))
        py = per * fma(s0, w[0, Z + 1], fma(s1, w[0, Z + 3], s2 * w[0, Z + 5]))
        ux = per * fma(s0, w[0, RATE], fma(s1, w[0, RATE + 2], s2 * w[0, RATE + 4]))
        uy = per * fma(s0, w[0, RATE + 1], fma(s1, w[0, RATE + 3], s2 * w[0, RATE + 5]))
        strain = 0.5 * (px * px + py * py - 1.0 + tau * tau * (ux * ux + uy * uy))
        rate = px * ux + py * uy
        weight = WEIGHTS[p] * l0
        tension = weight * (ea * strain + ca * rate)
        lost = lost + weight * ca * rate * rate
        stretch = weight * (tau * ea + ca) * per * per
        ax, ay = stretch * px, stretch * py
        lx, ly, tight = fma(tau, ux, px), fma(tau, uy, py), tau * per * per * tension
        xx, xy, yx, yy = fma(ax, lx, tight), ax * ly, ay * lx, fma(ay, ly, tight)
        for r in range(3):
            pull = slopes[r] * per * tension
            w[0, PULL + 2 * r] = fma(pull, px, w[0, PULL + 2 * r])
            w[0, PULL + 2 * r + 1] = fma(pull, py, w[0, PULL + 2 * r + 1])
            for c in range(3):
                both, field = slopes[r] * slopes[c], INNER + 12 * r + 2 * c
                w[0, field] = fma(both, xx, w[0, field])
                w[0, field + 1] = fma(both, xy, w[0, field + 1])
                w[0, field + 6] = fma(both, yx, w[0, field + 6])
                w[0, field + 7] = fma(both, yy, w[0, field + 7])
    # of mass; then of the inside of the element
    for r in range(PER_NODE):
        for x in range(2):
            total = -l0 * m * MASS[r, 0] * w[0, _ACCELERATION + x]
            for c in range(1, PER_NODE):
                total = fma(-l0 * m * MASS[r, c], w[0, _ACCELERATION + 2 * c + x], total)
            w[0, FORCE + 2 * r + x] = total
    lost = lost + _damp_across(w, 0.5 * beam.mass_damping * m * l0)
    w[0, LOST] = lost
    for x in range(2):
        w[0, FORCE + x] = w[0, FORCE + x] + w[0, PULL + x]
        w[0, FORCE + 4 + x] = w[0, FORCE + 4 + x] - w[0, PULL + x]
        w[0, FORCE + 2 + x] = l0 * (w[0, FORCE + 2 + x] - w[0, PULL + 2 + x])
        w[0, FORCE + 6 + x] = l0 * (w[0, FORCE + 6 + x] - w[0, PULL + 4 + x])
    for r in range(PER_NODE):
        of_r = 0 if r % 2 == 0 else r - r // 2
        for c in range(PER_NODE):
            of_c = 0 if c % 2 == 0 else c - c // 2
            sign = -1.0 if (r == 0) != (c == 0) else 1.0
            scale = w[0, _EXTENT + r] * w[0, _EXTENT + c]
            inertia = l0 * m / tau * MASS[r, c]
            for x in range(2):
                for y in range(2):
                    field = MATRIX + 8 * (2 * r + x) + 2 * c + y
                    total = w[0, field] + sign * w[0, INNER + 6 * (2 * of_r + x) + 2 * of_c + y]
                    if x == y:
                        total = total + inertia
                    w[0, field] = scale * total


@register_jitable
def _curve(w, z, to, cube):
    """H z of both curvatures."""
    dx, dy, ax, ay, bx, by = w[0, z], w[0, z + 1], w[0, z + 2], w[0, z + 3], w[0, z + 4], w[0, z + 5]
    for point in range(2):
        at, first, second = to + 6 * point, FIRST[point] * cube, _SECOND[point] * cube
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
    """Hand over the results of an element between nodes i and j; elements in order."""
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


class Chain(NamedTuple):
    """Motion of a chain of n nodes; all but the equations are (n, 4) arrays."""

    q: np.ndarray  # positions of the nodes [m, 1]
    v: np.ndarray  # speeds of the nodes [m/s, 1/s]
    dq: np.ndarray  # rate of q, as the method of steps knows it
    dv: np.ndarray  # rate of v, likewise
    stage_q: np.ndarray  # q of the last stage
    stage_v: np.ndarray  # v of the last stage
    start_q: np.ndarray  # initial value of its implicit Euler step
    start_v: np.ndarray  # likewise
    blocks: LaneArray  # equations of `cyclic_blocks`
    columns: LaneArray  # their right-hand sides
    work: LaneArray  # of `assemble`


def chain(q: np.ndarray, v: np.ndarray, columns: int = 1) -> Chain:
    """A chain at copies of positions [m, 1] and speeds [m/s, 1/s], (n, 4); its accelerations are 0.

    Its equations have as many right-hand sides as `columns`.
    """
    q, v = np.array(q, float), np.array(v, float)
    dv, stage_q, stage_v, start_q, start_v = np.zeros((5, *q.shape))
    equations = empty_blocks(len(q), PER_NODE), empty_columns(len(q), PER_NODE, columns)
    return Chain(q, v, v.copy(), dv, stage_q, stage_v, start_q, start_v, *equations, _empty_work())


@kernel
def begin_stage(chain: Chain, scheme: Scheme, dt: float) -> None:
    """Initial values of a stage, with the speeds at the begin of the step as a guess of its own."""
    begin(scheme, dt, chain.q, chain.dq, chain.start_q)
    begin(scheme, dt, chain.v, chain.dv, chain.start_v)
    for i in range(chain.q.shape[0]):
        for k in range(PER_NODE):
            chain.stage_v[i, k] = chain.v[i, k]


@kernel
def finish_stage(chain: Chain, scheme: Scheme, dt: float) -> None:
    """Positions and speeds at the end of a step, by the speeds of its stage."""
    place(chain, stage_length(scheme, dt))
    finish(scheme, dt, chain.stage_q, chain.start_q, chain.q, chain.dq)
    finish(scheme, dt, chain.stage_v, chain.start_v, chain.v, chain.dv)


@kernel
def place(chain: Chain, tau: float) -> None:
    """Positions of a stage by its speeds."""
    for i in range(chain.q.shape[0]):
        for k in range(PER_NODE):
            chain.stage_q[i, k] = chain.start_q[i, k] + tau * chain.stage_v[i, k]


@kernel
def set_up(beam: AncfBeam, chain: Chain, tau: float, column: int) -> float:
    """Set up a correction of the speeds of a stage, by `assemble`; the power that damping takes [W]."""
    return assemble(
        beam,
        chain.work,
        chain.stage_q,
        chain.stage_v,
        chain.start_v,
        tau,
        chain.blocks,
        chain.columns,
        column,
    )


@kernel
def correct(chain: Chain, column: int) -> float:
    """Add a solution to the speeds of a stage; the largest correction of a node's own speed [m/s]."""
    largest = 0.0
    for i in range(chain.q.shape[0]):
        for k in range(PER_NODE):
            correction = chain.columns.data[i, k, column]
            chain.stage_v[i, k] += correction
            if k < 2 and not abs(correction) <= largest:
                largest = abs(correction)
    return largest
