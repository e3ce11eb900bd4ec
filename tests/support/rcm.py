"""Chains of RCM elements as whole matrices, and what of their motion is conserved."""

import numpy as np

from cvt_hpc.multibody.rcm_beam import energies
from cvt_hpc.multibody.rcm_chain import assemble
from cvt_hpc.solvers.cyclic_blocks import LOWER, UPPER


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
