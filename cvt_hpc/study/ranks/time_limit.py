"""The time of a sweep: as requested, or the rest of the Slurm job that it runs in."""

import logging
import math
import os
import re
import signal
import subprocess
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import NamedTuple

from cvt_hpc.errors import mismatch

_SQUEUE = ("squeue", "--noheader", "--format=%L")  # %L: time left, as days-hours:minutes:seconds
_PATIENCE = 20.0  # [s] with a busy controller
_GATHERING = 2e-4  # [s] a run
_SHORTEST_PLANNING = 10.0  # [s]: a plan takes so long on a busy machine, whatever its size
_TIME_LEFT = re.compile(r"(?:(\d+)-)?(?:(\d+):)?(?:(\d+):)?(\d+)")
_logger = logging.getLogger(__name__)


class TimeLimit(NamedTuple):
    """Time [s] that is left to compute in, and the name of its end."""

    seconds: float = math.inf
    name: str = "time limit"


def find_time_limit(asked: float | None, runs: int, environment: Mapping[str, str] = os.environ) -> TimeLimit:
    """Return how much time is left.

    Parameters
    ----------
    asked : float or None
        Time [s] that the user has given; without it that of the Slurm job counts, if there is one.
    runs : int
        Number of runs of the study, which have to be gathered before the end.
    environment : mapping
        Of this process.
    """
    if asked is not None:
        return TimeLimit(asked - _GATHERING * runs)
    left = _left_to_slurm_job(environment)
    return (
        TimeLimit(left - gathering_margin(runs), "end of the Slurm job") if left < math.inf else TimeLimit()
    )


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

    Parameters
    ----------
    seconds : float
        Time [s] that is left; infinite for no limit. Some seconds are always left.
    runs : int
        Number of runs, for the error.

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
        _logger.warning(
            "the end of Slurm job %s is not known (SLURM_JOB_END_TIME is not set, squeue: %s); "
            "--time-limit tells it",
            job,
            found or "no such job",
        )
        return math.inf
    return _in_seconds(left)


def _in_seconds(left: re.Match[str]) -> float:
    """Return [days-][[hours:]minutes:]seconds as seconds."""
    days, *clock = left.groups()
    *larger, seconds = [int(part) for part in clock if part is not None]
    hours, minutes = [0, 0, *larger][-2:]
    return ((int(days or 0) * 24 + hours) * 60 + minutes) * 60 + seconds
