"""The constants, state and work space of a planar pushbelt, as its kernels take them.

Arrays hold one row an element, in linked lanes (`cvt_hpc.lanes.rings`): the ring of elements is cut into
equal parts, one for each lane of a register.

Start of a pushbelt from the geometry of its path: constants, state and work space by parameters of a run.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.parameters import MODES, flank_compliance, local_compliance, path_length
from cvt_hpc.models.pushbelt.ring_bending import COLUMNS
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.friction_laws import Law
from cvt_hpc.physics.geometry import Variator, driven_radius, variator
from cvt_hpc.solvers.linked_blocks import empty_scratch, empty_system
from cvt_hpc.variator.history import points_at
from cvt_hpc.variator.profiles import multiple
from cvt_hpc.vibration.ramped import ramped


class Belt(NamedTuple):
    """Constants of a belt and its pulleys; of an element where not stated otherwise."""

    centre_distance: float  # [m]
    # sine, cosine: of the half wedge angle
    sine: float
    cosine: float
    thickness: float  # [m]
    # pitch_depth, head_height: of the rocking edge and the flank's contact point below the saddle, and of the
    # head's contact above it [m]
    pitch_depth: float
    head_height: float
    # mass, inertia, ring_mass: [kg], [kg m^2], and mass of the ring for each element [kg]
    mass: float
    inertia: float
    ring_mass: float
    ring_stiffness: float  # EA of both ring packages [N]
    # bending_stiffness, pitch: EI of theirs in the plane [N m^2], distance of neighbours [m]
    bending_stiffness: float
    pitch: float
    ring_time: float  # their damping along the belt over that stiffness [s]
    # normal force at each flank by its penetration, element and local bending of the sheave in series, where
    # neighbours have the same force [N/m]
    flank_stiffness: float
    # local_compliance, local_decay: local bending of a sheave along the normal by that force [m/N], 0: none;
    # its decay from element to element [1] (`local_bending`)
    local_compliance: float
    local_decay: float
    contact_stiffness: float  # of each of the two contacts between elements [N/m]
    # nose_height, nose_clearance, nose_stiffness: of nose and hole above the saddle [m], play to either side
    # [m], infinite without noses, and [N/m]
    nose_height: float
    nose_clearance: float
    nose_stiffness: float
    contact_time: float  # damping over stiffness of contacts and noses between elements [s]
    # angle_stiffness, angle_damping: of an element's rotation against each segment of the ring, half at each
    # end [N m/rad], [N m s/rad]
    angle_stiffness: float
    angle_damping: float
    transverse_damping: float  # force against the speed across the path [N s/m]
    # flank_law, flank_kinetic, flank_gradient, flank_speed: friction law at the flanks (`physics.friction`)
    flank_law: int
    flank_kinetic: float
    flank_gradient: float
    flank_speed: float
    friction_memory: float  # time constant of the sliding speed at which that law is read [s]
    ring_friction: float  # friction coefficient of the ring on the saddles
    # friction_speed, ring_friction_speed: v_reg of both: friction is mu N tanh(|v| / v_reg) [m/s]
    friction_speed: float
    ring_friction_speed: float
    driven_inertia: float  # [kg m^2]
    # driving_rate, driven_rate: radial speed of the belt by the excess of a loose sheave's thrust over the
    # belt's axial force [m/(s N)]; 0: the sheave is fixed
    driving_rate: float
    driven_rate: float
    # shape (2, modes): S_k of the opening of each pulley's sheaves as sum a_k psi_k(phi), psi 1, cos, sin,
    # cos 2, ... [N/m]; none: rigid sheaves
    modal_stiffness: np.ndarray
    # shape (2, modes): of the same openings, where their tilt lags (`border`) [N s/m]
    modal_damping: np.ndarray
    gravity: float = 0.0  # acceleration of gravity, against z [m/s^2]


class Newton(NamedTuple):
    """Settings by which a step is solved."""

    tolerance: float  # largest correction of a speed [m/s]
    power_tolerance: float  # largest power residual of the whole belt [W]
    # weights of the corrections of an element's speeds: lengths of angular velocities [m], else 1
    weights: tuple[float, ...]
    # most_iterations, first_half_step: iterations a step, and the first one whose correction is halved where
    # corrections do not fall
    most_iterations: int = 40
    first_half_step: int = 10
    most_failures: int = 20  # failed steps in a row with which a run ends


NEWTON = Newton(tolerance=1e-3, power_tolerance=1.0, weights=(1.0, 1.0, 2e-3, 1.0))


def newton_of(parameters: Parameters, default: Newton) -> Newton:
    """Settings by a run's parameters, the others by default."""
    p = parameters
    limits = {"power_tolerance": p["power_tolerance"], "most_iterations": p["most_iterations"]}
    return default._replace(tolerance=p["speed_tolerance"], **limits)


