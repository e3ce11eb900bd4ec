"""Rings and open beams of planar RCM elements: the equations of all elements.

The coordinates lie one after the other, five for each element and three for the last node:
x, y, phi, a1, a2, x, y, phi, ... An element takes eight of them from its node on, so that mass matrices join
to blocks of 5 x 5. In a ring the last three are those of the first node, turned once around.
"""

import math
from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.multibody.rcm_beam import RcmBeam, equations_of_motion
from cvt_hpc.solvers import cyclic_blocks

PER_ELEMENT, PER_NODE = 5, 3
SIZE = cyclic_blocks.block_size(PER_ELEMENT)


class Chain(NamedTuple):
    """Elements that are joined, and their motion.

    Attributes
    ----------
    beam : RcmBeam
        Constants of each of the k elements.
    turn : float
        Angle by which the tangent turns along a ring [rad]; 0 for an open beam.
    q, u : (5 k + 3,) arrays
        Coordinates [m, rad] and their rates.
    blocks, columns : (n + 1, 25) and (n + 1, 5) LaneArrays
        Equations of n nodes, k of a ring, k + 1 of an open beam.
    mass, force : (8, 8) and (8,) arrays
        Those of an element.
    """

    beam: RcmBeam
    turn: float
    q: np.ndarray
    u: np.ndarray
    blocks: LaneArray
    columns: LaneArray
    mass: np.ndarray
    force: np.ndarray


def relaxed_ring(beam: RcmBeam, elements: int) -> Chain:
    """A ring at rest around the origin, counter-clockwise: nodes and quarter points on a circle.

    Parameters
    ----------
    beam : RcmBeam
        Constants of an element. With its curvature that of the circle, hardly any energy is stored.
    elements : int
        At least 3.

    Returns
    -------
    Chain
        The ring.
    """
    step = 2.0 * math.pi / elements
    radius = beam.length / step
    nodes = np.zeros((elements + 1, PER_ELEMENT))
    angle = step * np.arange(elements + 1)
    nodes[:, 0] = radius * np.cos(angle)
    nodes[:, 1] = radius * np.sin(angle)
    nodes[:, 2] = angle + math.pi / 2
    nodes[:, 3:] = math.hypot(radius, 0.25 * beam.length) - radius
    ring = chain_of(beam, 2.0 * math.pi, nodes, elements)
    close(ring)
    return ring


def chain_of(beam: RcmBeam, turn: float, nodes: np.ndarray, blocks: int) -> Chain:
    """A chain at rest, from its nodes (k + 1, 5) with quarter points, with so many blocks of equations."""
    q = nodes.ravel()[: nodes.size - (PER_ELEMENT - PER_NODE)].copy()
    return Chain(
        beam,
        turn,
        q,
        np.zeros_like(q),
        cyclic_blocks.empty_blocks(blocks, PER_ELEMENT),
        cyclic_blocks.empty_columns(blocks, PER_ELEMENT, 1),
        np.zeros((8, 8)),
        np.zeros(8),
    )


@kernel
def close(ring: Chain) -> None:
    """Give the end of a ring the state of its first node, which has been changed."""
    end = ring.q.size - PER_NODE
    for k in range(PER_NODE):
        ring.q[end + k], ring.u[end + k] = ring.q[k], ring.u[k]
    ring.q[end + 2] += ring.turn


@kernel
def assemble(chain: Chain, ahead: float, stiff: float, damp: float) -> None:
    """Set up M u' = h of all elements, in `blocks` and column 0 of `columns`.

    Parameters
    ----------
    chain : Chain
        At a state.
    ahead, stiff, damp : float
        As `equations_of_motion` takes them [s, s^2, s].
    """
    blocks, columns, mass, force = chain.blocks.data, chain.columns.data, chain.mass, chain.force
    nodes = chain.blocks.rows - 1
    blocks[:] = 0.0
    columns[:] = 0.0
    for i in range((chain.q.size - PER_NODE) // PER_ELEMENT):
        first = i * PER_ELEMENT
        q, u = chain.q[first : first + 8], chain.u[first : first + 8]
        equations_of_motion(chain.beam, q, u, ahead, stiff, damp, mass, force)
        j = (i + 1) % nodes
        for r in range(PER_ELEMENT):
            columns[i, r, 0] += force[r]
            for c in range(PER_ELEMENT):
                blocks[i, cyclic_blocks.DIAGONAL * PER_ELEMENT + r, c] += mass[r, c]
        for c in range(PER_NODE):
            columns[j, c, 0] += force[PER_ELEMENT + c]
            for r in range(PER_NODE):
                blocks[j, cyclic_blocks.DIAGONAL * PER_ELEMENT + r, c] += mass[
                    PER_ELEMENT + r, PER_ELEMENT + c
                ]
            for r in range(PER_ELEMENT):
                blocks[i, cyclic_blocks.UPPER * PER_ELEMENT + r, c] = mass[r, PER_ELEMENT + c]
                blocks[j, cyclic_blocks.LOWER * PER_ELEMENT + c, r] = mass[PER_ELEMENT + c, r]
    if chain.turn == 0.0:  # the last node of an open beam has no quarter points
        for c in range(PER_NODE, PER_ELEMENT):
            blocks[nodes - 1, cyclic_blocks.DIAGONAL * PER_ELEMENT + c, c] = 1.0


@kernel
def add_product(chain: Chain, element: int, factor: float, left: np.ndarray, right: np.ndarray) -> None:
    """Add factor left right^T of an element's coordinates, rows (8,), to the matrix in `blocks`."""
    blocks = chain.blocks.data
    i, j = element, (element + 1) % (chain.blocks.rows - 1)
    for r in range(8):
        value = factor * left[r]
        for c in range(8):
            if r < PER_ELEMENT and c < PER_ELEMENT:
                blocks[i, cyclic_blocks.DIAGONAL * PER_ELEMENT + r, c] += value * right[c]
            elif r < PER_ELEMENT:
                blocks[i, cyclic_blocks.UPPER * PER_ELEMENT + r, c - PER_ELEMENT] += value * right[c]
            elif c < PER_ELEMENT:
                blocks[j, cyclic_blocks.LOWER * PER_ELEMENT + r - PER_ELEMENT, c] += value * right[c]
            else:
                blocks[j, cyclic_blocks.DIAGONAL * PER_ELEMENT + r - PER_ELEMENT, c - PER_ELEMENT] += (
                    value * right[c]
                )


@kernel
def add_to_column(columns: LaneArray, column: int, element: int, factor: float, row: np.ndarray) -> None:
    """Add factor times a row (8,) of an element's coordinates to a right-hand side of `columns`."""
    i, j = element, (element + 1) % (columns.rows - 1)
    for r in range(PER_ELEMENT):
        columns.data[i, r, column] += factor * row[r]
    for r in range(PER_NODE):
        columns.data[j, r, column] += factor * row[PER_ELEMENT + r]


@kernel
def along_row(columns: LaneArray, column: int, element: int, row: np.ndarray) -> float:
    """Product of a row (8,) of an element's coordinates with a solution in `columns`."""
    i, j = element, (element + 1) % (columns.rows - 1)
    total = 0.0
    for r in range(PER_ELEMENT):
        total += columns.data[i, r, column] * row[r]
    for r in range(PER_NODE):
        total += columns.data[j, r, column] * row[PER_ELEMENT + r]
    return total
