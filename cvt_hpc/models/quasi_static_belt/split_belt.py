"""The quasi-static belt as its step has it: constants, motion, work space.

Rows of `Work.stations` are named here: the values of a step at each station.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.belt import Belt, Mesh, State
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts, strains
from cvt_hpc.models.quasi_static_belt import fields as q
from cvt_hpc.models.quasi_static_belt.basis import Basis
from cvt_hpc.models.quasi_static_belt.coupled import Chain, chain
from cvt_hpc.physics.compliance import Contact


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
    return SplitBelt(
        belt,
        shapes,
        slow,
        step,
        inertia,
        np.ascontiguousarray(0.5 * (gyration - gyration.T)),
        longitudinal == "steady_flow",
        lag_drag(belt, grid, lag),
        layer_shares(belt),
    )


def work_space(model: SplitBelt) -> Work:
    """Work space of a step."""
    n, size = model.belt.cell.size, model.shapes.shape[1] + 2
    width = 8 * ((size + 1 + 7) // 8)
    return Work(
        np.zeros((q.STATIONS, n)),
        np.zeros((7, n)),
        np.zeros(n),
        chain(n, model.shapes.shape[1]),
        np.zeros((size, width)),
        np.zeros(model.shapes.shape[1]),
        np.zeros(size),
        np.zeros(model.shapes.shape[1]),
        np.zeros(8 * ((model.shapes.shape[1] + 3 + 7) // 8)),
    )


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