class BeltState(NamedTuple):
    """State of a run, which `step.advance` takes on."""

    elements: LaneArray  # (rows, STATE_FIELDS): element p rows + j lies in row j, lane p
    # (4,): speeds [rad/s], radii on which flanks' contact points run without penetration [m]
    pulleys: np.ndarray
    openings: np.ndarray  # a_k of each pulley's sheaves, (2, modes) [m]
    # (1 + 2 modes,): changes in the last step of the border's unknowns: speed of the driven pulley, openings
    increments: np.ndarray
    totals: np.ndarray  # sums since the start, (TOTALS,)
    counters: np.ndarray  # work done, and how the last call ended, (COUNTERS,)


class Workspace(NamedTuple):
    """Work space of a step, which is not needed afterwards; of elements with b unknowns."""

    step: LaneArray  # (rows, STEP_FIELDS): geometry, directions and the linear laws of a step
    iterate: LaneArray  # (rows, ITERATE_FIELDS): forces, slopes and residuals of an iterate
    shapes: LaneArray  # (rows, modes): psi_k at the elements
    # (rows, b (3 b + columns)): the system of an iteration (`solvers.linked_blocks`), with a column for the
    # residual and one for each unknown of the border
    blocks: LaneArray
    # that of an element's first unknowns, where a model assembles it before the others come in; else `blocks`
    # itself
    narrow: LaneArray
    scratch: LaneArray  # (3, b (3 b + columns)): work space of its solution, and sums
    border: np.ndarray  # (columns - 1, columns): system of the border, its right side last
    # (1, (columns - 1) columns): its entries in the parts of the ring (`border.close_border`)
    sums: LaneArray
    inputs: np.ndarray  # (INPUTS,) of the step
    increments: np.ndarray  # `BeltState.increments` at its start
    kept: np.ndarray  # (2, STATE_FIELDS): states of two elements before the last correction
    bent: np.ndarray  # (elements, COLUMNS), of `ring_bending` and `local_bending`


# Constants that are parameters of a job
_AS_GIVEN = (
    *("centre_distance", "head_height", "ring_stiffness", "bending_stiffness", "driven_inertia", "gravity"),
    *("nose_height", "nose_clearance", "nose_stiffness"),
    *("friction_memory", "ring_friction", "friction_speed", "ring_friction_speed"),
)


def parts_of(nodes: int) -> int:
    """Number of lanes that a ring of nodes is cut into: as many of 8, 4 or 2 as leave whole parts; else 1."""
    return next(parts for parts in (8, 4, 2, 1) if nodes % parts == 0)


