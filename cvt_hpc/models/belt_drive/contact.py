"""Contacts of the belt with its pulleys: forces at points along the belt, and their slopes.

Each element has points at equal distances that may touch each pulley. A point of the belt at distance
d < R from the pulley's axis is pressed by R - d into the pulley's rim of radius R, with the normal force per
length

    p = max(stiffness (R - d) + damping d/dt (R - d), 0).

The rubber between the belt's cord and the rim turns with the pulley, so that the cord slides by the speed
t . dr/dt - w d over it. Friction (`cvt_hpc.models.belt_drive.friction`) acts at the radius d: its moment turns
the pulley.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.belt_drive.friction import WRONG, Friction, Memory, empty_memory, laws_hold, rub
from cvt_hpc.models.belt_drive.pulleys import CONTACT_LOSS, FRICTION_LOSS, WORK_IN, Pulleys, Wheels
from cvt_hpc.multibody.ancf_beam import PER_NODE, shapes
from cvt_hpc.multibody.ancf_chain import Chain
from cvt_hpc.solvers.cyclic_blocks import DIAGONAL, LOWER, UPPER


NEAR = 1.05  # in radii of a pulley, within which a point may touch it

class Contact(NamedTuple):
    """Constants of the contacts.

    Attributes
    ----------
    shape : (C, 4) array
        Shapes at the C points of an element of length 1.
    stiffness, damping : float
        Per length [N/m^2], [N s/m^2].
    friction : Friction
        How they rub.
    """

    shape: np.ndarray
    stiffness: float
    damping: float
    friction: Friction


class Touch(NamedTuple):
    """What the contacts of P pulleys and k elements remember, and their forces.

    Attributes
    ----------
    memory : Memory
        Of friction.
    normal, tangential : (P, k, C) arrays
        Forces on the belt in the last stage, outwards and counter-clockwise [N].
    """

    memory: Memory
    normal: np.ndarray
    tangential: np.ndarray


def contact_shapes(points: int) -> np.ndarray:
    """Shapes (C, 4) at C points, each in the middle of its share of an element."""
    return shapes((np.arange(points) + 0.5) / points)[0]


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
    """Add the forces of contacts, and their slopes, to the equations of a stage.

    Parameters
    ----------
    contact, touch : Contact, Touch
        What the contacts are, and what they remember.
    lengths : (k,) array
        Of the elements [m].
    chain : Chain
        The belt.
    pulleys, wheels : Pulleys, Wheels
        What it runs around.
    tau : float
        [s]
    is_known : bool
        Whether `touch` is of an iterate of this stage.

    Returns
    -------
    bool
        Whether the laws of friction held in that iterate.
    """
    q, u, n = chain.stage_q, chain.stage_v, chain.q.shape[0]
    blocks, columns = chain.blocks.data, chain.columns.data
    last, points = pulleys.radius.size - 1, contact.shape.shape[0]
    touch.memory.pivots[WRONG] = 0
    touch.normal[:] = 0.0
    touch.tangential[:] = 0.0
    for i in range(n):
        j = (i + 1) % n
        l0 = lengths[i]
        weight = l0 / points
        for c in range(points):
            s0, s1, s2, s3 = (
                contact.shape[c, 0],
                l0 * contact.shape[c, 1],
                contact.shape[c, 2],
                l0 * contact.shape[c, 3],
            )
            x = s0 * q[i, 0] + s1 * q[i, 2] + s2 * q[j, 0] + s3 * q[j, 2]
            y = s0 * q[i, 1] + s1 * q[i, 3] + s2 * q[j, 1] + s3 * q[j, 3]
            for p in range(last + 1):
                away_x, away_y, radius = x - pulleys.centre[p, 0], y - pulleys.centre[p, 1], pulleys.radius[p]
                if away_x * away_x + away_y * away_y >= (NEAR * radius) ** 2:
                    continue
                vx = s0 * u[i, 0] + s1 * u[i, 2] + s2 * u[j, 0] + s3 * u[j, 2]
                vy = s0 * u[i, 1] + s1 * u[i, 3] + s2 * u[j, 1] + s3 * u[j, 3]
                distance = np.sqrt(away_x * away_x + away_y * away_y)
                nx, ny = away_x / distance, away_y / distance
                outward, around = nx * vx + ny * vy, nx * vy - ny * vx
                depth = radius - distance
                pressure = contact.stiffness * depth - contact.damping * outward
                if pressure <= 0.0:
                    continue
                slip = around - wheels.stage_speed[0, p] * distance
                found = rub(contact.friction, touch.memory, p, i, c, slip, pressure, tau, is_known)
                force, traction, settled = weight * pressure, -weight * found.force, -weight * found.settled
                touch.normal[p, i, c], touch.tangential[p, i, c] = force, traction
                wheels.power[FRICTION_LOSS + p] -= traction * slip
                wheels.power[CONTACT_LOSS] += weight * contact.damping * outward * outward
                if p == 0:
                    wheels.power[WORK_IN] += traction * distance * wheels.stage_speed[0, 0]
                # slopes by speeds of the belt: of the force, of the slip, of traction and its moment
                steep = -weight * found.by_slip
                of_normal = -weight * (contact.stiffness * tau + contact.damping)
                of_around = -weight * contact.damping * tau * around / distance
                by_normal = steep * -tau * wheels.stage_speed[0, p] - found.by_pressure * of_normal
                by_around = steep * (1.0 - tau * outward / distance) - found.by_pressure * of_around
                turn = tau / distance  # of the normal
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
                if p > 0:
                    corner = wheels.corner.data
                    corner[0, p - 1, p - 1] -= steep * distance * distance
                    corner[0, p - 1, last] -= traction * distance
                lever = steep * distance
                for node in range(2):
                    at = i if node == 0 else j
                    for kind in range(2):
                        s = (s0 if kind == 0 else s1) if node == 0 else (s2 if kind == 0 else s3)
                        k = 2 * kind
                        columns[at, k, last] += s * fx
                        columns[at, k + 1, last] += s * fy
                        if p > 0:
                            columns[at, k, p - 1] -= s * lever * ny
                            columns[at, k + 1, p - 1] += s * lever * nx
                            wheels.rows[at, p - 1, k] += s * mx
                            wheels.rows[at, p - 1, k + 1] += s * my
                        for other in range(2):
                            block = DIAGONAL
                            if other != node:
                                block = UPPER if node == 0 else LOWER
                            row = block * PER_NODE + k
                            a = s * (s0 if other == 0 else s2)
                            b = s * (s1 if other == 0 else s3)
                            blocks[at, row, 0] += a * xx
                            blocks[at, row, 1] += a * xy
                            blocks[at, row, 2] += b * xx
                            blocks[at, row, 3] += b * xy
                            blocks[at, row + 1, 0] += a * yx
                            blocks[at, row + 1, 1] += a * yy
                            blocks[at, row + 1, 2] += b * yx
                            blocks[at, row + 1, 3] += b * yy
    return laws_hold(contact.friction, touch.memory, is_known)
