"""Contacts of the belt with its pulleys: forces at points along the belt, and their slopes.

Each element has points at equal distances that may touch each pulley. A point of the belt at distance
d < R + h + b from the pulley's axis is pressed by the depth R + h + b - d into the rim, with the normal force
per length

    p = max(stiffness depth + damping d/dt depth, 0).

R is the pulley's radius, b the height of the belt's surface at the point, which moves along with it, and h
that of an eccentric rim, run_out cos(psi), with the angle psi from the rim's highest place to the point. The
rim has the slope s = h' / d there, by which p pushes the belt by -s p around the axis and turns the pulley by
s p d. So p has the energy stiffness depth^2 / 2, and its damping takes damping (d depth / dt)^2, whatever
moves.

A point that approaches is pressed shortly before it is there, so that p has no jump. The rubber between the
belt's cord and the rim turns with the pulley, so that the cord slides by the speed t . dr/dt - w d over it.
Friction (`cvt_hpc.models.belt_drive.friction`) acts at the radius d: its moment turns the pulley.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.models.belt_drive.friction import Friction, Memory, begin_iterate, empty_memory, laws_hold, rub
from cvt_hpc.models.belt_drive.pulleys import CONTACT_LOSS, FRICTION_LOSS, WORK_IN, Pulleys, Wheels
from cvt_hpc.multibody.ancf_beam import AXES, PER_NODE, X, Y, shapes
from cvt_hpc.multibody.ancf_equations import Chain
from cvt_hpc.solvers.cyclic_blocks import DIAGONAL, LOWER, UPPER

_NEAR = 1.05  # radii of a pulley, beyond which nothing touches it
_Two = tuple[float, float]
_Four = tuple[float, float, float, float]
_Point = tuple[int, int, _Four]  # of the belt: the nodes before and behind it, and the shapes there


class Contact(NamedTuple):
    """Constants of the contacts."""

    shape: np.ndarray  # shape (C, 4): shapes at the C points of an element of length 1
    # stiffness, damping: per length [N/m^2], [N s/m^2]
    stiffness: float
    damping: float
    friction: Friction  # how they rub
    # height, highest: of the belt's surface over its mean, at each element's points, (k, C) [m]; the largest
    height: np.ndarray
    highest: float


class Touch(NamedTuple):
    """State of the contacts of P pulleys and k elements, and their forces."""

    memory: Memory  # of friction
    # normal, tangential, shape (P, k, C): forces on the belt in the last stage, outwards and
    # counter-clockwise [N]
    normal: np.ndarray
    tangential: np.ndarray


def contact_shapes(points: int) -> np.ndarray:
    """Shapes (C, 4) at C points, each in the middle of its share of an element."""
    return shapes(_places(points))[0]


def contact_slopes(points: int) -> np.ndarray:
    """Derivatives (C, 4) of these shapes by the share of an element."""
    return shapes(_places(points))[1]


def _places(points: int) -> np.ndarray:
    found: np.ndarray = (np.arange(points) + 0.5) / points
    return found


def first_touch(pulleys: int, elements: int, points: int) -> Touch:
    """Contacts that remember nothing."""
    return Touch(empty_memory(pulleys, elements, points), *np.zeros((2, pulleys, elements, points)))


@kernel
def add_contacts(
    contact: Contact,
    touch: Touch,
    lengths: np.ndarray,
    chain: Chain,
    pulleys: Pulleys,
    wheels: Wheels,
    tau: float,
    is_known: bool,
) -> bool:
    """Add the forces of contacts, and their slopes, to the equations of a stage of `tau` [s].

    The belt has elements of `lengths` [m]. `is_known` tells whether `touch`, the state of the contacts, is of
    an iterate of this stage. Returns whether the laws of friction held in that iterate.
    """
    q, u, n = chain.stage_q, chain.stage_v, chain.q.shape[0]
    blocks, columns, rows, corner = chain.blocks.data, chain.columns.data, wheels.rows, wheels.corner.data[0]
    last, points = wheels.speed.shape[1] - 1, contact.shape.shape[0]
    begin_iterate(touch.memory)
    touch.normal[:] = 0.0
    touch.tangential[:] = 0.0
    for i in range(n):
        j = (i + 1) % n
        l0 = lengths[i]
        reach = _reach(q, i, j, l0) + contact.highest
        weight = l0 / points
        for p in range(pulleys.radius.size):
            radius, centre_x, centre_y = pulleys.radius[p], wheels.centre[p, 0], wheels.centre[p, 1]
            farthest = radius + pulleys.run_out[p] + reach
            if (q[i, 0] - centre_x) ** 2 + (q[i, 1] - centre_y) ** 2 >= farthest**2:
                continue
            rim_x, rim_y = wheels.rim[p, 0], wheels.rim[p, 1]
            centre_vx, centre_vy = wheels.centre_speed[p, 0], wheels.centre_speed[p, 1]
            turning = wheels.stage_speed[0, p]
            for c in range(points):
                s0 = contact.shape[c, 0]
                s1 = l0 * contact.shape[c, 1]
                s2 = contact.shape[c, 2]
                s3 = l0 * contact.shape[c, 3]
                x = s0 * q[i, 0] + s1 * q[i, 2] + s2 * q[j, 0] + s3 * q[j, 2]
                y = s0 * q[i, 1] + s1 * q[i, 3] + s2 * q[j, 1] + s3 * q[j, 3]
                away_x, away_y = x - centre_x, y - centre_y
                if away_x * away_x + away_y * away_y >= (_NEAR * radius) ** 2:
                    continue
                vx = s0 * u[i, 0] + s1 * u[i, 2] + s2 * u[j, 0] + s3 * u[j, 2] - centre_vx
                vy = s0 * u[i, 1] + s1 * u[i, 3] + s2 * u[j, 1] + s3 * u[j, 3] - centre_vy
                distance = np.sqrt(away_x * away_x + away_y * away_y)
                nx, ny = away_x / distance, away_y / distance
                outward, around = nx * vx + ny * vy, nx * vy - ny * vx
                slip = around - turning * distance
                rise, slope = nx * rim_x + ny * rim_y, (nx * rim_y - ny * rim_x) / distance  # of the rim
                leaving = outward - slope * slip
                depth = radius + contact.height[i, c] + rise - distance
                pressure = contact.stiffness * depth - contact.damping * leaving
                if pressure <= 0.0:
                    continue
                found = rub(contact.friction, touch.memory, p, i, c, slip, pressure, tau, is_known)
                force, traction, settled = weight * pressure, -weight * found.force, -weight * found.settled
                wheels.power[FRICTION_LOSS + p] -= settled * slip
                wheels.power[CONTACT_LOSS] += weight * contact.damping * leaving * leaving
                traction, settled = traction - slope * force, settled - slope * force
                touch.normal[p, i, c], touch.tangential[p, i, c] = force, settled
                if p == 0:
                    wheels.power[WORK_IN] += settled * distance * turning
                # slopes by speeds of the belt: of the force, of the slip, of traction and its moment
                steep, turn = -weight * found.by_slip, tau / distance  # turn: of the normal
                stiff, damp = weight * contact.stiffness, weight * contact.damping
                of_normal = -weight * (contact.stiffness * tau + contact.damping)
                of_normal -= damp * slope * (turn * slip + tau * turning)
                of_around = -weight * contact.damping * tau * around / distance
                along = 1.0 - tau * outward / distance  # of the slip
                of_around += stiff * tau * slope + damp * (slope * along - turn * rise * slip / distance)
                tangential = -found.by_pressure - slope  # of traction by the force
                by_normal = steep * -tau * turning + tangential * of_normal + force * turn * slope
                by_around = steep * along + tangential * of_around + force * turn * rise / distance
                nn, nt = of_normal, of_around - settled * turn
                tn, tt = by_normal, by_around + force * turn
                # with tangent (-ny, nx)
                xx = -(nx * nx * nn - nx * ny * (nt + tn) + ny * ny * tt)
                xy = -(nx * ny * (nn - tt) + nx * nx * nt - ny * ny * tn)
                yx = -(nx * ny * (nn - tt) + nx * nx * tn - ny * ny * nt)
                yy = -(ny * ny * nn + nx * ny * (nt + tn) + nx * nx * tt)
                fx, fy = force * nx - traction * ny, force * ny + traction * nx
                moment_n = distance * by_normal + tau * settled
                moment_t = distance * by_around
                mx, my = moment_n * nx - moment_t * ny, moment_n * ny + moment_t * nx
                point = i, j, (s0, s1, s2, s3)
                _add_to_belt(blocks, columns, point, last, (fx, fy), (xx, xy, yx, yy))
                # by the pulley's speed
                of_turning = damp * (turn * rise * slip - slope * distance) - stiff * tau * slope * distance
                by_turning = tangential * of_turning - steep * distance - force * turn * rise
                if p > 0:
                    corner[p - 1, p - 1] += by_turning * distance
                    corner[p - 1, last] -= traction * distance
                    column = by_turning * ny - of_turning * nx, -of_turning * ny - by_turning * nx
                    _add_to_border(columns, rows, point, p - 1, column, (mx, my))
                if pulleys.arm[p] < 0:
                    continue
                # by the arm's rate the axis moves along (ex, ey), and its speed turns with the arm as well
                arm = pulleys.radius.size - 1 + pulleys.arm[p]
                ex, ey = wheels.lever[p, 0], wheels.lever[p, 1]
                turned = tau * wheels.stage_speed[0, arm + 1]
                by_n = -damp * turned * (nx * ey - ny * ex) - damp * slope * turned * (nx * ex + ny * ey)
                by_t = tangential * by_n - steep * turned * (nx * ex + ny * ey)
                by_x = xx * ex + xy * ey + by_n * nx - by_t * ny
                by_y = yx * ex + yy * ey + by_n * ny + by_t * nx
                ax, ay = -(ex * xx + ey * yx), -(ex * xy + ey * yy)
                _add_to_border(columns, rows, point, arm, (-by_x, -by_y), (ax, ay))
                corner[arm, arm] += ex * by_x + ey * by_y - tau * (fx * ey - fy * ex)
                corner[arm, last] -= fx * ex + fy * ey
                if p > 0:
                    corner[p - 1, arm] += distance * by_t - (mx * ex + my * ey)
                    corner[arm, p - 1] += by_turning * (ey * nx - ex * ny) + of_turning * (nx * ex + ny * ey)
    return laws_hold(contact.friction, touch.memory, is_known)


@merged_kernel
def _reach(q, i, j, l0):
    """Bound the distance of an element between nodes i and j from the first of them [m].

    A cubic lies within the hull of its ends and of the points a third of the end's derivative inwards.
    """
    share = l0 / 3.0
    dx, dy = q[j, 0] - q[i, 0], q[j, 1] - q[i, 1]
    bx, by = dx - share * q[j, 2], dy - share * q[j, 3]
    first = share * share * (q[i, 2] * q[i, 2] + q[i, 3] * q[i, 3])
    return np.sqrt(max(dx * dx + dy * dy, max(bx * bx + by * by, first)))


@merged_kernel
def _add_to_belt(
    blocks: np.ndarray, columns: np.ndarray, point: _Point, last: int, force: _Two, matrix: _Four
) -> None:
    """Add a force at a point of the belt, and the matrix (xx, xy, yx, yy) of its slopes."""
    i, j, shape = point
    xx, xy, yx, yy = matrix
    for node in range(2):
        at = i if node == 0 else j
        for kind in range(2):
            s, k = shape[2 * node + kind], AXES * kind
            columns[at, k + X, last] += s * force[0]
            columns[at, k + Y, last] += s * force[1]
            for other in range(2):
                block = DIAGONAL
                if other != node:
                    block = UPPER if node == 0 else LOWER
                row = block * PER_NODE + k
                for other_kind in range(2):
                    a, column = s * shape[2 * other + other_kind], AXES * other_kind
                    blocks[at, row + X, column + X] += a * xx
                    blocks[at, row + X, column + Y] += a * xy
                    blocks[at, row + Y, column + X] += a * yx
                    blocks[at, row + Y, column + Y] += a * yy


@merged_kernel
def _add_to_border(
    columns: np.ndarray, rows: np.ndarray, point: _Point, k: int, column: _Two, row: _Two
) -> None:
    """Add to column and row k of the border the coupling of an unknown there and a point of the belt."""
    i, j, shape = point
    for node in range(2):
        at = i if node == 0 else j
        for kind in range(2):
            s, first = shape[2 * node + kind], AXES * kind
            columns[at, first + X, k] += s * column[0]
            columns[at, first + Y, k] += s * column[1]
            rows[at, k, first + X] += s * row[0]
            rows[at, k, first + Y] += s * row[1]
