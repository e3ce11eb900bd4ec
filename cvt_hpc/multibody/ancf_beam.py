"""A planar beam in absolute nodal coordinates: constant mass matrix (Berzeri and Shabana 2000).

A node has its position r and the gradient r' = dr/ds by the length s without load: q = (x, y, x', y'). An
element of length l between two nodes is the cubic of Hermite through both, so that positions and gradients
are continuous and the shapes S_i(s) make r' = sum S_i' q_i. There is no shear. Energy and what is lost of it,

    W = int [EA/2 e^2 + EI/2 |r''|^2] ds,    e = (r' . r' - 1) / 2,
    P = int [cA (de/dt)^2 + beta EI (dk/dt)^2 + alpha m (n . dr/dt)^2] ds,    k ~ r' x r'',

with n across the beam, do not depend on the frame: a rigid motion stores nothing, and loses nothing but what
alpha takes of a motion across the beam. The square |r''|^2 counts the gradient of e as well, which is
negligible where EI / EA is small beside the square of an element's length. The axial damping is that of
Kelvin and Voigt; alpha and beta stand for Rayleigh's, but a belt that runs along itself around a pulley
loses nothing by them.

The curvature k is the line nearest to r' x r'', through its values at two Gauss points, as the element bends
by lines; alpha's integral is that of these points. All other integrals are exact.

A cubic that bends unevenly cannot keep e even: e waves along an element that is as long as a bend. A strain
of less degree (Gerstmayr and Irschik 2008) smooths the forces, but not the speeds along the belt, on which
friction acts; `docs/guide/results_drive.md` describes the consequences.
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

# Coordinates of a node: its position, and the slope of the line there, each by axes
X, Y = range(2)
AXES = 2
PER_NODE = 2 * AXES
POINTS = 5  # exact to degree 9
_X, _W = np.polynomial.legendre.leggauss(POINTS)
PLACES, WEIGHTS = 0.5 + 0.5 * _X, 0.5 * _W


def shapes(place: float | np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Shapes of an element of length 1 and their first two derivatives, (..., 4), at places from 0 to 1.

    Of the first node's position and gradient, and the second's. At length l the shapes of gradients are l
    times as large, and a derivative is 1 / l times as large.
    """
    x = np.asarray(place, float)
    value = [1 - 3 * x**2 + 2 * x**3, x - 2 * x**2 + x**3, 3 * x**2 - 2 * x**3, x**3 - x**2]
    slope = [6 * x**2 - 6 * x, 1 - 4 * x + 3 * x**2, 6 * x - 6 * x**2, 3 * x**2 - 2 * x]
    bend = [12 * x - 6, 6 * x - 4, 6 - 12 * x, 6 * x - 2]
    return np.stack(value, -1), np.stack(slope, -1), np.stack(bend, -1)


SHAPES = np.stack(shapes(PLACES), 1)  # at the Gauss points: (point, derivative, shape)


class AncfBeam(NamedTuple):
    """Constants of a chain of k elements."""

    lengths: np.ndarray  # of the elements without load, (k,) [m]
    line_mass: float  # mass per length without load [kg/m]
    axial_stiffness: float  # EA [N]
    bending_stiffness: float  # EI [N m^2]
    axial_damping: float  # cA [N s]
    mass_damping: float  # alpha [1/s]
    bending_damping: float  # beta [s]
    gravity: tuple[float, float]  # acceleration along x and y [m/s^2]


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
    )


def random_lengths(total: float, elements: int, scatter: float, seed: int) -> np.ndarray:
    """Lengths (elements,) [m] that differ at random, of the sum `total` [m] (Cepon and Boltezar 2011, eq. 3).

    `scatter` is the largest share, below 1, by which one differs from the mean before all are scaled to the
    sum.
    """
    lengths = 1.0 + scatter * np.random.default_rng(seed).uniform(-1.0, 1.0, elements)
    return total * lengths / lengths.sum()


def at_places(beam: AncfBeam, nodes: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Values at m places of each of k elements, along x and y, (k, m, 2), from those of the nodes (n, 4).

    They are positions or speeds. `shape` (m, 4) are the shapes of an element of length 1 at these places;
    their derivatives give those by the share of a length.
    """
    first = np.arange(beam.lengths.size)
    second, lengths = (first + 1) % len(nodes), beam.lengths[:, None]
    ends = (nodes[first, :2], lengths * nodes[first, 2:], nodes[second, :2], lengths * nodes[second, 2:])
    return shape @ np.stack(ends, 1)


@register_jitable
def tension_of(axial_stiffness, strain):
    """Force along the belt against the area without load [N], EA e |r'|."""
    return axial_stiffness * strain * np.sqrt(1.0 + 2.0 * strain)


def strains(beam: AncfBeam, q: np.ndarray) -> np.ndarray:
    """Axial strain at the Gauss points, (k, POINTS), from positions (n, 4) of the nodes."""
    square = (at_places(beam, q, SHAPES[:, 1]) ** 2).sum(-1) / beam.lengths[:, None] ** 2
    return 0.5 * (square - 1.0)


def energies(beam: AncfBeam, q: np.ndarray, u: np.ndarray) -> tuple[float, float, float]:
    """Kinetic, elastic and weight's energy [J], from positions and speeds (n, 4) of the nodes."""
    lengths = beam.lengths[:, None]
    weight = lengths * WEIGHTS
    position, speed = (at_places(beam, nodes, SHAPES[:, 0]) for nodes in (q, u))
    bend = at_places(beam, q, SHAPES[:, 2])
    stored = beam.axial_stiffness * strains(beam, q) ** 2
    stored += beam.bending_stiffness * (bend**2).sum(-1) / lengths**4
    kinetic = 0.5 * beam.line_mass * (weight * (speed**2).sum(-1)).sum()
    fallen = -beam.line_mass * (weight * (position @ np.array(beam.gravity))).sum()
    return float(kinetic), float(0.5 * (weight * stored).sum()), float(fallen)


def tensions(beam: AncfBeam, q: np.ndarray) -> np.ndarray:
    """Elastic force along the belt at the Gauss points, (k, POINTS) [N], from positions (n, 4) of the nodes.

    That is EA e |r'|, against the area without load.
    """
    return tension_of(beam.axial_stiffness, strains(beam, q))
