"""A job and a simulator without mechanics, and a program that sweeps them: what the study's tests run.

The numbers are those of a logistic map: they are deterministic, and the slightest difference in an input changes
all their digits. As a program it takes a JSON text of options, see `main`.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
import resource
import signal
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.errors import InputError
from cvt_hpc.job.design import is_in_rounds
from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates

if TYPE_CHECKING:
    import xarray as xr


@dataclass(frozen=True)
class Axis:
    name: str
    values: tuple
    unit: str = "N m"
    description: str = "some axis"
    spacing: str = "linear"


@dataclass(frozen=True)
class Job:
    """Satisfies what the study asks of a `cvt_hpc.job.Job`.

    Parameters that steer the double: `pause` [s] per run; `raise_at` and `diverge_at`, the value of the first
    axis at which a run raises, or fails as a diverging integration does; `crash_at`, at which the process dies;
    `step` and `stable_step`, the time step [s] and one at which a run does not diverge in spite of that;
    `window`, the first and last value of that axis between which runs vibrate, instead of by their numbers.
    """

    axes: tuple[Axis, ...] = (Axis("load", tuple(range(12))),)
    parameters: dict[str, Any] = field(default_factory=dict)
    name: str = "double"
    description: str = "a study without mechanics"
    model: str = "logistic"
    stepper: str = "none"
    source: str = "double.toml"
    design: dict[str, Any] = field(default_factory=dict)
    histories: tuple[int, ...] = ()
    rules: tuple = ()
    derived: tuple = ()
    units: dict[str, str] = field(default_factory=dict)
    files: dict[str, str] = field(default_factory=dict)

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(len(axis.values) for axis in self.axes)

    @property
    def size(self) -> int:
        return math.prod(self.shape)

    @property
    def in_rounds(self) -> bool:
        return is_in_rounds(self.design)

    def point(self, index: int) -> dict[str, Any]:
        place = np.unravel_index(index, self.shape) if self.shape else ()
        return {**self.parameters, **{a.name: a.values[i] for a, i in zip(self.axes, place, strict=True)}}

    def resolved(self) -> dict[str, Any]:
        axes = {a.name: [str(v) if v == math.inf else v for v in a.values] for a in self.axes}
        design = {"design": self.design} if self.design else {}
        return {"model": self.model, "scene": self.parameters, **design, "axes": axes}

    def fingerprint(self) -> str:
        # What steers only the pace is no part of the numbers.
        numbers = {**self.resolved(), "scene": {k: v for k, v in self.parameters.items() if k != "pause"}}
        return hashlib.sha256(json.dumps(numbers, sort_keys=True).encode()).hexdigest()


class Interrupted(Exception):
    pass


class Simulator:
    """Satisfies what the study asks of the module `cvt_hpc.simulation`.

    `slow` makes runs take their time, and no difference to their numbers: {"from": first, "pause": seconds}.
    `largest_file` [bytes] is what the system lets the process write from the first run on. Up to `lanes` runs are
    done as one batch.
    """

    Interrupted = Interrupted

    def __init__(
        self, slow: dict[str, float] | None = None, largest_file: int | None = None, lanes: int = 1
    ) -> None:
        self.slow = slow or {}
        self.largest_file = largest_file
        self.lanes = lanes

    def record_variables(self, job: Job) -> tuple[Variable, ...]:
        return (
            Variable("status", "", "how the run ended", dtype="i1", flags=Status),
            Variable("vibrates", "", "whether the belt vibrates", dtype="i1", flags=Vibrates),
            Variable("reason", "", "why the run failed", dtype="S240"),
            Variable("amplitude", "m", "amplitude of the strand's vibration", dims=("strand",)),
            Variable("spectrum", "m", "amplitude spectrum", dims=("strand", "frequency_bin")),
            Variable("steps", "1", "number of time steps", dtype="i8"),
            Variable("core_seconds", "s", "computing time", volatile=True),
        )

    def record_coordinates(self, job: Job) -> dict[str, Coordinate]:
        return {
            "strand": Coordinate(np.array(["t1", "t2"]), "", "strand of the belt"),
            "frequency_bin": Coordinate(np.linspace(0, 100, 11), "Hz", "frequency"),
        }

    def run_costs(self, job: Job) -> np.ndarray:
        return np.ones(math.prod(len(axis.values) for axis in job.axes))

    def lane_groups(self, job: Job, indices: Sequence[int]) -> list[tuple[int, ...]]:
        return [tuple(indices[i : i + self.lanes]) for i in range(0, len(indices), self.lanes)]

    def turns(self, job: Job, runs: int) -> int:
        return 1

    def pilot_share(self, job: Job) -> float:
        return 0.25

    def profile_bytes(self, job: Job) -> int:
        return 0

    def forget(self, job: Job) -> None:
        pass

    def run_points(
        self,
        job: Job,
        points: Sequence[dict[str, Any]],
        interrupt: Callable[[], str | None],
        more: Callable[[], Sequence[dict[str, Any]]] | None = None,
    ) -> list[dict[str, Any]]:
        return [self.run_point(job, point, interrupt) for point in points]

    def run_points_keeping(
        self,
        job: Job,
        points: Sequence[dict[str, Any]],
        interrupt: Callable[[], str | None],
        kept: Sequence[int],
    ) -> tuple[list[dict[str, Any]], dict[int, xr.Dataset]]:
        # not above: it takes a third of a second of each process
        import xarray as xr

        histories = {
            place: xr.Dataset({"x": ("time", logistic_numbers(points[place], job))}) for place in kept
        }
        return self.run_points(job, points, interrupt), histories

    def run_point(
        self, job: Job, point: dict[str, Any], interrupt: Callable[[], str | None]
    ) -> dict[str, Any]:
        if self.largest_file is not None:
            resource.setrlimit(resource.RLIMIT_FSIZE, (self.largest_file, self.largest_file))
        started = time.perf_counter()
        first = point[job.axes[0].name] if job.axes else None
        is_slow = isinstance(first, int) and first >= self.slow.get("from", math.inf)
        wait(self.slow["pause"] if is_slow else point.get("pause", 0.0), interrupt)
        if first is not None and first == point.get("raise_at"):
            raise ZeroDivisionError("the driven pulley\nstands still")
        if first is not None and first == point.get("crash_at"):
            os.kill(os.getpid(), signal.SIGKILL)  # as for lack of memory
        diverges = first is not None and first == point.get("diverge_at")
        diverges = diverges and point.get("step", math.inf) > point.get("stable_step", 0.0)
        numbers = np.full(24, np.nan) if diverges else logistic_numbers(point, job)
        window = point.get("window")
        vibrates = window[0] <= first <= window[1] if window else numbers[0] > 0.5
        return {
            "status": Status.FAILED_NUMERICS if diverges else Status.DONE,
            "vibrates": Vibrates.YES if vibrates else Vibrates.NO,
            "reason": "step 17: the state is not finite" if diverges else "",
            "amplitude": numbers[:2],
            "spectrum": numbers[2:].reshape(2, 11),
            "steps": round(1e-3 / point.get("step", 1e-6)),
            "core_seconds": time.perf_counter() - started,
        }


def wait(pause: float, interrupt: Callable[[], str | None]) -> None:
    """Pass the time as a kernel does: in slices, asking after each whether to go on."""
    end = time.monotonic() + pause
    while time.monotonic() < end:
        if reason := interrupt():
            raise Interrupted(reason)
        time.sleep(0.005)


def logistic_numbers(point: dict[str, Any], job: Job) -> np.ndarray:
    seed = json.dumps([str(point[axis.name]) for axis in job.axes])
    x = int.from_bytes(hashlib.sha256(seed.encode()).digest()[:6]) / 2**48
    numbers = np.empty(24)
    for i in range(24):
        x = 3.99 * x * (1 - x)
        numbers[i] = x
    return numbers


def main(options: dict[str, Any]) -> int:
    """Sweep the double as the command line would.

    Options: `out`; `runs`, the length of the only axis; `parameters`, `design` and `histories` of the job; `sweep`, further arguments of
    `run`; `slow`, `largest_file` and `lanes`, see `Simulator`; `thread_level` of MPI; `break_rank`, the rank whose log
    has a defect, and whether the program `swallows_defects`; `break_rank_after`, the rank that raises when the
    sweep is over; `only_rank`, the only one that sweeps; `time_limits` of the ranks.
    """
    if "thread_level" in options:
        import mpi4py

        mpi4py.rc.thread_level = options["thread_level"]
    from cvt_hpc.study import process_rank, run
    from cvt_hpc.study.ranks.launch import end_process
    from cvt_hpc.study.record.log import RecordLog

    if "only_rank" in options:
        from mpi4py import MPI

        if MPI.COMM_WORLD.rank != options["only_rank"]:
            return 0
    if process_rank() == options.get("break_rank"):
        RecordLog.append = raise_defect
    axes = (Axis("load", tuple(range(options.get("runs", 12)))),)
    kept = tuple(options.get("histories", ()))
    job = Job(axes, options.get("parameters", {}), design=options.get("design", {}), histories=kept)
    simulator = Simulator(options.get("slow"), options.get("largest_file"), options.get("lanes", 1))
    further = {"raises": False, **options.get("sweep", {})}
    if "time_limits" in options:
        further["time_limit"] = options["time_limits"][process_rank()]
    try:
        report = run(job, Path(options["out"]), simulator=simulator, **further)
    except InputError as error:
        if process_rank() == 0:
            print(f"error: {error}", file=sys.stderr)
        return 2
    except RuntimeError:
        if options.get("swallows_defects"):
            return 0
        raise
    if process_rank() == options.get("break_rank_after"):
        raise_defect()
    if process_rank() == 0:
        facts = {"done": report.done, "failed": len(report.failed), "remaining": report.remaining}
        print(
            json.dumps(
                {
                    **facts,
                    "stopped": report.stopped,
                    "loaded": sorted({"mpi4py.MPI", "xarray"} & sys.modules.keys()),
                }
            )
        )
    return end_process(report.exit_status)


def raise_defect(*_: object) -> None:
    raise RuntimeError("a defect outside of runs")


if __name__ == "__main__":
    sys.exit(main(json.loads(sys.argv[1])))
