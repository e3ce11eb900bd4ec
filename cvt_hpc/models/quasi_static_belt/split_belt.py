"""The quasi-static belt as its step has it: shapes, constants, motion, work space.

A limit frequency splits the shapes across the belt into those that move by inertia and those that lag.
"""

from typing import NamedTuple

import numpy as np
from scipy.linalg import eigh

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, Mesh, State
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts, strains
from cvt_hpc.models.quasi_static_belt import fields as q
from cvt_hpc.models.quasi_static_belt.coupled import Chain, chain
from cvt_hpc.physics.compliance import Contact
from cvt_hpc.physics.sheaves import flexibility
from cvt_hpc.physics.splines import Splines, hierarchical_splines


class Basis(NamedTuple):
    """Shapes at the stations."""

    dynamic: np.ndarray  # shape (N, D): shapes that have inertia
    lagging: np.ndarray  # shape (N, L): shapes that follow their forces
    stiffness: np.ndarray  # shape (N, N): of the stations, at rest in closed grooves [N/m]
    # largest angular frequency of the dynamic ones under that stiffness [rad/s]; 0 where there is none
    fastest: float


def split_basis(belt: Belt, grid: Mesh, split: str, limit: float, spacing: float) -> Basis:
    """Shapes of a belt, split at a limit frequency [Hz] by `split`, with coarse splines of a spacing [m].

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
        own = own_frequencies(shapes, _free_stiffness(belt) if split == "free_splines" else held, mass)
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


def _free_stiffness(belt: Belt) -> np.ndarray:
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
    stiffness = _free_stiffness(belt)
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


class SplitBelt(NamedTuple):
    """Constants of a run and its step."""

    belt: Belt  # as of the elastic belt
    shapes: np.ndarray  # shape (N, D + L): dynamic shapes first
    dynamic: int  # their number D
    step: float  # [s]
    # shape (D + L, D + L): M / dt of the dynamic ones, dt / (1 - exp(-dt / T)) K of the lagging ones [N s/m]
    inertia: np.ndarray
    # shape (D + L, D + L): half of the gyroscopic matrix per belt speed, antisymmetric [N s^2/m^2]
    gyration: np.ndarray
    steady_flow: bool  # each layer has one speed
    # shape (2,): of the material against its layer's mean motion, with the steady flow [N s/m^2]
    drag: np.ndarray
    share: np.ndarray  # shape (2, N): the layers' mass at the stations over the layer's whole mass [1]


class Motion(NamedTuple):
    """State of a run."""

    state: State  # of the elastic belt; its u is the sliding part
    q: np.ndarray  # coordinates, (D + L,) [m]
    p: np.ndarray  # their rates, (D + L,) [m/s]
    contacts: tuple[Contact, Contact]  # closed sets
    force: np.ndarray  # axial line forces of `state`, (N,) [N/m]
    eps: np.ndarray  # strains of `state`, (2, N)
    counts: np.ndarray  # steps, steps done again, solves of the contact, (3,)


class Work(NamedTuple):
    """Work space: at the stations (STATIONS, N), rates (7, N), moments (N,); the layers; the dense system."""

    stations: np.ndarray
    rate: np.ndarray
    moments: np.ndarray
    layers: Chain
    matrix: np.ndarray
    row: np.ndarray
    found: np.ndarray
    vector: np.ndarray
    closing: np.ndarray


def lag_drag(belt: Belt, grid: Mesh, lag: float) -> np.ndarray:
    """Drag (2,) [N s/m^2] by which the longest wave of a layer settles with a time constant [s]."""
    longest = 2.0 * np.pi / grid.path.path_length
    return np.array([belt.element_stiffness, belt.ring_stiffness]) * longest**2 * lag


def layer_shares(belt: Belt) -> np.ndarray:
    """The layers' mass at the stations over the layer's whole mass, (2, N) [1]."""
    layers = np.array([np.full(belt.cell.size, belt.element_mass), belt.ring_mass]) * belt.dual
    return layers / layers.sum(axis=1, keepdims=True)


def split_belt(
    belt: Belt, grid: Mesh, basis: Basis, limit: float, longitudinal: str, step: float
) -> SplitBelt:
    """Constants of a run, with a limit frequency [Hz], a step [s] and the job's parameter `longitudinal`."""
    lag = 1.0 / (2.0 * np.pi * limit)
    shapes = np.ascontiguousarray(np.hstack([basis.dynamic, basis.lagging]))
    count, slow = shapes.shape[1], basis.dynamic.shape[1]
    inertia = np.zeros((count, count))
    inertia[:slow, :slow] = (basis.dynamic.T * (belt.mass * belt.dual)) @ basis.dynamic / step
    held = basis.lagging.T @ basis.stiffness @ basis.lagging
    inertia[slow:, slow:] = step / -np.expm1(-step / lag) * held
    difference = np.roll(np.eye(belt.cell.size), 1, axis=1) - np.roll(np.eye(belt.cell.size), -1, axis=1)
    # 2 m v u_s, a difference of the neighbours over both cells, times the length of the station: half of it
    gyration = 0.5 * belt.mass * shapes.T @ difference @ shapes
    gyration = np.ascontiguousarray(0.5 * (gyration - gyration.T))
    flow = longitudinal == "steady_flow", lag_drag(belt, grid, lag), layer_shares(belt)
    return SplitBelt(belt, shapes, slow, step, inertia, gyration, *flow)


def work_space(model: SplitBelt) -> Work:
    """Work space of a step."""
    n, count = model.belt.cell.size, model.shapes.shape[1]
    size = count + 2
    at_stations = np.zeros((q.STATIONS, n)), np.zeros((7, n)), np.zeros(n)
    matrix = np.zeros((size, 8 * ((size + 1 + 7) // 8)))
    vectors = np.zeros(count), np.zeros(size), np.zeros(count), np.zeros(8 * ((count + 3 + 7) // 8))
    return Work(*at_stations, chain(n, count), matrix, *vectors)


def motion(model: SplitBelt, state: State) -> Motion:
    """Motion nearest to a state: its displacement by the shapes, its speeds by the dynamic ones."""
    belt, weight = model.belt, np.sqrt(model.belt.dual)
    fields = state.fields.copy()
    q = np.linalg.lstsq(model.shapes * weight[:, None], weight * fields[f.W], rcond=None)[0]
    p, slow = np.zeros_like(q), model.dynamic
    if slow:
        p[:slow] = np.linalg.lstsq(
            model.shapes[:, :slow] * weight[:, None], weight * fields[f.U], rcond=None
        )[0]
    fields[f.W], fields[f.U] = model.shapes @ q, model.shapes @ p
    found = State(fields, state.scalars.copy())
    n = belt.cell.size
    moved = Motion(
        found, q, p, fresh_contacts(belt), np.zeros(n), np.zeros((2, n)), np.zeros(3, dtype=np.int64)
    )
    refresh(model, moved)
    return moved


@kernel
def refresh(model: SplitBelt, moved: Motion) -> bool:
    """Strains and contact forces of the present state; whether the contact has a solution."""
    strains(model.belt, moved.state.fields, moved.eps)
    solves = contact_forces(model.belt, moved.state, moved.contacts, moved.force)
    moved.counts[2] += solves
    return solves > 0
