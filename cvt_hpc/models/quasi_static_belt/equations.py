"""The papers' own way with a belt: what is faster than a limit frequency follows its forces with a lag.

Another model than `rhs`, not another way to solve it (Bullinger et al. 2005, sec. 5.1 and 5.2; Lebrecht et
al. 2004). Forces, contact and laws are the same; inertia is not:

- Transverse: w is a sum of hierarchical cubic B-splines. Splines whose own frequency (stiffness over mass of
  the shape, in the groove if it lies there) is below the limit move by their equations of motion. The others
  follow with the time constant T = 1 / (2 pi limit): T K q' = the force on them that the slow splines'
  inertia leaves, K that of sheaves, tension and bending. They are no part of the radial sliding speed's w_t,
  only of its v w_s.
- Longitudinal: each layer has one speed C as a rigid ring has; local acceleration is dropped, and the speed
  along the path is that of a steady flow, v = C (1 + eps) (eqs 29, 30). The force that is left at a station,
  beyond its share in the acceleration of the whole, shifts material against a drag, d xi' = N,s + f - mean
  (eq. 28), so that strains settle where forces balance; content is conserved. The drag gives the longest wave
  of a layer the time constant T.

What differs from the papers: longitudinal shape functions are those of the mesh's cells, and the papers give
neither the drag's matrix nor the frequencies of single splines, which are chosen as said.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt.belt import (
    DRIVEN_POSITION,
    DRIVEN_SPEED,
    N_ELEMENT,
    TIME,
    V_ELEMENT,
    V_FILTERED,
    Belt,
    Mesh,
    State,
    U,
    W,
)
from cvt_hpc.models.elastic_belt.one_system import (
    SIZE_OF_POSITION,
    SIZE_OF_SPEED,
    SIZES,
    FlatBelt,
    driven_moment,
    driven_thrust,
    flat_belt,
    set_inlets,
)
from cvt_hpc.models.elastic_belt.rhs import (
    accelerations,
    contact_forces,
    load_at,
    memory_rates,
    strains,
)
from cvt_hpc.physics.sheaves import flexibility
from cvt_hpc.physics.splines import Splines, hierarchical_splines
from cvt_hpc.steppers.system import System

COARSE_SPACING = 0.02  # [m]: seven splines along a strand, three for the shortest half wave that is looked at


class QuasiStatic(NamedTuple):
    """What `rates` needs beside t and y.

    Attributes
    ----------
    flat : FlatBelt
        The belt, its layers' dampers taken out, and work space.
    shapes : (N, D + L) array
        The splines at the stations, dynamic ones first.
    moving : (N, D) array
        The dynamic ones of them.
    slow_pull : (D, N) array
        Accelerations of the dynamic splines from accelerations of the stations.
    fast_pull : (L, N) array
        Rates of the lagging splines from accelerations [s]: (T K)^-1 shapes^T mass.
    drag : (2,) array
        Of the material against its layer's mean motion [N s/m^2].
    inertia : (2, N) array
        The layers' mass at the stations over the layer's whole mass [1].
    origin : (n,) array
        What the unknowns are counted from.
    """

    flat: FlatBelt
    shapes: np.ndarray
    moving: np.ndarray
    slow_pull: np.ndarray
    fast_pull: np.ndarray
    drag: np.ndarray
    inertia: np.ndarray
    origin: np.ndarray


def splines_of_belt(grid: Mesh) -> Splines:
    """Splines of a belt: the coarse ones all around, finer ones on the arcs and finest at the arcs' ends.

    None finer than the mesh: with 160 stations 10 mm on the arcs and 5 mm at their ends.
    """
    length = grid.path.path_length
    coarse = round(length / COARSE_SPACING)
    spacing = length / coarse
    levels = int(np.floor(np.log2(spacing / grid.cell.max()))) if spacing > grid.cell.max() else 0
    ends = [grid.position[start] for start in grid.starts]
    arcs = [(ends[0] - spacing, ends[1] + spacing), (ends[2] - spacing, ends[3] + spacing)]
    corners = [(end - 0.75 * spacing, end + 0.75 * spacing) for end in ends]
    return hierarchical_splines(grid.position, length, coarse, [arcs, corners][:levels])


def transverse_stiffness(belt: Belt) -> np.ndarray:
    """Stiffness of the stations at rest in closed grooves, without sliding, (N, N) symmetric [N/m]."""
    n = belt.cell.size
    tangent = np.tan(belt.half_wedge_angle)
    stiffness = np.zeros((n, n))
    for j in range(n):
        for k in range(5):
            stiffness[j, (j + k - 2) % n] -= belt.dual[j] * belt.bending[j, k]
    # what the thrust leaves of tension, all around
    wrap = belt.driven.weight.sum() / belt.driven_radius
    gradient = np.diag(1.0 / belt.cell) @ (np.roll(np.eye(n), 1, axis=1) - np.eye(n))
    stiffness += 2.0 * tangent * belt.thrust / wrap * (gradient.T * belt.cell) @ gradient
    for sheave, first in ((belt.driving, 0), (belt.driven, belt.driven_start)):
        stations = slice(first, first + sheave.weight.size)
        stiffness[stations, stations] += (
            4.0 * tangent**2 * sheave.weight[:, None] * np.linalg.inv(flexibility(sheave))
        )
    return 0.5 * (stiffness + stiffness.T)


def own_frequencies(shapes: np.ndarray, stiffness: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Frequency [Hz] of each shape by itself: its stiffness over its mass."""
    stiff = np.einsum("ji,jk,ki->i", shapes, stiffness, shapes)
    return np.sqrt(stiff / (mass @ shapes**2)) / (2.0 * np.pi)


