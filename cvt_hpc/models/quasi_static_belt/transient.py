"""A transient run of the quasi-static belt by any general stepper."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.models.elastic_belt.belt import Belt, Mesh, State
from cvt_hpc.models.elastic_belt.general_run import GeneralTransient
from cvt_hpc.models.elastic_belt.sampling import CHANNELS
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.quasi_static_belt import equations

__all__ = ["CHANNELS", "TAKES_OVER", "Transient", "batch"]

TAKES_OVER = True  # runs go on from where others stand


class QuasiStaticForm:
    """As `cvt_hpc.models.elastic_belt.general_run.Form`, of the split model."""

    def __init__(self, belt: Belt, grid: Mesh, parameters: Mapping[str, Any]) -> None:
        self._model = equations.quasi_static_belt(belt, grid, parameters["limit_frequency"])
        self.system = equations.system(self._model)

    def pack(self, state: State) -> np.ndarray:
        """Unknowns nearest to a state."""
        return equations.pack(self._model, state)

    def state(self, time: float, y: np.ndarray) -> State:
        """State of unknowns; overwritten by the next call, and by the next evaluation of rates."""
        equations.unpack(self._model, time, y)
        return self._model.flat.state

    def hints(self, stepper: str) -> dict[str, Any]:
        """What SciPy's integrators can use: nothing, since splines fill the Jacobian."""
        return {}


class Transient(GeneralTransient):
    """One run; see `GeneralTransient`."""

    form = QuasiStaticForm


batch = batches_of_one(Transient)
