"""The constants, state and work space of a planar pushbelt, as its kernels take them.

Arrays hold one row an element, in linked lanes (`cvt_hpc.lanes.rings`): the ring of elements is cut into
equal parts, one for each lane of a register.

Start of a pushbelt from the geometry of its path: constants, state and work space from given values.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.ring_bending import COLUMNS
from cvt_hpc.physics.friction_laws import Law
from cvt_hpc.physics.geometry import Variator, driven_radius, variator
from cvt_hpc.solvers.linked_blocks import empty_scratch, empty_system
from cvt_hpc.variator.history import points_at


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


TILT_MODES = slice(1, 3)  # cos and sin
NEWTON = Newton(tolerance=1e-3, power_tolerance=1.0, weights=(1.0, 1.0, 2e-3, 1.0))


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


def parts_of(nodes: int) -> int:
    """Number of lanes that a ring of nodes is cut into: as many of 8, 4 or 2 as leave whole parts; else 1."""
    return next(parts for parts in (8, 4, 2, 1) if nodes % parts == 0)


def path_of(given: Mapping[str, Any]) -> Variator:
    """The path of the pitch line at the start."""
    radius = driven_radius(given["ratio"], given["belt_length"], given["centre_distance"])
    return variator(given["ratio"], radius, given["centre_distance"])


def shared_constants(given: Mapping[str, Any], chord: float, names: Sequence[str]) -> dict[str, Any]:
    """Constants that a belt has in its plane and out of it, and what is given of `names`; as `belt_of`."""
    g, angle = given, given["half_wedge_angle"]
    modal_stiffness = np.array(g["modal_stiffness"], dtype=np.float64).reshape(2, -1)
    modal_damping = np.zeros_like(modal_stiffness)
    modal_damping[:, TILT_MODES] = g["tilt_lag"] * modal_stiffness[:, TILT_MODES]
    found = {
        "sine": float(np.sin(angle)),
        "cosine": float(np.cos(angle)),
        "thickness": float(chord - g["play"] / g["elements"]),
        "pitch": float(chord),
        "mass": float(g["element_mass"]),
        "ring_mass": float(g["ring_mass"] / g["elements"]),
        "ring_time": float(g["ring_damping"] / g["ring_stiffness"]),
        "transverse_damping": float(g["transverse_damping"] * chord),
        "flank_law": int(Law[g["friction_law"].upper()]),
        "flank_kinetic": float(g["kinetic_friction"]),
        "flank_gradient": float(g["friction_gradient"]),
        "flank_speed": float(g["stribeck_velocity"]),
        "modal_stiffness": modal_stiffness,
        "modal_damping": modal_damping,
    }
    return {name: float(g[name]) for name in names if name in g and name not in found} | found


def belt_of(given: Mapping[str, Any], chord: float) -> Belt:
    """Constants from values as `start` takes them, and the distance of neighbours [m]."""
    shared = shared_constants(given, chord, Belt._fields)
    square = given["element_height"] ** 2 + shared["thickness"] ** 2
    return Belt(**shared, inertia=float(shared["mass"] * square / 12.0))


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


def pitch_line(given: Mapping[str, Any]) -> PitchLine:
    """The pitch line at the start, from values as `start` takes them."""
    path, distance = path_of(given), given["centre_distance"]
    s, chord = equal_chords(lambda s: points_at(path, distance, s)[0], path.path_length, given["elements"])
    points, _, curvature = points_at(path, distance, s)
    along = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
    along /= np.linalg.norm(along, axis=1)[:, None]
    speed = given["driving_speed"] * path.driving_radius
    pulleys = [given["driving_speed"], speed / path.driven_radius, path.driving_radius, path.driven_radius]
    return PitchLine(path, s, points, along, curvature, chord, speed, np.array(pulleys))


def start(given: Mapping[str, Any]) -> tuple[Belt, BeltState]:
    """Constants and a state from which a belt can run in: equal chords along the ideal path, at its speed.

    The flanks just touch; the ring has the strain `ring_strain`. Values [SI] are given as `transient.given`
    names them, those of an element for each of `elements`.
    """
    g, line = given, pitch_line(given)
    belt, nodes, along, speed = belt_of(g, line.chord), g["elements"], line.along, line.speed
    points = line.points + belt.pitch_depth * np.stack([along[:, 1], -along[:, 0]], 1)
    distances = np.linalg.norm(np.roll(points, -1, axis=0) - points, axis=1)
    fields = np.zeros((nodes, f.STATE_FIELDS))
    fields[:, [f.Y, f.Z]], fields[:, [f.HEADING_Y, f.HEADING_Z]] = points, along
    fields[:, f.OMEGA] = speed * line.curvature
    fields[:, [f.U_Y, f.U_Z]] = (speed + belt.pitch_depth * fields[:, f.OMEGA])[:, None] * along
    fields[:, f.V] = speed * distances.sum() / (nodes * line.chord)
    fields[:, f.LENGTH] = distances / (1.0 + g["ring_strain"])
    fields[:, f.TENSION] = belt.ring_stiffness * g["ring_strain"]
    fields[:, f.DRIVEN] = points[:, 0] > 0.5 * belt.centre_distance
    modes = belt.modal_stiffness.shape[1]
    state = BeltState(
        in_lanes(fields),
        line.pulleys,
        np.zeros((2, modes)),
        np.zeros(1 + 2 * modes),
        np.zeros(f.TOTALS),
        np.zeros(f.COUNTERS, np.int64),
    )
    return belt, state


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
