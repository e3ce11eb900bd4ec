"""Many steps and samples in one call: one loop per step kernel, since a kernel is compiled for its callee."""

from __future__ import annotations

from typing import NamedTuple

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, like, merge_parts
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.explicit import ExplicitWork, step_explicit
from cvt_hpc.models.elastic_belt.imex import step_imex
from cvt_hpc.models.elastic_belt.imex_stations import ImexWork
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_forces import derive, note_speeds
from cvt_hpc.models.elastic_belt.sampling import Sensors, sample


class Sampled(NamedTuple):
    """The belt of which samples are taken: the marched one, where that is in linked parts all in one.

    Attributes
    ----------
    belt, state
        Constants and state, not in parts.
    stations : LaneArray
        The step's work space.
    """

    belt: LaneBelt
    state: LaneState
    stations: LaneArray


@kernel
def march_imex(
    belt: LaneBelt,
    state: LaneState,
    work: ImexWork,
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
    """Fill rows first .. last - 1 with samples, `steps` steps before each.

    Parameters
    ----------
    belt, state, work
        As the step kernel takes them.
    step, steps : float, int
        Step [s] and their number between samples.
    sampled : Sampled
        Of the same run or runs; at the end it has all of the state.
    sensing, rows, profiles, ended
        As `sample` takes them.
    first, last : int
        Which rows.
    """
    for k in range(first, last):
        for taken in range(steps):
            note_speeds(belt, state, work.stations, taken, steps)
            step_imex(belt, state, work, step)
        take_sample(state, work.stations, sampled, sensing, rows, k, profiles, ended)
    gather(state, work.stations, sampled, work.stations.data.shape[1])


@kernel
def march_explicit(
    belt: LaneBelt,
    state: LaneState,
    work: ExplicitWork,
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
    """As `march_imex`, by the explicit step."""
    for k in range(first, last):
        for taken in range(steps):
            note_speeds(belt, state, work.stations, taken, steps)
            step_explicit(belt, state, work, step)
        take_sample(state, work.stations, sampled, sensing, rows, k, profiles, ended)
    gather(state, work.stations, sampled, work.stations.data.shape[1])


@kernel
def take_sample(
    state: LaneState,
    stations: LaneArray,
    sampled: Sampled,
    sensing: Sensors,
    rows: LaneArray,
    k: int,
    profiles: LaneArray,
    ended: LaneArray,
) -> None:
    """Sample the marched belt, which may be in parts."""
    gather(state, stations, sampled, lf.FIELDS_OF_FORCES)
    sample(sampled.belt, sampled.state, sampled.stations, sensing, rows, k, profiles, ended)
    # a sample takes it to its end
    state.scalars[0, lf.LAYER_WORK] = like(
        sampled.state.scalars[0, lf.LAYER_WORK], state.scalars[0, lf.LAYER_WORK]
    )


@kernel
def gather(state: LaneState, stations: LaneArray, sampled: Sampled, fields: int) -> None:
    """Join the sampled values from linked parts, of the stations' work space its first `fields`."""
    merge_parts(state.fields, sampled.state.fields, state.fields.data.shape[1])
    merge_parts(stations, sampled.stations, fields)
    merge_parts(state.column, sampled.state.column, state.column.data.shape[1])
    merge_parts(state.scalars, sampled.state.scalars, state.scalars.data.shape[1])


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
