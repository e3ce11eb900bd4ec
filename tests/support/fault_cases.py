"""A case of the fault campaign: a sweep is struck at random, started again until it is done, and looked at.

A record is acknowledged when its write has returned. None may be lost, the dataset has to be that of an undisturbed
sweep bit by bit, and every start has to end.
"""

from __future__ import annotations

import hashlib
import random
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

from cvt_hpc.job import load_job
from cvt_hpc.study import open_results, run
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.index import read_records
from support.fault_child import ACKNOWLEDGED
from support.fault_starts import Forked, Hang, Launched
from support.recorded import assert_same_numbers
from support.study_double import Axis, Job, Simulator

RUNS = 40
HISTORIES = (5, 23)
JOB = Job((Axis("load", tuple(range(RUNS))),), histories=HISTORIES)
OSCILLATORS = """
name = "oscillators"
model = "oscillator"
[axes]
start = ["sliding", "sticking"]
belt_speed = { from = "0.18 m/s", to = "0.275 m/s", step = "5 mm/s" }
[scene]
normal_load = "1 N"
initial_displacement = "0.1 mm"
[oscillator]
mass = "0.538 kg"
stiffness = "6957 N/m"
damping = "5.946 N s/m"
[friction]
friction_law = "stribeck"
kinetic_friction = 2.0
friction_gradient = "-40 s/m"
stribeck_velocity = "0.1 m/s"
[numerics]
step = "100 us"
[run]
duration = "2.5 s"
[record]
sampling_rate = "2 kHz"
history = [{ start = "sliding", belt_speed = "0.205 m/s" }, { start = "sticking", belt_speed = "0.195 m/s" }]
[vibration]
band_low = "5 Hz"
band_high = "100 Hz"
window_length = "0.4 s"
amplitude_threshold = "50 um"
"""
_MOST_STARTS = 5  # after the last fault
_GATHERING = 0.15  # [s], about


class Reference(NamedTuple):
    """An undisturbed sweep: options of `fault_child` for the same one, its dataset and histories by run."""

    options: dict[str, Any]
    dataset: xr.Dataset
    histories: dict[int, xr.Dataset]


@dataclass
class Outcome:
    """What came of a case; after `longest` all are to be 0 or empty.

    Attributes
    ----------
    kind, seed : str
        Which case it is.
    faults, starts, acknowledged : int
        How many there were; a blow that came after the end is no fault.
    longest : float
        Time [s] of the longest start.
    lost, different, hangs, left : int
        Acknowledged records that are not there or changed; datasets (and histories) with other numbers; starts
        that did not end; processes that were left behind.
    wrong : list of str
        What else was not as it should be.
    """

    kind: str
    seed: str
    faults: int = 0
    starts: int = 0
    acknowledged: int = 0
    longest: float = 0.0
    lost: int = 0
    different: int = 0
    hangs: int = 0
    left: int = 0
    wrong: list[str] = field(default_factory=list)

    @property
    def is_sound(self) -> bool:
        """Whether nothing is to be complained of."""
        return not (self.lost or self.different or self.hangs or self.left or self.wrong)


