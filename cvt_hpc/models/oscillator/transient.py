"""Transient runs of the oscillator, alone by any stepper or together by `moreau`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.models.marched import MarchedRun, Probe, batches_of_one
from cvt_hpc.models.oscillator import motion
from cvt_hpc.models.oscillator.lanes import ENDED, Lane, Lanes, march
from cvt_hpc.models.oscillator.rest import (
    REASONS,
    REST,
    peak,
    rest_missed,
    stuck_wrongly,
    wrongly_held,
    wrongly_stuck,
)
from cvt_hpc.models.oscillator.swing import Swing, silenced, swing_of
from cvt_hpc.recording import sample_count, steps_per_sample
from cvt_hpc.steppers.facts import OK, STEPS, Result
from cvt_hpc.variables import Status

CHANNELS = ("speed",)


class Transient(MarchedRun):
    """One run of the oscillator, from resolved parameters [SI], by a stepper that the model takes.

    A run ends as failed where its friction at rest is not that of the model (`rest`): at the first sample
    within a step of rest, should step or tolerance be too coarse to find rest; and wherever the mass was let
    go by less, or held against more, than friction can do. So does a run whose step damps a vibration about
    steady sliding that friction drives (`slide`), at its first sample.

    `is_set_valued` tells whether friction jumps at rest; else the jump is smoothed, and sticking is creep.
    """

    def __init__(self, parameters: Mapping[str, Any], stepper: str) -> None:
        self.is_set_valued = stepper == "moreau"
        equations = (motion.set_valued_system if self.is_set_valued else motion.system)(parameters)
        self.constants = o = motion.oscillator(parameters)
        self._peak = None if self.is_set_valued else peak(o)
        probes = (Probe("mass", 0.0),)
        frequency = np.sqrt(o.stiffness / o.mass)
        start = motion.initial_state(parameters)
        super().__init__(parameters, stepper, equations, start, probes, (motion.X,), frequency)
        self._silenced = None
        if not self.marching.facts.adaptive:
            self._silenced = silenced(o, equations, stepper, parameters, self.interval)
        self._typical_speed = float(equations.scale[motion.V])
        self._allowed = parameters.get("tolerance", 0.0) * self._typical_speed

    def _doubt(self, first: int) -> str | None:
        seen = self.rows[max(first - 1, 0) : self.done]
        o = self.constants
        missed = rest_missed(o, self.marching.facts, self.step, self._allowed, seen) or self._silenced
        if missed or not self.is_set_valued:
            return missed or wrongly_held(o, self._peak, seen, self.interval)
        return wrongly_stuck(o, seen, self.interval, self.step, self.slowest)

    @cached_property
    def steady(self) -> motion.SteadySliding:
        """Steady sliding of the mass."""
        return motion.steady_sliding(self.constants)

    @property
    def contact_solves(self) -> int:
        """Solves of the contact with the belt so far; none where friction is smoothed."""
        return self.counters()["solves"] if self.is_set_valued else 0

    @property
    def first_judged(self) -> int:
        """Samples before the judged part."""
        return self.samples - round(self.parameters["judged_fraction"] * self.samples)

    @property
    def is_stuck(self) -> np.ndarray:
        """Whether the mass sticks, or with smoothed friction creeps, at each sample so far, (done,) bool."""
        return np.abs(self.constants.belt_speed - self.channel("speed")) <= self.slowest

    @property
    def slowest(self) -> float:
        """Sliding [m/s] up to which the mass sticks or creeps."""
        if self.is_set_valued:
            return REST * float(np.abs(self.channel("speed")).max(initial=self._typical_speed))
        return motion.HUMP * self.constants.width

    def friction(self) -> np.ndarray:
        """Friction force on the mass at each sample so far, (done,) [N]."""
        several, rows = motion.together([self.constants]), self.rows[np.newaxis, : self.done]
        return motion.friction_forces(several, rows, np.array([self.slowest]), self.is_set_valued)[0]

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,): speed of the mass [m/s]."""
        return self.rows[: self.done, {"speed": motion.V}[name]]


class LaneRun(Transient):
    """A run of a `Batch`: a `Transient` by `moreau`, whose steps the batch takes."""

    def __init__(
        self, parameters: Mapping[str, Any], constants: motion.Oscillator, steady: motion.SteadySliding
    ) -> None:
        self.is_set_valued, self.constants, self.probes = True, constants, (Probe("mass", 0.0),)
        self.interval, self.done, self.steady = 1.0 / parameters["sampling_rate"], 0, steady
        self.marching: Lane = Lane(parameters, self.interval)
        self._displacements, self._silenced = [motion.X], None
        self._longest = self.marching.facts.vibration_limit / np.sqrt(constants.stiffness / constants.mass)

    def extend(self, parameters: Mapping[str, Any], rows: np.ndarray) -> None:
        """Record in other rows from now on, (samples, 2), of a run over another duration."""
        if self.done:
            rows[: self.done] = self.rows[: self.done]
        self.parameters, self.samples, self.rows = parameters, len(rows), rows

    def end(self, outcome: Result, stuck: str | None) -> None:
        """Fail, by the outcome of the march, or by what it did with the mass."""
        wrong = self._too_long()
        if outcome == Result.OK:
            wrong = wrong or self._silenced or stuck
        else:
            wrong = wrong or self.marching.explain(outcome)
        self.failure = Status.FAILED_NUMERICS, str(wrong)

    @property
    def slowest(self) -> float:
        """Sliding [m/s] up to which the mass sticks."""
        return REST * float(self.marching.lanes.fastest[self.marching.place])


