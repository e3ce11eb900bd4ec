"""Ring layers in their plain form: the elastic belt whose rings are n bands that slide on each other.

All layers follow the path with the elements; each has a speed v_k and a content n_k of its own:

    stretch   eps_k = (1 + kappa (w + d_k)) / n_k - 1,   T_k = EA_k eps_k
    content   n_k,t + (v_k / (1 + eps_k)),s = 0
    speed     m_k (v_k,t + v_k v_k,s) = T_k,s + a_k q_k - b_k+1 q_k+1

with q_k the friction at the layer's inner surface, q_1 that of the saddle (Bullinger et al. 2005, eqs 43-48).
A layer that turns about a pulley with v_k has the speed v_k (1 + c kappa) / (1 + d_k kappa) at a surface c
above the pitch line: these are the factors a of the layer above a surface and b of the one below, and by
virtual power also the shares of its friction that act along their neutral lines. Of elements d = 0.

For the belt's other parts the rings are one: with the mean strain, whose tension is the sum of all, and the
mean speed. Rows V_RING and N_RING of a state have these. The layers' own rows follow `FIELDS`: n speeds, then
n contents less 1 + kappa d_k.

For general integrators the belt with ring layers is one system, too. Its unknowns are those of `one_system`,
of which the rings as one are left alone and follow from the layers; then the layers' speeds less the nominal
belt speed, (n, N), and their contents less 1 + kappa d_k, (n, N).
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import one_system
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.belt_settings import DEFAULTS, layer_count
from cvt_hpc.models.elastic_belt.lane_forces import LEAST_SHARE_OF_WIDTH
from cvt_hpc.models.elastic_belt.one_system import ROWS, FlatBelt, sizes
from cvt_hpc.models.elastic_belt.rhs import lengthening, speed_share_at
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.layers import ring_friction, stack_forces
from cvt_hpc.solvers.arrays import copy
from cvt_hpc.steppers.system import System

FIRST_LAYER = len(f.FIELDS)  # row of a state with the first layer's speed


class Rings(NamedTuple):
    """Constants of n layers, in SI units; each has an n-th of the rings' mass, stiffness and damping."""

    mass: float  # inertia along the path per length [kg/m]
    relief: float  # tension that the layer's weight bears at the nominal speed [N]
    stiffness: float  # EA [N]
    damping: float  # [N s]
    offset: np.ndarray  # neutral lines over the pitch line, d_k, (n,) [m]
    surface: np.ndarray  # surfaces over the pitch line: saddle, between layers, ears, (n + 1,) [m]
    kinetic: np.ndarray  # kinetic friction coefficients of the surfaces, (n + 1,)
    static_excess: float  # static over kinetic friction less 1
    stribeck_speed: float  # of that fall [m/s]
    friction_speed: float  # of the regularisation [m/s]
    length: np.ndarray  # of each layer without tension, (n,) [m]


def ring_constants(parameters: Parameters, belt: Belt) -> Rings:
    """Constants of the layers of one run, by its resolved parameters [SI] and the belt's constants."""
    p = DEFAULTS | dict(parameters)
    n, thickness = layer_count(p), p["layer_thickness"]
    offset = p["ring_offset"] + thickness * (np.arange(n) - 0.5 * (n - 1))
    surface = np.append(offset - 0.5 * thickness, offset[-1] + 0.5 * thickness)
    kinetic = np.array([p["ring_friction"], *[p["layer_friction"]] * (n - 1), p["ring_friction"]])
    # the path at each neutral line is longer by the angle that it turns about
    fitting = (belt.cell.sum() + (belt.cell @ belt.curvature) * offset) / (
        1.0 + p["reference_tension"] / p["ring_stiffness"]
    )
    return Rings(
        mass=p["longitudinal_mass"] * p["ring_mass"] / n,
        relief=p["ring_mass"] / n * belt.belt_speed**2,
        stiffness=p["ring_stiffness"] / n,
        damping=p["ring_damping"] / n,
        offset=offset,
        surface=surface,
        kinetic=kinetic,
        static_excess=p["ring_static_factor"] - 1.0,
        stribeck_speed=p["ring_stribeck_speed"],
        friction_speed=p["ring_friction_speed"],
        length=fitting * np.array(p["layer_tolerance"] or [1.0] * n),
    )


def without_saddle_friction(belt: Belt) -> Belt:
    """The belt whose rings as one do not rub: their layers do."""
    return belt._replace(ring_friction=0.0)


def with_layers(state: State, belt: Belt, rings: Rings) -> State:
    """A state whose rings are one, with layers that have its speed and are strained alike all around."""
    n = rings.length.size
    fields = np.zeros((FIRST_LAYER + 2 * n, belt.cell.size))
    fields[:FIRST_LAYER] = state.fields
    w = state.fields[f.W]
    bent = belt.curvature * 0.5 * (w + np.roll(w, -1))
    for k in range(n):
        stretched = 1.0 + bent + belt.curvature * rings.offset[k]
        content = stretched * rings.length[k] / (belt.cell @ stretched)
        fields[FIRST_LAYER + k] = state.fields[f.V_RING]
        fields[FIRST_LAYER + n + k] = content - 1.0 - belt.curvature * rings.offset[k]
    found = State(fields, state.scalars.copy())
    unite_layers(belt, rings, found, np.empty((n, belt.cell.size)))
    return found


