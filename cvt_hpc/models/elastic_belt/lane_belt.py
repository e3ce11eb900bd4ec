"""The elastic belt for several runs at once: constants and state of all lanes, in the order that steps read.

Runs of one batch share the mesh, the friction law's kind and the course of time; all else is each lane's own.
Velocities of the layers are kept as deviations from the belt speed that belongs to the driving pulley's
present speed, contents as deviations from the reference path's, so that single precision does not lose
strains and sliding speeds in them.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import DTypeLike

from cvt_hpc.lanes import LaneArray, split
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.bending import bending_bands, bending_load, squared_curvature
from cvt_hpc.models.elastic_belt.rhs import contact_forces, fresh_contacts, speed_share_at
from cvt_hpc.physics.compliance import Contact, lane_contact
from cvt_hpc.physics.friction import FrictionLaw
from cvt_hpc.physics.moving_discs import settle
from cvt_hpc.physics.sheaves import disc_factor
from cvt_hpc.variator.course import SPEED

LEAST_ROWS = 3  # of a part of a run: bending reaches two stations


class LaneBelt(NamedTuple):
    """Constants of W runs on one mesh of N stations; arrays of one number a station are shared.

    What is not described is as in `Belt`; `bending` and `bending_load` are those of a bending stiffness of 1
    N m^2. Of one run in linked parts (`parted`), arrays of stations are LaneArrays, of one field or of five.
    """

    cell: np.ndarray
    dual: np.ndarray
    per_cell: np.ndarray
    per_dual: np.ndarray
    per_span: np.ndarray
    curvature: np.ndarray
    arc_curvature: np.ndarray
    touches: np.ndarray
    on_driven: np.ndarray
    rise: np.ndarray
    lean: np.ndarray
    lean_rate: np.ndarray
    upright: np.ndarray
    # of both neighbouring cells, weighted by length, (N,) [1/m]: a station's ring mass is ring_mass (1 +
    # ring_offset ring_curvature), and so with its centrifugal relief
    ring_curvature: np.ndarray
    bending: np.ndarray
    bending_load: np.ndarray
    squared_curvature: np.ndarray
    constants: LaneArray  # (1, 60): CONSTANTS
    # row and part of the stations that the driving and the driven groove may hold, (m,) int each
    places: tuple[tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]
    memory: bool  # whether friction has one
    law: FrictionLaw  # its kind, and the table where it is one; coefficients are in `constants`
    rise_time: float  # end of the load's rise [s]
    start_damping: float
    largest_displacement: float
    faded: float
    ramp_end: float  # end of a ramp of load or speed [s]
    profile: np.ndarray  # (K, 4), the same for all runs
    speed_changes: bool  # whether some run's driving speed does
    is_free: bool  # whether the pulleys have the states and laws of `pulleys.py`
    is_curved: bool  # whether curvature terms count
    has_column: bool  # whether pressed elements bear a bending moment
    tilts: bool  # whether elements tilt


class LaneState(NamedTuple):
    """State of W runs on N stations; what fields, scalars, column and tilt hold is named in `lane_fields`."""

    # FIELDS at each station, (N, 7), of rings in n layers (N, 7 + 2 n), see `rings.py`: layers' speeds less
    # the belt speed of `time`; contents less 1 + kappa d_i
    fields: LaneArray
    scalars: LaneArray  # (1, 12) doubles
    time: np.ndarray  # (1,) [s]
    contacts: tuple[Contact, Contact]  # driving and driven wrap
    column: LaneArray  # (N, 11), without rows where elements bear no moment
    tilt: LaneArray  # (N, 4), without rows where elements do not tilt


class Work(NamedTuple):
    """Work space of a step that keeps values of stations alone."""

    stations: LaneArray  # (N, fields), those that `lane_fields` and the step name


def work_space(state: LaneState, fields: int) -> Work:
    """Work space for a state; `derive` has to be called before the first step."""
    rows, _, lanes = state.fields.data.shape
    return Work(LaneArray(rows, fields, lanes, state.fields.data.dtype))


def lane_belt(belts: list[Belt], dtype: DTypeLike) -> LaneBelt:
    """Constants of several runs on the same mesh, one for each lane, in np.float64 or np.float32."""
    first = belts[0]
    constants = LaneArray(1, len(lf.CONSTANTS), len(belts), dtype)
    for lane, belt in enumerate(belts):
        constants.data[0, :, lane] = _constants_of(belt)
    law, terms, path = first.law, first.curvature_terms, (first.cell, first.dual, first.curvature)
    tables = (law.table_force.astype(dtype), law.table_speed.astype(dtype), law.table_mu.astype(dtype))
    changing = any(belt.speed_start != belt.driving_speed for belt in belts)
    computed = dict(
        ring_curvature=squared_curvature(*path, 1),
        bending=bending_bands(first.cell, first.dual, 1.0, first.curvature, terms),
        bending_load=bending_load(first.cell, first.dual, 1.0, first.curvature, terms),
        constants=constants,
        places=_places(first.driving_stations, first.driven_stations, first.cell.size),
        memory=first.friction_memory > 0.0,
        law=FrictionLaw(law.kind, 0.0, 0.0, 0.0, *tables),
        speed_changes=changing or bool(np.any(first.profile[:, SPEED] != 1.0)),
        is_free=first.pulleys.are_free,
        is_curved=terms > 0,
    )
    # all else is of the first belt, by the same name
    given = {key: getattr(first, key) for key in LaneBelt._fields if key not in computed}
    found = LaneBelt(**computed, **given)
    return found._replace(**{name: array.astype(dtype) for name, array in _of_stations(found).items()})


def _of_stations(belt: LaneBelt) -> dict[str, Any]:
    """Arrays of stations, by name: all but the profile, which no station has."""
    return {
        name: array
        for name, array in belt._asdict().items()
        if isinstance(array, np.ndarray) and name != "profile"
    }


def _places(driving: np.ndarray, driven: np.ndarray, rows: int) -> Any:
    """Row and part of each groove's stations, in parts of so many rows."""
    return (driving % rows, driving // rows), (driven % rows, driven // rows)


def _constants_of(belt: Belt) -> list[float]:
    angle, memory = belt.half_wedge_angle, belt.friction_memory
    longer = 1.0 + belt.ring_offset * squared_curvature(belt.cell, belt.dual, belt.curvature, 1)[0]
    named = {
        "ring_mass": belt.ring_mass[0] / longer,
        "ring_relief": belt.ring_relief[0] / longer,
        "kinetic_friction": belt.law.kinetic,
        "friction_gradient": belt.law.gradient,
        "law_speed": belt.law.speed,
        "sine": np.sin(angle),
        "cosine": np.cos(angle),
        "wedge": 2.0 * np.tan(angle),
        "forget": 1.0 / memory if memory else 0.0,
        "start_share": belt.speed_start / belt.driving_speed,
        # energy stored in a pulley of given speed does not count
        "driven_inertia": belt.driven_inertia if np.isfinite(belt.driven_inertia) else 0.0,
        **dict(zip(f.LAWS, belt.pulleys.laws[0], strict=True)),
    }
    return [named[key] if key in named else getattr(belt, key) for key in lf.CONSTANTS]


def lane_state(belts: list[Belt], states: list[State], dtype: type) -> LaneState:
    """State of several runs on the same mesh, one for each lane, all at one time, with fresh contacts."""
    n, lanes = belts[0].cell.size, len(belts)
    tilts = belts[0].tilts
    wraps = [belt.driving for belt in belts], [belt.driven for belt in belts]
    contacts = lane_contact(wraps[0], dtype), lane_contact(wraps[1], dtype)
    _settle_discs(contacts, belts, states)
    found = LaneState(
        LaneArray(n, states[0].fields.shape[0] - tilts, lanes, dtype),
        LaneArray(1, lf.SCALARS, lanes),
        np.zeros(1),
        contacts,
        LaneArray(n if belts[0].has_column else 0, lf.FIELDS_OF_COLUMN, lanes, dtype),
        LaneArray(n * tilts, lf.FIELDS_OF_TILT, lanes, dtype),
    )
    for lane, (belt, state) in enumerate(zip(belts, states, strict=True)):
        put_lane(found, lane, belt, state)
    return found


def _settle_discs(contacts: tuple[Contact, Contact], belts: list[Belt], states: list[State]) -> None:
    """Put discs with inertia to rest under the forces that discs without have in these states."""
    if not any(contact.discs.place.size for contact in contacts):
        return
    for lane, (belt, state) in enumerate(zip(belts, states, strict=True)):
        force = np.zeros(belt.cell.size)
        contact_forces(belt, state, fresh_contacts(belt), force)
        wraps = (belt.driving, belt.driving_stations), (belt.driven, belt.driven_stations)
        for contact, (wrap, stations) in zip(contacts, wraps, strict=True):
            pressed = wrap.weight * np.maximum(force[stations], 0.0)
            settle(contact.discs, lane, wrap.modes, disc_factor(wrap), pressed)


def parts_of(stations: int, most: int) -> int:
    """Into how many linked parts one run's stations go: as many as are of equal length and long enough."""
    parts = most
    while parts > 1 and (stations % parts or stations // parts < LEAST_ROWS):
        parts //= 2
    return parts


def parted_state(state: LaneState, parts: int) -> LaneState:
    """State of one run, its stations in linked parts; time and contacts remain those of `state`."""
    fields, column, tilt = (split(array, parts) for array in (state.fields, state.column, state.tilt))
    return state._replace(fields=fields, scalars=alike(state.scalars, parts), column=column, tilt=tilt)


def parted(belt: LaneBelt, parts: int) -> LaneBelt:
    """Constants of one run, of one lane, its stations in linked parts.

    Their number is a power of 2 that divides that of the stations.
    """
    arrays: dict[str, Any] = {
        name: split(_one_lane(array), parts) for name, array in _of_stations(belt).items()
    }
    rows = belt.cell.size // parts
    places = _places(belt.places[0][0], belt.places[1][0], rows)
    return belt._replace(constants=alike(belt.constants, parts), places=places, **arrays)


def _one_lane(array: np.ndarray) -> LaneArray:
    fields = array.reshape(len(array), -1)
    lane = LaneArray(*fields.shape, 1, array.dtype)
    lane.data[:, :, 0] = fields
    return lane


def alike(array: LaneArray, parts: int) -> LaneArray:
    """Numbers of one ring, (1, F, 1), in all its linked parts."""
    linked = LaneArray(1, array.data.shape[1], parts, array.data.dtype, linked=True)
    linked.data[:] = array.data
    return linked


def put_lane(lanes: LaneState, lane: int, belt: Belt, state: State) -> None:
    """Write a run's state into its lane, and its time, which is that of all."""
    values, scalars = state.fields.copy(), lanes.scalars.data
    if belt.tilts:
        lanes.tilt.data[:, lf.ANGLE, lane] = values[f.ELEMENT_TILT]
        values = values[: f.ELEMENT_TILT]
    belt_speed = speed_share_at(belt, state.scalars[f.TIME]) * belt.belt_speed
    values[f.V_ELEMENT] -= belt_speed
    values[f.V_RING] -= belt_speed
    values[len(f.FIELDS) : (len(values) + len(f.FIELDS)) // 2] -= belt_speed  # ring layers, where there are
    values[f.N_ELEMENT] -= 1.0
    values[f.N_RING] -= 1.0 + belt.curvature * belt.ring_offset
    lanes.fields.data[:, :, lane] = values.T
    lanes.time[0] = state.scalars[f.TIME]
    scalars[0, lf.SPEED, lane] = state.scalars[f.DRIVEN_SPEED]
    scalars[0, lf.POSITION, lane] = state.scalars[f.DRIVEN_POSITION]
    scalars[0, f.FIRST_STATE :, lane] = state.scalars[f.FIRST_STATE :]


def take_lane(state: LaneState, lane: int, belt: Belt) -> State:
    """One run's state out of its lane."""
    values = state.fields.data[:, :, lane].T.astype(float, order="C")
    belt_speed = speed_share_at(belt, state.time[0]) * belt.belt_speed
    values[f.V_ELEMENT] += belt_speed
    values[f.V_RING] += belt_speed
    values[len(f.FIELDS) : (len(values) + len(f.FIELDS)) // 2] += belt_speed
    values[f.N_ELEMENT] += 1.0
    values[f.N_RING] += 1.0 + belt.curvature * belt.ring_offset
    if belt.tilts:
        values = np.vstack([values, state.tilt.data[:, lf.ANGLE, lane].astype(float)])
    scalars = state.scalars.data[0, :, lane]
    return State(values, np.array([state.time[0], *scalars[: lf.LAYER_WORK + 1], *scalars[f.FIRST_STATE :]]))
