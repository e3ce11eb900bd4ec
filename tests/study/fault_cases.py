"""Cases of the fault campaign: a sweep is struck at random, started again until it is done, and looked at.

A record is acknowledged when its write has returned. None may be lost, the dataset has to be that of an undisturbed
sweep bit by bit, and every start has to end.
"""

from __future__ import annotations

import hashlib
import random
import shutil
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from fault_child import ACKNOWLEDGED
from fault_starts import Forked, Hang, Launched
from study_double import Axis, Job, Simulator, logistic_numbers
from study_processes import assert_same_numbers

from cvt_hpc.study import open_results, run
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.recovery import read_records

RUNS = 40
HISTORIES = (5, 23)
JOB = Job((Axis("load", tuple(range(RUNS))),), histories=HISTORIES)
_MOST_STARTS = 5  # after the last fault
_GATHERING = 0.15  # [s], about
_LOG = 20_000  # [bytes], about


@dataclass
class Outcome:
    """What came of a case; all but the first five are to be 0 or empty.

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
    reference : xarray.Dataset
        Of the undisturbed sweep.
    """

    def __init__(self, kind: str, seed: str, folder: Path, reference: xr.Dataset) -> None:
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
            "runs": RUNS,
            "histories": HISTORIES,
            "lanes": self.random.choice((1, 1, 3, 7)),
            "parameters": {"pause": 0.008},
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
                there = found["spectrum"].values[done].tobytes()
                same = there == self._reference["spectrum"].values[done].tobytes()
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
                assert_same_numbers(found, self._reference)
            for index in HISTORIES:
                with xr.open_dataset(StudyFolder(self.out).history(index)) as history:
                    assert (history["x"].values == logistic_numbers(JOB.point(index), JOB)).all()
        except (AssertionError, OSError) as error:
            self.outcome.wrong.append(f"{error!r}")
            return False
        return True

    def _last_words(self) -> str:
        return self._output.read_text()[-2000:] if self._output.exists() else ""


def make_reference(folder: Path) -> xr.Dataset:
    """Return the dataset of an undisturbed sweep."""
    run(JOB, folder, simulator=Simulator(), progress=False)
    with open_results(folder) as dataset:
        return dataset.load()


def play(kind: str, seed: str, folder: Path, reference: xr.Dataset) -> Outcome:
    """Return what came of a case; its files stay if something is to be complained of."""
    case = Case(kind, seed, folder, reference)
    try:
        outcome = KINDS[kind](case)
    finally:
        _unmount(case)
    if outcome.is_sound:
        shutil.rmtree(folder)
    return outcome


