"""Early end of a sweep: by a signal, the time limit, or another rank that stops.

Where MPI tolerates it (ULFM; Open MPI: `mpirun --with-ft ulfm`) a sweep goes on without ranks that have died.
Elsewhere the launcher ends all ranks when one dies, and the same command continues later.

The time limit is as requested, or the rest of the Slurm job that the sweep runs in.
"""

import logging
import math
import os
import re
import signal
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType
from typing import Any, NamedTuple, NoReturn, Self

from cvt_hpc.errors import mismatch
from cvt_hpc.study.ranks.launch import RankDied, Result, Team, is_tolerated
from cvt_hpc.study.ranks.progress import Counter, show_duration
from cvt_hpc.study.ranks.starting import SIGNALS

_SQUEUE = ("squeue", "--noheader", "--format=%L")  # %L: time left, as days-hours:minutes:seconds
_PATIENCE = 20.0  # [s] with a busy controller
_GATHERING = 2e-4  # [s] a run
_SHORTEST_PLANNING = 10.0  # [s]: a plan takes so long on a busy machine, whatever its size
_TIME_LEFT = re.compile(r"(?:(\d+)-)?(?:(\d+):)?(?:(\d+):)?(\d+)")

_logger = logging.getLogger(__name__)

_LOOK_INTERVAL = 0.5  # [s] between checks of the other ranks
_IMPATIENCE = 1.0  # [s]; a Ctrl-C later than this after the first one ends the process at once

ELSEWHERE = "stopped by another rank"


class TimeLimit(NamedTuple):
    """Time [s] that is left to compute in, and the name of its end."""

    seconds: float = math.inf
    name: str = "time limit"


def find_time_limit(asked: float | None, runs: int, environment: Mapping[str, str] = os.environ) -> TimeLimit:
    """Return how much time is left, with some to gather so many runs of the study before the end.

    It is the time [s] that the user has asked for; without it that of the Slurm job counts, if there is one.
    """
    if asked is not None:
        return TimeLimit(asked - _GATHERING * runs)
    left = _left_to_slurm_job(environment) - gathering_margin(runs)
    return TimeLimit(left, "end of the Slurm job") if left < math.inf else TimeLimit()


def gathering_margin(runs: int) -> float:
    """Return the time [s] to keep for ending the sweep and for writing the dataset of so many runs.

    It is longer than that between Slurm's warning and the end, 30 s by slurm/*.sbatch, up to 90 s:
    no batch that is expected to end in time is broken off by the warning.
    """
    return 90.0 + _GATHERING * runs


class _TimeUp(BaseException):
    """Raised wherever the process is when an alarm goes off; no handler of errors takes it for one."""


@contextmanager
def planning_within(seconds: float, runs: int) -> Iterator[None]:
    """End a `with` block when its time is up: a plan of very many runs can take longer than their limit.

    The time that is left [s] is infinite for no limit. Some seconds are always left.

    Raises
    ------
    InputError
        If the time is up. In a thread, where Python has no signals, it never is.
    """
    if seconds == math.inf or threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, frame: FrameType | None) -> None:
        raise _TimeUp

    limit, began = max(seconds, _SHORTEST_PLANNING), time.monotonic()
    handler = signal.signal(signal.SIGALRM, end)
    before, _ = signal.setitimer(signal.ITIMER_REAL, limit)
    try:
        yield
    except _TimeUp:
        expected = f"more than {limit:.3g} s, which the plan of {runs} runs takes before the first one begins"
        raise mismatch("time limit", expected, f"{max(seconds, 0.0):.3g} s left") from None
    finally:
        left = max(before - (time.monotonic() - began), 1e-3) if before else 0.0
        signal.setitimer(signal.ITIMER_REAL, left)
        signal.signal(signal.SIGALRM, handler)


def _left_to_slurm_job(environment: Mapping[str, str]) -> float:
    """Return the time [s] that the Slurm job has left; infinite where there is no job or no limit."""
    job = environment.get("SLURM_JOB_ID", "")
    if not job:
        return math.inf
    end = environment.get("SLURM_JOB_END_TIME", "")
    if end.isdigit():
        return int(end) - time.time()
    try:
        found = subprocess.run(
            [*_SQUEUE, f"--jobs={job}"], capture_output=True, text=True, timeout=_PATIENCE, check=True
        ).stdout.strip()
    except (OSError, subprocess.SubprocessError) as error:
        found = str(error)
    if found == "UNLIMITED":
        return math.inf
    left = _TIME_LEFT.fullmatch(found)
    if left is None:
        why = f"SLURM_JOB_END_TIME is not set, squeue: {found or 'no such job'}"
        _logger.warning("the end of Slurm job %s is not known (%s); --time-limit tells it", job, why)
        return math.inf
    return _in_seconds(left)


