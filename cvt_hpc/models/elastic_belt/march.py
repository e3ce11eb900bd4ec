"""Many steps and samples in one call: one loop per step kernel, since a kernel is compiled for its callee."""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt.belt import (
    DRIVEN_POSITION,
    DRIVEN_SPEED,
    LAYER_WORK,
    N_ELEMENT,
    N_RING,
    TIME,
    V_ELEMENT,
    V_RING,
    Belt,
    State,
)
from cvt_hpc.models.elastic_belt.explicit import step_explicit
from cvt_hpc.models.elastic_belt.imex import ImexWork, derive, step_imex
from cvt_hpc.models.elastic_belt.lane_belt import LAYER_WORK as LANE_LAYER_WORK
from cvt_hpc.models.elastic_belt.lane_belt import POSITION, SPEED, LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.sampling import Sensors, sample
from cvt_hpc.physics.compliance import ContactState


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
        for _ in range(steps):
            step_imex(belt, state, work, step)
        sample(belt, state, work.stations, sensing, rows, k, profiles, ended)


@kernel
def march_explicit(
    belt: Belt,
    state: State,
    contacts: tuple[ContactState, ContactState],
    work: np.ndarray,
    lane_belt: LaneBelt,
    lane: LaneState,
    lane_work: ImexWork,
    step: float,
    steps: int,
    sensing: Sensors,
    rows: LaneArray,
    first: int,
    last: int,
    profiles: LaneArray,
    ended: LaneArray,
) -> int:
    """As `march_imex`, with the explicit step of one run, whose state is handed over to be sampled.

    Parameters
    ----------
    belt, state, contacts, work
        As `step_explicit` takes them.
    lane_belt, lane, lane_work
        The same run as a single lane.

    Returns
    -------
    int
        Linear solves of the contact problem.
    """
    solves = 0
    for k in range(first, last):
        for _ in range(steps):
            solves += step_explicit(belt, state, contacts, work, step)
        record_state(belt, state, lane_belt, lane, lane_work, sensing, rows, k, profiles, ended)
    return solves


@kernel
def record_state(
    belt: Belt,
    state: State,
    lane_belt: LaneBelt,
    lane: LaneState,
    lane_work: ImexWork,
    sensing: Sensors,
    rows: LaneArray,
    k: int,
    profiles: LaneArray,
    ended: LaneArray,
) -> None:
    """Sample the state of one run; arguments as of `march_explicit`, `k` the row."""
    hand_over(belt, state, lane)
    derive(lane_belt, lane, lane_work.stations)
    sample(lane_belt, lane, lane_work.stations, sensing, rows, k, profiles, ended)


@kernel
def hand_over(belt: Belt, state: State, lane: LaneState) -> None:
    """Copy a run's state into a LaneState of one lane."""
    fields, scalars = state.fields, state.scalars
    for j in range(belt.cell.size):
        for field in range(fields.shape[0]):
            base = 0.0
            if field == V_ELEMENT or field == V_RING:
                base = belt.belt_speed
            elif field == N_ELEMENT:
                base = 1.0
            elif field == N_RING:
                base = 1.0 + belt.curvature[j] * belt.ring_offset
            lane.fields[j, field] = fields[field, j] - base
    lane.scalars[0, SPEED], lane.scalars[0, POSITION] = scalars[DRIVEN_SPEED], scalars[DRIVEN_POSITION]
    lane.scalars[0, LANE_LAYER_WORK], scalars[LAYER_WORK] = scalars[LAYER_WORK], 0.0
    lane.time[0] = scalars[TIME]
