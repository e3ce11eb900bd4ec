"""The shapes across the belt, and which of them move by inertia: the split at the limit frequency."""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from cvt_hpc.models.elastic_belt.belt import Belt, Mesh
from cvt_hpc.physics.sheaves import flexibility
from cvt_hpc.physics.splines import Splines, hierarchical_splines

SPLITS = ("free_splines", "held_splines", "modes")


class Basis(NamedTuple):
    """Shapes at the stations."""

    dynamic: np.ndarray  # shape (N, D): shapes that have inertia
    lagging: np.ndarray  # shape (N, L): shapes that follow their forces
    stiffness: np.ndarray  # shape (N, N): of the stations, at rest in closed grooves [N/m]
    # largest angular frequency of the dynamic ones under that stiffness [rad/s]; 0 where there is none
    fastest: float


def split_basis(belt: Belt, grid: Mesh, split: str, limit: float, spacing: float) -> Basis:
    """Shapes of a belt, split at a limit frequency [Hz], one of SPLITS, with coarse splines of a spacing [m].

    `free_splines`: by the frequency of each spline by itself under tension and bending, without grooves: the
    coarse ones move, the refinements lag (Lebrecht et al. 2004, fig. 2.6). `held_splines`: by that frequency
    in the groove, if it lies there. `modes`: the eigenmodes of all splines in closed grooves, of which none
    of the dynamic ones is faster than the limit.
    """
    mass, held = belt.mass * belt.dual, transverse_stiffness(belt)
    shapes = splines_of_belt(grid, spacing).values
    if split == "modes":
        squares, mix = eigh(shapes.T @ held @ shapes, (shapes.T * mass) @ shapes)
        shapes = shapes @ mix
        own = np.sqrt(np.maximum(squares, 0.0)) / (2.0 * np.pi)
    else:
        own = own_frequencies(shapes, free_stiffness(belt) if split == "free_splines" else held, mass)
    slow = own < limit
    moving = shapes[:, slow]
    fastest = 0.0
    if slow.any():
        squares = eigh(moving.T @ held @ moving, (moving.T * mass) @ moving, eigvals_only=True)
        fastest = float(np.sqrt(squares[-1]))
    return Basis(np.ascontiguousarray(moving), np.ascontiguousarray(shapes[:, ~slow]), held, fastest)


def splines_of_belt(grid: Mesh, spacing: float) -> Splines:
    """Splines of a belt: the coarse ones all around, finer ones on the arcs and finest at the arcs' ends.

    None finer than the mesh's mean cell: of 20 mm with 160 stations 10 mm on the arcs and 5 mm at their ends.
    """
    length = grid.path.path_length
    coarse = max(round(length / spacing), 4)
    spacing = length / coarse
    levels = max(int(np.floor(np.log2(spacing * grid.cell.size / length))), 0)
    ends = [grid.position[start] for start in grid.starts]
    arcs = [(ends[0] - spacing, ends[1] + spacing), (ends[2] - spacing, ends[3] + spacing)]
    corners = [(end - 0.75 * spacing, end + 0.75 * spacing) for end in ends]
    return hierarchical_splines(grid.position, length, coarse, [arcs, corners][:levels])


def free_stiffness(belt: Belt) -> np.ndarray:
    """Stiffness of the stations by bending and by the tension that the thrust leaves, (N, N) [N/m]."""
    n = belt.cell.size
    stiffness = np.zeros((n, n))
    for j in range(n):
        for k in range(5):
            stiffness[j, (j + k - 2) % n] -= belt.dual[j] * belt.bending[j, k]
    wrap = (belt.cell * belt.curvature * belt.on_driven).sum()
    gradient = np.diag(1.0 / belt.cell) @ (np.roll(np.eye(n), 1, axis=1) - np.eye(n))
    tension = 2.0 * np.tan(belt.half_wedge_angle) * belt.thrust / wrap
    stiffness += tension * (gradient.T * belt.cell) @ gradient
    return 0.5 * (stiffness + stiffness.T)


def transverse_stiffness(belt: Belt) -> np.ndarray:
    """Stiffness of the stations at rest in closed grooves, without sliding, (N, N) symmetric [N/m]."""
    stiffness = free_stiffness(belt)
    tangent = np.tan(belt.half_wedge_angle)
    for sheave, zone in ((belt.driving, belt.driving_stations), (belt.driven, belt.driven_stations)):
        on_arc = sheave.rise == 0.0
        stations, closed = zone[on_arc], np.ix_(on_arc, on_arc)
        held = sheave.weight[on_arc, None] * np.linalg.inv(flexibility(sheave)[closed])
        stiffness[np.ix_(stations, stations)] += 4.0 * tangent**2 * held
    return 0.5 * (stiffness + stiffness.T)


def own_frequencies(shapes: np.ndarray, stiffness: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Frequency [Hz] of each shape by itself: its stiffness over its mass."""
    stiff = np.einsum("ji,jk,ki->i", shapes, stiffness, shapes)
    return np.sqrt(stiff / (mass @ shapes**2)) / (2.0 * np.pi)
