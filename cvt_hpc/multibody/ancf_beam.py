"""A planar beam in absolute nodal coordinates: constant mass matrix (Berzeri and Shabana 2000).

A node has its position r and the gradient r' = dr/ds by the length s without load: q = (x, y, x', y'). An
element of length l between two nodes is the cubic of Hermite through both, so that positions and gradients
are continuous and the shapes S_i(s) make r' = sum S_i' q_i. There is no shear. Energy and what is lost of it,

    W = int [EA/2 e^2 + EI/2 |r''|^2] ds,    e = (r' . r' - 1) / 2,
    P = int [cA (de/dt)^2 + beta EI (dk/dt)^2 + alpha m (n . dr/dt)^2] ds,    k = r' x r'',

with n across the beam, do not depend on the frame: a rigid motion stores nothing, and loses nothing but what
alpha takes of a motion across the beam. The square |r''|^2 counts the gradient of e as well, which is
negligible where EI / EA is small beside the square of an element's length. The axial damping is that of
Kelvin and Voigt; alpha and beta stand for Rayleigh's, but a belt that runs along itself around a pulley
loses nothing by them.

The integrals are those of Gauss with POINTS points an element, which is exact for all but alpha's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, fma
from cvt_hpc.solvers.cyclic_blocks import DIAGONAL, LOWER, UPPER

PER_NODE = 4
POINTS = 5  # exact to degree 9; e^2 has 8
_X, _W = np.polynomial.legendre.leggauss(POINTS)
PLACES, WEIGHTS = 0.5 + 0.5 * _X, 0.5 * _W


def shapes(place: float | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shapes of an element of length 1 and their first two derivatives, (..., 4) each.

    Parameters
    ----------
    place : float or array
        From 0 at the first node to 1 at the second.

    Returns
    -------
    tuple of arrays
        Of the first node's position and gradient, and the second's. At length l the shapes of gradients are
        l times as large, and a derivative is 1 / l times as large.
    """
    x = np.asarray(place, float)
    value = [1 - 3 * x**2 + 2 * x**3, x - 2 * x**2 + x**3, 3 * x**2 - 2 * x**3, x**3 - x**2]
    slope = [6 * x**2 - 6 * x, 1 - 4 * x + 3 * x**2, 6 * x - 6 * x**2, 3 * x**2 - 2 * x]
    bend = [12 * x - 6, 6 * x - 4, 6 - 12 * x, 6 * x - 2]
    return np.stack(value, -1), np.stack(slope, -1), np.stack(bend, -1)


SHAPES = np.stack(shapes(PLACES), 1)  # at the Gauss points: (point, derivative, shape)
_FIELDS = 6  # of a node at a point: value, slope and bend, each along x and along y


def _tables() -> LaneArray:
    """Shapes at the points, in lanes of the coordinates of a node; the last row tells these apart."""
    tables = LaneArray(POINTS + 1, 2 * _FIELDS, PER_NODE)
    for node in range(2):
        for field in range(_FIELDS):
            derivative, axis = divmod(field, 2)
            lanes = tables.data[:POINTS, _FIELDS * node + field]
            lanes[:, axis::2] = SHAPES[:, derivative, 2 * node : 2 * node + 2]
    tables.data[POINTS, 0, :2] = 1.0  # of the position
    tables.data[POINTS, 1, 2:] = 1.0  # of the gradient
    return tables


class AncfBeam(NamedTuple):
    """Constants of a chain of elements.

    Attributes
    ----------
    lengths : (k,) array
        Of the elements without load [m].
    line_mass : float
        Mass per length without load [kg/m].
    axial_stiffness, bending_stiffness : float
        EA [N], EI [N m^2].
    axial_damping : float
        cA [N s].
    mass_damping, bending_damping : float
        alpha [1/s], beta [s].
    gravity : (float, float)
        Acceleration along x and y [m/s^2].
    tables : LaneArray
        Shapes, as `beam` makes them.
    """

    lengths: np.ndarray
    line_mass: float
    axial_stiffness: float
    bending_stiffness: float
    axial_damping: float
    mass_damping: float
    bending_damping: float
    gravity: tuple[float, float]
    tables: LaneArray


