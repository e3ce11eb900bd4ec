"""Transient runs of the elastic belt: state, stepper and recording in one object, for one run or a batch.

A `Batch` has runs that advance together by a step in lanes, or one whose stations fill them. A `StateMarch`
takes the belt's own steps from states of one's choice, without a job, a recording or a verdict.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.lanes import LaneArray, split
from cvt_hpc.models.elastic_belt import OWN_STEPPERS, lane_belt, ring_step, sampling
from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt.belt import Belt, State, belt_constants, initial_state, random_strands
from cvt_hpc.models.elastic_belt.belt_settings import layer_count
from cvt_hpc.models.elastic_belt.explicit import FIELDS_OF_WORK, step_explicit
from cvt_hpc.models.elastic_belt.grouping import LANES, lanes
from cvt_hpc.models.elastic_belt.imex import step_imex
from cvt_hpc.models.elastic_belt.lane_forces import derive
from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun, Records
from cvt_hpc.models.elastic_belt.rings import ring_constants, with_layers, without_saddle_friction
from cvt_hpc.models.elastic_belt.sampling import CHANNELS as CHANNELS
from cvt_hpc.models.elastic_belt.sampling import begin_at_once, march, take_sample
from cvt_hpc.models.elastic_belt.step_choice import transverse_limit
from cvt_hpc.models.elastic_belt.validity import FAILURES, step_doubt
from cvt_hpc.models.marched import BatchOfOne, batches_of_one
from cvt_hpc.parameters import Parameters
from cvt_hpc.recording import steps_per_sample
from cvt_hpc.variables import Failure, Values

_Work = lane_belt.Work | ring_step.RingWork
PRECISIONS = {"double": np.float64, "single": np.float32}
_imex_march = partial(march, begin_at_once, step_imex, take_sample)
_explicit_march = partial(march, begin_at_once, step_explicit, take_sample)
_ring_march = partial(march, ring_step.begin_rings, ring_step.step_rings, ring_step.take_sample_of_rings)
STEPS = {  # fields of the work space, march
    "imex": (lf.FIELDS_OF_WORK, _imex_march),
    "explicit": (FIELDS_OF_WORK, _explicit_march),
}


class Paused(NamedTuple):
    """A run at its end, from which another batch continues; a copy, which keeps no batch alive."""

    time: float  # simulated [s]
    # its lane of all arrays that a batch keeps by lanes, in the order of `_lane_arrays`
    lane: tuple[np.ndarray, ...]
    rows: np.ndarray  # its history, as `LaneRun.rows`


def _lane_arrays(*parts: Any) -> Iterator[LaneArray]:
    """Yield the arrays of lanes in nested tuples, such as a LaneState or a step's work space."""
    for part in parts:
        if isinstance(part, LaneArray):
            yield part
        elif isinstance(part, tuple):
            yield from _lane_arrays(*part)


