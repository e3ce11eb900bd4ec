"""The interface of a sweep to its runs, so that tests can replace the mechanics by something small."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from cvt_hpc.job.values import Point
from cvt_hpc.study.batches import Batch
from cvt_hpc.variables import Coordinate, Variable

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.job import Job


Interrupt = Callable[[], str | None]  # returns a text where runs have to end
RecordValues = Mapping[str, Any]  # those of a run, by the names of its quantities


class Simulator(Protocol):
    """The functions that a sweep needs; the module `cvt_hpc.simulation` satisfies it."""

    Interrupted: type[Exception]

    def record_variables(self, job: Job) -> tuple[Variable, ...]:
        """Return the quantities of a run's record, `status` first."""

    def record_coordinates(self, job: Job) -> Mapping[str, Coordinate]:
        """Return the dimensions of the record beside the grid's, by name."""

    def run_costs(self, job: Job) -> np.ndarray:
        """Return the predicted duration of each run, in any unit."""

    def lane_groups(self, job: Job, indices: Sequence[int]) -> list[tuple[int, ...]]:
        """Split run indices into batches of runs that can advance together, as large as may be."""

    def turns(self, job: Job, runs: int) -> int:
        """Return how many groups of lanes a batch of so many runs does one after the other."""

    def may_join(self, job: Job, runs: Batch, others: Batch) -> bool:
        """Return whether other runs can be done in the batch of some, and fill the lanes with them."""

    def pilot_share(self, job: Job) -> float:
        """Return the share of a run's simulated time from which the cost of the whole run is estimated."""

    def profile_bytes(self, job: Job) -> int:
        """Return the size of a kept history's values along the belt at each sample, at most [byte]."""

    def forget(self, job: Job) -> None:
        """Have the next batch take its full time, whatever runs before it have left."""

    def run_points(
        self, job: Job, points: Sequence[Point], interrupt: Interrupt, more: Callable[[], Sequence[Point]]
    ) -> Sequence[RecordValues]:
        """Do the runs of a batch, and return their records in the order of the points.

        No number of a record depends on the other runs of its batch. When `interrupt()` returns a text, all
        runs end by `Interrupted`. When all runs have done their first transients, `more()` gives the points
        of runs that join, and again when these have, until there are none.
        """

    def run_points_keeping(
        self, job: Job, points: Sequence[Point], interrupt: Interrupt, kept: Collection[int]
    ) -> tuple[Sequence[RecordValues], dict[int, xr.Dataset]]:
        """Do as `run_points`, and return the histories of the runs at the places `kept` as well."""


def default_simulator() -> Simulator:
    """Return the module that does runs of the models."""
    # Imported late: reading a status or gathering needs no kernels.
    return import_module("cvt_hpc.simulation")
