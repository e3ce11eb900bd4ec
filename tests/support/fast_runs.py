"""The belt's own steps for tests: runs with a state of their own choice, each in a lane of its own."""

from __future__ import annotations

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt.batch import STEPS
from cvt_hpc.models.elastic_belt.belt import LAYER_WORK, Belt, State
from cvt_hpc.models.elastic_belt.lane_belt import lane_belt, lane_state, take_lane
from cvt_hpc.models.elastic_belt.lane_forces import derive
from cvt_hpc.models.elastic_belt.march import Sampled
from cvt_hpc.models.elastic_belt.power import LAYER_LOSS, POWERS
from cvt_hpc.models.elastic_belt.sampling import CHANNELS, ENDED, OUTCOME, PROFILES, Outcome, Sensors


class FastRuns:
    """Runs on the same mesh.

    It marches by the kernel that runs take, so that tests need no other: that costs tens of seconds to compile.

    Parameters
    ----------
    belts, states : lists of Belt and State
        One for each lane; the states stay as they are.
    dtype : type
        np.float64 or np.float32.
    stepper : str
        "imex" or "explicit".
    """

    def __init__(
        self, belts: list[Belt], states: list[State], dtype: type = np.float64, stepper: str = "imex"
    ) -> None:
        self.belts = belts
        self.lanes = lane_state(belts, states, dtype)
        work_space, self._march = STEPS[stepper]
        self.work = work_space(self.lanes)
        self._constants = lane_belt(belts, dtype)
        n, width = belts[0].cell.size, len(belts)
        nowhere = np.zeros(2, dtype=np.int64)
        # an interval of 1 s: the dampers' mean power is their work since the last sample
        self._sensing = Sensors(np.zeros((0, n), dtype), *[nowhere] * 5, 1.0)
        self._rows = LaneArray(1, len(CHANNELS), width)
        self._profiles = LaneArray(n, len(PROFILES), width)
        self._ended = LaneArray(1, len(ENDED), width)
        self._layer_work = np.array([state.scalars[LAYER_WORK] for state in states])

    def advance(self, steps: int, step: float) -> None:
        """March, and take a sample at the end: with no step at all, of the state as it is."""
        # a test may have changed the state since
        derive(self._constants, self.lanes, self.work.stations)
        self._march(
            self._constants,
            self.lanes,
            self.work,
            step,
            steps,
            Sampled(self._constants, self.lanes, self.work.stations),
            self._sensing,
            self._rows,
            0,
            1,
            self._profiles,
            self._ended,
        )
        self._layer_work += self._rows.data[0, CHANNELS.index(POWERS[LAYER_LOSS])]

    def outcome(self, lane: int = 0) -> Outcome:
        """Why the run has ended, or that it goes on."""
        return Outcome(int(self._ended.data[0, OUTCOME, lane]))

    def state(self, lane: int = 0) -> State:
        """The state, with the dampers' work since the start."""
        state = take_lane(self.lanes, lane, self.belts[lane])
        state.scalars[LAYER_WORK] = self._layer_work[lane]
        return state

    def profiles(self) -> dict[str, np.ndarray]:
        """PROFILES by name, summed over the samples, (N, lanes) each."""
        return dict(zip(PROFILES, self._profiles.data.transpose(1, 0, 2), strict=True))

    def channels(self, lane: int = 0) -> dict[str, float]:
        """CHANNELS by name, of the last sample."""
        return dict(zip(CHANNELS, self._rows.data[0, :, lane].tolist(), strict=True))


def march(stepper: str, belt: Belt, state: State, step: float, steps: int) -> State:
    """State of one run after some steps, alone in its lane, with the dampers' work in them."""
    run = FastRuns([belt], [state], stepper=stepper)
    run.advance(steps, step)
    assert run.outcome() is Outcome.OK, run.outcome()
    return run.state()


def march_fast(belt: Belt, state: State, step: float, steps: int) -> State:
    """As `march`, by the fast step."""
    return march("imex", belt, state, step, steps)
