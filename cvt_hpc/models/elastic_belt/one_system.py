"""The elastic belt as one system of differential equations, y' = rates(t, y), for general integrators.

Unknowns, in this order, for N stations: w, u, v_element, v_ring, n_element, n_ring (N each), the tilt of the
elements where they tilt (N), the filtered speed of those stations that have a memory, the states of free
pulleys where they are, the driven pulley's speed and position. Layers' speeds are counted from the nominal
belt speed, contents from 1 and the pulley's speed from its nominal one, so that tolerances relative to an
unknown mean its variation. Stations that no groove can hold have no memory, and without friction memory none
has. Forces, contact and laws are those of `rhs`, called and not written again.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import rhs
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.pulleys import pulley_rates
from cvt_hpc.physics.compliance import Contact
from cvt_hpc.steppers.system import System

ROWS = (f.W, f.U, f.V_ELEMENT, f.V_RING, f.N_ELEMENT, f.N_RING)  # of the state, as they follow in y
_VELOCITIES = (f.U, f.V_ELEMENT, f.V_RING)

# Sizes that count alike in each unknown of the default scene, by row of the state: 0.1 mm off the path,
# 0.1 m/s of sliding (u, both layers and filtered), the strain of the rings, and the tilt of elements.
SIZES = (1e-4, 0.1, 0.1, 0.1, 0.1, 1e-3, 1e-3, 1e-2)
SIZE_OF_SPEED, SIZE_OF_POSITION = 1.0, 1e-4  # of a pulley [rad/s], [m]
_SIZE_OF_THRUST = 1e3  # [N]
SIZES_OF_STATES = (SIZE_OF_SPEED, *[SIZE_OF_POSITION] * (f.RATIO_SUM - 1), _SIZE_OF_THRUST, _SIZE_OF_THRUST)


class FlatBelt(NamedTuple):
    """Input of `rates` beside t and y; `state`, and from `force` on all, is work space."""

    belt: Belt
    state: State  # y as fields and scalars, of the last call
    # closed sets of the last call, where the next search starts; they change results by round-off alone
    contacts: tuple[Contact, Contact]
    remembering: np.ndarray  # stations whose filtered speed is an unknown, (M,) int
    # state's scalars that are unknowns beside the driven pulley's speed and position, (K,) int
    loose: np.ndarray
    origin: np.ndarray  # from which the unknowns are counted, (n,)
    start: float  # simulated time at t = 0 [s]
    force: np.ndarray  # axial line forces, or pulls, of `contact_forces`, (N,)
    eps: np.ndarray  # strains, (2, N)
    rate: np.ndarray  # rates, (7 or 8, N)
    moments: np.ndarray  # on the driven pulley, (N,)


def flat_belt(belt: Belt, start: float = 0.0) -> FlatBelt:
    """Constants and work space of a belt's `rates`; `start` is the simulated time at t = 0 [s]."""
    n = belt.cell.size
    remembering = np.flatnonzero((belt.touches > 0.0) & (belt.friction_memory > 0.0))
    origins = {f.V_ELEMENT: belt.belt_speed, f.V_RING: belt.belt_speed, f.N_ELEMENT: 1.0, f.N_RING: 1.0}
    rows = np.repeat([origins.get(row, 0.0) for row in ROWS], n)
    loose = f.FIRST_STATE + np.arange(f.STATES if belt.pulleys.are_free else 0)
    driven = [belt.driving_speed / belt.ratio, 0.0]
    origin = np.concatenate([rows, np.zeros(n * belt.tilts + remembering.size + loose.size), driven])
    fields = np.zeros((len(f.FIELDS) + belt.tilts, n))
    state = State(fields, np.zeros(f.SCALARS))
    work = np.zeros(n), np.zeros((2, n)), np.zeros_like(fields), np.zeros(n)
    return FlatBelt(belt, state, rhs.fresh_contacts(belt), remembering, loose, origin, start, *work)


def pack(flat: FlatBelt, state: State) -> np.ndarray:
    """Vector y of a state; its time is not part of it."""
    scalars = state.scalars[[*flat.loose, f.DRIVEN_SPEED, f.DRIVEN_POSITION]]
    return np.concatenate([state.fields[list(ROWS)].ravel(), carried(flat, state), scalars]) - flat.origin