class Batch:
    """Runs that advance together, sample by sample, each in a lane of its own, or one in linked parts.

    Their `points` are resolved parameters [SI], all of one `lane_key`, their stepper "imex" or "explicit".
    They continue from `paused`, one for each: shorter runs of the same points by the same stepper and step.
    Each is then bit by bit the run of its point from the start.

    Attributes
    ----------
    records : Records
        The arrays into which it records.
    samples, done : int
        Samples of a whole run, and those taken so far.
    begun : float
        When it took over from another stepper [s]; 0 where it did not.
    interval, step : float
        Sampling interval and time step [s].
    """

    def __init__(self, points: Sequence[Parameters], stepper: str, paused: Sequence[Paused] = ()) -> None:
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
        fields, self._march = STEPS[stepper]
        self._work_space: Callable[..., _Work] = partial(lane_belt.work_space, fields=fields)
        if layer_count(p) > 1:
            rings = [ring_constants(point, belt) for point, belt in zip(padded, self.belts, strict=True)]
            self.belts = [without_saddle_friction(belt) for belt in self.belts]
            starts = [with_layers(*each) for each in zip(starts, self.belts, rings, strict=True)]
            self._work_space = partial(ring_step.ring_work, belts=self.belts, rings=rings)
            self._march = _ring_march
        self.state = lane_belt.lane_state(self.belts, starts, self.dtype)
        self._belt = lane_belt.lane_belt(self.belts, self.dtype)
        self.work = self._work_space(self.state)
        derive(self._belt, self.state, self.work.stations)
        self.records = Records(points, width, self.dtype)
        self.interval, self.samples = self.records.interval, self.records.samples
        self.steps_per_sample = steps_per_sample(self.interval, p["step"])
        self.step = self.interval / self.steps_per_sample
        self.begun = 0.0
        nothing = np.zeros((0, self.records.channels))
        self._go_on_after([run.rows for run in paused] or [nothing] * len(points))
        if paused:
            self._resume([*paused, *[paused[-1]] * (width - len(paused))])
        most_parts = LANES[p["precision"]] if p["lanes"] == "stations" else 1
        self._parts = lane_belt.parts_of(self.records.mesh.cell.size, most_parts)

    def _go_on_after(self, rows: Sequence[np.ndarray]) -> None:
        """Take rows that have been recorded, (done, S + C) each, as the beginning of the runs' histories."""
        self.done = self._recorded = len(rows[0])
        self._disturbed = self.done > self.records.kick
        self.rows = LaneArray(self.samples - self.done, rows[0].shape[1], len(self.belts))
        self._earlier = tuple(rows)
        self._ordered: np.ndarray | None = None

    def _resume(self, paused: Sequence[Paused]) -> None:
        """Put the runs' states into the lanes, with all data that the step keeps."""
        for k, array in enumerate(_lane_arrays(self.state, self.work, self.records.ended)):
            array.data[:] = np.stack([run.lane[k] for run in paused], axis=-1)
        self.state.time[0] = paused[0].time
        if isinstance(self.work, ring_step.RingWork):
            self.work.sums.data[:] = 0.0  # of a judged part that has yet to come

    @property
    def runs(self) -> tuple[LaneRun, ...]:
        """The runs; they keep the batch, which does not keep them, so that it goes with the last of them."""
        return tuple(LaneRun(self, lane) for lane in range(len(self.points)))

    @property
    def running(self) -> bool:
        """Whether any run has not ended."""
        outcomes = self.records.ended.data[0, sampling.OUTCOME, : len(self.points)]
        return self.done < self.samples and bool((outcomes == sampling.Outcome.OK).any())

    def advance(self, samples: int) -> None:
        """March on by so many samples at most, no further than to the next border of the judged part."""
        first, plan = self.done, self.records
        if first == plan.kick and not self._disturbed:
            for lane, point in enumerate(self.points):
                shape = random_strands(plan.mesh, point["disturbance"], point["seed"])
                self.state.fields.data[:, f.W, lane] += shape
            derive(self._belt, self.state, self.work.stations)
            self._disturbed = True
        kept = plan.momentary.first
        borders = plan.kick, plan.first_judged, kept, self.samples
        last = min(first + samples, *(border for border in borders if border > first))
        whole = sampling.Sampled(self._belt, self.state, self.work.stations)
        belt, state, work, parts = self._belt, self.state, self.work, self._parts
        if parts > 1:
            belt, state = lane_belt.parted(belt, parts), lane_belt.parted_state(state, parts)
            work = _parted_work(work, parts)
        ends = range(first + 1, last + 1) if first >= kept and last > first else [last]
        for end in ends:
            rows = self.done - self._recorded, end - self._recorded
            with plan.profiles_of(self.done) as profiles:
                into = sampling.Samples(plan.sensing, self.rows, profiles, plan.ended)
                self._march(belt, state, work, self.step, self.steps_per_sample, whole, into, *rows)
            self.done = end

    def take_over(self, runs: Sequence[Any]) -> None:
        """Continue runs by another stepper, their history included, except for means that began before.

        One LaneRun or GeneralTransient for each run, of the same mesh, sampling and duration, all at the same
        time.
        """
        self._go_on_after([np.broadcast_to(run.rows, (run.done, self.rows.data.shape[1])) for run in runs])
        states = [run.state for run in runs]
        states += [states[-1].copy() for _ in self.belts[len(runs) :]]
        self.state = lane_belt.lane_state(self.belts, states, self.dtype)
        self.work = self._work_space(self.state)
        derive(self._belt, self.state, self.work.stations)
        self.begun = self.records.ended.data[0, sampling.ENDED_AT] = runs[0].time
        if self.done > self.records.first_judged:
            self.records.without_means()
            if isinstance(self.work, ring_step.RingWork):
                self.work.sums.data[:] = np.nan

    def history(self, lane: int) -> np.ndarray:
        """Rows of a run so far, (done, S + C); put in order of lanes and channels once all are there.

        As they are written, values of a channel lie far apart: reading them costs more than the copy.
        """
        if self.done < self.samples:
            earlier = self._earlier[lane]
            new = self.rows.data[: self.done - self._recorded, :, lane]
            return np.concatenate([earlier, new]) if len(earlier) else new
        if self._ordered is None:
            ordered = np.empty((len(self.points), self.rows.data.shape[1], self.samples))
            ordered[:, :, self._recorded :] = self.rows.data.transpose(2, 1, 0)[: len(self.points)]
            for k, earlier in enumerate(self._earlier):
                ordered[k, :, : self._recorded] = earlier.T
            self._ordered = ordered
        return self._ordered[lane].T


