"""The constants, state and work space of a spatial pushbelt, as its kernels take them.

Arrays hold one row an element, in linked lanes (`cvt_hpc.lanes.rings`): the ring of elements is cut into
equal parts, one for each lane of a register.

The frame is global: pulleys lie side by side in the plane (y, z), the driving centre at the origin and the
driven one at y = centre_distance, and the third coordinate is axial. Right is the side of the greater axial
coordinate, left the other. Vectors take three fields in that order.

Start of a spatial pushbelt from the geometry of its path: constants and state by parameters of a run.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.pushbelt import fields as planar
from cvt_hpc.models.pushbelt.belt import Belt as PlanarBelt
from cvt_hpc.models.pushbelt.belt import Newton, Workspace, empty_workspace, in_lanes, of_lanes, outset
from cvt_hpc.models.pushbelt.parameters import path_length
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt.parameters import LOOSE_SIDES, package_arm
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.geometry import Variator
from cvt_hpc.physics.out_of_plane import SIDES
from cvt_hpc.variator.history import points_at, regions

_SEED_MODES = 5  # half waves of a strand that the disturbance at the start is made of


class Belt(NamedTuple):
    """Constants of a belt and its pulleys; of an element where not said otherwise."""

    centre_distance: float  # [m]
    # shape (2, 3): directions of the driving and the driven axis, unit vectors; without tilt (0, 0, 1)
    axes: np.ndarray
    # shape (2,): of each pulley 1 where the right sheave moves, -1 where the left one does, 0 where both do
    loose_side: np.ndarray
    # sine, cosine: of the half wedge angle
    sine: float
    cosine: float
    half_width: float  # from the middle to either flank on the pitch line [m]
    flank_reach: float  # of the flanks' contact points above and below the pitch line [m]
    thickness: float  # [m]
    # bending_stiffness, pitch: EI of the rings in the plane [N m^2], distance of neighbours [m]
    bending_stiffness: float
    pitch: float
    # pitch_depth, head_height: of the pitch line below the saddles, which is that of the rocking edge, and of
    # the head's contacts above them [m]
    pitch_depth: float
    head_height: float
    # edge_width, head_width: from the middle to the contacts at the rocking edge and at the head [m]
    edge_width: float
    head_width: float
    package_distance: float  # from the middle to the line of either ring package [m]
    # pin_height, pin_clearance, pin_stiffness: of pin and hole above the saddles [m], play to all sides [m],
    # infinite without pins, and [N/m]
    pin_height: float
    pin_clearance: float
    pin_stiffness: float
    mass: float  # [kg]
    # roll_inertia, yaw_inertia, pitch_inertia: about the element's x, o and a [kg m^2]
    roll_inertia: float
    yaw_inertia: float
    pitch_inertia: float
    # ring_mass, ring_rotary_inertia: of both packages for each element [kg], and against a change of slope
    # [kg m^2]
    ring_mass: float
    ring_rotary_inertia: float
    # ring_stiffness, ring_time, ring_bending, ring_shear: EA [N], damping along the belt over it [s], lateral
    # EI [N m^2] and lateral k G A [N] of both packages
    ring_stiffness: float
    ring_time: float
    ring_bending: float
    ring_shear: float
    # normal force at each flank by its penetration, shared by its two points, with local bending in series as
    # in the plane [N/m]
    flank_stiffness: float
    # local_compliance, local_decay: as in the plane [m/N], [1]
    local_compliance: float
    local_decay: float
    contact_stiffness: float  # of the contacts at an edge and at a head, shared by its two points [N/m]
    contact_time: float  # damping over stiffness of contacts and pins between elements [s]
    # angle_stiffness, angle_damping: of an element's pitch against each segment of the ring, half at each end
    # [N m/rad], [N m s/rad]
    angle_stiffness: float
    angle_damping: float
    # yaw_stiffness, yaw_damping: of an element's yaw against the slope of the ring [N m/rad], [N m s/rad]
    yaw_stiffness: float
    yaw_damping: float
    # transverse_damping, lateral_damping: force against the speed across the path in the plane, and out of it
    # [N s/m]
    transverse_damping: float
    lateral_damping: float
    # flank_law, flank_kinetic, flank_gradient, flank_speed: friction law at the flanks (`physics.friction`)
    flank_law: int
    flank_kinetic: float
    flank_gradient: float
    flank_speed: float
    friction_memory: float  # time constant of the sliding speed at which that law is read [s]
    ring_friction: float  # friction coefficient of the rings on the saddles
    # friction_speed, ring_friction_speed: v_reg of both: friction is mu N tanh(|v| / v_reg) [m/s]
    friction_speed: float
    ring_friction_speed: float
    driven_inertia: float  # [kg m^2]
    # driving_rate, driven_rate: radial speed of the belt by the excess of a loose sheave's thrust over the
    # belt's axial force on it [m/(s N)]; 0: the sheave is fixed
    driving_rate: float
    driven_rate: float
    # shape (2, modes): S_k of the opening of each sheave of a pulley as sum a_k psi_k(phi), psi 1, cos, sin,
    # cos 2, ... [N/m]; none: rigid sheaves
    modal_stiffness: np.ndarray
    modal_damping: np.ndarray  # shape (2, modes): of the same openings, where their tilt lags [N s/m]
    # time constant with which the difference of a pulley's two sheaves follows their load [s]
    lean_lag: float
    gravity: float = 0.0  # acceleration of gravity, against z [m/s^2]


# How a step is solved: velocity, angular velocity in the plane and out of it, V, rate of the slope
NEWTON = Newton(tolerance=3e-3, power_tolerance=5.0, weights=(1.0, 1.0, 1.0, 1e-2, 1e-2, 2e-3, 1.0, 1e-3))


class BeltState(NamedTuple):
    """State of a run, which `step.advance` takes on.

    Of each pulley the sheaves open by a_k, `openings`, and the right one b_k more, the left one b_k less,
    `leans` [m].
    """

    elements: LaneArray  # (rows, STATE_FIELDS): element p rows + j lies in row j, lane p
    pulleys: np.ndarray  # (PULLEY_FIELDS,): speeds, radii and positions of mid planes
    openings: np.ndarray  # (2, modes)
    leans: np.ndarray  # (2, modes)
    # (1 + 2 modes,): changes in the last step of the border's unknowns: speed of the driven pulley, openings
    increments: np.ndarray
    # (LOADS,): axial forces on the four sheaves and torques on the pulleys in the last step; no part of what
    # a run goes on from
    loads: np.ndarray
    totals: np.ndarray  # sums since the start, (TOTALS,)
    counters: np.ndarray  # work done, and how the last call ended, (COUNTERS,)


NEWTON_OF_TWO_FLOWS = NEWTON._replace(weights=(*NEWTON.weights, 1.0))


def workspace(belt: Belt, nodes: int, flows: int = 1) -> Workspace:
    """Work space for a belt of so many nodes, and flows of ring material."""
    modes = belt.modal_stiffness.shape[1]
    if flows == 1:
        return empty_workspace(
            nodes, modes, f.SIZE, f.STEP_FIELDS, f.ITERATE_FIELDS, f.STATE_FIELDS, f.INPUTS
        )
    fields = f.WIDE_STEP_FIELDS, f.WIDE_ITERATE_FIELDS, f.WIDE_STATE_FIELDS
    return empty_workspace(nodes, modes, f.WIDE, *fields, f.INPUTS, narrow=f.SIZE)


def belt_of(parameters: Parameters, planar: PlanarBelt) -> Belt:
    """Constants of the belt that is a planar one where it stays in its plane."""
    p, mass, thickness = parameters, planar.mass, planar.thickness
    height, width, pitch = p["element_height"], p["element_width"], path_length(p) / p["elements"]
    turned = np.array([[0.0, 0.0, 1.0], [np.tan(p["axis_tilt"]), np.tan(p["axis_skew"]), 1.0]])
    return Belt(
        **{name: value for name, value in planar._asdict().items() if name in Belt._fields},
        axes=turned / np.linalg.norm(turned, axis=1)[:, None],
        loose_side=np.array([float(SIDES[p[key]]) for key in LOOSE_SIDES]),
        half_width=float(0.5 * width),
        flank_reach=float(p["flank_reach"]),
        edge_width=float(p["edge_half_width"]),
        head_width=float(p["head_half_width"]),
        package_distance=package_arm(p),
        pin_height=planar.nose_height,
        pin_clearance=planar.nose_clearance,
        pin_stiffness=planar.nose_stiffness,
        roll_inertia=float(mass * (height**2 + width**2) / 12.0),
        yaw_inertia=float(mass * (width**2 + thickness**2) / 12.0),
        pitch_inertia=planar.inertia,
        ring_rotary_inertia=float(planar.ring_mass * p["strip_width"] ** 2 / 12.0),
        ring_bending=float(p["lateral_bending_stiffness"]),
        ring_shear=float(p["lateral_shear_stiffness"]),
        yaw_stiffness=float(p["yaw_spring"] * pitch),
        yaw_damping=float(p["yaw_damper"] * pitch),
        lateral_damping=float(p["lateral_damping"] * planar.pitch),
        lean_lag=float(p["lean_lag"]),
    )


class SideLine:
    """Line of the belt out of the plane at the start, along its path [m].

    On the arcs it is in the mid planes of the pulleys, on the strands along cubics with the slopes of the
    arcs' ends, as a beam without tension lies between them; there with a disturbance of so much at the most
    [m], whose slope vanishes at the ends. The amplitudes of its modes are drawn by the seed.
    """

    def __init__(
        self, path: Variator, belt: Belt, middles: tuple[float, float], disturbance: float, seed: int
    ) -> None:
        self._path, self._belt, self._middles = path, belt, middles
        self._starts = np.concatenate([[0.0], np.cumsum(path.lengths)[:3]])
        shares = np.linspace(0.0, 1.0, 1001)
        self._modes = np.random.default_rng(seed).uniform(-1.0, 1.0, (2, _SEED_MODES))
        self._modes *= disturbance / np.abs([self._disturbed(k, shares)[0] for k in (0, 1)]).max()

    def _disturbed(self, strand: int, share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Displacement on a strand by the share of its length, and its derivative by it."""
        x = np.pi * share
        moved, change = np.zeros((2, x.size))
        for n, size in enumerate(self._modes[strand], start=1):
            wave, slope = np.sin(n * x), n * np.cos(n * x)
            moved += size * np.sin(x) * wave
            change += size * np.pi * (np.cos(x) * wave + np.sin(x) * slope)
        return moved, change

    def _on_pulley(self, k: int, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Axial position [m] and slope of the mid plane of a pulley at path coordinates (n,) [m]."""
        axis = self._belt.axes[k]
        points, angle, _ = points_at(self._path, self._belt.centre_distance, position)
        y = points[:, 0] - k * self._belt.centre_distance
        height = self._middles[k] / axis[2] - (axis[0] * y + axis[1] * points[:, 1]) / axis[2]
        return height, -(axis[0] * np.cos(angle) + axis[1] * np.sin(angle)) / axis[2]

    def at(self, position: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Axial positions (n,) [m], slopes (n,), and axes of the elements (n, 3) at path coordinates [m]."""
        path, axes = self._path, self._belt.axes
        region = regions(path, position)
        height, slope = np.zeros(position.size), np.zeros(position.size)
        direction = np.zeros((position.size, 3))
        for k in (0, 1):
            on_arc = region == 2 * k
            height[on_arc], slope[on_arc] = self._on_pulley(k, position[on_arc])
            direction[on_arc] = axes[k]
            on_strand = region == 2 * k + 1
            start, length = self._starts[2 * k + 1], path.strand_length
            ends = np.array([start, np.nextafter(start + length, 0.0)])
            (w0, s0), (w1, s1) = (self._on_pulley(p, ends[e : e + 1]) for p, e in ((k, 0), (1 - k, 1)))
            x = (position[on_strand] - start) / length
            rise = w1 - w0
            m0, m1 = s0 * length, s1 * length
            seed, seed_slope = self._disturbed(k, x)
            cubic = w0 + m0 * x + (3.0 * rise - 2.0 * m0 - m1) * x**2 + (m0 + m1 - 2.0 * rise) * x**3
            change = m0 + 2.0 * (3.0 * rise - 2.0 * m0 - m1) * x + 3.0 * (m0 + m1 - 2.0 * rise) * x**2
            height[on_strand], slope[on_strand] = cubic + seed, (change + seed_slope) / length
            smooth = (x * x * (3.0 - 2.0 * x))[:, None]
            direction[on_strand] = (1.0 - smooth) * axes[k] + smooth * axes[1 - k]
        return height, slope, direction


def start(parameters: Parameters) -> tuple[Belt, BeltState]:
    """Constants and a state from which a belt can run in: equal chords along the ideal path, at its speed.

    The flanks just touch, but for the disturbance. Half of the misalignment is the driving pulley's.
    """
    p, (planar_belt, line, strain) = parameters, outset(parameters)
    belt, nodes, along, speed = belt_of(p, planar_belt), p["elements"], line.along, line.speed
    middles = -0.5 * p["misalignment"], 0.5 * p["misalignment"]
    height, slope, axial = SideLine(line.path, belt, middles, p["disturbance"], p["seed"]).at(line.places)
    heading = np.column_stack([along, slope])
    heading /= np.linalg.norm(heading, axis=1)[:, None]
    outward = np.cross(heading, axial)
    outward /= np.linalg.norm(outward, axis=1)[:, None]
    axial = np.cross(outward, heading)
    points = np.column_stack([line.points, height]) + belt.pitch_depth * outward

    ahead = np.roll(points, -1, axis=0) - points
    arms = belt.package_distance * (np.roll(axial, -1, axis=0) - axial)
    lines = 0.5 * (np.linalg.norm(ahead + arms, axis=1) + np.linalg.norm(ahead - arms, axis=1))
    # elements that run along the path turn as the path does, in the plane and out of it
    slope_rate = speed * (np.roll(slope, -1) - np.roll(slope, 1)) / (2.0 * line.chord)
    plane_outward = np.column_stack([along[:, 1], -along[:, 0], np.zeros(nodes)])
    omega = speed * line.curvature[:, None] * np.array([0.0, 0.0, 1.0]) + slope_rate[:, None] * plane_outward
    fields = np.zeros((nodes, f.STATE_FIELDS))
    fields[:, f.vector(f.POSITION)] = points
    fields[:, f.vector(f.HEADING)], fields[:, f.vector(f.OUTWARD)] = heading, outward
    fields[:, f.SLOPE], fields[:, f.SLOPE_RATE] = slope, slope_rate
    running = speed + belt.pitch_depth * speed * line.curvature
    fields[:, f.vector(f.SPEED)] = np.column_stack([running[:, None] * along, speed * slope])
    fields[:, f.vector(f.OMEGA)] = omega
    fields[:, f.V] = speed * lines.sum() / (nodes * line.chord)
    fields[:, f.LENGTH] = lines / (1.0 + strain)
    fields[:, f.TENSION] = belt.ring_stiffness * strain
    fields[:, f.DRIVEN] = points[:, 0] > 0.5 * belt.centre_distance
    openings, leans = np.zeros_like(belt.modal_stiffness), np.zeros_like(belt.modal_stiffness)
    increments, pulleys = np.zeros(1 + openings.size), np.append(line.pulleys, middles)
    sums = np.zeros(f.LOADS), np.zeros(planar.TOTALS), np.zeros(planar.COUNTERS, np.int64)
    return belt, BeltState(in_lanes(fields), pulleys, openings, leans, increments, *sums)


def with_two_flows(belt: Belt, state: BeltState) -> BeltState:
    """The state of a belt with one flow as one of two flows whose packages are strained alike.

    Both share all but the elements.
    """
    fields = of_lanes(state.elements)
    wide = np.zeros((len(fields), f.WIDE_STATE_FIELDS))
    wide[:, : f.STATE_FIELDS] = fields
    o = fields[:, f.vector(f.OUTWARD)]
    arm = belt.package_distance * np.cross(o, fields[:, f.vector(f.HEADING)])
    chord, turn = (np.roll(of, -1, axis=0) - of for of in (fields[:, f.vector(f.POSITION)], arm))
    right, left = (np.linalg.norm(chord + side * turn, axis=1) for side in (1.0, -1.0))
    wide[:, f.HALF_LENGTH] = fields[:, f.LENGTH] * (right - left) / (right + left)
    wide[:, f.SADDLE_RIGHT] = wide[:, f.SADDLE_LEFT] = 0.5 * fields[:, f.SADDLE]
    return state._replace(elements=in_lanes(wide))