def _kill_serial(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start()
        case.wait_for_a_moment(start)
        case.strike(start)
    return case.finish()


def _kill_rank(case: Case) -> Outcome:
    ranks = case.random.choice((2, 3))
    start = case.start(ranks)
    case.wait_for_a_moment(start, case.random.randint(1, RUNS))
    case.strike(start, target=f"rank {case.random.randrange(ranks)}")
    return case.finish(case.random.choice((0, 0, 2)))


def _kill_mpirun(case: Case) -> Outcome:
    start = case.start(case.random.choice((2, 3)))
    case.wait_for_a_moment(start, case.random.randint(1, RUNS))
    case.strike(start, target="mpirun")
    return case.finish(case.random.choice((0, 0, 2)))


def _kill_part(case: Case) -> Outcome:
    parts = [{"part": f"{number}/3"} for number in (1, 2, 3)]
    starts = [case.start(sweep=part) for part in parts]
    struck = case.random.randrange(3)
    case.wait_for_a_moment(starts[struck])
    case.strike(starts[struck])
    again = case.start(sweep=parts[struck])  # beside those that may still be at work
    ends = [case.end(start) for start in (*starts[:struck], *starts[struck + 1 :], again)]
    if any(ends):
        case.outcome.wrong.append(f"parts ended with {ends}")
    if not (case.out / "results.nc").exists():
        case.outcome.wrong.append("no part has gathered")
    case.look_at_dataset()
    return case.finish()


def _kill_gather(case: Case) -> Outcome:
    start = case.start()
    case.wait_for_a_moment(start, case.random.randint(1, RUNS))
    case.strike(start)
    for _ in range(case.random.randint(2, 4)):
        start = case.start(gathers=True)
        case.wait_for_gathering(start)
        case.strike(start)
        case.look_at_dataset()
    return case.finish()


def _kill_last_gather(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start()
        case.wait_for_a_moment(start, RUNS - 1)
        case.wait_for_gathering(start)
        case.strike(start)
        case.look_at_dataset()
    return case.finish()


def _tear_write(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start(torn=case.random.randint(1, _LOG))
        case.outcome.faults += case.end(start) == -signal.SIGKILL
    return case.finish()


def _lose_power(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start()
        case.wait_for_a_moment(start)
        case.strike(start)
        case.cut_last_log()
    return case.finish()


def _turn_read_only(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        start = case.start(torn=case.random.randint(1, _LOG), turns_read_only=True)
        _count_refusal(case, case.end(start))
    return case.finish()


def _fill_disk(case: Case) -> Outcome:
    _mount(case, f"size={4 * case.random.randint(2, 40)}k")
    for _ in range(case.random.randint(1, 2)):
        _count_refusal(case, case.end(case.start()))
    _mount(case, "remount,size=16m")
    return case.finish()


def _make_read_only(case: Case) -> Outcome:
    _mount(case, "size=16m")
    start = case.start()
    case.wait_for_a_moment(start)
    case.strike(start)
    _mount(case, "remount,ro")
    for gathers in (False, True):
        status = case.end(case.start(gathers=gathers))
        _count_refusal(case, status)
    case.look_at_dataset()
    _mount(case, "remount,rw")
    return case.finish()


def _jump_clock(case: Case) -> Outcome:
    limit = {"time_limit": 50.0}  # so that predictions, which come from times on record, have a say
    for _ in range(case.random.randint(1, 3)):
        start = case.start(clock=case.random.randrange(10**6), sweep=limit)
        case.wait_for_a_moment(start)
        case.strike(start)
    return case.finish(clock=case.random.randrange(10**6), sweep=limit)


def _signal(case: Case) -> Outcome:
    for _ in range(case.random.randint(1, 3)):
        _signal_once(case, ranks=0)
    return case.finish()


def _signal_rank(case: Case) -> Outcome:
    _signal_once(case, ranks=2)
    return case.finish()


def _signal_once(case: Case, ranks: int) -> None:
    number = case.random.choice((signal.SIGTERM, signal.SIGUSR1, signal.SIGINT))
    start = case.start(ranks)
    case.wait_for_a_moment(start, case.random.randint(1, RUNS))  # from then on it is listened to
    status = case.strike(start, number, f"rank {case.random.randrange(ranks or 1)}")
    if status not in (0, 98, 99, -number):  # the last after the sweep has ended
        case.outcome.wrong.append(f"after {signal.Signals(number).name} it ended with {status}")


def _count_refusal(case: Case, status: int) -> None:
    """Count a start that the system has not let write: it says so, unless it was done before."""
    case.outcome.faults += status == 2
    if status not in (0, 2):
        case.outcome.wrong.append(f"refused by the system it ended with {status}")


def _mount(case: Case, options: str) -> None:
    command = ["mount", "-t", "tmpfs", "-o", options, "tmpfs", str(case.out.parent)]
    subprocess.run(command, check=True, capture_output=True)


def _unmount(case: Case) -> None:
    if case.out.parent.is_mount():
        subprocess.run(["umount", str(case.out.parent)], check=True)


def can_mount(folder: Path) -> bool:
    """Return whether a file system of one's own can be had: root may, outside of most containers."""
    command = ["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", str(folder)]
    try:
        subprocess.run(command, check=True, capture_output=True)
    except (OSError, subprocess.CalledProcessError):
        return False
    subprocess.run(["umount", str(folder)], check=True)
    return True


KINDS: dict[str, Callable[[Case], Outcome]] = {
    "kill -9 of a serial sweep": _kill_serial,
    "kill -9 of a rank": _kill_rank,
    "kill -9 of mpirun": _kill_mpirun,
    "kill -9 of a part beside others": _kill_part,
    "kill -9 of gather": _kill_gather,
    "kill -9 at the end of a sweep": _kill_last_gather,
    "kill -9 in mid-write": _tear_write,
    "kill -9 and a log cut short": _lose_power,
    "full disk": _fill_disk,
    "read-only folder": _make_read_only,
    "folder turns read-only": _turn_read_only,
    "clock jumps and kill -9": _jump_clock,
    "signal": _signal,
    "signal to a rank": _signal_rank,
}
NEED_MOUNT = ("full disk", "read-only folder")
NEED_MPI = ("kill -9 of a rank", "kill -9 of mpirun", "signal to a rank")