def quasi_static_belt(belt: Belt, grid: Mesh, limit: float) -> QuasiStatic:
    """Constants and work space.

    Parameters
    ----------
    belt, grid
        The belt and its mesh.
    limit : float
        Limit frequency [Hz].
    """
    lag = 1.0 / (2.0 * np.pi * limit)
    mass, stiffness = belt.mass * belt.dual, transverse_stiffness(belt)
    shapes = splines_of_belt(grid).values
    slow = own_frequencies(shapes, stiffness, mass) < limit
    moving, lagging = shapes[:, slow], shapes[:, ~slow]
    moved = (moving.T * mass) @ moving
    held = lagging.T @ stiffness @ lagging
    longest = 2.0 * np.pi / grid.path.path_length
    layers = np.array([np.full(belt.cell.size, belt.element_mass), belt.ring_mass]) * belt.dual
    flat = flat_belt(belt._replace(element_damping=0.0, ring_damping=0.0))
    nominal = 0.0, belt.belt_speed, 1.0, 0.0, belt.driving_speed / belt.ratio, 0.0
    n, still = belt.cell.size, shapes.shape[1] + int(slow.sum())
    return QuasiStatic(
        flat,
        np.ascontiguousarray(np.hstack([moving, lagging])),
        np.ascontiguousarray(moving),
        np.linalg.solve(moved, moving.T * mass),
        np.linalg.solve(lag * held, lagging.T * mass),
        np.array([belt.element_stiffness, belt.ring_stiffness]) * longest**2 * lag,
        layers / layers.sum(axis=1, keepdims=True),
        np.repeat(nominal, (still, 2, 2 * n, flat.remembering.size, 1, 1)),
    )


def pack(model: QuasiStatic, state: State) -> np.ndarray:
    """Vector y nearest to a state.

    In it follow splines (dynamic, lagging), rates of the dynamic ones, C of both layers, contents (2 N),
    filtered speeds, the driven pulley's speed and position.
    """
    flat = model.flat
    weight = np.sqrt(flat.belt.dual)
    q = np.linalg.lstsq(model.shapes * weight[:, None], weight * state.fields[W], rcond=None)[0]
    eps = np.empty((2, weight.size))
    strains(flat.belt, state.fields, eps)
    speeds = state.fields[V_ELEMENT : V_ELEMENT + 2] / (1.0 + np.roll(eps, 1, axis=1))
    parts = (
        q,
        model.slow_pull @ state.fields[U],
        (speeds * model.inertia).sum(axis=1),
        state.fields[N_ELEMENT : N_ELEMENT + 2].ravel(),
        state.fields[V_FILTERED, flat.remembering],
        state.scalars[[DRIVEN_SPEED, DRIVEN_POSITION]],
    )
    return np.concatenate(parts) - model.origin