def belt_of(parameters: Parameters, chord: float) -> Belt:
    """Constants of a belt whose neighbouring elements are at a distance `chord` [m]."""
    p, length, angle = parameters, path_length(parameters), parameters["half_wedge_angle"]
    pitch = length / p["elements"]
    mass, thickness = float(p["element_mass"] * pitch), float(chord - p["play"] / p["elements"])
    modes = (
        () if np.isinf(p["sheave_stiffness"]) else [p["sheave_stiffness"] * np.array(p[key]) for key in MODES]
    )
    modal_stiffness = np.array(modes, dtype=np.float64).reshape(2, -1)
    tilting = np.isin(np.arange(modal_stiffness.shape[1]), (1, 2))  # cos and sin
    return Belt(
        **{name: float(p[name]) for name in _AS_GIVEN},
        sine=float(np.sin(angle)),
        cosine=float(np.cos(angle)),
        thickness=thickness,
        pitch_depth=float(p["ring_offset"]),
        mass=mass,
        inertia=float(mass * (p["element_height"] ** 2 + thickness**2) / 12.0),
        ring_mass=float(p["ring_mass"] * length / p["elements"]),
        pitch=float(chord),
        ring_time=float(p["ring_damping"] / p["ring_stiffness"]),
        flank_stiffness=float(pitch / flank_compliance(p)),
        local_compliance=float(local_compliance(p) / pitch),
        local_decay=float(np.exp(-pitch / p["local_length"])),
        contact_stiffness=float(p["edge_stiffness"] / pitch),
        contact_time=float(p["element_damping"] / p["edge_stiffness"]),
        angle_stiffness=float(p["tilt_spring"] * pitch),
        angle_damping=float(p["tilt_damper"] * pitch),
        transverse_damping=float(p["transverse_damping"] * chord),
        flank_law=int(Law[p["friction_law"].upper()]),
        flank_kinetic=float(p["kinetic_friction"]),
        flank_gradient=float(p["friction_gradient"]),
        flank_speed=float(p["stribeck_velocity"]),
        driving_rate=float(p["sheave_rate"]) if p["driving_thrust"] > 0.0 else 0.0,
        driven_rate=float(p["sheave_rate"]),
        modal_stiffness=modal_stiffness,
        modal_damping=np.where(tilting, p["tilt_lag"] * modal_stiffness, 0.0),
    )


def equal_chords(
    points: Callable[[np.ndarray], np.ndarray], length: float, nodes: int
) -> tuple[np.ndarray, float]:
    """Places (nodes,) [m] along a closed line with equal distances of neighbours, and that distance [m].

    `points` gives the points (nodes, 2) [m] of a line of that length, of which the first place is 0.
    """
    s = np.arange(nodes) * length / nodes
    for _ in range(50):
        found = points(s)
        chords = np.linalg.norm(np.roll(found, -1, axis=0) - found, axis=1)
        if np.ptp(chords) < 1e-13:
            break
        # arc lengths scaled by the mean chord over their own; it contracts, as both differ by their curvature
        gaps = np.diff(np.append(s, length)) * (chords.mean() / chords)
        gaps *= length / gaps.sum()
        s = np.concatenate([[0.0], np.cumsum(gaps[:-1])])
    return s, float(chords.mean())


class PitchLine(NamedTuple):
    """Line of the rocking edges of a belt at the start, and its speed."""

    path: Variator  # [m]
    # places, points, along, curvature, shapes (n,), (n, 2), (n, 2), (n,): of the elements, with equal chords:
    # path coordinate [m], position [m], running direction and curvature of the path [1/m]
    places: np.ndarray
    points: np.ndarray
    along: np.ndarray
    curvature: np.ndarray
    # chord, speed: distance of neighbours [m], and speed along the path [m/s]
    chord: float
    speed: float
    pulleys: np.ndarray  # shape (4,): speeds [rad/s] and radii [m]


def pitch_line(path: Variator, centre_distance: float, elements: int, driving_speed: float) -> PitchLine:
    """The line of so many elements along a path [m], at a speed of the driving pulley [rad/s]."""
    s, chord = equal_chords(lambda s: points_at(path, centre_distance, s)[0], path.path_length, elements)
    points, _, curvature = points_at(path, centre_distance, s)
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    speed = driving_speed * path.driving_radius
    pulleys = [driving_speed, speed / path.driven_radius, path.driving_radius, path.driven_radius]
    return PitchLine(path, s, points, along, curvature, chord, speed, np.array(pulleys))


class Outset(NamedTuple):
    """What a belt starts from."""

    belt: Belt  # its constants
    line: PitchLine  # where its elements are, and how fast
    ring_strain: float  # of the rings [1]


