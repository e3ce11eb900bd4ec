"""Beams of RCM by their definition; steps of a ring, its whole matrices, and what of its motion is conserved."""

import math

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.beam_pushbelt.rcm import SHAPE, elastic_energy, equations_of_motion, kinematics
from cvt_hpc.models.beam_pushbelt.ring import PER_BEAM, SIZE, Ring, assemble, stored_energy
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


@kernel
def advance(ring: Ring, dt: float, steps: int) -> bool:
    """Advance by steps u+ = u + dt (M + dt^2 / 4 K)^-1 h, q+ = q + dt u+; whether all could be solved."""
    for _ in range(steps):
        assemble(ring, 0.25 * dt * dt)
        if not factor(ring.blocks, SIZE):
            return False
        solve(ring.blocks, ring.columns, SIZE)
        nodes = ring.blocks.rows - 1
        for k in range(ring.q.size):
            ring.u[k] += dt * ring.columns.data[k // PER_BEAM % nodes, k % PER_BEAM, 0]
            ring.q[k] += dt * ring.u[k]
    return True


def energies(beam, q, u):
    """Kinetic and elastic energy of a beam [J]."""
    mass, force = np.empty((8, 8)), np.empty(8)
    equations_of_motion(beam, q, u, 0.0, mass, force)
    return 0.5 * u @ mass @ u, elastic_energy(beam, q)


def equations(ring, stiff=0.0):
    """Matrix M + stiff K (5 k, 5 k) and forces (5 k,) of a ring."""
    assemble(ring, stiff)
    nodes = ring.blocks.data.shape[0] - 1
    matrix = np.zeros((nodes, 5, nodes, 5))
    for i in range(nodes):
        for block, j in ((0, i), (LOWER, i - 1), (UPPER, (i + 1) % nodes)):
            matrix[i, :, j] += ring.blocks.data[i, 5 * block : 5 * block + 5, :5]
    return matrix.reshape(5 * nodes, -1), ring.columns.data[:nodes].ravel()[: 5 * nodes].copy()


def tangent_stiffness(forces, q):
    """Minus the change of forces, by coordinates q (n,), with these, by central differences."""
    steps = 1e-6 * np.eye(q.size)
    matrix = np.stack([(forces(q - step) - forces(q + step)) / 2e-6 for step in steps], 1)
    return 0.5 * (matrix + matrix.T)


def conserved(ring):
    """Momentum along x and y, angular momentum about the origin, total energy."""
    mass, _ = equations(ring)
    q, u = ring.q[:-3], ring.u[:-3]
    along, across, around = np.zeros((3, q.size))
    along[0::5] = across[1::5] = around[2::5] = 1.0
    around[0::5], around[1::5] = -q[1::5], q[0::5]
    return np.array([*(np.stack([along, across, around]) @ mass @ u), stored_energy(ring)])