@kernel
def unpack(model: QuasiStatic, t: float, y: np.ndarray) -> None:
    """Write y into `model.flat.state`, and its strains into `model.flat.eps`."""
    flat = model.flat
    fields, scalars, belt, eps = flat.state.fields, flat.state.scalars, flat.belt, flat.eps
    n, count, slow = belt.cell.size, model.shapes.shape[1], model.slow_pull.shape[0]
    np.dot(model.shapes, y[:count], fields[W])
    np.dot(model.moving, y[count : count + slow], fields[U])
    first = count + slow
    for layer in range(2):
        for c in range(n):
            fields[N_ELEMENT + layer, c] = 1.0 + y[first + 2 + layer * n + c]
    strains(belt, fields, eps)
    for layer in range(2):
        speed = model.origin[first + layer] + y[first + layer]
        for j in range(n):
            fields[V_ELEMENT + layer, j] = speed * (1.0 + eps[layer, j - 1 if j > 0 else n - 1])
    first += 2 + 2 * n
    for k in range(flat.remembering.size):
        fields[V_FILTERED, flat.remembering[k]] = y[first + k]
    scalars[TIME], scalars[DRIVEN_SPEED], scalars[DRIVEN_POSITION] = t, model.origin[-2] + y[-2], y[-1]
    set_inlets(flat)


@kernel
def rates(model: QuasiStatic, t: float, y: np.ndarray, out: np.ndarray) -> bool:
    """Right-hand side; arguments and result as those of `flat.rates`."""
    flat = model.flat
    belt, state, rate = flat.belt, flat.state, flat.rate
    unpack(model, t, y)
    if contact_forces(belt, state, flat.contacts, flat.force) == 0:
        return False
    memory_rates(belt, state, rate)
    accelerations(belt, state, flat.force, flat.eps, rate, flat.moments)
    n, count, slow = belt.cell.size, model.shapes.shape[1], model.slow_pull.shape[0]
    first = count + slow
    out[:slow] = y[count:first]
    np.dot(model.slow_pull, rate[U], out[count:first])
    rate[U] -= np.dot(model.moving, out[count:first])
    np.dot(model.fast_pull, rate[U], out[slow:count])
    for layer in range(2):
        out[first + layer] = _shift(model, layer, rate[V_ELEMENT + layer], out, first + 2 + layer * n)
    first += 2 + 2 * n
    for k in range(flat.remembering.size):
        out[first + k] = rate[V_FILTERED, flat.remembering[k]]
    out[-2] = (driven_moment(belt, flat.moments) - belt.ratio * load_at(belt, t)) / belt.driven_inertia
    out[-1] = (driven_thrust(belt, flat.force) - belt.thrust) / belt.axial_damping
    return True


@kernel
def _shift(model: QuasiStatic, layer: int, pull: np.ndarray, out: np.ndarray, first: int) -> float:
    """Rates of a layer's content from the accelerations of its stations; returns that of the whole layer."""
    belt = model.flat.belt
    n = belt.cell.size
    whole = 0.0
    for j in range(n):
        whole += model.inertia[layer, j] * pull[j]
    ring = layer == 1
    for c in range(n):
        b = c + 1 if c < n - 1 else 0
        here, ahead = (
            belt.ring_mass[c] if ring else belt.element_mass,
            belt.ring_mass[b] if ring else belt.element_mass,
        )
        change = here * (pull[c] - whole) - ahead * (pull[b] - whole)
        out[first + c] = change / (model.drag[layer] * belt.cell[c])
    return whole


def system(model: QuasiStatic) -> System:
    """The model as general steppers take it; of the velocities the dynamic splines' alone have positions."""
    flat, count, slow = model.flat, model.shapes.shape[1], model.slow_pull.shape[0]
    n, filtered = flat.belt.cell.size, flat.remembering.size
    parts = (count, slow, 2, 2 * n, filtered, 1, 1)
    moving = np.repeat([False, True, True, False, False, True, False], parts)
    position_of = np.full(moving.size, -1)
    position_of[count : count + slow] = np.arange(slow)
    kinds = [
        SIZES[W],
        SIZES[U],
        SIZES[V_ELEMENT],
        SIZES[N_ELEMENT],
        SIZES[V_FILTERED],
        SIZE_OF_SPEED,
        SIZE_OF_POSITION,
    ]
    return System(rates, model, moving, position_of, np.repeat(kinds, parts))