def outset(parameters: Parameters) -> Outset:
    """What a run starts from, by its flat parameters [SI]."""
    p = parameters
    speed = p["driving_speed"] * multiple(p, "driving_speed", 0.0)
    if ramped(p) == "speed":
        speed = p["speed_start"]
    radius = driven_radius(p["ratio"], path_length(p), p["centre_distance"])
    path = variator(p["ratio"], radius, p["centre_distance"])
    line = pitch_line(path, p["centre_distance"], p["elements"], speed)
    return Outset(belt_of(p, line.chord), line, p["reference_tension"] / p["ring_stiffness"])


def start(given: Outset) -> tuple[Belt, BeltState]:
    """Constants and a state from which a belt can run in: equal chords along the ideal path, at its speed.

    The flanks just touch.
    """
    belt, line, strain = given
    along, speed, nodes = line.along, line.speed, len(line.places)
    points = line.points + belt.pitch_depth * np.stack([along[:, 1], -along[:, 0]], 1)
    distances = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    fields = np.zeros((nodes, f.STATE_FIELDS))
    fields[:, [f.Y, f.Z]], fields[:, [f.HEADING_Y, f.HEADING_Z]] = points, along
    fields[:, f.OMEGA] = speed * line.curvature
    fields[:, [f.U_Y, f.U_Z]] = (speed + belt.pitch_depth * fields[:, f.OMEGA])[:, None] * along
    fields[:, f.V] = speed * distances.sum() / (nodes * line.chord)
    fields[:, f.LENGTH] = distances / (1.0 + strain)
    fields[:, f.TENSION] = belt.ring_stiffness * strain
    fields[:, f.DRIVEN] = points[:, 0] > 0.5 * belt.centre_distance
    openings = np.zeros_like(belt.modal_stiffness)
    increments, totals = np.zeros(1 + openings.size), np.zeros(f.TOTALS)
    counters = np.zeros(f.COUNTERS, np.int64)
    return belt, BeltState(in_lanes(fields), line.pulleys, openings, increments, totals, counters)


def in_lanes(fields: np.ndarray) -> LaneArray:
    """Values (nodes, fields) as a LaneArray of linked parts."""
    nodes, count = fields.shape
    parts = parts_of(nodes)
    array = LaneArray(nodes // parts, count, parts, linked=parts > 1)
    array.data[:] = fields.reshape(parts, -1, count).transpose(1, 2, 0)
    return array


def of_lanes(array: LaneArray) -> np.ndarray:
    """Values (nodes, fields) of a LaneArray of linked parts."""
    return array.data.transpose(2, 0, 1).reshape(-1, array.data.shape[1])


def workspace(belt: Belt, nodes: int) -> Workspace:
    """Work space for a belt of so many nodes."""
    return empty_workspace(
        nodes, belt.modal_stiffness.shape[1], 4, f.STEP_FIELDS, f.ITERATE_FIELDS, f.STATE_FIELDS, f.INPUTS
    )


def empty_workspace(
    nodes: int, modes: int, size: int, step: int, iterate: int, state: int, inputs: int, narrow: int = 0
) -> Workspace:
    """Work space for elements with `size` unknowns and so many fields, and for sheaves with so many modes.

    Of these unknowns the first `narrow` are assembled apart from the others; 0: all at once.
    """
    parts, columns = parts_of(nodes), 2 + 2 * modes
    rows = nodes // parts

    def lanes(count: int, fields: int) -> LaneArray:
        return LaneArray(count, fields, parts, linked=parts > 1)

    blocks = empty_system(nodes, parts, size, columns)
    return Workspace(
        step=lanes(rows, step),
        iterate=lanes(rows, iterate),
        shapes=lanes(rows, max(modes, 1)),
        blocks=blocks,
        narrow=empty_system(nodes, parts, narrow, columns) if narrow else blocks,
        scratch=empty_scratch(parts, size, columns),
        border=np.zeros((columns - 1, columns)),
        sums=lanes(1, (columns - 1) * columns),
        inputs=np.zeros(inputs),
        increments=np.zeros(columns - 1),
        kept=np.zeros((2, state)),
        bent=np.zeros((nodes, COLUMNS)),
    )
