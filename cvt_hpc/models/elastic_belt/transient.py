"""Transient runs of the elastic belt: state, stepper and recording in one object, for one run or a batch."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from cvt_hpc.models.elastic_belt import OWN_STEPPERS
from cvt_hpc.models.elastic_belt.batch import Batch, LaneRun
from cvt_hpc.models.elastic_belt.sampling import CHANNELS
from cvt_hpc.models.marched import BatchOfOne, batches_of_one
from cvt_hpc.variables import Status

__all__ = ["CHANNELS", "TAKES_OVER", "Transient", "batch"]

TAKES_OVER = True  # runs continue from the state of others


def batch(
    points: Sequence[Mapping[str, Any]], stepper: str, paused: Sequence[Any] = ()
) -> Batch | BatchOfOne:
    """Runs that advance together by any stepper that the belt takes.

    Parameters
    ----------
    points : sequence of dict
        Resolved parameters of the runs [SI], all of one `lane_key`; one for steppers without lanes.
    stepper : str
        A stepper that the model takes.
    paused : sequence, optional
        Results of `paused()` of shorter runs, one for each point, to continue from.

    Returns
    -------
    Batch or BatchOfOne
        They have `runs`, `samples`, `done`, `running`, `interval` and `advance` in common.
    """
    if stepper in OWN_STEPPERS:
        return Batch(points, stepper, paused)
    from cvt_hpc.models.elastic_belt.general_run import GeneralTransient

    return batches_of_one(GeneralTransient)(points, stepper, paused)


class Transient(LaneRun):
    """One run, alone in a batch of its own; attributes as of `LaneRun`.

    Parameters
    ----------
    parameters : dict
        Resolved parameters of the run [SI].
    stepper : str
        "imex" or "explicit".
    """

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        super().__init__(Batch([parameters], stepper), 0)

    def advance(self, samples: int) -> tuple[Status, str] | None:
        """March on.

        Parameters
        ----------
        samples : int
            How many samples at most.

        Returns
        -------
        (Status, str) or None
            The failure, where the run cannot continue.
        """
        self.batch.advance(samples)
        return self.failure
