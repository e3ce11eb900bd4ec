"""Ranks wait for each other, and not without end: in MPI's start, and where they begin a joint work.

MPI_Init waits for all ranks, and holds Python's interpreter lock meanwhile: neither a thread nor a handler of
signals would run. A process beside it therefore watches the time, and signals have their default actions.
"""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from cvt_hpc.errors import mismatch

if TYPE_CHECKING:
    from mpi4py import MPI

# Signals sent by a person, by a terminal that closes, by batch systems at the end of a job and as a warning
# before, and by the system at the end of the processor time.
SIGNALS = (signal.SIGINT, signal.SIGHUP, signal.SIGTERM, signal.SIGUSR1, signal.SIGUSR2, signal.SIGXCPU)
_VARIABLE = "CVT_HPC_RANK_WAIT"
# Some thousand ranks take minutes to import Python modules from a busy network file system.
_PATIENCE = 300.0  # [s]
_SPREAD = 0.1  # of that time, over which ranks end: the launcher ends the others when the first one does
_POLL = 1e-3  # [s]

_requests: dict[int, MPI.Request] = {}  # of barriers that not all ranks have reached in time, by communicator


def patience(environment: Mapping[str, str] = os.environ) -> float:
    """Return how long [s] ranks wait for each other.

    Raises
    ------
    InputError
        If the environment variable for it holds no time.
    """
    if _VARIABLE not in environment:
        return _PATIENCE
    from cvt_hpc.job.units import read_duration

    return read_duration(environment[_VARIABLE], _VARIABLE)


@contextmanager
def bounded_start(rank: int, size: int) -> Iterator[None]:
    """End this process by SIGKILL, with a line on stderr, if MPI_Init in a `with` block takes too long."""
    seconds = patience()
    ranks = f"all {size} ranks" if size > 1 else "all ranks"  # a launcher may not tell their number
    line = (
        f"cvt-hpc: MPI: expected {ranks} to start it within {seconds:.4g} s, found that rank {rank} "
        f"waits for others: look above for one that has ended or hangs; {_VARIABLE}=20min would wait longer"
    )
    program = Path(__file__).with_name("watcher.py")
    command = [sys.executable, "-I", "-S", str(program), str(seconds * (1.0 + _SPREAD * rank / size)), line]
    with _default_actions():
        watcher = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
        try:
            yield
        finally:
            watcher.kill()
            watcher.communicate()


@contextmanager
def _default_actions() -> Iterator[None]:
    """Let signals with handlers in Python end the process at once."""
    is_main = threading.current_thread() is threading.main_thread()
    numbers = SIGNALS if is_main else ()
    handled = {number: handler for number in numbers if callable(handler := signal.getsignal(number))}
    for number in handled:
        signal.signal(number, signal.SIG_DFL)
    try:
        yield
    finally:
        for number, handler in handled.items():
            signal.signal(number, handler)


def await_all(communicator: MPI.Intracomm) -> None:
    """Return when all ranks of a communicator have come here.

    Raises
    ------
    InputError
        If they have not in time. A later call goes on with the same wait, as MPI requires.
    """
    key, seconds = communicator.py2f(), patience()
    deadline = time.monotonic() + seconds
    request = _requests.pop(key, None) or communicator.Ibarrier()
    while not request.Test():
        if time.monotonic() > deadline:
            _requests[key] = request
            expected = f"a call on all {communicator.size} ranks within {seconds:.4g} s"
            then = f"comm=None runs on one rank alone, {_VARIABLE}=20min waits longer"
            raise mismatch("run", expected, f"that rank {communicator.rank} waits for others", then)
        time.sleep(_POLL)
