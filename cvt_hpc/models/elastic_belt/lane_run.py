"""One run of a batch, as its lane holds it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt.belt import State
from cvt_hpc.models.elastic_belt.lane_belt import take_lane
from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun
from cvt_hpc.models.elastic_belt.sampling import CONTACT_SOLVES, ENDED_AT, OUTCOME, REPEATED, Outcome
from cvt_hpc.models.elastic_belt.step_choice import transverse_limit
from cvt_hpc.models.elastic_belt.validity import FAILURES, step_doubt
from cvt_hpc.variables import Status

if TYPE_CHECKING:
    from cvt_hpc.models.elastic_belt.batch import Batch


class Paused(NamedTuple):
    """A run at its end, as another batch goes on with it; a copy, which keeps no batch alive.

    Attributes
    ----------
    time : float
        Simulated time [s].
    lane : tuple of (rows, fields) arrays
        Its lane of all that a batch keeps by lanes, in the order of `lane_arrays`.
    rows : (done, S + C) array
        Its history, as `LaneRun.rows`.
    """

    time: float
    lane: tuple[np.ndarray, ...]
    rows: np.ndarray


def lane_arrays(*parts: Any) -> Iterator[LaneArray]:
    """Yield the arrays of lanes in nested tuples, such as a LaneState or a step's work space."""
    for part in parts:
        if isinstance(part, LaneArray):
            yield part
        elif isinstance(part, tuple):
            yield from lane_arrays(*part)


class LaneRun(RecordedRun):
    """One run of a batch; attributes as of `RecordedRun`.

    Parameters
    ----------
    batch : Batch
        Which it belongs to.
    lane : int
        Its lane there.

    Attributes
    ----------
    batch : Batch
        As given.
    step : float
        Time step [s].
    """

    def __init__(self, batch: Batch, lane: int) -> None:
        super().__init__(batch.points[lane], batch.plan, batch.profiles[1].data[:, :, lane])
        self.batch, self.step = batch, batch.step
        self._lane = lane

    @property
    def failure(self) -> tuple[Status, str] | None:
        """What has gone wrong, where the run cannot go on."""
        outcome = int(self._ended(OUTCOME))
        return FAILURES[Outcome(outcome)] if outcome else None

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """Whether a run that reached its end is not to be trusted, as `RecordedRun` has it; or its step."""
        found = super().numerical_doubt(record)
        if found is None and self.batch.stepper == "imex":
            found = step_doubt(self.step, transverse_limit(self.parameters))
        return found

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._ended(ENDED_AT)

    @property
    def state(self) -> State:
        """The present state; a copy."""
        return take_lane(self.batch.state, self._lane, self.batch.belts[self._lane])

    def paused(self) -> Paused:
        """What a batch of the same point over a longer time goes on from."""
        kept = lane_arrays(self.batch.state, self.batch.work, self.batch.ended)
        lane = tuple(array.data[:, :, self._lane].copy() for array in kept)
        return Paused(float(self.batch.state.time[0]), lane, self.rows.copy(order="K"))

    @property
    def done(self) -> int:
        """Samples recorded so far, up to the one at which the run failed."""
        taken = round(self.time / self.interval)
        return taken if self.failure is None else taken - 1

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return round((self.time - self.batch.begun) / self.step)

    @property
    def contact_solves(self) -> int:
        """Linear solves of the contact problem so far."""
        return int(self._ended(CONTACT_SOLVES))

    def counters(self) -> dict[str, int]:
        """Work done so far, by its name."""
        counts = {"steps": self.steps, "contact_solves": self.contact_solves}
        if self.batch.stepper == "imex":
            counts["repeats"] = int(self._ended(REPEATED))
        return counts

    @property
    def rows(self) -> np.ndarray:
        """The sensors' displacement [m], the strands' modes [m], and CHANNELS, (done, S + C)."""
        return self.batch.history(self._lane)[: self.done]

    def _ended(self, what: int) -> float:
        return float(self.batch.ended.data[0, what, self._lane])
