"""A run of the belt by a step that knows nothing of lanes: sampled as a single lane, as every other run."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.lane_belt import lane_belt, lane_state
from cvt_hpc.models.elastic_belt.lane_rings import SUMS, audit_layers, lane_rings
from cvt_hpc.models.elastic_belt.march import sample_state
from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun, Records
from cvt_hpc.models.elastic_belt.ring_settings import layer_count
from cvt_hpc.models.elastic_belt.rings import ring_constants, without_saddle_friction
from cvt_hpc.models.elastic_belt.sampling import OUTCOME, SCALARS, Outcome

_sample, _audit_layers = called_alike(sample_state), called_alike(audit_layers)


class OneLaneRun(RecordedRun):
    """Common parts of such runs; attributes as of `RecordedRun`."""

    done: int

    def prolong(self, parameters: Mapping[str, Any]) -> None:
        """Make room for the samples of a longer duration, whose judged part has yet to come.

        Parameters
        ----------
        parameters : dict
            Parameters of the run but for `duration` and `judged_fraction`.
        """
        RecordedRun.__init__(self, parameters, Records([parameters], 1, np.float64))
        rows = LaneArray(self.samples, self._records.channels, 1)
        if self.done:
            rows.data[: self.done, :, 0] = self.rows
        self._rows = rows
        # of the part that is not judged, and of the judged one
        self._layer_sums = [LaneArray(layer_count(parameters) + 1, len(SUMS), 1) for _ in range(2)]

    def _make_lane(self, belt: Belt, first: State) -> None:
        """The same run as a single lane, which can be sampled."""
        count = layer_count(self.parameters)
        if count > 1:
            self._rings = lane_rings([belt], [ring_constants(self.parameters, belt)], np.float64)
            self._layers = LaneArray(self.mesh.cell.size, count, 1)
            belt = without_saddle_friction(belt)
        self._lane_belt = lane_belt([belt], np.float64)
        self._state = lane_state([belt], [first], np.float64)
        self._stations = LaneArray(self.mesh.cell.size, lf.FIELDS_OF_FORCES, 1)

    @property
    def layer_sums(self) -> np.ndarray | None:
        """As of `RecordedRun`."""
        return self._layer_sums[1].data[:, :, 0] if layer_count(self.parameters) > 1 else None

    @property
    def rows(self) -> np.ndarray:
        """The sensors' displacement [m], the strands' modes [m], and CHANNELS, (done, S + C)."""
        return self._rows.data[: self.done, :, 0]

    def _go_on_from(self, run: Any) -> None:
        """Take over the history of a run by another stepper, except for means that began before."""
        self.done, self._disturbed = run.done, run.done > self._plan.kick
        self._rows.data[: self.done, :, 0] = run.rows
        if self.done > self._plan.first_judged:
            self._records.without_means()
            self._layer_sums[1].data[:] = np.nan

    def _sample_lane(self) -> Outcome:
        """Record the values in the lane; `done` is left to the caller."""
        layer_sums = self._layer_sums[int(self.done >= self._plan.first_judged)]
        with self._records.profiles_of(self.done) as profiles:
            place = self._plan.sensing, self._rows, self.done, profiles, self._records.ended
            _sample(self._lane_belt, self._state, self._stations, *place)
            if layer_count(self.parameters) > 1:
                first = self._sensed + len(SCALARS)
                of_layers = self._lane_belt, self._rings, self._state, self._layers, self._rows
                _audit_layers(*of_layers, self.done, first, profiles, layer_sums)
        return Outcome(int(self._records.ended.data[0, OUTCOME, 0]))
