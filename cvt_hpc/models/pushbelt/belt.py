"""The constants, state and work space of a planar pushbelt, as its kernels take them.

Arrays hold one row an element, in linked lanes (`cvt_hpc.lanes.rings`): the ring of elements is cut into
equal parts, one for each lane of a register.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray


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
