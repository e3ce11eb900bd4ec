"""What a sweep asks of one run, so that tests can put something small in the place of the mechanics."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any, Protocol

from cvt_hpc.variables import Variable

if TYPE_CHECKING:
    from cvt_hpc.job import Job


class Simulator(Protocol):
    """What a sweep needs to know of one run; the module `cvt_hpc.simulation` satisfies it."""

    Interrupted: type[Exception]

    def record_variables(self, job: Job) -> tuple[Variable, ...]:
        """Return the quantities of a run's record, `status` first."""

    def record_coordinates(self, job: Job) -> Mapping[str, Any]:
        """Return the dimensions of the record beside the grid's: name -> (values, units, long_name)."""

    def run_point(
        self, job: Job, point: dict[str, Any], interrupt: Callable[[], str | None]
    ) -> Mapping[str, Any]:
        """Do one run; raise `Interrupted` when `interrupt()` returns a text."""


def default_simulator() -> Simulator:
    """Return the module that does runs of the models."""
    # Imported late: reading a status or gathering needs no kernels.
    return import_module("cvt_hpc.simulation")
