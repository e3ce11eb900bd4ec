"""Many steps and samples in one call, by any of the belt's own steps."""

from typing import Any, NamedTuple

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray, like, merge_parts
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.lane_belt import LaneBelt, LaneState
from cvt_hpc.models.elastic_belt.lane_forces import derive, note_speeds
from cvt_hpc.models.elastic_belt.sampling import Samples, sample


class Sampled(NamedTuple):
    """The belt of which samples are taken, not in parts, and the step's work space."""

    belt: LaneBelt
    state: LaneState
    stations: LaneArray


@kernel
def march(
    begin: Any,
    advance: Any,
    take: Any,
    belt: LaneBelt,
    state: LaneState,
    work: Any,
    step: float,
    steps: int,
    sampled: Sampled,
    samples: Samples,
    first: int,
    last: int,
) -> None:
    """Fill rows first .. last - 1 with samples, `steps` steps of `step` [s] before each.

    The kernels: begin(belt, state, work) comes first; advance(belt, state, work, step) takes a step; take,
    with the arguments of `take_sample`, takes a sample. `sampled` is of the same run or runs; at the end it
    has all of the state.
    """
    begin(belt, state, work)
    for k in range(first, last):
        for taken in range(steps):
            note_speeds(belt, state, work.stations, taken, steps)
            advance(belt, state, work, step)
        take(state, work, sampled, samples, k)
    gather(state, work.stations, sampled, work.stations.data.shape[1])


@kernel
def begin_at_once(belt: LaneBelt, state: LaneState, work: Any) -> None:
    """Begin a march whose step needs no more than the results of `derive`."""


@kernel
def take_sample(state: LaneState, work: Any, sampled: Sampled, samples: Samples, k: int) -> None:
    """Sample the marched belt, which may be in parts."""
    gather(state, work.stations, sampled, lf.FIELDS_OF_FORCES)
    sample(sampled.belt, sampled.state, sampled.stations, samples, k)
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
    merge_parts(state.tilt, sampled.state.tilt, state.tilt.data.shape[1])
    merge_parts(state.scalars, sampled.state.scalars, state.scalars.data.shape[1])


@kernel
def sample_state(belt: LaneBelt, state: LaneState, stations: LaneArray, samples: Samples, k: int) -> None:
    """Take a sample, as `sample` does, of a state whose forces are not known yet."""
    derive(belt, state, stations)
    sample(belt, state, stations, samples, k)
