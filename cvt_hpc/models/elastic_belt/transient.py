"""Transient runs of the elastic belt: state, stepper and recording in one object, for one run or a batch."""

from collections.abc import Sequence
from typing import Any

from cvt_hpc.models.elastic_belt import OWN_STEPPERS
from cvt_hpc.models.elastic_belt.batch import Batch
from cvt_hpc.models.elastic_belt.sampling import CHANNELS as CHANNELS
from cvt_hpc.models.marched import BatchOfOne, batches_of_one
from cvt_hpc.parameters import Parameters

TAKES_OVER = True  # runs continue from the state of others


def batch(points: Sequence[Parameters], stepper: str, paused: Sequence[Any] = ()) -> Batch | BatchOfOne:
    """Runs that advance together by any stepper that the belt takes.

    `points` are resolved parameters of the runs [SI], all of one `lane_key`; one for steppers without lanes.
    `paused` are results of `paused()` of shorter runs, one for each point, to continue from. Either batch has
    `runs`, `samples`, `done`, `running`, `interval` and `advance`.
    """
    if stepper in OWN_STEPPERS:
        return Batch(points, stepper, paused)
    from cvt_hpc.models.elastic_belt.general_run import GeneralTransient

    return batches_of_one(GeneralTransient)(points, stepper, paused)
