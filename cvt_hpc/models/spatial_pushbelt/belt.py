"""The constants, state and work space of a spatial pushbelt, as its kernels take them.

Arrays hold one row an element, in linked lanes (`cvt_hpc.lanes.rings`): the ring of elements is cut into
equal parts, one for each lane of a register.

The frame is global: pulleys lie side by side in the plane (y, z), the driving centre at the origin and the
driven one at y = centre_distance, and the third coordinate is axial. Right is the side of the greater axial
coordinate, left the other. Vectors take three fields in that order.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.pushbelt.belt import Newton, Workspace
from cvt_hpc.models.pushbelt.start import empty_workspace
from cvt_hpc.models.spatial_pushbelt import fields as f


class Belt(NamedTuple):
    """Constants of a belt and its pulleys; of an element where not said otherwise.

    Attributes
    ----------
    centre_distance : float
        [m]
    axes : (2, 3) array
        Directions of the driving and the driven axis, unit vectors; without tilt (0, 0, 1).
    loose_side : (2,) array
        Of each pulley 1 where the right sheave moves, -1 where the left one does, 0 where both do.
    sine, cosine : float
        Of the half wedge angle.
    half_width : float
        From the middle to either flank on the pitch line [m].
    flank_reach : float
        Of the flanks' contact points above and below the pitch line [m].
    thickness : float
        [m]
    pitch : float
        Distance of neighbours [m].
    pitch_depth, head_height : float
        Of the pitch line below the saddles, which is that of the rocking edge, and of the head's contacts
        above them [m].
    edge_width, head_width : float
        From the middle to the contacts at the rocking edge and at the head [m].
    package_distance : float
        From the middle to the line of either ring package [m].
    pin_height, pin_clearance, pin_stiffness : float
        Of pin and hole above the saddles [m], play to all sides [m], infinite without pins, and [N/m].
    mass : float
        [kg]
    roll_inertia, yaw_inertia, pitch_inertia : float
        About the element's x, o and a [kg m^2].
    ring_mass, ring_rotary_inertia : float
        Of both packages for each element [kg], and against a change of slope [kg m^2].
    ring_stiffness, ring_bending, ring_shear : float
        EA [N], lateral EI [N m^2] and lateral k G A [N] of both packages.
    flank_stiffness : float
        Normal force at each flank by its penetration, shared by its two points [N/m].
    contact_stiffness : float
        Of the contacts at an edge and at a head, shared by its two points [N/m].
    angle_stiffness, angle_damping : float
        Of an element's pitch against each segment of the ring, half at each end [N m/rad], [N m s/rad].
    yaw_stiffness, yaw_damping : float
        Of an element's yaw against the slope of the ring [N m/rad], [N m s/rad].
    transverse_damping, lateral_damping : float
        Force against the speed across the path in the plane, and out of it [N s/m].
    flank_law, flank_kinetic, flank_gradient, flank_speed : int, float, float, float
        Friction law at the flanks (`physics.friction`).
    friction_memory : float
        Time constant of the sliding speed at which that law is read [s].
    ring_friction : float
        Friction coefficient of the rings on the saddles.
    friction_speed, ring_friction_speed : float
        v_reg of both: friction is mu N tanh(|v| / v_reg) [m/s].
    driven_inertia : float
        [kg m^2]
    driving_rate, driven_rate : float
        Radial speed of the belt by the excess of a loose sheave's thrust over the belt's axial force on it
        [m/(s N)]; 0: the sheave is fixed.
    modal_stiffness : (2, modes) array
        S_k of the opening of each sheave of a pulley as sum a_k psi_k(phi), psi 1, cos, sin, cos 2, ...
        [N/m]; none: rigid sheaves.
    lean_lag : float
        Time constant with which the difference of a pulley's two sheaves follows their load [s].
    """

    centre_distance: float
    axes: np.ndarray
    loose_side: np.ndarray
    sine: float
    cosine: float
    half_width: float
    flank_reach: float
    thickness: float
    pitch: float
    pitch_depth: float
    head_height: float
    edge_width: float
    head_width: float
    package_distance: float
    pin_height: float
    pin_clearance: float
    pin_stiffness: float
    mass: float
    roll_inertia: float
    yaw_inertia: float
    pitch_inertia: float
    ring_mass: float
    ring_rotary_inertia: float
    ring_stiffness: float
    ring_bending: float
    ring_shear: float
    flank_stiffness: float
    contact_stiffness: float
    angle_stiffness: float
    angle_damping: float
    yaw_stiffness: float
    yaw_damping: float
    transverse_damping: float
    lateral_damping: float
    flank_law: int
    flank_kinetic: float
    flank_gradient: float
    flank_speed: float
    friction_memory: float
    ring_friction: float
    friction_speed: float
    ring_friction_speed: float
    driven_inertia: float
    driving_rate: float
    driven_rate: float
    modal_stiffness: np.ndarray
    lean_lag: float


# How a step is solved: velocity, angular velocity in the plane and out of it, V, rate of the slope
NEWTON = Newton(tolerance=3e-3, power_tolerance=5.0, weights=(1.0, 1.0, 1.0, 1e-2, 1e-2, 2e-3, 1.0, 1e-3))


class BeltState(NamedTuple):
    """State of a run, which `step.advance` takes on.

    Attributes
    ----------
    elements : (rows, STATE_FIELDS) LaneArray
        Element p rows + j lies in row j, lane p.
    pulleys : (PULLEY_FIELDS,) array
        Speeds, radii and positions of mid planes.
    openings, leans : (2, modes) array
        Of each pulley: the sheaves open by a_k, and the right one b_k more, the left one b_k less [m].
    increments : (1 + 2 modes,) array
        Changes in the last step of the border's unknowns: speed of the driven pulley, openings.
    loads : (LOADS,) array
        Axial forces on the four sheaves and torques on the pulleys in the last step; no part of what a run
        goes on from.
    totals : (TOTALS,) array
        What has added up since the start.
    counters : (COUNTERS,) int array
        Work done, and how the last call ended.
    """

    elements: LaneArray
    pulleys: np.ndarray
    openings: np.ndarray
    leans: np.ndarray
    increments: np.ndarray
    loads: np.ndarray
    totals: np.ndarray
    counters: np.ndarray


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
