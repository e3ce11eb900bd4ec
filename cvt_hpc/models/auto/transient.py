"""Runs that climb the ladder together: those that a rung leaves open fill the lanes of the next one."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any

from cvt_hpc.models.auto.rules import Rung, coarse, is_clear, is_passive, is_settled
from cvt_hpc.models.elastic_belt import record as belt_record
from cvt_hpc.models.elastic_belt.batch import Batch
from cvt_hpc.models.elastic_belt.grouping import lane_key, lanes
from cvt_hpc.models.elastic_belt.lane_run import LaneRun
from cvt_hpc.variables import Status, Vibrates


class ClimbingRun:
    """One run, on the rung that it has reached.

    Parameters
    ----------
    parameters : dict
        Resolved parameters of the run [SI].

    Attributes
    ----------
    parameters
        As given.
    answering : LaneRun or None
        The transient that has answered; None where none was needed.
    found : dict
        The record, its cost apart; empty until a rung has answered.
    core_seconds : float
        Processor time of all rungs [s]; of runs that advance together, their time divided by their number.
    steps, contact_solves : int
        Of all rungs.
    """

    def __init__(self, parameters: dict[str, Any]) -> None:
        self.parameters = parameters
        self.answering: LaneRun | None = None
        self.found: dict[str, Any] = {}
        self.core_seconds = 0.0
        self.steps = self.contact_solves = 0
        if is_passive(parameters):
            reason = "friction does not fall with sliding speed"
            self.found = {"status": Status.DONE, "vibrates": Vibrates.NO, "reason": reason}
            self.found |= {"rung": Rung.PASSIVE}

    @property
    def failure(self) -> tuple[Status, str] | None:
        """Why the full run ended before its end, as `RecordedRun` has it."""
        return None if self.answering is None else self.answering.failure

    @property
    def time(self) -> float:
        """Time that the run which answered has simulated [s]."""
        return 0.0 if self.answering is None else self.answering.time

    @property
    def step(self) -> float:
        """Its time step [s]; not a number where none was taken."""
        return float("nan") if self.answering is None else self.answering.step

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """Whether the run that answered is not to be trusted, as `LaneRun` has it."""
        return None if self.answering is None else self.answering.numerical_doubt(record)

    def take(self, run: LaneRun, rung: Rung, seconds: float) -> None:
        """Look at what a transient has found, and keep it if it answers the question.

        Parameters
        ----------
        run : LaneRun
            At its end.
        rung : Rung
            COARSE or FULL; what the latter finds is kept whatever it is.
        seconds : float
            Processor time that it has taken [s].
        """
        started = time.process_time()
        self.steps, self.contact_solves = self.steps + run.steps, self.contact_solves + run.contact_solves
        if rung is Rung.FULL:
            self.answering = run
        if run.failure is not None:
            if rung is Rung.FULL and run.failure[0] is Status.DONE:
                self.found = belt_record.judge(run) | {"rung": rung}
        else:
            found = belt_record.assess(run)
            if rung is Rung.FULL or is_settled(self.parameters, found):
                values = found.record() | belt_record.evaluate(run, found.strongest_probe)
                if rung is Rung.COARSE and not is_clear(self.parameters, found):
                    reason = f"too close for a coarse run: {found.reason}"[:240]
                    values |= {"vibrates": Vibrates.UNDECIDED, "reason": reason}
                if rung is Rung.FULL or run.numerical_doubt(values) is None:
                    self.answering = run
                    self.found = values | {"rung": rung, "margin": found.margin}
        self.core_seconds += seconds + time.process_time() - started


class Climb:
    """A batch of runs on their way up the ladder.

    Parameters
    ----------
    points : sequence of dict
        Resolved parameters of the runs [SI], all of one `lane_key`.
    stepper : str
        "imex".

    Attributes
    ----------
    runs : tuple of ClimbingRun
        The runs.
    running : bool
        Whether any run has not been answered.
    """

    def __init__(self, points: Sequence[dict[str, Any]], stepper: str) -> None:
        self.runs = tuple(ClimbingRun(point) for point in points)
        self.running = True
        self._stepper = stepper
        self._batch: Batch | None = None
        self._climb = self._climbing()
        self._ask_for_more()

    def advance(self, samples: int) -> None:
        """March on.

        Parameters
        ----------
        samples : int
            How many samples at most, of the runs that are at work.
        """
        if self._batch is None:
            return
        started = time.process_time()
        self._batch.advance(samples)
        if samples:  # else kernels are compiled, which is no cost of these runs
            self._spent += time.process_time() - started
        if not self._batch.running:
            self._ask_for_more()

    def _ask_for_more(self) -> None:
        self._batch, self._spent = next(self._climb, None), 0.0
        self.running = self._batch is not None

    def _climbing(self) -> Iterator[Batch]:
        """Each batch that has to be marched to its end, in turn."""
        for rung, prepare in ((Rung.COARSE, coarse), (Rung.FULL, dict)):
            waiting = [(run, prepare(run.parameters)) for run in self.runs if not run.found]
            ready = [(run, p) for run, p in waiting if p is not None]
            for group in _in_lanes(ready, self._stepper):
                batch = Batch([p for _, p in group], self._stepper)
                yield batch
                for (run, _), marched in zip(group, batch.runs, strict=True):
                    run.take(marched, rung, self._spent / len(group))


def _in_lanes(
    ready: Sequence[tuple[ClimbingRun, dict[str, Any]]], stepper: str
) -> Iterator[list[tuple[ClimbingRun, dict[str, Any]]]]:
    """Batches of runs that fit into lanes together."""
    groups: dict[tuple, list] = {}
    for run, p in ready:
        groups.setdefault(lane_key(p), []).append((run, p))
    for group in groups.values():
        most = lanes(group[0][1], stepper)
        for first in range(0, len(group), most):
            yield group[first : first + most]


def batch(points: Sequence[dict[str, Any]], stepper: str) -> Climb:
    """Runs that climb together.

    Parameters
    ----------
    points : sequence of dict
        Resolved parameters of the runs [SI], all of one `lane_key`.
    stepper : str
        One of STEPPER_NAMES.
    """
    return Climb(points, stepper)
