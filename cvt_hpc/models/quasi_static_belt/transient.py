"""A transient run of the quasi-static belt by the model's own step."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import State, belt_constants, initial_state, random_strands
from cvt_hpc.models.elastic_belt.lane_belt import put_lane
from cvt_hpc.models.elastic_belt.recorded_run import OneLaneRun
from cvt_hpc.models.elastic_belt.sampling import CHANNELS as CHANNELS
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.validity import FAILURES
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.quasi_static_belt.split_belt import motion, refresh, split_basis, split_belt, work_space
from cvt_hpc.models.quasi_static_belt.step import march
from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Failure, Status, Values

BEYOND_LIMIT = 1.25  # of 2 / w of the fastest dynamic shape: contact may be stiffer than at rest


TAKES_OVER = True  # runs continue from the state of others


class _SplitRun(OneLaneRun):
    """One run by the stepper "split", advanced sample by sample; attributes as of `RecordedRun`."""

    failure: Failure | None

    def __init__(self, parameters: Parameters, stepper: str) -> None:
        p = parameters
        self.done, self.failure, self._begun = 0, None, 0.0
        self.prolong(p)
        self.belt = belt_constants(p)
        n = self.mesh.cell.size
        self._basis = split_basis(self.belt, self.mesh, p["split"], p["limit_frequency"], p["spline_spacing"])
        self._steps = max(int(np.ceil(self.interval / p["step"] - 1e-9)), 1)
        self.step = self.interval / self._steps
        self._model = split_belt(
            self.belt, self.mesh, self._basis, p["limit_frequency"], p["longitudinal"], self.step
        )
        first = initial_state(p, self.belt)
        self._motion, self._work = motion(self._model, first), work_space(self._model)
        self._make_lane(self.belt, first)
        self._march = called_alike(march)
        self._noted = np.zeros((3, n))
        self._disturbed = False

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._motion.state.scalars[0])

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return int(self._motion.counts[0])

    @property
    def contact_solves(self) -> int:
        """Linear solves of the contact problem so far."""
        return int(self._motion.counts[2])

    def counters(self) -> dict[str, int]:
        """Work done so far, by its name."""
        return dict(zip(("steps", "repeats", "contact_solves"), map(int, self._motion.counts), strict=True))

    @property
    def state(self) -> State:
        """The present state; a copy."""
        return self._motion.state.copy()

    def paused(self) -> _SplitRun:
        """The state from which a batch of the same point over a longer time continues: the run itself."""
        return self

    def take_over(self, runs: Sequence[Any]) -> None:
        """Continue a run by another stepper, its history included, except for means that began before.

        `runs` is one run of the same mesh, sampling and duration.
        """
        (run,) = runs
        self._go_on_from(run)
        self._motion = motion(self._model, run.state)

    def numerical_doubt(self, record: Values) -> Failure | None:
        """Whether a run that reached its end is not to be trusted, as `RecordedRun` has it; or its step."""
        found = super().numerical_doubt(record)
        limit = 2.0 / max(self._basis.fastest, 1e-9)
        if found is None and self.step > BEYOND_LIMIT * limit:
            why = f"the step {self.step:.3g} s is beyond the longest that is stable, {limit:.3g} s"
            found = Status.FAILED_NUMERICS, f"{why}: the fastest dynamic shapes grow from step to step"
        return found

    def advance(self, samples: int) -> Failure | None:
        """March on by so many samples at most, 0 compiles only; the failure, if the run cannot continue."""
        if samples == 0:
            self._march(self._model, self._motion, self._work, 0, self._noted)
        for _ in range(min(samples, self.samples - self.done)):
            if self.done == self._records.kick and not self._disturbed:
                self._disturb()
            if not self._march(self._model, self._motion, self._work, self._steps, self._noted):
                self.failure = FAILURES[Outcome.NO_CONTACT_SOLUTION]
                return self.failure
            outcome = self._record()
            if outcome != Outcome.OK:
                self.failure = FAILURES[outcome]
                return self.failure
        return None

    def _disturb(self) -> None:
        """Give the strands their random displacement, once the start-up's damping has gone."""
        p, moved, state = self.parameters, self._motion, self.state
        state.fields[f.W] += random_strands(self.mesh, p["disturbance"], p["seed"])
        nearest = motion(self._model, state)
        moved.q[:], moved.state.fields[f.W] = nearest.q, nearest.state.fields[f.W]
        refresh(self._model, moved)
        self._disturbed = True

    def _record(self) -> Outcome:
        """Record the present state."""
        lane, state = self._state, self._motion.state
        put_lane(lane, 0, self.belt, state)
        lane.scalars.data[0, lf.LAYER_WORK] = state.scalars[f.LAYER_WORK]
        state.scalars[f.LAYER_WORK] = 0.0
        # the layers' speeds are counted from the belt speed there: a second difference takes that out
        noted = self._noted.copy()
        noted[1:] += state.fields[2:4] - lane.fields.data[:, 2:4, 0].T
        self._stations.data[:, lf.NOTED : lf.NOTED + len(noted), 0] = noted.T
        outcome = self._sample_lane()
        self.done += int(outcome == Outcome.OK)
        return outcome


batch = batches_of_one(_SplitRun)
