"""A run of the elastic belt by one of its own steps, alone in a batch, whose lanes its stations fill."""

from collections.abc import Mapping
from typing import Any

from cvt_hpc.models.elastic_belt.transient import Batch, LaneRun
from cvt_hpc.variables import Status


class Transient(LaneRun):
    """One run by "imex" or "explicit", with the parameters given [SI]."""

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        super().__init__(Batch([{**parameters, "lanes": "stations"}], stepper), 0)

    def advance(self, samples: int) -> tuple[Status, str] | None:
        """March on by so many samples at most; the failure, where the run cannot continue."""
        self.batch.advance(samples)
        return self.failure
