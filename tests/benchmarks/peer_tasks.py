"""The tasks that `peers.py` has done by each scheduler, and a witness on the disk of each that was done."""

from __future__ import annotations

import functools
import os
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.job import build_job

SHORTEST, LONGEST = 2e-3, 50e-3  # [s]
TAIL = 1.2  # exponent of the Pareto distribution: its mean is finite, its variance is not
SAMPLE = 0.12e-3  # processor time [s] that the belt needs for a sample, about
NUMBERS = np.linspace(0.0, 1.0, 24)  # what a task returns
ENTRY = np.dtype([("task", "i8"), ("process", "i8"), ("started", "f8"), ("ended", "f8")])


class Tasks(NamedTuple):
    """What is to be done.

    Attributes
    ----------
    kind : str
        "trivial" (nothing), "sleep", or "kernel": slices of a run of the elastic belt.
    count : int
        How many.
    folder : str
        Where the witness is.
    """

    kind: str
    count: int
    folder: str

    def durations(self) -> np.ndarray:
        """Return how long each takes [s], shape (count,)."""
        if self.kind == "trivial":
            return np.zeros(self.count)
        drawn = SHORTEST * (1 + np.random.default_rng(0).pareto(TAIL, self.count))
        return np.minimum(drawn, LONGEST)

    def longest_first(self) -> list[int]:
        """Return their numbers in the order in which they are best begun."""
        return [int(i) for i in np.argsort(-self.durations(), kind="stable")]

    def warm_up(self) -> None:
        """Load the kernels in this process."""
        if self.kind == "kernel":
            _belt().advance(1)

    def do(self, index: int) -> tuple[int, np.ndarray]:
        """Do one; return its number and its result."""
        started = time.monotonic()
        seconds = _durations(self)[index]
        if self.kind == "sleep":
            time.sleep(seconds)
        elif self.kind == "kernel":
            _belt().advance(round(seconds / SAMPLE))
        entry = np.array([(index, os.getpid(), started, time.monotonic())], ENTRY)
        os.write(_witness(self.folder), entry.tobytes())
        return index, NUMBERS


def read_witness(folder: Path) -> np.ndarray:
    """Return what was done in a folder, in the order of its ends, shape (tasks,)."""
    path = folder / "witness"
    return np.fromfile(path, ENTRY) if path.exists() else np.empty(0, ENTRY)


@functools.cache
def _durations(tasks: Tasks) -> np.ndarray:
    return tasks.durations()


@functools.cache
def _witness(folder: str) -> int:
    # One short write at the end of the file: entries of several processes do not mix.
    return os.open(Path(folder) / "witness", os.O_CREAT | os.O_APPEND | os.O_WRONLY)


@functools.cache
def _belt() -> Any:
    from cvt_hpc.models.elastic_belt.transient import Batch

    job = build_job(
        {"name": "peers", "model": "elastic_belt", "stepper": "imex"},
        "peers.py",
        {"load": 120.0, "duration": 4.0},  # longer than all slices together
    )
    return Batch([job.point(0)], "imex")


def simulate_one(history: np.ndarray, _: Any, specs: dict[str, Any]) -> np.ndarray:
    """Do the task of a row, as libEnsemble wants it."""
    output = np.zeros(1, dtype=specs["out"])
    # A named tuple among the specifications becomes a plain one.
    output["numbers"] = Tasks(*specs["user"]["tasks"]).do(int(history["task"][0]))[1]
    return output