class Case:
    """A sweep in a folder of its own.

    Parameters
    ----------
    kind, seed : str
        Which case it is.
    folder : Path
        For all its files, `out` among them.
    reference : Reference
        The undisturbed sweep.
    """

    def __init__(self, kind: str, seed: str, folder: Path, reference: Reference) -> None:
        self.random = random.Random(f"{seed} {kind}")
        self.outcome = Outcome(kind, seed)
        self.out = folder / "disk" / "out"
        self.out.parent.mkdir(parents=True)
        self._told = folder / "acknowledged"
        self._output = folder / "output.txt"
        self._reference = reference
        self._has_dataset = False

    def start(self, ranks: int = 0, **options: Any) -> Forked | Launched:
        """Start a sweep, under mpirun if it has ranks."""
        every = {
            "out": str(self.out),
            "acknowledged": str(self._told),
            "lanes": self.random.choice((1, 1, 3, 7)),
            **self._reference.options,
            **options,
        }
        every["sweep"] = {"progress": False, **options.get("sweep", {})}
        self.outcome.starts += 1
        return Launched(every, ranks) if ranks else Forked(every, self._output)

    def end(self, start: Forked | Launched) -> int:
        """Return how a start ended."""
        try:
            return start.wait()
        except Hang:
            self.outcome.hangs += 1
            return -int(signal.SIGKILL)
        finally:
            self.outcome.longest = max(self.outcome.longest, time.monotonic() - start.began)
            self.outcome.left += start.left_behind()

    def wait_for_a_moment(self, start: Forked | Launched, first: int | None = None) -> None:
        """Wait until a random number of records are acknowledged, at least `first`, and a little longer."""
        have = len(self.acknowledged())
        wanted = self.random.randint(have, RUNS) if first is None else first
        while start.status() is None and len(self.acknowledged()) < wanted:
            time.sleep(0.001)
        time.sleep(self.random.uniform(0.0, _GATHERING if wanted in (0, RUNS) else 0.03))

    def wait_for_gathering(self, start: Forked | Launched) -> None:
        """Wait until the dataset is being written, or in half of the cases for a random time."""
        if self.random.random() < 0.5:
            time.sleep(self.random.uniform(0.0, _GATHERING))
            return
        while start.status() is None and not list(self.out.glob(".results.nc.*")):
            time.sleep(0.001)
        time.sleep(10 ** self.random.uniform(-3.0, -0.3))

    def strike(self, start: Forked | Launched, number: int = signal.SIGKILL, target: str = "rank 0") -> int:
        """Send a signal and return how the start ended."""
        self.outcome.faults += start.status() is None
        start.send(number, target)
        return self.end(start)

    def acknowledged(self) -> np.ndarray:
        """Return all records that were acknowledged, as ACKNOWLEDGED has them."""
        data = self._told.read_bytes() if self._told.exists() else b""
        return np.frombuffer(data[: len(data) // ACKNOWLEDGED.itemsize * ACKNOWLEDGED.itemsize], ACKNOWLEDGED)

    def cut_last_log(self) -> None:
        """Cut the newest log at a random byte; what was acknowledged behind it may be lost."""
        logs = sorted(self.out.glob("records/*.log"), key=lambda path: path.stat().st_mtime_ns)
        if not logs:
            return
        size = self.random.randint(0, logs[-1].stat().st_size)
        with logs[-1].open("r+b") as file:
            file.truncate(size)
        told = self.acknowledged()
        behind = (told["log"] == logs[-1].name.encode()) & (told["end"] > size)
        self._told.write_bytes(told[~behind].tobytes())

    def look_at_dataset(self) -> None:
        """See that what is in the dataset between two starts has the numbers of the undisturbed one."""
        if not (self.out / "results.nc").exists():
            if self._has_dataset:
                self.outcome.wrong.append("the dataset that was there is gone")
            return
        self._has_dataset = True
        try:
            with open_results(self.out) as found:
                done = found["status"].values == 1
                there = found["amplitude"].values[done].tobytes()
                same = there == self._reference.dataset["amplitude"].values[done].tobytes()
        except Exception as error:
            self.outcome.wrong.append(f"the dataset that was there: {error!r}")
        else:
            self.outcome.different += not same

    def finish(self, ranks: int = 0, **options: Any) -> Outcome:
        """Start again until all runs are done, and look at everything."""
        statuses: list[int] = []
        while 0 not in statuses and len(statuses) < _MOST_STARTS:
            statuses.append(self.end(self.start(ranks, **options)))
        if statuses[-1] != 0:
            self.outcome.wrong.append(f"starts ended with {statuses}: {self._last_words()}")
            return self.outcome
        told = self.acknowledged()
        self.outcome.acknowledged = len(told)
        records = read_records(StudyFolder(self.out).records, StudyFolder(self.out).load())
        for entry in told:
            kept = hashlib.sha256(records.read(int(entry["run"])).tobytes()).hexdigest().encode()
            self.outcome.lost += not records.recorded[entry["run"]] or kept != entry["digest"]
        self.outcome.different += not self._is_same()
        self.outcome.wrong += [f"{path.name} is left" for path in self.out.glob(".results.nc.*")]
        return self.outcome

    def _is_same(self) -> bool:
        try:
            with open_results(self.out) as found:
                assert_same_numbers(found, self._reference.dataset)
            for index, expected in self._reference.histories.items():
                with xr.open_dataset(StudyFolder(self.out).history(index)) as history:
                    timings = {"core_seconds"} & {*history.variables}
                    assert_same_numbers(history.drop_vars(timings), expected.drop_vars(timings))
        except (AssertionError, OSError) as error:
            self.outcome.wrong.append(f"{error!r}")
            return False
        return True

    def _last_words(self) -> str:
        return self._output.read_text()[-2000:] if self._output.exists() else ""


def make_reference(folder: Path, model: bool = False) -> Reference:
    """Sweep without disturbance: the double, or oscillators by the program's own simulator."""
    folder.mkdir(exist_ok=True)
    if model:
        job_file = folder / "oscillators.toml"
        job_file.write_text(OSCILLATORS)
        out, options = run(load_job(job_file), folder / "out", progress=False).out, {"job": str(job_file)}
    else:
        options = {"runs": RUNS, "histories": HISTORIES, "parameters": {"pause": 0.008}}
        out = run(JOB, folder / "out", simulator=Simulator(), progress=False).out
    histories = {int(path.stem.split("-")[1]): xr.load_dataset(path) for path in out.glob("histories/*.nc")}
    assert len(histories) == len(HISTORIES)
    with open_results(out) as dataset:
        assert dataset["status"].size == RUNS and (dataset["status"] == 1).all()
        return Reference(options, dataset.load(), histories)
