"""The durable record: one append-only log per rank and session, one unbuffered write per batch of runs.

A log is a preamble (magic, format version, a JSON header and its checksum) and then frames of one length:
marker, payload length, run index, time of writing, checksum, payload. A frame's checksum starts from the
job's fingerprint and the payload's type, so a frame is known to belong to its study even where the header is
lost, and reading can take up again at the next frame after a damaged stretch.
"""

from __future__ import annotations

import json
import os
import platform
import time
import zlib
from collections.abc import Sequence
from pathlib import Path
from struct import Struct
from typing import Any

import numpy as np

from cvt_hpc.files import storage_error, sync_folder

MAGIC = b"\x89CVTREC\n"
FORMAT_VERSION = 1
MARKER = b"\xf5RUN"
PREAMBLE = Struct("<8sIII")  # magic, format version, header length, header checksum
FRAME = Struct("<4sIqdI")  # marker, payload length, run index, time of writing [s], checksum
_CHECKED = Struct("<Iqd")  # the part of a frame's head that its checksum covers

KEPT = "The runs recorded so far are kept, and the same command goes on from them"
SYNC_INTERVAL = 5.0  # [s]; a dead process loses nothing, a power failure at most this much

Record = tuple[int, np.ndarray]  # run index, and the record of that run, shape ()


class RecordFormat:
    """How a study's records are framed.

    Parameters
    ----------
    fingerprint : str
        Of the job.
    dtype : numpy.dtype
        Structured type of one record.
    """

    def __init__(self, fingerprint: str, dtype: np.dtype) -> None:
        self.fingerprint = fingerprint
        self.dtype = dtype
        self.descr = json.loads(json.dumps(np.lib.format.dtype_to_descr(dtype)))
        self._seed = zlib.crc32(json.dumps([fingerprint, self.descr]).encode())

    @property
    def frame_size(self) -> int:
        """Bytes of one framed record."""
        return FRAME.size + self.dtype.itemsize

    def frame(self, index: int, written: float, payload: bytes) -> bytes:
        """Return one framed record.

        Parameters
        ----------
        index : int
            Run index.
        written : float
            Time of writing [s] since the epoch.
        payload : bytes
            The record, of the format's dtype.
        """
        return (
            FRAME.pack(MARKER, len(payload), index, written, self._check(index, written, payload)) + payload
        )

    def unframe(self, data: bytes, start: int) -> tuple[int, float] | None:
        """Return run index and time of the frame that starts at `start`, None if there is no valid one."""
        stop = start + self.frame_size
        if stop > len(data):
            return None
        marker, length, index, written, check = FRAME.unpack_from(data, start)
        if marker != MARKER or length != self.dtype.itemsize:
            return None
        payload = memoryview(data)[start + FRAME.size : stop]
        return (index, written) if check == self._check(index, written, payload) else None

    def preamble(self, session: dict[str, Any], rank: int) -> bytes:
        """Return the bytes with which a log begins."""
        header = {"fingerprint": self.fingerprint, "dtype": self.descr, "rank": rank, "session": session}
        text = json.dumps(header).encode()
        return PREAMBLE.pack(MAGIC, FORMAT_VERSION, len(text), header_check(FORMAT_VERSION, text)) + text

    def _check(self, index: int, written: float, payload: bytes | memoryview) -> int:
        return zlib.crc32(payload, zlib.crc32(_CHECKED.pack(len(payload), index, written), self._seed))


def header_check(version: int, text: bytes) -> int:
    """Return the checksum of a log's format version and JSON header."""
    return zlib.crc32(text, version)


class RecordLog:
    """A rank's log of one session; the file comes into being with the first record.

    Parameters
    ----------
    folder : Path
        The study's folder of records.
    layout : RecordFormat
        How records are framed.
    session : dict
        What is to be known of this start of the sweep, see `provenance.new_session`.
    rank : int
        Of this process.
    """

    def __init__(self, folder: Path, layout: RecordFormat, session: dict[str, Any], rank: int) -> None:
        # Host, process and time keep two sessions, or two nodes, from ever writing to one file.
        unique = f"{platform.node()}-{os.getpid()}-{time.time_ns():x}"
        self.path = folder / f"rank-{rank:04d}-{unique}.log"
        self._layout = layout
        self._preamble = layout.preamble(session, rank)
        self._descriptor: int | None = None
        self._synced = 0.0

    def append(self, records: Sequence[Record]) -> None:
        """Write the records of some runs; when this returns, the death of the process cannot lose them.

        Raises
        ------
        StorageError
            If the system refuses the write. The log then ends with the record before, and none of these.
        """
        now = time.time()
        try:
            if self._descriptor is None:
                self._open()
            self._write(b"".join(self._layout.frame(index, now, row.tobytes()) for index, row in records))
            if time.monotonic() - self._synced > SYNC_INTERVAL:
                self._sync()
        except OSError as error:
            raise storage_error(self.path, error, KEPT) from error

    def close(self) -> None:
        """Bring everything to the disk and close the file."""
        if self._descriptor is None:
            return
        try:
            self._sync()
        except OSError as error:
            raise storage_error(self.path, error, KEPT) from error
        finally:
            os.close(self._descriptor)
            self._descriptor = None

    def __enter__(self) -> RecordLog:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _open(self) -> None:
        self._descriptor = os.open(self.path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_APPEND, 0o666)
        self._write(self._preamble)
        sync_folder(self.path.parent)
        self._synced = time.monotonic()

    def _write(self, data: bytes) -> None:
        """Write all of `data` or nothing: a write that the system cut short is taken back."""
        before = os.fstat(self._descriptor).st_size
        rest = memoryview(data)
        try:
            while rest:
                rest = rest[os.write(self._descriptor, rest) :]
        except OSError:
            os.ftruncate(self._descriptor, before)
            raise

    def _sync(self) -> None:
        os.fsync(self._descriptor)
        self._synced = time.monotonic()
