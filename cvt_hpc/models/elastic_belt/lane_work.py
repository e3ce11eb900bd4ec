"""Work space of the step in lanes: what is kept at each station beside the state."""

from __future__ import annotations

from typing import NamedTuple

from cvt_hpc.lanes import LaneArray

# fields of ImexWork.stations
FORCE, LAST_U, EPS_0, EPS_1, SHORT_0, SHORT_1, PER_CONTENT_0, PER_CONTENT_1 = range(8)
PUSH, LAG, SLOPE, FLANK, FLANK_SLOPE, FLANK_CROSS, SLIDING_R, SLIDING_T, REVERSING = range(8, 17)
D_00, D_01, D_11, Y_0, Y_1 = range(17, 22)
I_00, I_01, I_11, DV_0, DV_1, G_00, G_01, G_10, G_11, LINK_0, LINK_1 = range(22, 33)
COEFFICIENT, FACTOR, PER_SPEED, RING_FACTOR = range(33, 37)
FIELDS_OF_WORK = 37


class ImexWork(NamedTuple):
    """Work space of the step.

    Attributes
    ----------
    stations : (N, 37) LaneArray
        Of the present state: axial line force, u one step earlier, the cells' strains, 1 / (1 + strain) and 1
        / content. Of the step: pending increment of u, its sensitivity to v_element's, slope w_s, the flanks'
        tangential force and its slopes, sliding speeds, whether (1) the linearised friction would throw the
        station back; the blocks of the system and its right side; the eliminated system: inverse pivots, the
        increments of v_element and v_ring, the border, the stresses' slopes with the speeds' differences; the
        law's coefficient, tanh of sliding speed over regularisation, 1 / that speed, the same of rings.
    """

    stations: LaneArray