def carried(flat: FlatBelt, state: State) -> np.ndarray:
    """Unknowns that the elements carry with them, after those of ROWS: tilt, and filtered speeds."""
    filtered = state.fields[f.V_FILTERED, flat.remembering]
    return np.concatenate([*state.fields[f.ELEMENT_TILT :], filtered]) if flat.belt.tilts else filtered


def carried_places(flat: FlatBelt) -> dict[int, np.ndarray]:
    """By row of the state the place in y of each station's unknown of `carried`, (N,); -1: it has none."""
    n = flat.belt.cell.size
    first = len(ROWS) * n
    place = {f.V_FILTERED: np.full(n, -1)}
    if flat.belt.tilts:
        place[f.ELEMENT_TILT] = first + np.arange(n)
        first += n
    place[f.V_FILTERED][flat.remembering] = first + np.arange(flat.remembering.size)
    return place


@kernel
def unpack(flat: FlatBelt, t: float, y: np.ndarray) -> None:
    """Write y into `flat.state`."""
    n, fields, scalars, origin = flat.belt.cell.size, flat.state.fields, flat.state.scalars, flat.origin
    for k, row in enumerate(ROWS):
        for j in range(n):
            fields[row, j] = origin[k * n + j] + y[k * n + j]
    first = len(ROWS) * n
    if flat.belt.tilts:
        for j in range(n):
            fields[f.ELEMENT_TILT, j] = y[first + j]
        first += n
    for k in range(flat.remembering.size):
        fields[f.V_FILTERED, flat.remembering[k]] = y[first + k]
    first += flat.remembering.size
    for k in range(flat.loose.size):
        scalars[flat.loose[k]] = y[first + k]
    scalars[f.TIME] = flat.start + t
    scalars[f.DRIVEN_SPEED], scalars[f.DRIVEN_POSITION] = origin[-2] + y[-2], y[-1]


@kernel
def driven_thrust(belt: Belt, force: np.ndarray) -> float:
    """Axial force of the belt on the driven sheave [N]."""
    total = 0.0
    for k in range(belt.driven.weight.size):
        total += belt.driven.weight[k] * max(force[belt.driven_stations[k]], 0.0)
    return total


@kernel
def driven_moment(belt: Belt, moments: np.ndarray) -> float:
    """Moment of the belt on the driven pulley [N m]."""
    return moments @ belt.on_driven


@kernel
def pulled_by(belt: Belt, force: np.ndarray, moments: np.ndarray) -> np.ndarray:
    """Action of the belt on its pulleys, (8,), driving one first.

    The torque that it takes from the driving one, its moment on the driven one [N m], the axial forces, and
    the tilting forces on the sheaves [N].
    """
    pull = np.zeros(8)
    pull[1] = driven_moment(belt, moments)
    pull[0] = moments.sum() - pull[1]
    for wrap in range(2):
        sheave = belt.driven if wrap else belt.driving
        places = belt.driven_stations if wrap else belt.driving_stations
        for k in range(sheave.weight.size):
            pressed = sheave.weight[k] * max(force[places[k]], 0.0)
            pull[2 + wrap] += pressed
            pull[4 + 2 * wrap] += pressed * sheave.tilt[0, k]
            pull[5 + 2 * wrap] += pressed * sheave.tilt[1, k]
    return pull


@kernel
def free_rates(belt: Belt, state: State, pull: np.ndarray) -> np.ndarray:
    """Rates of free pulleys, (10,), by `pulled_by`: the driven one's speed and position, and STATES."""
    scalars, time = state.scalars, state.scalars[f.TIME]
    row, going = scalars.reshape(1, scalars.size), 1.0 if time >= belt.rise_time else 0.0
    turning = rhs.driving_speed_at(belt, state), scalars[f.DRIVEN_SPEED]
    pulled = pull[0], pull[1], (pull[2], pull[3]), (pull[4], pull[5], pull[6], pull[7])
    given = rhs.load_at(belt, time), belt.ratio, rhs.thrust_at(belt, time), belt.axial_damping
    position = scalars[f.DRIVEN_POSITION]
    found = pulley_rates(belt.pulleys.laws, 0, row, going, turning, position, pulled, given)
    return np.array(found)


