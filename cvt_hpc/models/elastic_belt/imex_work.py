"""Work space of the fast step: what it keeps at each station beside the state."""

from __future__ import annotations

from typing import NamedTuple

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt.lane_belt import LaneState
from cvt_hpc.models.elastic_belt.lane_forces import FIELDS_OF_FORCES

# fields of ImexWork.stations, after those of `lane_forces`
PUSH, LAG, SLOPE, FLANK, FLANK_SLOPE, FLANK_CROSS = range(FIELDS_OF_FORCES, 23)
REVERSING, RING_REVERSING, MEETING, AHEAD = range(23, 27)
D_00, D_01, D_11, Y_0, Y_1 = range(27, 32)
I_00, I_01, I_11, DV_0, DV_1, G_00, G_01, G_10, G_11, LINK_0, LINK_1 = range(32, 43)
FIELDS_OF_WORK = 43


class ImexWork(NamedTuple):
    """Work space of the step.

    Attributes
    ----------
    stations : (N, 43) LaneArray
        The fields of `lane_forces`. Of the step: pending increment of u, its sensitivity to v_element's,
        slope w_s, of the driven pulley's stations the flanks' tangential force and its slopes, whether (1)
        linearised friction would turn the sliding of the flanks, or of the saddle, about, whether (1) the
        elements of the cell ahead of a station meet within the step, and, where they are apart, their strain
        at its end with the speeds that it begins with; the blocks of the system and its right side;
        the eliminated system: inverse pivots, the increments of v_element and v_ring, the border, the
        stresses' slopes with the speeds' differences.
    """

    stations: LaneArray


def imex_work(state: LaneState) -> ImexWork:
    """Work space for a state; `derive` has to be called before the first step."""
    rows, _, lanes = state.fields.data.shape
    return ImexWork(LaneArray(rows, FIELDS_OF_WORK, lanes, state.fields.data.dtype))
