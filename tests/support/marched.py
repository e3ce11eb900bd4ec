"""Runs of the elastic belt for the tests of this folder: each is done once, however many tests look at it."""

from functools import cache
from typing import Any

import numpy as np

from cvt_hpc.job import Job
from cvt_hpc.models.elastic_belt.record import judge
from cvt_hpc.models.elastic_belt.transient import LaneRun
from cvt_hpc.simulation import record_variables, run_point
from cvt_hpc.simulation.marching import march_runs
from support.lone import Transient
from support.rungs import rung_job

# A coarse belt that is loaded within 10 ms, judged over the shortest part that is allowed: 0.1 s of computing.
CHEAP = {"stations": 48, "duration": 0.04, "rise_time": 0.01}


def job(stepper: str = "imex", axes: dict | None = None, **values) -> Job:
    """A job of the elastic belt on the scene of the tests but for `values` [SI]: in double precision, one transient a run.

    So that tolerances tell what the method leaves, not what rounding does, and that runs show what a step does.
    """
    values = {"most_refinements": 0, "longest_duration": values.get("duration", 0.3)} | values
    if stepper == "imex" and "precision" not in (axes or {}):
        values = {"precision": "double"} | values
    return rung_job("elastic_belt", axes, stepper, **values)


def alone(**values) -> Job:
    """A job of a run that shares its lanes with no other: its stations fill them, for a third of the time of "imex"."""
    return job(**({"lanes": "stations"} if values.get("stepper", "imex") == "imex" else {}) | values)


def never() -> None:
    """The answer of a sweep that lets a run go on."""


def fresh_record(**values) -> dict:
    """The record of one run, computed anew."""
    asked = alone(**values)
    return run_point(asked, asked.point(0), never)


@cache
def record(**values) -> dict:
    """The record of one run."""
    return fresh_record(**values)


class Together:
    """Runs that are done when the first one is asked for, in lanes: each is bit by bit what it is alone.

    Parameters
    ----------
    *scenes : dict
        Parameters of each run but for defaults [SI].
    """

    def __init__(self, *scenes: dict) -> None:
        self._scenes = {frozenset(scene.items()): scene for scene in scenes}
        self._done: dict[frozenset, tuple[Any, dict]] = {}

    def _of(self, values: dict) -> tuple[Any, dict]:
        if not self._done:
            points = [job(**scene).point(0) for scene in self._scenes.values()]
            found = march_runs(job(), points, never, range(len(points)))
            self._done = dict(zip(self._scenes, found, strict=True))
        return self._done[frozenset(values.items())]

    def record(self, **values) -> dict:
        """The record of one of them."""
        return self._of(values)[1]

    def finished(self, **values) -> LaneRun:
        """One of them with all its samples."""
        run, _ = self._of(values)
        assert run.failure is None
        return run


@cache
def finished(**values) -> Transient:
    """One run with all its samples."""
    asked = alone(**values)
    run = Transient(asked.point(0), asked.stepper)
    while run.done < run.samples:
        assert run.advance(run.samples) is None
    return run


def balance(run: LaneRun) -> dict:
    """The model's part of the record of a finished run."""
    return judge(run)


def mean(run: LaneRun, name: str) -> float:
    """Mean of a channel over the judged part."""
    return float(run.channel(name)[run.judged].mean())


def assert_same_bits(record: dict, other: dict) -> None:
    """Assert that two records have the same numbers, but for times of computing and the like."""
    for variable in record_variables(job()):
        if not variable.volatile:
            one, two = np.asarray(record[variable.name]), np.asarray(other[variable.name])
            assert one.tobytes() == two.tobytes(), variable.name
