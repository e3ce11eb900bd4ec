"""State and work space of a pushbelt on a ring of beams, as its kernels take them.

An element takes the fields of `pushbelt.belt`, so that both models are read off alike, and those below.
"""

from typing import NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.multibody.rcm_chain import Chain


class Proximal(NamedTuple):
    """How the set-valued laws of a step are solved, and how implicit the ring is.

    Attributes
    ----------
    theta : float
        0: the ring's elasticity is explicit; 1/2 to 1: linearly implicit (`step`).
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
