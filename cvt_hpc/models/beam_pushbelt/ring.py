"""A ring of beams (`rcm`), its equations and its energy.

In the ring the coordinates lie one after the other, five for each beam: x, y, phi, a1, a2, x, y, phi, ... The
last three are those of the first node, turned once around. A beam takes eight from its node on, so that mass
matrices join to blocks of 5 x 5 (`solvers.cyclic_blocks`).
"""

import math
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.beam_pushbelt.rcm import RcmBeam, elastic_energy, equations_of_motion
from cvt_hpc.solvers.cyclic_blocks import DIAGONAL, LOWER, UPPER, block_size, empty_blocks, empty_columns

PER_BEAM, _PER_NODE = 5, 3
SIZE = block_size(PER_BEAM)


class Ring(NamedTuple):
    """A ring of k beams, its motion, and work space of its equations."""

    beam: RcmBeam
    q: np.ndarray  # (5 k + 3,): coordinates [m, rad]
    u: np.ndarray  # their rates
    blocks: LaneArray  # (k + 1, 25): matrix of the equations, of k nodes
    columns: LaneArray  # (k + 1, 5): their right-hand side
    mass: np.ndarray  # (8, 8), (8,): equations of a beam
    force: np.ndarray


def relaxed_ring(beam: RcmBeam, beams: int) -> Ring:
    """A ring at rest around the origin, counter-clockwise: nodes and quarter points on a circle."""
    step = 2.0 * math.pi / beams
    radius, angle = beam.length / step, step * np.arange(beams + 1)
    nodes = np.zeros((beams + 1, PER_BEAM))
    nodes[:, 0], nodes[:, 1] = radius * np.cos(angle), radius * np.sin(angle)
    nodes[:, 2] = angle + math.pi / 2
    nodes[:, 3:] = math.hypot(radius, 0.25 * beam.length) - radius
    q = nodes.ravel()[: PER_BEAM * beams + _PER_NODE].copy()
    blocks, columns = empty_blocks(beams, PER_BEAM), empty_columns(beams, PER_BEAM, 1)
    return Ring(beam, q, np.zeros_like(q), blocks, columns, np.zeros((8, 8)), np.zeros(8))


@kernel
def close(ring: Ring) -> None:
    """Give the end of a ring the state of its first node, which has been changed."""
    for k in range(_PER_NODE):
        ring.q[k - _PER_NODE], ring.u[k - _PER_NODE] = ring.q[k], ring.u[k]
    ring.q[-1] += 2.0 * math.pi


@kernel
def assemble(ring: Ring, stiff: float) -> None:
    """Set up (M + stiff K) u' = h of all beams, in `blocks` and column 0 of `columns`."""
    ring.blocks.data[:] = 0.0
    ring.columns.data[:] = 0.0
    for i in range(ring.blocks.rows - 1):
        q, u = ring.q[PER_BEAM * i : PER_BEAM * i + 8], ring.u[PER_BEAM * i : PER_BEAM * i + 8]
        equations_of_motion(ring.beam, q, u, stiff, ring.mass, ring.force)
        add_matrix(ring.blocks, i, ring.mass)
        add_to_column(ring.columns, 0, i, 1.0, ring.force)


@kernel
def stored_energy(ring: Ring) -> float:
    """Kinetic and elastic energy [J]."""
    total = 0.0
    for i in range(ring.blocks.rows - 1):
        q, u = ring.q[PER_BEAM * i : PER_BEAM * i + 8], ring.u[PER_BEAM * i : PER_BEAM * i + 8]
        equations_of_motion(ring.beam, q, u, 0.0, ring.mass, ring.force)
        for r in range(8):
            for c in range(8):
                total += 0.5 * u[r] * ring.mass[r, c] * u[c]
        total += elastic_energy(ring.beam, q)
    return total


@kernel
def add_matrix(blocks: LaneArray, beam: int, matrix: np.ndarray) -> None:
    """Add an (8, 8) matrix of a beam's coordinates to the ring's."""
    for r in range(8):
        node = beam if r < PER_BEAM else (beam + 1) % (blocks.rows - 1)
        for c in range(8):
            block = DIAGONAL
            if (r < PER_BEAM) != (c < PER_BEAM):
                block = UPPER if r < PER_BEAM else LOWER
            blocks.data[node, block * PER_BEAM + r % PER_BEAM, c % PER_BEAM] += matrix[r, c]


@kernel
def add_to_column(columns: LaneArray, column: int, beam: int, factor: float, row: np.ndarray) -> None:
    """Add factor times a row (8,) of a beam's coordinates to a right-hand side."""
    for r in range(8):
        node = beam if r < PER_BEAM else (beam + 1) % (columns.rows - 1)
        columns.data[node, r % PER_BEAM, column] += factor * row[r]


@kernel
def along_row(columns: LaneArray, column: int, beam: int, row: np.ndarray) -> float:
    """Product of a row (8,) of a beam's coordinates with a solution."""
    total = 0.0
    for r in range(8):
        node = beam if r < PER_BEAM else (beam + 1) % (columns.rows - 1)
        total += columns.data[node, r % PER_BEAM, column] * row[r]
    return total
