"""The belt with ring layers as one system of differential equations for general integrators.

Unknowns are those of `one_system`, of which the rings as one are left alone and follow from the layers; then
the layers' speeds less the nominal belt speed, (n, N), and their contents less 1 + kappa d_k, (n, N).
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import one_system
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.one_system import ROWS, FlatBelt, sizes
from cvt_hpc.models.elastic_belt.rhs import speed_share_at
from cvt_hpc.models.elastic_belt.rings import (
    FIRST_LAYER,
    Rings,
    layer_rates,
    unite_layers,
    with_layers,
    without_saddle_friction,
)
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers.system import System


class FlatRings(NamedTuple):
    """Input of `rates` beside t and y."""

    flat: FlatBelt  # of the belt whose rings as one do not rub
    rings: Rings  # constants of the n layers
    state: State  # work space: the belt with its layers, of the last call
    one: np.ndarray  # work space: the unknowns of `one_system`, (m,)
    eps: np.ndarray  # work space of `layer_rates`, (n, N)
    rate: np.ndarray  # likewise, (2 n + 1, N)


def flat_rings(belt: Belt, rings: Rings) -> FlatRings:
    """Constants and work space of a belt's `rates`."""
    flat = one_system.flat_belt(without_saddle_friction(belt))
    n, cells = rings.length.size, belt.cell.size
    state = State(np.zeros((FIRST_LAYER + 2 * n, cells)), np.zeros(flat.state.scalars.size))
    work = np.zeros((n, cells)), np.zeros((2 * n + 1, cells))
    return FlatRings(flat, rings, state, np.zeros(flat.origin.size), *work)


def pack(flat: FlatRings, state: State) -> np.ndarray:
    """Vector y of a state, with layers or without, as at the start; its time is not part of it."""
    if state.fields.shape[0] == FIRST_LAYER:
        state = with_layers(state, flat.flat.belt, flat.rings)
    n = flat.rings.length.size
    one = one_system.pack(flat.flat, State(state.fields[:FIRST_LAYER], state.scalars))
    for row in (f.V_RING, f.N_RING):
        first = ROWS.index(row) * state.fields.shape[1]
        one[first : first + state.fields.shape[1]] = 0.0
    layers = state.fields[FIRST_LAYER:].copy()
    layers[:n] -= flat.flat.belt.belt_speed
    return np.concatenate([one, layers.ravel()])


@kernel
def unpack(flat: FlatRings, t: float, y: np.ndarray) -> None:
    """Write y into `flat.state`, and the part of `one_system` into `flat.one`."""
    belt, fields, one = flat.flat.belt, flat.state.fields, flat.one
    cells, n = belt.cell.size, flat.rings.length.size
    copy(y, one)
    for k in range(2 * n):
        for j in range(cells):
            fields[FIRST_LAYER + k, j] = y[one.size + k * cells + j] + (belt.belt_speed if k < n else 0.0)
    for j in range(cells):
        fields[0, j] = one[j]  # the displacement, from which the layers' strains follow
    unite_layers(belt, flat.rings, flat.state, flat.eps)
    for place in range(len(ROWS)):
        row = ROWS[place]
        if row == f.V_RING or row == f.N_RING:
            for j in range(cells):
                one[place * cells + j] = fields[row, j] - flat.flat.origin[place * cells + j]
    one_system.unpack(flat.flat, t, one)
    for row in range(FIRST_LAYER):
        copy(flat.flat.state.fields[row], fields[row])
    copy(flat.flat.state.scalars, flat.state.scalars)


@kernel
def rates(flat: FlatRings, t: float, y: np.ndarray, out: np.ndarray) -> bool:
    """Right-hand side, as `one_system.rates`."""
    unpack(flat, t, y)
    belt, m, cells = flat.flat.belt, flat.one.size, flat.flat.belt.cell.size
    if not one_system.rates(flat.flat, t, flat.one, out[:m]):
        return False
    share = speed_share_at(belt, flat.state.scalars[f.TIME])
    layer_rates(belt, flat.rings, flat.state, flat.eps, share, flat.rate)
    n = flat.rings.length.size
    for place in range(len(ROWS)):
        row = ROWS[place]
        for j in range(cells):
            if row == f.V_RING or row == f.N_RING:
                out[place * cells + j] = 0.0
            elif row == f.V_ELEMENT:
                out[place * cells + j] += flat.rate[2 * n, j]
    for k in range(2 * n):
        for j in range(cells):
            out[m + k * cells + j] = flat.rate[k, j]
    return True


def system(flat: FlatRings) -> System:
    """The belt as general steppers take it."""
    one = one_system.system(flat.flat)
    cells, n = flat.flat.belt.cell.size, flat.rings.length.size
    velocities = one.velocities.copy()
    first = ROWS.index(f.V_RING) * cells
    velocities[first : first + cells] = False
    moving = np.concatenate([velocities, np.repeat([True, False], n * cells)])
    position_of = np.concatenate([one.position_of, np.full(2 * n * cells, -1)])
    size = sizes(flat.flat.belt)
    scale = np.concatenate([one.scale, np.repeat([size[f.V_RING], size[f.N_RING]], n * cells)])
    return System(rates, flat, moving, position_of, scale)
