"""Elements of RCM by their definition; open beams, their steps, whole matrices, and what of the motion is conserved."""

import math

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.multibody.rcm_beam import SHAPE, RcmBeam, energies, kinematics
from cvt_hpc.multibody.rcm_chain import PER_ELEMENT, SIZE, Chain, assemble, chain_of
from cvt_hpc.solvers.cyclic_blocks import LOWER, UPPER, factor, solve


@kernel
def internal_coordinates(l0: float, q: np.ndarray, internal: np.ndarray) -> None:
    """Coordinates in the frame of the element's centre.

    Parameters
    ----------
    l0 : float
        Length of the element [m].
    q : (8,) array
        Coordinates [m, rad].
    internal : (8,) array
        Place for x, y, phi of the centre, eps, and deflection and slope of the first end and of the second,
        against the tangent at the other end of the half, both positive where the element bends to the left.
    """
    shape = kinematics(l0, q)
    bend = 8 / 9 * (q[3] + q[4]) + 5 / 72 * shape.psi
    slope = (11 / 4 * shape.delta - 4.0 * (q[3] - q[4])) / l0
    half = 0.5 * shape.psi / l0
    internal[4], internal[5] = bend + 0.5 * shape.delta, half + slope
    internal[6], internal[7] = bend - 0.5 * shape.delta, half - slope
    c, s = math.cos(q[2]), math.sin(q[2])
    ahead = 0.5 * l0 * shape.stretch
    internal[0] = q[0] + ahead * c - internal[4] * s
    internal[1] = q[1] + ahead * s + internal[4] * c
    internal[2], internal[3] = q[2] + internal[5], shape.stretch - 1.0


@kernel
def material_point(l0: float, q: np.ndarray, s: float) -> tuple[float, float, float]:
    """Position x, y [m] and angle of the section [rad] of a material point.

    Parameters
    ----------
    l0 : float
        Length of the element [m].
    q : (8,) array
        Coordinates [m, rad].
    s : float
        Where the point lies without load, -l0/2 to l0/2 from the centre [m].
    """
    shape = kinematics(l0, q)
    first = s < 0.0
    side = 1.0 if first else -1.0
    node = 0 if first else 5
    v1, v2 = (q[3], q[4]) if first else (q[4], q[3])
    x = 0.5 - abs(s) / l0
    w = slope = 0.0
    v = (v1, v2, shape.psi, side * shape.delta)
    for j in range(4):
        k0, k1, k2 = SHAPE[j]
        w += v[j] * x * x * (k0 + x * (k1 + x * k2))
        slope += v[j] * x * (2.0 * k0 + x * (3.0 * k1 + x * 4.0 * k2))
    c, sn = math.cos(q[node + 2]), math.sin(q[node + 2])
    along = side * shape.stretch * l0 * x
    return q[node] + along * c - w * sn, q[node + 1] + along * sn + w * c, q[node + 2] + side * slope / l0


def straight_beam(beam: RcmBeam, elements: int) -> Chain:
    """An open beam at rest, straight along x from the origin on."""
    nodes = np.zeros((elements + 1, PER_ELEMENT))
    nodes[:, 0] = beam.length * np.arange(elements + 1)
    return chain_of(beam, 0.0, nodes, elements + 1)


@kernel
def advance(chain: Chain, dt: float, theta: float, steps: int) -> int:
    """Advance by steps of first order: u+ = u + dt (M + theta dt D + theta^2 dt^2 K)^-1 h, q+ = q + dt u+.

    With `theta` 0 this is the symplectic Euler method, half explicit: stable while dt < 2 / omega_max, where
    the axial vibration of an element has omega_max = sqrt(12 EA / line_mass) / length, and its bending
    379 sqrt(EI / line_mass) / length^2 (a free element; 306 in a chain). From 1/2 on neither sets a limit;
    the change of directions under tension still does, at dt < 0.3 length / sqrt(tension / line_mass).
    A vibration that dt does not resolve loses a factor (1 - theta) / theta in amplitude a step: with 1/2 it
    lasts, with 1 it vanishes. One of angular frequency omega that dt does resolve is damped at a rate of
    (theta - 1/2) omega^2 dt, since elastic forces are taken (2 theta - 1) dt ahead.

    Parameters
    ----------
    chain : Chain
        At a state; then at the last one.
    dt : float
        Step [s].
    theta : float
        0 or 1/2 to 1.
    steps : int
        How many.

    Returns
    -------
    int
        Steps done; fewer than `steps` where a matrix was singular or not finite.
    """
    q, u = chain.q, chain.u
    for step in range(steps):
        assemble(chain, max(2.0 * theta - 1.0, 0.0) * dt, (theta * dt) ** 2, theta * dt)
        if not factor(chain.blocks, SIZE):
            return step
        solve(chain.blocks, chain.columns, SIZE)
        for k in range(q.size):
            u[k] += dt * chain.columns.data[k // PER_ELEMENT % (chain.blocks.rows - 1), k % PER_ELEMENT, 0]
            q[k] += dt * u[k]
    return steps


def equations(chain):
    """Mass matrix (n, n) and forces (n,) of a chain."""
    assemble(chain, 0.0, 0.0, 0.0)
    nodes = chain.blocks.data.shape[0] - 1
    matrix = np.zeros((nodes, 5, nodes, 5))
    for i in range(nodes):
        for block, j in ((0, i), (LOWER, i - 1), (UPPER, (i + 1) % nodes)):
            matrix[i, :, j] += chain.blocks.data[i, 5 * block : 5 * block + 5, :5]
    size = chain.q.size - (3 if chain.turn else 0)
    return matrix.reshape(5 * nodes, -1)[:size, :size], chain.columns.data[:nodes].ravel()[:size].copy()


def tangent_stiffness(chain):
    """Minus the change of the forces with the coordinates, by central differences."""
    size = equations(chain)[1].size
    at = chain.q.copy()
    matrix = np.empty((size, size))
    for k in range(size):
        sides = []
        for step in (1e-6, -1e-6):
            chain.q[:] = at
            chain.q[k] += step
            if chain.turn and k < 3:
                chain.q[size + k] += step
            sides.append(equations(chain)[1])
        matrix[:, k] = (sides[1] - sides[0]) / 2e-6
    chain.q[:] = at
    return 0.5 * (matrix + matrix.T)


def conserved(chain):
    """Momentum along x and y, angular momentum about the origin, total energy."""
    mass, _ = equations(chain)
    size = mass.shape[0]
    q, u = chain.q[:size], chain.u[:size]
    along, across, around = np.zeros((3, size))
    along[0::5] = across[1::5] = around[2::5] = 1.0
    around[0::5], around[1::5] = -q[1::5], q[0::5]
    parts = range(0, chain.q.size - 3, 5)
    energy = sum(sum(energies(chain.beam, chain.q[i : i + 8], chain.u[i : i + 8])) for i in parts)
    return np.array([*(np.stack([along, across, around]) @ mass @ u), energy])