@kernel
def unite_layers(belt: Belt, rings: Rings, state: State, eps: np.ndarray) -> None:
    """Strains of the layers into `eps` (n, N), and of the rings as one into their rows of the state."""
    fields, n = state.fields, rings.length.size
    cells = belt.cell.size
    for c in range(cells):
        kappa = belt.curvature[c]
        bent = kappa * 0.5 * (fields[f.W, c] + fields[f.W, (c + 1) % cells])
        strain = speed = 0.0
        for k in range(n):
            more = fields[FIRST_LAYER + n + k, c]
            eps[k, c] = (bent - more) / (1.0 + kappa * rings.offset[k] + more)
            strain += eps[k, c]
            speed += fields[FIRST_LAYER + k, c]
        fields[f.V_RING, c] = speed / n
        fields[f.N_RING, c] = (1.0 + bent + kappa * belt.ring_offset) / (1.0 + strain / n)


@kernel
def surface_friction(
    belt: Belt,
    rings: Rings,
    state: State,
    eps: np.ndarray,
    share: float,
    j: int,
    normal: np.ndarray,
    sliding: np.ndarray,
) -> None:
    """Normal line forces [N/m] and sliding speeds [m/s] of the surfaces at station j, (n + 1,) each.

    Sliding is the speed of the body below a surface against the body above; `share` is the belt's speed over
    its nominal one.
    """
    n, kappa = rings.length.size, belt.arc_curvature[j]
    a = j - 1 if j > 0 else belt.cell.size - 1
    left, right = belt.cell[a] * belt.curvature[a], belt.cell[j] * belt.curvature[j]
    turn = 0.5 * (left + right) / belt.dual[j]
    inward = np.empty(n)
    for k in range(n):
        tension = 0.5 * rings.stiffness * (left * eps[k, a] + right * eps[k, j]) / belt.dual[j]
        weight = rings.relief * share * share * (1.0 + rings.offset[k] * turn)
        inward[k] = tension - weight * turn
    stack_forces(inward, normal)
    below = element = state.fields[f.V_ELEMENT, j]
    for k in range(n + 1):
        above = state.fields[FIRST_LAYER + k, j] / (1.0 + rings.offset[k] * kappa) if k < n else element
        sliding[k] = (1.0 + rings.surface[k] * kappa) * (below - above)
        below = above


@kernel
def layer_rates(
    belt: Belt, rings: Rings, state: State, eps: np.ndarray, share: float, rate: np.ndarray
) -> None:
    """Rates of the layers' speeds and contents, and of the elements' speed by the surfaces' friction.

    `state` is with layers, `eps` (n, N) are their strains, `share` is the belt speed over its nominal one.
    Into `rate` (2 n + 1, N) go the rates of speeds [m/s^2] and contents [1/s], then the sum to be added for
    the elements [m/s^2].
    """
    n, cells = rings.length.size, belt.cell.size
    normal, sliding = np.empty(n + 1), np.empty(n + 1)
    per_stribeck, per_width = 1.0 / rings.stribeck_speed, 1.0 / rings.friction_speed
    least = LEAST_SHARE_OF_WIDTH * rings.friction_speed
    u, v = state.fields[f.U], state.fields[FIRST_LAYER : FIRST_LAYER + n]
    for j in range(cells):
        a, b = j - 1 if j > 0 else cells - 1, j + 1 if j < cells - 1 else 0
        kappa = belt.arc_curvature[j]
        weighted = 0.5 * (belt.cell[a] * belt.curvature[a] + belt.cell[j] * belt.curvature[j]) / belt.dual[j]
        for k in range(n):
            left = rings.stiffness * eps[k, a] + rings.damping * lengthening(belt, v[k], u, a)
            right = rings.stiffness * eps[k, j] + rings.damping * lengthening(belt, v[k], u, j)
            rate[k, j] = (right - left) / belt.dual[j]
        rate[2 * n, j] = 0.0
        if belt.arc_curvature[j] > 0.0:
            surface_friction(belt, rings, state, eps, share, j, normal, sliding)
            for k in range(n + 1):
                level, excess = rings.kinetic[k], rings.static_excess
                secant, _ = ring_friction(sliding[k], level, True, excess, per_stribeck, per_width, least)
                drag = (1.0 + rings.surface[k] * kappa) * normal[k] * secant * sliding[k]
                if k < n:
                    rate[k, j] += drag / (1.0 + rings.offset[k] * kappa)
                else:
                    rate[2 * n, j] += drag / belt.element_mass
                if k > 0:
                    rate[k - 1, j] -= drag / (1.0 + rings.offset[k - 1] * kappa)
                else:
                    rate[2 * n, j] -= drag / belt.element_mass
        for k in range(n):
            rate[k, j] /= rings.mass * (1.0 + rings.offset[k] * weighted)
            rate[k, j] -= v[k, j] * (v[k, j] - v[k, a]) / belt.cell[a]
            inflow = v[k, j] / (1.0 + eps[k, a if v[k, j] >= 0.0 else j])
            outflow = v[k, b] / (1.0 + eps[k, j if v[k, b] >= 0.0 else b])
            rate[n + k, j] = (inflow - outflow) / belt.cell[j]


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
