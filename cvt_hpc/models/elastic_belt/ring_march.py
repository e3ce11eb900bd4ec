"""Many steps and samples of a belt with ring layers in one call."""

from __future__ import annotations

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_forces import note_speeds
from cvt_hpc.models.elastic_belt.lane_rings import audit_layers, unite_strains
from cvt_hpc.models.elastic_belt.march import Sampled, gather, take_sample
from cvt_hpc.models.elastic_belt.ring_step import STRIDE, RingWork, step_rings
from cvt_hpc.models.elastic_belt.sampling import SCALARS, Sensors


@kernel
def march_rings(
    belt: LaneBelt,
    state: LaneState,
    work: RingWork,
    step: float,
    steps: int,
    sampled: Sampled,
    sensing: Sensors,
    rows: LaneArray,
    first: int,
    last: int,
    profiles: LaneArray,
    ended: LaneArray,
) -> None:
    """As `march_imex`, with ring layers."""
    unite_strains(belt, work.rings, state, work.layers, STRIDE)
    powers = sensing.matrix.shape[0] + len(SCALARS)
    for k in range(first, last):
        for taken in range(steps):
            note_speeds(belt, state, work.stations, taken, steps)
            step_rings(belt, state, work, step)
        take_sample(state, work.stations, sampled, sensing, rows, k, profiles, ended)
        audit_layers(
            sampled.belt, work.whole, sampled.state, work.audited, rows, k, powers, profiles, work.sums
        )
    gather(state, work.stations, sampled, work.stations.data.shape[1])
