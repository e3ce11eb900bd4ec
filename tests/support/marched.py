"""Runs of the elastic belt for the tests of this folder: each is done once, however many tests look at it."""

from functools import cache

import numpy as np

from cvt_hpc.job import Job
from cvt_hpc.models.elastic_belt.record import evaluate
from cvt_hpc.models.elastic_belt.transient import Transient
from cvt_hpc.simulation import record_variables, run_point
from support.rungs import rung_job

# A coarse belt that is loaded within 10 ms, judged over the shortest part that is allowed: 0.1 s of computing.
CHEAP = {"stations": 48, "duration": 0.04, "rise_time": 0.01}


def job(stepper: str = "imex", axes: dict | None = None, **values) -> Job:
    """A job of the elastic belt with defaults but for `values` [SI]: in double precision, one transient a run.

    So that tolerances tell what the method leaves, not what rounding does, and that runs show what a step does.
    """
    values = {"most_refinements": 0, "longest_duration": values.get("duration", 0.3)} | values
    if stepper == "imex" and "precision" not in (axes or {}):
        values = {"precision": "double"} | values
    return rung_job("elastic_belt", axes, stepper, **values)


def never() -> None:
    """The answer of a sweep that lets a run go on."""


def fresh_record(**values) -> dict:
    """The record of one run, computed anew."""
    asked = job(**values)
    return run_point(asked, asked.point(0), never)


@cache
def record(**values) -> dict:
    """The record of one run."""
    return fresh_record(**values)


@cache
def finished(**values) -> Transient:
    """One run with all its samples."""
    asked = job(**values)
    run = Transient(asked.point(0), asked.stepper)
    while run.done < run.samples:
        assert run.advance(run.samples) is None
    return run


def balance(run: Transient) -> dict:
    """The model's part of the record of a finished run."""
    return evaluate(run, np.array([2, 7]))  # the probes in the middles of the strands


def mean(run: Transient, name: str) -> float:
    """Mean of a channel over the judged part."""
    return float(run.channel(name)[run.judged].mean())


def assert_same_bits(record: dict, other: dict) -> None:
    """Assert that two records have the same numbers, but for times of computing and the like."""
    for variable in record_variables(job()):
        if not variable.volatile:
            one, two = np.asarray(record[variable.name]), np.asarray(other[variable.name])
            assert one.tobytes() == two.tobytes(), variable.name