def _parted_work(work: _Work, parts: int) -> _Work:
    """A step's work space for linked parts."""
    if isinstance(work, ring_step.RingWork):
        return ring_step.parted_ring_work(work, parts)
    return lane_belt.Work(split(work.stations, parts))


class LaneRun(RecordedRun):
    """One run of a batch, in a lane of it; attributes as of `RecordedRun`, and the time step `step` [s]."""

    def __init__(self, batch: Batch, lane: int) -> None:
        super().__init__(batch.points[lane], batch.records, lane)
        self.batch, self.step = batch, batch.step

    @property
    def failure(self) -> Failure | None:
        """The failure, where the run cannot continue."""
        outcome = int(self._ended(sampling.OUTCOME))
        return FAILURES[sampling.Outcome(outcome)] if outcome else None

    def numerical_doubt(self, record: Values) -> Failure | None:
        """Whether a run that reached its end is not to be trusted, as `RecordedRun` has it; or its step."""
        found = super().numerical_doubt(record)
        if found is None and self.batch.stepper == "imex":
            found = step_doubt(self.step, transverse_limit(self.parameters))
        return found

    @property
    def layer_sums(self) -> np.ndarray | None:
        """Return the sums over layers of `RecordedRun`."""
        work = self.batch.work
        return work.sums.data[:, :, self._lane] if isinstance(work, ring_step.RingWork) else None

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._ended(sampling.ENDED_AT)

    @property
    def state(self) -> State:
        """The present state; a copy."""
        return lane_belt.take_lane(self.batch.state, self._lane, self.batch.belts[self._lane])

    def paused(self) -> Paused:
        """The state from which a batch of the same point over a longer time continues."""
        kept = _lane_arrays(self.batch.state, self.batch.work, self._records.ended)
        lane = tuple(array.data[:, :, self._lane].copy() for array in kept)
        return Paused(float(self.batch.state.time[0]), lane, self.rows.copy(order="K"))

    @property
    def done(self) -> int:
        """Samples recorded so far, up to the one at which the run failed."""
        taken = round(self.time / self.interval)
        return taken if self.failure is None else taken - 1

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return round((self.time - self.batch.begun) / self.step)

    @property
    def contact_solves(self) -> int:
        """Linear solves of the contact problem so far."""
        return int(self._ended(sampling.CONTACT_SOLVES))

    def counters(self) -> dict[str, int]:
        """Work done so far, by its name."""
        counts = {"steps": self.steps, "contact_solves": self.contact_solves}
        if self.batch.stepper == "imex":
            counts["repeats"] = int(self._ended(sampling.REPEATED))
        return counts

    @property
    def rows(self) -> np.ndarray:
        """The sensors' displacement [m], the strands' modes [m], and CHANNELS, (done, S + C)."""
        return self.batch.history(self._lane)[: self.done]

    def _ended(self, what: int) -> float:
        return float(self._records.ended.data[0, what, self._lane])


