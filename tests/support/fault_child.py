"""A sweep, or a gathering, of the double at which faults strike, and which says what it has on record.

As a program it takes a JSON text of options: those of `study_double.main` and of `main` here.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import random
import signal
import sys
import time
from typing import Any

import numba
import numpy as np

from cvt_hpc.errors import InputError
from cvt_hpc.job import load_job
from cvt_hpc.study import gather, run
from cvt_hpc.study.ranks.launch import end_process
from cvt_hpc.study.record import log
from cvt_hpc.study.record.log import Record, RecordLog
from support import study_double

# A record whose write has returned: run, SHA-256 of its bytes, and the name and the end [byte] of its log.
ACKNOWLEDGED = np.dtype([("run", "i8"), ("digest", "S64"), ("log", "S160"), ("end", "i8")])
_PIECE = 97  # [bytes] that are written at a time where writes are torn
_JUMP = 3e8  # [s], ten years


def main(options: dict[str, Any]) -> int:
    """Sweep or gather.

    Further options: `job`, the file of one that is swept in the place of the double; `cache`, a folder of its own for
    machine code; `acknowledged`, a file that is told of each record; `gathers` instead of sweeping; `torn`, after
    how many bytes written to a log the process dies, or where it `turns_read_only`, its file system refuses all
    changes; `clock`, the seed of a clock that jumps.
    """
    acknowledge(options["acknowledged"])
    if "cache" in options:
        numba.config.CACHE_DIR = options["cache"]
    if "torn" in options:
        log.os = TornWrites(options["torn"], options.get("turns_read_only", False))
    if "clock" in options:
        let_clock_jump(options["clock"])
    if not options.get("gathers") and "job" not in options:
        return study_double.main(options)
    try:
        if not options.get("gathers"):
            sweep = {"raises": False, **options["sweep"]}
            return end_process(run(load_job(options["job"]), options["out"], **sweep).exit_status)
        gather(options["out"])
    except InputError as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    return 0


def run_child(options: dict[str, Any], output: str) -> None:
    """Do as the program does, in a process that was forked; what it prints goes to a file."""
    descriptor = os.open(output, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    try:
        sys.exit(main(options))
    except KeyboardInterrupt:  # once the sweep has ended; end as Python itself would
        signal.signal(signal.SIGINT, signal.SIG_DFL)
        os.kill(os.getpid(), signal.SIGINT)


def acknowledge(path: str) -> None:
    """Let every log tell a file of the records whose write has returned."""
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o666)
    append = RecordLog.append

    def append_and_tell(log: RecordLog, records: list[Record]) -> None:
        append(log, records)
        end = os.fstat(log._descriptor).st_size
        told = np.zeros(len(records), ACKNOWLEDGED)
        for place, (index, row) in enumerate(records):
            behind = (len(records) - 1 - place) * log._layout.record_size
            digest = hashlib.sha256(row.tobytes()).hexdigest().encode()
            told[place] = (index, digest, log.path.name.encode(), end - behind)
        os.write(descriptor, told.tobytes())

    RecordLog.append = append_and_tell


class TornWrites:
    """Stands in for the module `os` of the record: short writes, and after some bytes the blow."""

    def __init__(self, left: int, read_only: bool) -> None:
        self._left = left
        self._read_only = read_only

    def __getattr__(self, name: str) -> Any:
        return getattr(os, name)

    def write(self, descriptor: int, data: memoryview) -> int:
        """Write no more than a piece, and nothing after the blow."""
        if self._left == 0:
            self._refuse_or_die()
        written = os.write(descriptor, data[: min(_PIECE, self._left)])
        self._left -= written
        if self._left == 0 and not self._read_only:
            self._refuse_or_die()
        return written

    def ftruncate(self, descriptor: int, length: int) -> None:
        """Truncate, unless the blow has come."""
        if self._left == 0:
            self._refuse_or_die()
        os.ftruncate(descriptor, length)

    def _refuse_or_die(self) -> None:
        if self._read_only:
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        os.kill(os.getpid(), signal.SIGKILL)


def let_clock_jump(seed: int) -> None:
    """Let the time of day jump by up to ten years, back and forth, at the start and within."""
    generator, real = random.Random(seed), time.time
    offset = generator.uniform(-_JUMP, _JUMP)

    def jumping_time() -> float:
        nonlocal offset
        if generator.random() < 0.05:
            offset = generator.uniform(-_JUMP, _JUMP)
        return real() + offset

    time.time = jumping_time


if __name__ == "__main__":
    sys.exit(main(json.loads(sys.argv[1])))
