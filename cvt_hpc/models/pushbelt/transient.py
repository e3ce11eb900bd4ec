"""A transient run of the planar pushbelt: it starts from geometry, is clamped and loaded, and recorded."""

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.pushbelt import run
from cvt_hpc.models.pushbelt.belt import NEWTON
from cvt_hpc.models.pushbelt.readings import SCALARS, Reading
from cvt_hpc.models.pushbelt.run import COURSES, ElementRun, given
from cvt_hpc.models.pushbelt.start import of_lanes, start, workspace
from cvt_hpc.models.pushbelt.step import EQUATIONS
from cvt_hpc.models.pushbelt.stepping import advance_by

CHANNELS = (*COURSES, *SCALARS)


class Transient(ElementRun):
    """One run of the planar pushbelt; parameters as of `ElementRun`."""

    def _begin(self, p: Mapping[str, Any]) -> None:
        self._advance = partial(called_alike(advance_by), EQUATIONS)
        self._belt, self._state = start(given(p))
        self._work = workspace(self._belt, p["elements"])
        self._method = NEWTON._replace(
            tolerance=p["speed_tolerance"],
            power_tolerance=p["power_tolerance"],
            most_iterations=p["most_iterations"],
        )

    def _read(self) -> Reading:
        return Reading(self._readings, self._elements(), self._state.pulleys)

    def _elements(self) -> np.ndarray:
        """Fields of the elements in the order of the belt, (n, fields)."""
        return of_lanes(self._state.elements)

    def _stored_energy(self, found: Reading) -> float:
        return found.stored_energy(self._state.openings)


batch = batches_of_one(Transient)
forget = run.forget