class StateMarch:
    """Runs on the same mesh, each in a lane of its own, by the kernel that recorded runs take.

    One belt and state for each lane; the states stay as they are. The lanes' dtype is np.float64 or
    np.float32, the stepper "imex" or "explicit".
    """

    def __init__(
        self, belts: Sequence[Belt], states: Sequence[State], dtype: type = np.float64, stepper: str = "imex"
    ) -> None:
        self.belts = belts
        self.lanes = lane_belt.lane_state(list(belts), list(states), dtype)
        fields, self._march = STEPS[stepper]
        self.work = lane_belt.work_space(self.lanes, fields)
        self._constants = lane_belt.lane_belt(list(belts), dtype)
        n, width = belts[0].cell.size, len(belts)
        nowhere = np.zeros(2, dtype=np.int64)
        # an interval of 1 s: the dampers' mean power is their work since the last sample
        no_weights: np.ndarray = np.zeros((0, n), dtype)
        self._samples = sampling.Samples(
            sampling.Sensors(no_weights, nowhere, nowhere, nowhere, nowhere, nowhere, 1.0),
            LaneArray(1, len(sampling.CHANNELS), width),
            LaneArray(n, len(sampling.PROFILES), width),
            LaneArray(1, len(sampling.ENDED), width),
        )
        self._layer_work = np.array([state.scalars[f.LAYER_WORK] for state in states])

    def advance(self, steps: int, step: float) -> None:
        """March, and take a sample at the end: with no step at all, of the state as it is."""
        # the state may have been changed since
        derive(self._constants, self.lanes, self.work.stations)
        whole = sampling.Sampled(self._constants, self.lanes, self.work.stations)
        self._march(self._constants, self.lanes, self.work, step, steps, whole, self._samples, 0, 1)
        self._layer_work += self._samples.rows.data[0, sampling.CHANNELS.index("layer_loss")]

    def outcome(self, lane: int = 0) -> sampling.Outcome:
        """Why the run has ended, or that it continues."""
        return sampling.Outcome(int(self._samples.ended.data[0, sampling.OUTCOME, lane]))

    def state(self, lane: int = 0) -> State:
        """The state, with the dampers' work since the start."""
        state = lane_belt.take_lane(self.lanes, lane, self.belts[lane])
        state.scalars[f.LAYER_WORK] = self._layer_work[lane]
        return state

    def profiles(self) -> dict[str, np.ndarray]:
        """PROFILES by name, summed over the samples, (N, lanes) each."""
        return dict(zip(sampling.PROFILES, self._samples.profiles.data.transpose(1, 0, 2), strict=True))

    def channels(self, lane: int = 0) -> dict[str, float]:
        """CHANNELS by name, of the last sample."""
        return dict(zip(sampling.CHANNELS, self._samples.rows.data[0, :, lane].tolist(), strict=True))


def sampled(belt: Belt, state: State) -> StateMarch:
    """A run of which one sample is taken, of a state as it is."""
    march = StateMarch([belt], [state])
    march.advance(0, 1.0)
    return march


TAKES_OVER = True  # runs continue from the state of others


def batch(points: Sequence[Parameters], stepper: str, paused: Sequence[Any] = ()) -> Batch | BatchOfOne:
    """Runs that advance together by any stepper that the belt takes.

    `points` are resolved parameters of the runs [SI], all of one `lane_key`; one for steppers without lanes.
    `paused` are results of `paused()` of shorter runs, one for each point, to continue from. Either batch has
    `runs`, `samples`, `done`, `running`, `interval` and `advance`.
    """
    if stepper in OWN_STEPPERS:
        return Batch(points, stepper, paused)
    from cvt_hpc.models.elastic_belt.general_run import GeneralTransient

    return batches_of_one(GeneralTransient)(points, stepper, paused)