@kernel
def rates_under_forces(flat: FlatBelt) -> None:
    """Rates of the fields and moments at the stations, of `flat.state` and of `flat.force` as it stands."""
    belt, state, rate = flat.belt, flat.state, flat.rate
    rhs.strains(belt, state.fields, flat.eps)
    rhs.memory_rates(belt, state, flat.force, rate)
    rhs.content_rates(belt, state, flat.eps, rate)
    rhs.accelerations(belt, state, flat.force, flat.eps, rate, flat.moments)


@kernel
def rates(flat: FlatBelt, t: float, y: np.ndarray, out: np.ndarray) -> bool:
    """Right-hand side: rates of the unknowns y (n,) at time t [s] into `out` (n,).

    Whether the contact has a solution; it has one unless y is not a number.
    """
    belt, state, rate = flat.belt, flat.state, flat.rate
    unpack(flat, t, y)
    if rhs.contact_forces(belt, state, flat.contacts, flat.force) == 0:
        return False
    rates_under_forces(flat)
    n = belt.cell.size
    for j in range(n):
        out[j] = state.fields[f.U, j]
    for k in range(1, len(ROWS)):
        for j in range(n):
            out[k * n + j] = rate[ROWS[k], j]
    first = len(ROWS) * n
    if belt.tilts:
        for j in range(n):
            out[first + j] = rate[f.ELEMENT_TILT, j]
        first += n
    for k in range(flat.remembering.size):
        out[first + k] = rate[f.V_FILTERED, flat.remembering[k]]
    if flat.loose.size > 0:
        found = free_rates(belt, state, pulled_by(belt, flat.force, flat.moments))
        first += flat.remembering.size
        for k in range(flat.loose.size):
            out[first + k] = found[2 + k]
        out[-2], out[-1] = found[0], found[1]
        return True
    moment = driven_moment(belt, flat.moments)
    time = state.scalars[f.TIME]
    out[-2] = (moment - belt.ratio * rhs.load_at(belt, time)) / belt.driven_inertia
    out[-1] = (driven_thrust(belt, flat.force) - rhs.thrust_at(belt, time)) / belt.axial_damping
    return True


def system(flat: FlatBelt) -> System:
    """The belt as general steppers take it.

    Velocities are those unknowns whose rates are forces over masses: u, the layers' speeds and the pulley's.
    Of these u alone is the rate of an unknown.
    """
    is_velocity = np.arange(f.STATES) == f.EXCESS
    moving = _by_row(flat, np.isin(range(len(SIZES)), _VELOCITIES), is_velocity, True, False)
    n = flat.belt.cell.size
    position_of = np.full(moving.size, -1)
    position_of[n : 2 * n] = np.arange(n)
    size = flat.belt.measures
    pulley = SIZE_OF_SPEED / size.time, SIZE_OF_POSITION * size.length
    scale = _by_row(flat, sizes(flat.belt), sizes_of_states(flat.belt), *pulley)
    return System(rates, flat, moving, position_of, scale)


def sizes(belt: Belt) -> np.ndarray:
    """SIZES in the measures of a scene."""
    speed = belt.measures.length / belt.measures.time
    return np.array(SIZES) * [belt.measures.length, *[speed] * 4, 1.0, 1.0, 1.0]


def sizes_of_states(belt: Belt) -> np.ndarray:
    """SIZES_OF_STATES in the measures of a scene."""
    size, positions = belt.measures, f.RATIO_SUM - 1
    factors = [1.0 / size.time, *[size.length] * positions, size.force, size.force]
    return np.array(SIZES_OF_STATES) * factors


def _by_row(flat: FlatBelt, values: np.ndarray, states: np.ndarray, *scalars: float) -> np.ndarray:
    """One value for each unknown, by its row of the state, or its place in STATES."""
    known = (*ROWS, f.ELEMENT_TILT) if flat.belt.tilts else ROWS
    rows = np.repeat([values[row] for row in known], flat.belt.cell.size)
    loose = states[flat.loose - f.FIRST_STATE]
    return np.concatenate([rows, np.full(flat.remembering.size, values[f.V_FILTERED]), loose, scalars])
