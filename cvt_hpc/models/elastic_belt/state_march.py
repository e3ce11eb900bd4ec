"""The belt's own steps from states of one's choice: runs without a job, a recording or a verdict."""

from collections.abc import Sequence

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import power_terms
from cvt_hpc.models.elastic_belt.batch import STEPS
from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.lane_belt import lane_belt, lane_state, take_lane
from cvt_hpc.models.elastic_belt.lane_forces import derive
from cvt_hpc.models.elastic_belt.march import Sampled
from cvt_hpc.models.elastic_belt.power_terms import POWERS
from cvt_hpc.models.elastic_belt.sampling import CHANNELS, ENDED, OUTCOME, PROFILES, Outcome, Samples, Sensors


class StateMarch:
    """Runs on the same mesh, each in a lane of its own, by the kernel that recorded runs take.

    One belt and state for each lane; the states stay as they are. The lanes' dtype is np.float64 or
    np.float32, the stepper "imex" or "explicit".
    """

    def __init__(
        self, belts: Sequence[Belt], states: Sequence[State], dtype: type = np.float64, stepper: str = "imex"
    ) -> None:
        self.belts = belts
        self.lanes = lane_state(list(belts), list(states), dtype)
        work_space, self._march = STEPS[stepper]
        self.work = work_space(self.lanes)
        self._constants = lane_belt(list(belts), dtype)
        n, width = belts[0].cell.size, len(belts)
        nowhere = np.zeros(2, dtype=np.int64)
        # an interval of 1 s: the dampers' mean power is their work since the last sample
        no_weights: np.ndarray = np.zeros((0, n), dtype)
        self._samples = Samples(
            Sensors(no_weights, nowhere, nowhere, nowhere, nowhere, nowhere, 1.0),
            LaneArray(1, len(CHANNELS), width),
            LaneArray(n, len(PROFILES), width),
            LaneArray(1, len(ENDED), width),
        )
        self._layer_work = np.array([state.scalars[f.LAYER_WORK] for state in states])

    def advance(self, steps: int, step: float) -> None:
        """March, and take a sample at the end: with no step at all, of the state as it is."""
        # the state may have been changed since
        derive(self._constants, self.lanes, self.work.stations)
        whole = Sampled(self._constants, self.lanes, self.work.stations)
        self._march(self._constants, self.lanes, self.work, step, steps, whole, self._samples, 0, 1)
        self._layer_work += self._samples.rows.data[0, CHANNELS.index(POWERS[power_terms.LAYER_LOSS])]

    def outcome(self, lane: int = 0) -> Outcome:
        """Why the run has ended, or that it continues."""
        return Outcome(int(self._samples.ended.data[0, OUTCOME, lane]))

    def state(self, lane: int = 0) -> State:
        """The state, with the dampers' work since the start."""
        state = take_lane(self.lanes, lane, self.belts[lane])
        state.scalars[f.LAYER_WORK] = self._layer_work[lane]
        return state

    def profiles(self) -> dict[str, np.ndarray]:
        """PROFILES by name, summed over the samples, (N, lanes) each."""
        return dict(zip(PROFILES, self._samples.profiles.data.transpose(1, 0, 2), strict=True))

    def channels(self, lane: int = 0) -> dict[str, float]:
        """CHANNELS by name, of the last sample."""
        return dict(zip(CHANNELS, self._samples.rows.data[0, :, lane].tolist(), strict=True))


def sampled(belt: Belt, state: State) -> StateMarch:
    """A run of which one sample is taken, of a state as it is."""
    march = StateMarch([belt], [state])
    march.advance(0, 1.0)
    return march
