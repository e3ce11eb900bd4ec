"""The durable record: one log per rank and session, one unbuffered write per batch of runs.

Before a batch begins a mark is written. A process that dies leaves it without records after it, which shows
the runs at which it died; a process that ends in an orderly way removes it.
"""

from __future__ import annotations

import os
import platform
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.files import storage_error, sync_folder
from cvt_hpc.study.record.frames import AGAIN, ALONE, BEGUN, Place, RecordFormat

KEPT = "The runs recorded so far are kept, and the same command goes on from them"
SYNC_INTERVAL = 5.0  # [s]; a dead process loses nothing, a power failure at most this much
_CLOSED = -1  # no descriptor of a file

Record = tuple[int, np.ndarray]  # run index, and the record of that run, shape ()


class RecordLog:
    """A rank's log of one session; the file is created by the first write.

    Parameters
    ----------
    folder : Path
        The study's folder of records.
    layout : RecordFormat
        How records are framed.
    session : dict
        Description of this start of the sweep, see `provenance.new_session`.
    rank : int
        Of this process.
    attempts : mapping, optional
        Which attempt of a run this is, by run index; the first one where it is not named.
    """

    def __init__(
        self,
        folder: Path,
        layout: RecordFormat,
        session: dict[str, Any],
        rank: int,
        attempts: Mapping[int, int] | None = None,
    ) -> None:
        # Host, process and time keep two sessions, or two nodes, from ever writing to one file.
        unique = f"{platform.node()}-{os.getpid()}-{time.time_ns():x}"
        self.path = folder / f"rank-{rank:04d}-{unique}.log"
        self._layout = layout
        self._preamble = layout.preamble(session, rank)
        self._attempts = attempts or {}
        self._descriptor = _CLOSED
        # A clock that is set right meanwhile must not make a batch look as if it had taken hours.
        self._clock_lead = time.time() - time.monotonic()
        self._synced = 0.0
        self._open_mark: int | None = None  # where the mark of the batch at work begins [byte]

    def begin(self, batch: Sequence[int], *, alone: bool = False) -> None:
        """Write that this process is at work at some runs.

        Parameters
        ----------
        batch : sequence of int
            Run indices.
        alone : bool
            Whether the run is done alone because its process has died before.

        Raises
        ------
        StorageError
            If the system refuses the write.
        """
        mark = self._layout.mark(ALONE if alone else BEGUN, self._places(batch), self._now())
        self._open_mark = self._append(mark)

    def begin_again(self, indices: Iterable[int]) -> None:
        """Write that the earlier records of some runs count no more; errors as for `begin`."""
        self._append(self._layout.mark(AGAIN, self._places(indices), self._now()))

    def append(self, records: Sequence[Record]) -> None:
        """Write the records of some runs; when this returns, the death of the process cannot lose them.

        Raises
        ------
        StorageError
            If the system refuses the write. The log then ends with the record before, and none of these.
        """
        now = self._now()
        places = self._places([index for index, _ in records])
        frames = (self._layout.record(at, now, row) for at, (_, row) in zip(places, records, strict=True))
        self._append(b"".join(frames))
        self._open_mark = None

    def close(self) -> None:
        """Take back the mark of runs that were broken off, bring the rest to the disk, and close the file."""
        if self._descriptor == _CLOSED:
            return
        try:
            if self._open_mark is not None:
                os.ftruncate(self._descriptor, self._open_mark)  # which a full disk allows
            if self._open_mark == len(self._preamble):  # nothing else was ever in it
                self.path.unlink()
            self._sync()
        except OSError as error:
            raise storage_error(self.path, error, KEPT) from error
        finally:
            os.close(self._descriptor)
            self._descriptor = _CLOSED

    def __enter__(self) -> RecordLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _places(self, indices: Iterable[int]) -> list[Place]:
        return [(int(index), self._attempts.get(int(index), 1)) for index in indices]

    def _now(self) -> float:
        """Return the time [s] since 1970 at the beginning of the log, plus the time elapsed since then."""
        return self._clock_lead + time.monotonic()

    def _append(self, data: bytes) -> int:
        """Write and now and then bring to the disk; return where in the file the data begin."""
        try:
            if self._descriptor == _CLOSED:
                self._open()
            before = self._write(data)
            if time.monotonic() - self._synced > SYNC_INTERVAL:
                self._sync()
        except OSError as error:
            raise storage_error(self.path, error, KEPT) from error
        return before

    def _open(self) -> None:
        # The folder itself, and no link that may stand in its place.
        folder = os.open(self.path.parent, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
        try:
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND | os.O_CLOEXEC
            self._descriptor = os.open(self.path.name, flags, 0o666, dir_fd=folder)
        finally:
            os.close(folder)
        self._write(self._preamble)
        sync_folder(self.path.parent)
        self._synced = time.monotonic()

    def _write(self, data: bytes) -> int:
        """Write all of `data` or nothing: a write that the system cut short is taken back."""
        before = os.fstat(self._descriptor).st_size
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError:
            os.ftruncate(self._descriptor, before)
            raise
        return before

    def _sync(self) -> None:
        os.fsync(self._descriptor)
        self._synced = time.monotonic()