def beam(
    lengths: np.ndarray,
    line_mass: float,
    axial_stiffness: float,
    bending_stiffness: float,
    axial_damping: float = 0.0,
    mass_damping: float = 0.0,
    bending_damping: float = 0.0,
    gravity: tuple[float, float] = (0.0, 0.0),
) -> AncfBeam:
    """Constants of a chain; see `AncfBeam`."""
    return AncfBeam(
        np.array(lengths, float),
        line_mass,
        axial_stiffness,
        bending_stiffness,
        axial_damping,
        mass_damping,
        bending_damping,
        gravity,
        _tables(),
    )


def random_lengths(total: float, elements: int, scatter: float, seed: int) -> np.ndarray:
    """Lengths of elements that differ at random (Cepon and Boltezar 2011, eq. 3).

    Parameters
    ----------
    total : float
        Their sum [m].
    elements : int
        How many.
    scatter : float
        Largest share by which one differs from the mean before all are scaled to the sum, below 1.
    seed : int
        Of the random numbers.

    Returns
    -------
    (elements,) array
        Lengths [m].
    """
    lengths = 1.0 + scatter * np.random.default_rng(seed).uniform(-1.0, 1.0, elements)
    return total * lengths / lengths.sum()


@kernel
def assemble(
    beam: AncfBeam,
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
    tau u. The strain is the mean of those at both ends of a step 2 tau with q in its middle, which makes the
    midpoint rule conserve energy (Simo and Tarnow 1992) and changes others by their order. K leaves out how
    alpha's direction turns.

    Parameters
    ----------
    beam : AncfBeam
        k elements.
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
    n, tables = q.shape[0], beam.tables
    blocks.data[:] = 0.0
    columns.data[:] = 0.0
    of_position, of_gradient = tables[POINTS, 0], tables[POINTS, 1]
    m, ea, ei, ca = beam.line_mass, beam.axial_stiffness, beam.bending_stiffness, beam.axial_damping
    alpha, beta = beam.mass_damping * m, beam.bending_damping * ei
    gx, gy = beam.gravity
    lost = 0.0
    for i in range(beam.lengths.size):
        j = (i + 1) % n
        l0 = beam.lengths[i]
        per = 1.0 / l0
        scale = of_position + l0 * of_gradient
        for p in range(POINTS):
            px, py = per * _at(q, i, j, 0, p, 1, l0), per * _at(q, i, j, 1, p, 1, l0)
            hx, hy = per * per * _at(q, i, j, 0, p, 2, l0), per * per * _at(q, i, j, 1, p, 2, l0)
            vx, vy = _at(u, i, j, 0, p, 0, l0), _at(u, i, j, 1, p, 0, l0)
            ux, uy = per * _at(u, i, j, 0, p, 1, l0), per * _at(u, i, j, 1, p, 1, l0)
            kx, ky = per * per * _at(u, i, j, 0, p, 2, l0), per * per * _at(u, i, j, 1, p, 2, l0)
            ax = (vx - _at(start, i, j, 0, p, 0, l0)) / tau
            ay = (vy - _at(start, i, j, 1, p, 0, l0)) / tau
            strain = 0.5 * (px * px + py * py - 1.0 + tau * tau * (ux * ux + uy * uy))
            strain_rate = px * ux + py * uy
            curvature_rate = ux * hy - uy * hx + px * ky - py * kx
            tension, moment = ea * strain + ca * strain_rate, beta * curvature_rate
            per_gradient, across_rate = 1.0 / (px * px + py * py), px * vy - py * vx
            drag = alpha * across_rate * per_gradient
            # against value, slope and bend of a virtual displacement
            f0x, f0y = m * (ax - gx) - drag * py, m * (ay - gy) + drag * px
            f1x, f1y = tension * px + moment * hy, tension * py - moment * hx
            f2x, f2y = ei * hx - moment * py, ei * hy + moment * px
            weight = WEIGHTS[p] * l0
            lost += weight * (ca * strain_rate * strain_rate + moment * curvature_rate + drag * across_rate)
            heavy, drags = weight * m / tau, weight * alpha * per_gradient
            stretch, stiff = weight * (tau * ea + ca), weight * tau * tension
            turn, lever, bent = weight * beta, weight * tau * moment, weight * tau * ei
            for other in range(2):  # whose speeds change
                first = _FIELDS * other
                sx, sy = scale * tables[p, first], scale * tables[p, first + 1]
                dx, dy = per * scale * tables[p, first + 2], per * scale * tables[p, first + 3]
                bx, by = per * per * scale * tables[p, first + 4], per * per * scale * tables[p, first + 5]
                across = drags * (px * sy - py * sx)
                along = stretch * fma(px + tau * ux, dx, (py + tau * uy) * dy)
                turning = fma(hy + tau * ky, dx, -(hx + tau * kx) * dy)
                turning = turn * fma(px + tau * ux, by, fma(-(py + tau * uy), bx, turning))
                c0x, c0y = fma(-py, across, heavy * sx), fma(px, across, heavy * sy)
                c1x = fma(px, along, fma(stiff, dx, fma(hy, turning, lever * by)))
                c1y = fma(py, along, fma(stiff, dy, fma(-hx, turning, -lever * bx)))
                c2x = fma(bent, bx, fma(-py, turning, -lever * dy))
                c2y = fma(bent, by, fma(px, turning, lever * dx))
                for node in range(2):  # on which the forces act
                    at, block = i, DIAGONAL if node == other else UPPER
                    if node == 1:
                        at, block = j, DIAGONAL if node == other else LOWER
                    for kind in range(2):
                        size = l0 if kind == 1 else 1.0
                        s = size * SHAPES[p, 0, 2 * node + kind]
                        d = per * size * SHAPES[p, 1, 2 * node + kind]
                        b = per * per * size * SHAPES[p, 2, 2 * node + kind]
                        x, row = 2 * kind, block * PER_NODE + 2 * kind
                        blocks[at, row] = fma(s, c0x, fma(d, c1x, fma(b, c2x, blocks[at, row])))
                        blocks[at, row + 1] = fma(s, c0y, fma(d, c1y, fma(b, c2y, blocks[at, row + 1])))
                        if other == 0:
                            columns.data[at, x, column] -= weight * (s * f0x + d * f1x + b * f2x)
                            columns.data[at, x + 1, column] -= weight * (s * f0y + d * f1y + b * f2y)
    return lost


@register_jitable
def _at(nodes, i, j, axis, p, derivative, l0):
    """A coordinate or its derivative by the share of the length, at point p between nodes i and j."""
    positions = SHAPES[p, derivative, 0] * nodes[i, axis] + SHAPES[p, derivative, 2] * nodes[j, axis]
    gradients = SHAPES[p, derivative, 1] * nodes[i, axis + 2] + SHAPES[p, derivative, 3] * nodes[j, axis + 2]
    return positions + l0 * gradients


def at_places(beam: AncfBeam, nodes: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Values at places of each element.

    Parameters
    ----------
    beam : AncfBeam
        k elements.
    nodes : (n, 4) array
        Positions of the nodes, or speeds.
    shape : (m, 4) array
        Shapes of an element of length 1 at m places; their derivatives give those by the share of a length.

    Returns
    -------
    (k, m, 2) array
        Along x and y.
    """
    first = np.arange(beam.lengths.size)
    second, lengths = (first + 1) % len(nodes), beam.lengths[:, None]
    ends = (nodes[first, :2], lengths * nodes[first, 2:], nodes[second, :2], lengths * nodes[second, 2:])
    return shape @ np.stack(ends, 1)


def energies(beam: AncfBeam, q: np.ndarray, u: np.ndarray) -> tuple[float, float, float]:
    """Kinetic, elastic and weight's energy [J], from positions and speeds (n, 4) of the nodes."""
    lengths = beam.lengths[:, None]
    weight = lengths * WEIGHTS
    position, speed = (at_places(beam, nodes, SHAPES[:, 0]) for nodes in (q, u))
    slope, bend = (at_places(beam, q, SHAPES[:, k]) for k in (1, 2))
    strain = 0.5 * ((slope**2).sum(-1) / lengths**2 - 1.0)
    stored = beam.axial_stiffness * strain**2 + beam.bending_stiffness * (bend**2).sum(-1) / lengths**4
    kinetic = 0.5 * beam.line_mass * (weight * (speed**2).sum(-1)).sum()
    fallen = -beam.line_mass * (weight * (position @ np.array(beam.gravity))).sum()
    return float(kinetic), float(0.5 * (weight * stored).sum()), float(fallen)


def tensions(beam: AncfBeam, q: np.ndarray) -> np.ndarray:
    """Elastic force along the belt at the Gauss points [N], (k, POINTS), from positions (n, 4) of the nodes.

    That is EA e |r'|, against the area without load.
    """
    square = (at_places(beam, q, SHAPES[:, 1]) ** 2).sum(-1) / beam.lengths[:, None] ** 2
    return 0.5 * beam.axial_stiffness * (square - 1.0) * np.sqrt(square)