def _in_seconds(left: re.Match[str]) -> float:
    """Return [days-][[hours:]minutes:]seconds as seconds."""
    days, *clock = left.groups()
    *larger, seconds = [int(part) for part in clock if part is not None]
    hours, minutes = [0, 0, *larger][-2:]
    return ((int(days or 0) * 24 + hours) * 60 + minutes) * 60 + seconds


class SignalWatch:
    """A context in which the signals to stop are noted instead of ending the process."""

    def __init__(self) -> None:
        self.noted: str | None = None  # name of the first signal that came
        self._noted_at = 0.0
        self._previous: dict[int, Any] = {}

    def __enter__(self) -> Self:
        for number in SIGNALS:
            if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN:  # as nohup leaves it
                self._previous[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)  # None: not of Python

    def _note(self, number: int, frame: FrameType | None) -> None:
        now = time.monotonic()
        if self.noted is None:
            self.noted, self._noted_at = signal.Signals(number).name, now
        elif number == signal.SIGINT and now - self._noted_at > _IMPATIENCE:
            # Not sooner: the terminal and mpirun may both pass on one Ctrl-C.
            raise KeyboardInterrupt


def raise_again(name: str, status: int) -> NoReturn:
    """Raise what a signal means to a script, on all ranks, once its sweep has been stopped.

    Raises
    ------
    KeyboardInterrupt
        After SIGINT.
    SystemExit
        After other signals, with the exit status of a script that leaves it uncaught.
    """
    error = KeyboardInterrupt(name) if name == signal.SIGINT.name else SystemExit(status)
    vars(error)["everywhere"] = True
    raise error


@dataclass
class Stop:
    """Whether this rank continues.

    No batch begins that is not expected to end within the limit, and those at work at its end are broken off.
    """

    counter: Counter  # through which ranks communicate
    signals: SignalWatch  # the signals that this process was sent
    limit: TimeLimit  # time from here on
    meanwhile: Callable[[], None]  # called about twice a second while a run computes: shows the progress

    def __post_init__(self) -> None:
        self._looked = time.monotonic()
        self._deadline = self._looked + self.limit.seconds
        self._late = ""
        self._told = self._heard = False
        self._death: RankDied | None = None

    @property
    def reason(self) -> str | None:
        """Why this rank starts no more runs, or not all; None if it continues."""
        if self.signals.noted:
            return self.signals.noted
        if self._heard:
            return ELSEWHERE
        return self._late or None

    def may_claim(self) -> bool:
        """Return whether this rank may start another run.

        Raises
        ------
        RankDied
            If a rank of the team is dead.
        """
        may = self.interrupt() is None
        if self._death is not None:
            raise self._death
        return may

    @property
    def seconds_left(self) -> float:
        """Time [s] until the limit."""
        return self._deadline - time.monotonic()

    def fits(self, seconds: float) -> bool:
        """Return whether there is so much time [s] left."""
        left = self.seconds_left
        late = seconds > left
        if late and not self._late:
            were_left, needed = show_duration(max(left, 0.0)), show_duration(seconds)
            self._late = f"{self.limit.name}: {were_left} were left, a batch may take {needed}"
        return not late

    def interrupt(self) -> str | None:
        """Return why the present run should be stopped, None if it should continue."""
        self.look()
        over = time.monotonic() >= self._deadline
        if over:
            self._late = self._late or self.limit.name
        return self.reason if self.signals.noted or self._heard or over else None

    def look(self) -> None:
        """Check the other ranks now and then, and tell them if this one is to stop."""
        now = time.monotonic()
        try:
            if now - self._looked > _LOOK_INTERVAL:
                self._looked = now
                self.meanwhile()
                self._heard = self.counter.is_interrupted()
            if self.signals.noted:
                self.tell_all()
        except RankDied as death:  # no reason to stop the present run
            self._death = death

    def tell_all(self) -> None:
        """Let all ranks stop, as this one does."""
        # Not from the signal handler: that may strike within another call of MPI.
        if not self._told:
            self._told = True
            self.counter.interrupt_all()


def outlive(team: Team, work: Callable[[Team], Result]) -> Result:
    """Return the result of `work`; when a rank dies during it, the remaining ranks do it again.

    Parameters
    ----------
    team : Team
        All ranks.
    work : callable
        Their joint work. The shared counter dies with the rank that holds it, and the claims of the dead rank
        are nowhere but in their logs: so `work` has to begin with the records.
    """
    if team.communicator is None or not is_tolerated():
        return work(team)
    while True:
        death = None
        try:
            result = work(team)
        except RankDied as caught:
            team.revoke()  # ranks that wait for the dead one learn of it
            death = caught
        # Some ranks may have come through before the death, and must not leave the others.
        if team.agree(death is None):
            return result
        size = team.size
        team = team.survivors()
        if team.size == size:
            raise death or RankDied("an error of MPI on another rank, and no death")
        if team.rank == 0:
            _logger.warning("a rank has died; %d go on", team.size)
