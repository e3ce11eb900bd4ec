"""Many steps and samples in one call: one loop per step kernel, since a kernel is compiled for its callee."""

from __future__ import annotations

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt.explicit import ExplicitWork, step_explicit
from cvt_hpc.models.elastic_belt.imex import step_imex
from cvt_hpc.models.elastic_belt.imex_work import ImexWork
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_forces import derive, note_speeds
from cvt_hpc.models.elastic_belt.sampling import Sensors, sample


@kernel
def march_imex(
    belt: LaneBelt,
    state: LaneState,
    work: ImexWork,
    step: float,
    steps: int,
    sensing: Sensors,
    rows: LaneArray,
    first: int,
    last: int,
    profiles: LaneArray,
    ended: LaneArray,
) -> None:
    """Fill rows first .. last - 1 with samples, `steps` steps before each.

    Parameters
    ----------
    belt, state, work
        As the step kernel takes them.
    step, steps : float, int
        Step [s] and their number between samples.
    sensing, rows, profiles, ended
        As `sample` takes them.
    first, last : int
        Which rows.
    """
    for k in range(first, last):
        for taken in range(steps):
            note_speeds(belt, state, work.stations, taken, steps)
            step_imex(belt, state, work, step)
        sample(belt, state, work.stations, sensing, rows, k, profiles, ended)


@kernel
def march_explicit(
    belt: LaneBelt,
    state: LaneState,
    work: ExplicitWork,
    step: float,
    steps: int,
    sensing: Sensors,
    rows: LaneArray,
    first: int,
    last: int,
    profiles: LaneArray,
    ended: LaneArray,
) -> None:
    """As `march_imex`, by the explicit step."""
    for k in range(first, last):
        for taken in range(steps):
            note_speeds(belt, state, work.stations, taken, steps)
            step_explicit(belt, state, work, step)
        sample(belt, state, work.stations, sensing, rows, k, profiles, ended)


@kernel
def sample_state(
    belt: LaneBelt,
    state: LaneState,
    stations: LaneArray,
    sensing: Sensors,
    rows: LaneArray,
    k: int,
    profiles: LaneArray,
    ended: LaneArray,
) -> None:
    """As `sample`, of a state whose forces are not known yet."""
    derive(belt, state, stations)
    sample(belt, state, stations, sensing, rows, k, profiles, ended)
