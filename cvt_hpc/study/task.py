"""What a sweep computes: batches of runs, each of which ends with a record, whatever becomes of it."""

from __future__ import annotations

import logging
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.study.batches import Batch, share_out
from cvt_hpc.study.description import Study
from cvt_hpc.study.record import Record
from cvt_hpc.study.simulator import Simulator

if TYPE_CHECKING:
    from cvt_hpc.job import Job

Interrupt = Callable[[], str | None]

_logger = logging.getLogger(__name__)


@dataclass(frozen=True)
class Task:
    """The runs of a job and what does them.

    Attributes
    ----------
    job : Job
        What to run.
    study : Study
        The layout of its records.
    simulator : Simulator
        What does the runs.
    """

    job: Job
    study: Study
    simulator: Simulator

    def plan(self, pending: np.ndarray, ranks: int) -> list[Batch]:
        """Return the runs that are to be done, in batches, in the order in which to start them."""
        groups = self.simulator.lane_groups(self.job, pending.tolist())
        return share_out(groups, self.simulator.run_costs(self.job), ranks)

    def do(self, batch: Batch, interrupt: Interrupt) -> Iterator[list[Record]]:
        """Do the runs of a batch, and yield their records as they come; none of runs that are broken off.

        All come at once, unless an exception ends the batch. Then its runs are done one by one, so that only
        those that raise it fail, and each record comes when its run ends.
        """
        try:
            records, error = self._attempt(batch, interrupt)
            if error is None:
                yield records
            elif len(batch) == 1:
                yield [(batch[0], self.study.pack_failure(error))]
            else:
                yield from self._do_one_by_one(batch, error, interrupt)
        except self.simulator.Interrupted:
            return

    def _do_one_by_one(self, batch: Batch, error: str, interrupt: Interrupt) -> Iterator[list[Record]]:
        found = False
        for index in batch:
            records, own_error = self._attempt((index,), interrupt)
            found = found or own_error is not None
            yield records if own_error is None else [(index, self.study.pack_failure(own_error))]
        if not found:
            # Every record is sound, but the time that lanes save is lost, and nobody would know.
            runs = ", ".join(map(str, batch))
            _logger.warning("runs %s, done together, raised %s; none of them does alone", runs, error)

    def _attempt(self, batch: Batch, interrupt: Interrupt) -> tuple[list[Record], str | None]:
        """Return the records of all runs, or none and the exception that ended the batch."""
        try:
            points = [self.job.point(index) for index in batch]
            found = self.simulator.run_points(self.job, points, interrupt)
            return [(index, self._pack(values)) for index, values in zip(batch, found, strict=True)], None
        except self.simulator.Interrupted:
            raise
        except Exception as error:  # one run's defect must not cost the others
            return [], _in_words(error)

    def _pack(self, values: Mapping[str, Any]) -> np.ndarray:
        """Return the record of what a run delivered, that of a failure if it is no record."""
        try:
            return self.study.pack(values)
        except Exception as error:
            return self.study.pack_failure(_in_words(error))


def _in_words(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