class Batch:
    """Runs of the oscillator, of one `lane_key`, that advance together by `moreau`.

    They continue from `paused`, shorter runs of the same points. They are looked at after 1, 3, 7, 15, ...
    samples of the batch, whatever runs there are and however long these take, and so end with the numbers
    that they have alone.
    """

    def __init__(self, points: Sequence[Mapping[str, Any]], paused: Sequence[LaneRun] = ()) -> None:
        count, p = len(points), points[0]
        self.interval, self.samples, self.done = 1.0 / p["sampling_rate"], sample_count(p), 0
        self._steps = steps_per_sample(self.interval, p["step"])
        each = [run.constants for run in paused] or [motion.oscillator(point) for point in points]
        self._several = several = motion.together(each)
        self._rows, self._lanes = np.full((count, self.samples, 2), np.nan), Lanes.at(np.zeros((count, 2)))
        if paused:
            self.runs, self.done = tuple(paused), paused[0].done
            for place, run in enumerate(self.runs):
                run.marching.go_over(self._lanes, place)
        else:
            known = np.empty((count, 7))
            _know(several, known)
            self._lanes.fastest[:] = known[:, 3]
            steady = [motion.sliding_with(*numbers[:3]) for numbers in known.tolist()]
            self.runs = tuple(map(LaneRun, points, each, steady))
            for place, (point, run) in enumerate(zip(points, self.runs, strict=True)):
                self._lanes.state[place] = motion.initial_state(point, run.steady)
                run.marching.enter(self._lanes, place)
            self._find_silenced([Swing(*numbers[4:]) for numbers in known.tolist()])
        for point, run, rows in zip(points, self.runs, self._rows, strict=True):
            run.extend(point, rows)
        self._longest = np.array([run._longest for run in self.runs])
        self._seen, self._border = self.done, self.done + 1

    def _find_silenced(self, swings: Sequence[Swing]) -> None:
        """Note of which runs the step damps a vibration that friction drives."""
        driven = [(run, swing) for run, swing in zip(self.runs, swings, strict=True) if swing.is_driven]
        if not driven:
            return
        lengths = [swing.samples(self.interval) for _, swing in driven]
        rows = np.full((len(driven), max(lengths), 2), np.nan)
        lanes = Lanes.at(np.array([swing.start(run.constants.belt_speed) for run, swing in driven]))
        march(motion.together([run.constants for run, _ in driven]), lanes, self.interval, self._steps, rows)
        for (run, swing), own, length in zip(driven, rows, lengths, strict=True):
            if not np.isnan(own[length - 1, 0]):  # else the run itself will report it
                run._silenced = swing.silenced(own[0], own[length - 1], self.interval)

    @property
    def running(self) -> bool:
        """Whether any run has not ended."""
        return self.done < self.samples and bool((self._lanes.outcome == OK).any())

    def advance(self, samples: int) -> None:
        """March on by so many samples at most; 0 compiles only."""
        last = min(self.done + samples, self.samples)
        while True:
            piece = self._rows[:, self.done : min(last, self._border)]
            march(self._several, self._lanes, self.interval, self._steps, piece)
            self.done += piece.shape[1]
            if self.done in (self._border, self.samples) or not self.running:
                self._look()
            if self.done == last or not self.running:
                return

    def _look(self) -> None:
        """Take the samples since the last look into the runs, and end those that cannot continue."""
        lanes, found = self._lanes, np.zeros(len(self.runs), np.int64)
        _look_at(self._several, lanes, self._rows, self._seen, self.done, self.interval, found)
        steps = lanes.clock / np.maximum(lanes.counts[:, STEPS], 1)
        doubtful = (lanes.outcome != OK) | (found != 0) | (steps > self._longest)
        for place, run in enumerate(self.runs):
            if run.failure is None:
                if lanes.outcome[place] == OK:
                    run.done = self.done
                if doubtful[place] or run._silenced:
                    run.end(Result(lanes.outcome[place]), REASONS[found[place]])
                    lanes.outcome[place] = ENDED
        self._seen, self._border = self.done, self.done + 2 * (self.done - self._seen)


@kernel
def _know(several: Any, known: np.ndarray) -> None:
    """Write the numbers of `about_sliding`, the typical speed, and those of `swing_of`, (run, 7)."""
    for k in range(len(known)):
        o = motion.one_of(several, k)
        known[k, 0], known[k, 1], known[k, 2] = motion.about_sliding(o)
        known[k, 3] = motion.typical_sizes(o)[1]
        known[k, 4], known[k, 5], known[k, 6] = swing_of(o, True)


@kernel
def _look_at(
    several: Any,
    lanes: Lanes,
    rows: np.ndarray,
    first: int,
    last: int,
    interval: float,
    found: np.ndarray,
) -> None:
    """Write the places in REASONS of runs (run,), by the samples from `first` on and the one before."""
    for k in range(len(found)):
        if lanes.outcome[k] == OK:
            for i in range(first, last):
                lanes.fastest[k] = max(lanes.fastest[k], abs(rows[k, i, motion.V]))
            step, rounding = lanes.clock[k] / lanes.counts[k, STEPS], REST * lanes.fastest[k]
            seen = rows[k, max(first - 1, 0) : last]
            found[k] = stuck_wrongly(motion.one_of(several, k), seen, interval, step, rounding)


def batch(points: Sequence[Mapping[str, Any]], stepper: str, paused: Sequence[Any] = ()) -> Any:
    """Runs that advance together: several by `moreau`, one by the others."""
    if stepper == "moreau":
        return Batch(points, paused)
    return batches_of_one(Transient)(points, stepper, paused)
