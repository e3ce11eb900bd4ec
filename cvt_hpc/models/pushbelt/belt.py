"""The constants, state and work space of a planar pushbelt, as its kernels take them.

Arrays hold one row an element, in linked lanes (`cvt_hpc.lanes.rings`): the ring of elements is cut into
equal parts, one for each lane of a register.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray

# Fields of the state of an element. Speeds are those at the middle of the last step.
(
    Y,  # saddle point, which is the ring line and the assumed centre of gravity [m]
    Z,
    HEADING_Y,  # running direction of the element, a unit vector
    HEADING_Z,
    U_Y,  # velocity of the saddle point [m/s]
    U_Z,
    OMEGA,  # angular velocity [rad/s]
    V,  # velocity of the ring's material along its line [m/s]
    LENGTH,  # unstretched length of the ring up to the next element [m]
    TENSION,  # of the ring up to the next element [N]
    SADDLE,  # normal force of the ring on the element [N]
    EDGE,  # contact forces to the next element, at rocking edge and head [N]
    HEAD,
    NOSE,  # force of the next element's hole on the nose, inwards [N]
    FLANK,  # normal force at each of the two flanks [N]
    FLANK_SLIP_M,  # sliding speed along the meridian of the sheave, outwards [m/s]
    FLANK_SLIP_T,  # sliding speed in the direction of rotation, element over sheave [m/s]
    FLANK_FRICTION_M,  # friction force at each flank against these speeds [N]
    FLANK_FRICTION_T,
    RING_SLIP,  # of the ring over the saddle, forwards [m/s]
    RING_FRICTION,  # friction force of the element against that [N]
    RING_DUAL,  # directions of friction as the Newton iteration has them, at most 1 in size
    FLANK_DUAL_M,
    FLANK_DUAL_T,
    V_FILTERED,  # sliding speed at which the friction law of the flanks is read [m/s]
    DRIVEN,  # 1 where the nearer pulley is the driven one, else 0
    CHANGE,  # 4: of the speeds in the last step, from which the next one starts
) = range(27)
STATE_FIELDS = CHANGE + 4

# Entries of the state of the pulleys
DRIVING_SPEED, DRIVEN_SPEED, DRIVING_RADIUS, DRIVEN_RADIUS = range(4)

# Entries of the inputs, at the start and at the end of a call
IN_SPEED, IN_DRIVING_THRUST, IN_DRIVEN_THRUST, IN_LOAD, IN_DRIVING_SHIFT = range(5)
INPUTS = IN_DRIVING_SHIFT + 1

# Entries of the totals: time, and sums over it
(
    TIME,  # [s]
    WORK_IN,  # of the driving shaft [J]
    WORK_OUT,  # against the load [J]
    THRUST_WORK,  # that what holds the sheaves takes up as they move [J]
    FLANK_LOSS,  # [J]
    RING_LOSS,  # [J]
    DAMPING_LOSS,  # of the rotation of elements against the ring [J]
    BELT_LOSS,  # of the transverse damping [J]
    ELEMENT_DAMPED,  # by the step itself, at contacts and noses between elements (`power`) [J]
    FLANK_DAMPED,  # at flanks and modes of the sheaves [J]
    RING_DAMPED,  # by the stretching of the ring [J]
    TILT_DAMPED,  # by the springs of the elements' tilt [J]
    POWER_RESIDUAL,  # of the equations of motion as they were solved [J]
) = range(13)
TOTALS = 13
DAMPED = {  # numerical damping of the step, by the springs and contacts where it occurs
    "elements": ELEMENT_DAMPED,
    "flanks": FLANK_DAMPED,
    "ring": RING_DAMPED,
    "tilt": TILT_DAMPED,
}

# Entries of the counters
STEPS, ITERATIONS, FAILED_STEPS, STATUS, FAILED_ELEMENT, FAILED_CONTACT, IN_A_ROW = range(7)
COUNTERS = 7
# values of STATUS
CONVERGED, NOT_CONVERGED, NOT_FINITE = range(3)
# values of FAILED_CONTACT
CONTACTS = ("edge", "head", "flank", "ring", "nose")


class Belt(NamedTuple):
    """Constants of a belt and its pulleys; of an element where not stated otherwise.

    Attributes
    ----------
    centre_distance : float
        [m]
    sine, cosine : float
        Of the half wedge angle.
    thickness : float
        [m]
    pitch_depth, head_height : float
        Of the rocking edge and the flank's contact point below the saddle, and of the head's contact above
        it [m].
    mass, inertia, ring_mass : float
        [kg], [kg m^2], and mass of the ring for each element [kg].
    ring_stiffness : float
        EA of both ring packages [N].
    flank_stiffness : float
        Normal force at each flank by its penetration [N/m].
    contact_stiffness : float
        Of each of the two contacts between elements [N/m].
    nose_height, nose_clearance, nose_stiffness : float
        Of nose and hole above the saddle [m], play to either side [m], infinite without noses, and [N/m].
    angle_stiffness, angle_damping : float
        Of an element's rotation against each segment of the ring, half at each end [N m/rad], [N m s/rad].
    transverse_damping : float
        Force against the speed across the path [N s/m].
    flank_law, flank_kinetic, flank_gradient, flank_speed : int, float, float, float
        Friction law at the flanks (`physics.friction`).
    friction_memory : float
        Time constant of the sliding speed at which that law is read [s].
    ring_friction : float
        Friction coefficient of the ring on the saddles.
    friction_speed, ring_friction_speed : float
        v_reg of both: friction is mu N tanh(|v| / v_reg) [m/s].
    driven_inertia : float
        [kg m^2]
    driving_rate, driven_rate : float
        Radial speed of the belt by the excess of a loose sheave's thrust over the belt's axial force
        [m/(s N)]; 0: the sheave is fixed.
    modal_stiffness : (2, modes) array
        S_k of the opening of each pulley's sheaves as sum a_k psi_k(phi), psi 1, cos, sin, cos 2, ... [N/m];
        none: rigid sheaves.
    """

    centre_distance: float
    sine: float
    cosine: float
    thickness: float
    pitch_depth: float
    head_height: float
    mass: float
    inertia: float
    ring_mass: float
    ring_stiffness: float
    flank_stiffness: float
    contact_stiffness: float
    nose_height: float
    nose_clearance: float
    nose_stiffness: float
    angle_stiffness: float
    angle_damping: float
    transverse_damping: float
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


class Newton(NamedTuple):
    """How a step is solved.

    Attributes
    ----------
    tolerance : float
        Largest correction of a speed [m/s].
    power_tolerance : float
        Largest power residual of the whole belt [W].
    weights : tuple of float
        Weights of the corrections of an element's speeds: lengths of angular velocities [m], else 1.
    most_iterations, first_half_step : int
        Iterations a step, and the first one whose correction is halved where corrections do not fall.
    most_failures : int
        Failed steps in a row with which a run ends.
    """

    tolerance: float
    power_tolerance: float
    weights: tuple[float, ...]
    most_iterations: int = 40
    first_half_step: int = 10
    most_failures: int = 20


NEWTON = Newton(tolerance=1e-3, power_tolerance=1.0, weights=(1.0, 1.0, 2e-3, 1.0))


class BeltState(NamedTuple):
    """State of a run, which `step.advance` takes on.

    Attributes
    ----------
    elements : (rows, STATE_FIELDS) LaneArray
        Element p rows + j lies in row j, lane p.
    pulleys : (4,) array
        Speeds [rad/s], and radii on which the flanks' contact points run without penetration [m].
    openings : (2, modes) array
        a_k of each pulley's sheaves [m].
    increments : (1 + 2 modes,) array
        Changes in the last step of the border's unknowns: speed of the driven pulley, openings.
    totals : (TOTALS,) array
        Sums since the start.
    counters : (COUNTERS,) int array
        Work done, and how the last call ended.
    """

    elements: LaneArray
    pulleys: np.ndarray
    openings: np.ndarray
    increments: np.ndarray
    totals: np.ndarray
    counters: np.ndarray


class Workspace(NamedTuple):
    """Work space of a step, which is not needed afterwards; of elements with b unknowns.

    Attributes
    ----------
    step : (rows, STEP_FIELDS) LaneArray
        Geometry, directions and the linear laws of a step.
    iterate : (rows, ITERATE_FIELDS) LaneArray
        Forces, slopes and residuals of an iterate.
    shapes : (rows, modes) LaneArray
        psi_k at the elements.
    blocks : (rows, b (3 b + columns)) LaneArray
        The system of an iteration (`solvers.linked_blocks`), with a column for the residual and one for each
        unknown of the border.
    narrow : LaneArray
        That of an element's first unknowns, where a model assembles it before the others come in; else
        `blocks` itself.
    scratch : (3, b (3 b + columns)) LaneArray
        Work space of its solution, and sums.
    border : (columns - 1, columns) array
        System of the border, its right side last.
    sums : (1, (columns - 1) columns) LaneArray
        Its entries in the parts of the ring (`border.close_border`).
    inputs : (INPUTS,) array
        Inputs of the step.
    increments : (1 + 2 modes,) array
        `BeltState.increments` at its start.
    kept : (2, STATE_FIELDS) array
        States of two elements before the last correction.
    """

    step: LaneArray
    iterate: LaneArray
    shapes: LaneArray
    blocks: LaneArray
    narrow: LaneArray
    scratch: LaneArray
    border: np.ndarray
    sums: LaneArray
    inputs: np.ndarray
    increments: np.ndarray
    kept: np.ndarray


# Fields of Workspace.step
(
    PREDICTED_Y,  # saddle point and running direction at q*
    PREDICTED_Z,
    PREDICTED_HEADING_Y,
    PREDICTED_HEADING_Z,
    T_Y,  # direction of the ring at an element
    T_Z,
    START_SLIP,  # of the ring at the old speeds
    TENSION_I_Y,  # direction of the tension at this element and at the next one
    TENSION_I_Z,
    TENSION_J_Y,
    TENSION_J_Z,
    PREDICTED_TENSION,
    TENSION_SLOPE,
    TURN_Y,  # rate of the angle of a segment by the speed difference of its ends
    TURN_Z,
    ANGLE_I,  # rate of the sine of the angle between element and segment by the difference of their rates
    ANGLE_J,
    PREDICTED_MOMENT_I,
    PREDICTED_MOMENT_J,
    EDGE_LEVER_I,
    EDGE_LEVER_J,
    EDGE_GAP,
    HEAD_LEVER_I,
    HEAD_LEVER_J,
    HEAD_GAP,
    NORMAL_Y,  # across the path: of the strand, or radial
    NORMAL_Z,
    R_Y,  # radial direction at the flank's contact point, at q_k
    R_Z,
    R_LEVER,
    T_LEVER,
    MID_R_Y,  # and at mid step
    MID_R_Z,
    MID_R_LEVER,
    MID_T_LEVER,
    MID_RADIUS,
    PREDICTED_DEPTH,  # penetration of the flank without opening of the sheaves
    NOSE_OFFSET,
    NOSE_LEVER_I,
    NOSE_LEVER_J,
    DIAGONAL,  # 4 x 4 blocks of the linear laws, by columns: of an element, and of it with the next one
) = range(41)
LINK = DIAGONAL + 16
STEP_FIELDS = LINK + 16

# Fields of Workspace.iterate
(
    ITERATE_TENSION,
    MOMENT_I,  # of the angle to the segment ahead, on this element and on the next one
    MOMENT_J,
    CONTACT,  # sums over both contacts: force, force times lever on this element and on the next one
    CONTACT_I,
    CONTACT_J,
    STIFF,  # the same of slopes: 1, levers, and products of levers
    STIFF_I,
    STIFF_J,
    STIFF_II,
    STIFF_IJ,
    STIFF_JJ,
    FORCE_R,  # of both flanks, in radial and in circumferential direction
    FORCE_T,
    DRIVEN_R,  # increase of both forces by the driven pulley's speed
    DRIVEN_T,
    OPENING_R,  # decrease of both forces by the opening of the sheaves
    OPENING_T,
    OPENING_N,  # decrease of the normal force by it
    RING_SLOPE,  # decrease of the ring's friction by its slip
    NOSE_SLOPE,
    EDGE_REACHED,  # gaps at both contacts, offset of the nose, penetration of the flanks [m]
    HEAD_REACHED,
    NOSE_REACHED,
    DEPTH_REACHED,
) = range(25)
RESIDUAL = 25  # 4 fields: of an element's equations
SLOPE_R = RESIDUAL + 4  # 3 fields: decrease of FORCE_R by U_Y, U_Z, OMEGA
SLOPE_T = SLOPE_R + 3  # 3 fields
ITERATE_FIELDS = SLOPE_T + 3
