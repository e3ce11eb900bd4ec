"""Runs of the elastic belt that advance together by a step in lanes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt.belt import W, belt_constants, initial_state, random_strands
from cvt_hpc.models.elastic_belt.explicit import explicit_work
from cvt_hpc.models.elastic_belt.grouping import lanes
from cvt_hpc.models.elastic_belt.imex_work import imex_work
from cvt_hpc.models.elastic_belt.lane_belt import lane_belt, lane_state
from cvt_hpc.models.elastic_belt.lane_forces import derive
from cvt_hpc.models.elastic_belt.lane_run import LaneRun
from cvt_hpc.models.elastic_belt.march import march_explicit, march_imex
from cvt_hpc.models.elastic_belt.recorded_run import recording
from cvt_hpc.models.elastic_belt.sampling import CHANNELS, ENDED, ENDED_AT, PROFILES

PRECISIONS = {"double": np.float64, "single": np.float32}
STEPS = {"imex": (imex_work, march_imex), "explicit": (explicit_work, march_explicit)}


class Batch:
    """Runs that advance together, sample by sample, each in a lane of its own.

    Parameters
    ----------
    points : sequence of dict
        Resolved parameters of the runs [SI], all of one `lane_key`.
    stepper : str
        "imex" or "explicit".

    Attributes
    ----------
    points, stepper
        As given.
    plan : Recording
        What is recorded.
    runs : tuple of LaneRun
        The runs.
    samples : int
        Samples of a whole run.
    done : int
        Samples taken so far.
    begun : float
        When it took over from another stepper [s]; 0 where it did not.
    interval, step : float
        Sampling interval and time step [s].
    """

    def __init__(self, points: Sequence[dict[str, Any]], stepper: str) -> None:
        p = points[0]
        most = lanes(p, stepper)
        if not 0 < len(points) <= most:
            raise ValueError(f"a batch of {stepper} takes 1 to {most} runs, not {len(points)}")
        self.points, self.stepper = tuple(points), stepper
        # one lane, or all of them: a register costs the same however many of its lanes are of use
        width = 1 if len(points) == 1 else most
        padded = [*points, *[points[-1]] * (width - len(points))]
        self.belts = [belt_constants(point) for point in padded]
        self.dtype = PRECISIONS[p["precision"]]
        starts = [initial_state(point, belt) for point, belt in zip(padded, self.belts, strict=True)]
        self._sweeps = p["contact_sweeps"] if stepper == "imex" else 0
        self.state = lane_state(self.belts, starts, self.dtype, self._sweeps)
        self._belt = lane_belt(self.belts, self.dtype)
        self._work_space, self._march = STEPS[stepper]
        self._work = self._work_space(self.state)
        derive(self._belt, self.state, self._work.stations)
        self.plan = recording(p, self.dtype)
        self.interval, self.samples = self.plan.interval, self.plan.samples
        self.steps_per_sample = max(int(np.ceil(self.interval / p["step"] - 1e-9)), 1)
        self.step = self.interval / self.steps_per_sample
        sensed = self.plan.sensing.matrix.shape[0]
        self.rows = LaneArray(self.samples, sensed + len(CHANNELS), width)
        self._ordered: np.ndarray | None = None
        self.done, self.begun = 0, 0.0
        n = self.plan.mesh.cell.size
        self.profiles = [LaneArray(n, len(PROFILES), width) for _ in range(2)]
        self.ended = LaneArray(1, len(ENDED), width)
        self._disturbed = False
        self.runs = tuple(LaneRun(self, lane) for lane in range(len(points)))

    @property
    def running(self) -> bool:
        """Whether any run has not ended."""
        return self.done < self.samples and any(run.failure is None for run in self.runs)

    def advance(self, samples: int) -> None:
        """March on, at most to the next border of the judged part.

        Parameters
        ----------
        samples : int
            How many samples at most.
        """
        first, plan = self.done, self.plan
        if first == plan.kick and not self._disturbed:
            for lane, point in enumerate(self.points):
                shape = random_strands(plan.mesh, point["disturbance"], point["seed"])
                self.state.fields.data[:, W, lane] += shape
            derive(self._belt, self.state, self._work.stations)
            self._disturbed = True
        borders = [border for border in (plan.kick, plan.first_judged, self.samples) if border > first]
        last = min(first + samples, *borders)
        self._march(
            self._belt,
            self.state,
            self._work,
            self.step,
            self.steps_per_sample,
            plan.sensing,
            self.rows,
            first,
            last,
            self.profiles[int(first >= plan.first_judged)],
            self.ended,
        )
        self.done = last

    def take_over(self, runs: Sequence[Any]) -> None:
        """Go on from where runs by another stepper stand, their history included, but for means begun before.

        Parameters
        ----------
        runs : sequence of LaneRun or GeneralTransient
            One for each run, of the same mesh, sampling and duration, all at the same time.
        """
        self.done, self._disturbed = runs[0].done, runs[0].done > self.plan.kick
        states = [run.state for run in runs]
        states += [states[-1].copy() for _ in self.belts[len(runs) :]]
        self.state = lane_state(self.belts, states, self.dtype, self._sweeps)
        self._work = self._work_space(self.state)
        derive(self._belt, self.state, self._work.stations)
        self.begun = self.ended.data[0, ENDED_AT] = runs[0].time
        for lane, run in enumerate(runs):
            self.rows.data[: self.done, :, lane] = run.rows
        if self.done > self.plan.first_judged:
            self.profiles[1].data[:] = np.nan  # what the other has summed up is not known

    def history(self, lane: int) -> np.ndarray:
        """Rows of a run, (samples, S + C); put in order of lanes and channels once all are there.

        As they are written, values of a channel lie far apart: reading them costs more than the copy.
        """
        if self.done < self.samples:
            return self.rows.data[:, :, lane]
        if self._ordered is None:
            self._ordered = np.ascontiguousarray(self.rows.data.transpose(2, 1, 0))
        return self._ordered[lane].T
