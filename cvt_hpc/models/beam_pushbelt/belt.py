"""State and work space of a pushbelt on a ring of beams, as its kernels take them.

An element takes the fields of `pushbelt.belt`, so that both models are read off alike, and those below.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.pushbelt.belt import STATE_FIELDS
from cvt_hpc.multibody.rcm_chain import Chain

(
    PLACE,  # of the element on the ring, length without load from the first node on [m]
    PLACE_RATE,  # [m/s]
    RING_IMPULSE,  # of friction on the ring along its line in the last step [N s]
    FLANK_IMPULSE_M,  # on the element at each flank, along the meridian [N s]
    FLANK_IMPULSE_T,  # and in the direction of rotation
) = range(STATE_FIELDS, STATE_FIELDS + 5)
FIELDS = STATE_FIELDS + 5

# Entries of the counters beside those of `pushbelt.belt`, of which ITERATIONS counts sweeps
CORRECTIONS = 7  # of impulses
COUNTERS = 8


class Proximal(NamedTuple):
    """How the set-valued laws of a step are solved, and how implicit the ring is.

    Attributes
    ----------
    theta : float
        0: the ring's elasticity is explicit; 1/2 to 1: linearly implicit (`rcm_chain.advance`).
    tolerance : float
        Speed up to which a law counts as fulfilled [m/s]; impulses count by the speed that they change.
    most_sweeps : int
        Sweeps over all contacts in a step.
    free_sweeps : int
        Sweeps in which the bounds of ring friction follow its normal forces.
    most_failures : int
        Unsolved steps in a row with which a run ends.
    """

    theta: float = 0.5
    tolerance: float = 1e-5
    most_sweeps: int = 500
    free_sweeps: int = 200
    most_failures: int = 20


class BeltState(NamedTuple):
    """State of a run, which `step.advance` takes on.

    Attributes
    ----------
    ring : Chain
        The ring, and the work space of its equations.
    elements : (n, FIELDS) array
        In the order of the belt.
    pulleys : (4,) array
        As `pushbelt.belt.BeltState` has them.
    totals : (TOTALS,) array
        Likewise.
    counters : (COUNTERS,) int array
        Work done, and how the last call ended.
    """

    ring: Chain
    elements: np.ndarray
    pulleys: np.ndarray
    totals: np.ndarray
    counters: np.ndarray


class Workspace(NamedTuple):
    """Work space of `step.advance`, which is not needed afterwards.

    Attributes
    ----------
    step : (n, STEP_FIELDS) array
        Geometry and impulses of a step.
    beams : (n,) int array
        On which beam an element is.
    rows : (n, ROWS, 8) array
        Rows of the ring's coordinates at the elements.
    middle : (5 k + 3,) array
        Coordinates of the ring at mid step.
    columns : (k + 1, 5) LaneArray
        Unit impulses on the ring, as many at a time as it has lanes.
    coupling : (n, 2, m) array
        Speeds of the ring at an element, across and along, by impulses on it: columns 2 f and 2 f + 1 are
        those across and along at element f; m is 2 n up to whole lanes [1/kg].
    impulses : (m,) array
        Impulses that friction has added to those of the last step [N s].
    free : (n, 3) array
        Both speeds of the ring at the elements without them [m/s], and the saddles' impulses [N s].
    inputs : (INPUTS,) array
        Inputs of the step.
    """

    step: np.ndarray
    beams: np.ndarray
    rows: np.ndarray
    middle: np.ndarray
    columns: LaneArray
    coupling: np.ndarray
    impulses: np.ndarray
    free: np.ndarray
    inputs: np.ndarray


# Rows of Workspace.rows (`rcm_beam.line_point`), at the start of a step and at its middle
ALONG, ACROSS, MID_ALONG, MID_ACROSS = range(4)
ROWS = 4

# Fields of Workspace.step
(
    T_Y,  # tangent of the ring at the start of a step; its normal is (-T_Z, T_Y)
    T_Z,
    MID_T_Y,  # and at its middle
    MID_T_Z,
    MID_STRETCH,  # |dr/ds| there
    COSINE,  # of the angle between both tangents
    TANGENT,
    FREE_T,  # velocity before the step in the directions of its start [m/s]
    FREE_N,
    IMPULSE_T,  # on the element but for that of the bilateral contact [N s]
    IMPULSE_N,
    SPIN,  # angular velocity after the step [rad/s]
    RING_ACROSS,  # speeds of the ring at the element in the directions of mid step, after the step [m/s]
    RING_ALONG,
    R_Y,  # direction from the pulley's shaft to the flank's contact point, and levers (`pushbelt.chain`)
    R_Z,
    R_LEVER,
    T_LEVER,
    MID_R_Y,
    MID_R_Z,
    MID_R_LEVER,
    MID_T_LEVER,
    MID_RADIUS,
    FLANK_BOUND,  # largest impulse of friction at a flank [N s]
    RING_STEP,  # of the proximal points [kg]
    FLANK_STEP,
) = range(26)
STEP_FIELDS = 26
