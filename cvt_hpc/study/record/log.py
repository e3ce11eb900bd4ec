"""The durable record: one log per rank and session, one unbuffered write per batch of runs.

Before a batch begins a mark is written. A process that dies leaves it without records after it, which shows
the runs at which it died; a process that ends in an orderly way removes it.

README.md of the folder above has the bytes of a log, format version 2, in a table. A log is a preamble
(magic, format version, a JSON header and its checksum) and then frames: a head (marker, payload length, time
of writing, checksum) and a payload. A frame's checksum starts from the job's fingerprint and the record's
type, so a frame is known to belong to its study even where the header is lost, and reading can take up again
at the next frame after a damaged stretch.
"""

import json
import os
import platform
import re
import time
import zlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from io import FileIO
from pathlib import Path
from struct import Struct
from typing import Any, NamedTuple, Self

import numpy as np

from cvt_hpc.storage.files import storage_error, sync_folder

MAGIC = b"\x89CVTREC\n"
FORMAT_VERSION = 2
PREAMBLE = Struct("<8sIII")  # magic, format version, header length, header checksum
HEAD = Struct("<4sIdI")  # marker, payload length, time of writing [s], checksum
_CHECKED = Struct("<4sId")  # the part of a frame's head that its checksum covers
PLACE = Struct("<qI")  # run index, attempt

RECORD = b"\xf5RUN"  # payload: a place and the record of that run
BEGUN = b"\xf5BEG"  # payload: the places of a batch that this process is at from here on
ALONE = b"\xf5ALO"  # the same of a run that is done alone, because its process has died before
AGAIN = b"\xf5AGN"  # payload: the places of runs that are to be done again, with their new attempt
_MARK_LIMIT = 1 << 28  # [bytes] of payload: 22 million runs

PREAMBLE_LIMIT = 1 << 20  # [bytes]; none is longer
WINDOW = 1 << 22  # [bytes] of a log that are read at a time
_MARKERS = re.compile(b"\xf5(?:RUN|BEG|ALO|AGN)")

Place = tuple[int, int]  # run index, and the attempt, counted from 1

KEPT = "The runs recorded so far are kept, and the same command goes on from them"
_SYNC_INTERVAL = 5.0  # [s]; a dead process loses nothing, a power failure at most this much
_CLOSED = -1  # no descriptor of a file

Session = dict[str, Any]  # description of a start of the sweep, see `provenance.new_session`
Record = tuple[int, np.ndarray]  # run index, and the record of that run, shape ()


class ForeignLog(Exception):
    """A file that does not hold records of the study."""


class Frame(NamedTuple):
    """A valid frame: its kind, size [bytes], time of writing, runs, and a run's record."""

    kind: bytes
    size: int
    written: float
    places: list[Place]
    row: memoryview


class RecordFormat:
    """Frame of a study's records and marks.

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
    def record_size(self) -> int:
        """Bytes of one framed record."""
        return HEAD.size + PLACE.size + self.dtype.itemsize

    def record(self, place: Place, written: float, row: np.ndarray) -> bytes:
        """Return one framed record, shape (), of the format's dtype, with its time of writing [s]."""
        return self._frame(RECORD, written, PLACE.pack(*place) + row.tobytes())

    def mark(self, kind: bytes, places: Sequence[Place], written: float) -> bytes:
        """Return one framed mark of some runs."""
        return self._frame(kind, written, b"".join(PLACE.pack(*place) for place in places))

    def unframe(self, data: bytes, start: int) -> Frame | None:
        """Return the frame that starts at `start`, None if there is no valid one."""
        if start + HEAD.size > len(data):
            return None
        kind, length, written, check = HEAD.unpack_from(data, start)
        stop = start + HEAD.size + length
        if stop > len(data) or not self._is_length_of(kind, length):
            return None
        payload = memoryview(data)[start + HEAD.size : stop]
        if check != self._check(kind, written, payload):
            return None
        listed = PLACE.size if kind == RECORD else len(payload)
        return Frame(kind, stop - start, written, list(PLACE.iter_unpack(payload[:listed])), payload[listed:])

    def frames(self, file: FileIO, start: int, size: int) -> Iterator[tuple[int, int, Frame | None]]:
        """Yield begin, end and content of each frame of a file; None for a stretch that is not valid.

        Parameters
        ----------
        file : FileIO
            Of it no more than some windows are in memory.
        start, size : int
            Where the first frame begins, and the size of the file [bytes].
        """
        data, base, place, damaged = b"", start, start, None  # window and its place; where damage begins
        while place < size:
            at = place - base
            frame = self.unframe(data, at)
            if frame is not None:
                if damaged is not None:
                    yield damaged, place, None
                    damaged = None
                yield place, place + frame.size, frame
                place += frame.size
            elif at + self._span(data, at) > len(data) and base + len(data) < size:
                wanted = max(WINDOW, self._span(data, at))
                data, base = os.pread(file.fileno(), wanted, place), place
                if len(data) < wanted:  # the end; bytes beyond `size` are not searched
                    size = min(size, base + len(data))
            else:
                damaged = place if damaged is None else damaged
                ahead = _MARKERS.search(data, at + 1)
                place = base + (ahead.start() if ahead else max(len(data) - len(RECORD) + 1, at + 1))
        if damaged is not None:
            yield damaged, size, None

    def preamble(self, session: Session, rank: int) -> bytes:
        """Return the bytes with which a log begins."""
        header = {"fingerprint": self.fingerprint, "dtype": self.descr, "rank": rank, "session": session}
        text = json.dumps(header).encode()
        return PREAMBLE.pack(MAGIC, FORMAT_VERSION, len(text), _header_check(FORMAT_VERSION, text)) + text

    def _frame(self, kind: bytes, written: float, payload: bytes) -> bytes:
        return HEAD.pack(kind, len(payload), written, self._check(kind, written, payload)) + payload

    def _check(self, kind: bytes, written: float, payload: bytes | memoryview) -> int:
        return zlib.crc32(payload, zlib.crc32(_CHECKED.pack(kind, len(payload), written), self._seed))

    def _span(self, data: bytes, start: int) -> int:
        """Return the number of bytes needed to decide whether a frame starts at `start`."""
        if start + HEAD.size > len(data):
            return HEAD.size
        kind, length, *_ = HEAD.unpack_from(data, start)
        return HEAD.size + (length if self._is_length_of(kind, length) else 0)

    def _is_length_of(self, kind: bytes, length: int) -> bool:
        if kind == RECORD:
            return length == PLACE.size + self.dtype.itemsize
        return kind in (BEGUN, ALONE, AGAIN) and 0 < length <= _MARK_LIMIT and length % PLACE.size == 0


def read_preamble(data: bytes, layout: RecordFormat) -> tuple[Session | None, int]:
    """Return a log's session, None if its header is damaged, and where its frames begin.

    Raises
    ------
    ForeignLog
        If a sound header shows that the file is not of this study.
    """
    if not data.startswith(MAGIC):
        return None, 0
    if len(data) < PREAMBLE.size:
        return None, len(data)
    _, version, length, check = PREAMBLE.unpack_from(data)
    text = data[PREAMBLE.size : PREAMBLE.size + length]
    if check != _header_check(version, text):
        return None, len(MAGIC)
    if version != FORMAT_VERSION:
        raise ForeignLog(f"expected format {FORMAT_VERSION} of the record log, found {version}")
    header = json.loads(text)
    if header["fingerprint"] != layout.fingerprint:
        raise ForeignLog(f"a record log of another job (fingerprint {header['fingerprint'][:12]})")
    if header["dtype"] != layout.descr:
        raise ForeignLog("a record log of this job with other recorded quantities")
    return header["session"], PREAMBLE.size + length


def _header_check(version: int, text: bytes) -> int:
    """Return the checksum of a log's format version and JSON header."""
    return zlib.crc32(text, version)


class RecordLog:
    """A rank's log of one session; the file is created by the first write.

    Parameters
    ----------
    folder, layout
        The study's folder of records, and how these are framed.
    session, rank
        The start of the sweep, and the rank of this process in it.
    attempts : mapping, optional
        Which attempt of a run this is, by run index; the first one where it is not named.
    """

    def __init__(
        self,
        folder: Path,
        layout: RecordFormat,
        session: Session,
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
        """Write that this process is at work at some runs, and no others; `alone` where one has died at it.

        Raises
        ------
        StorageError
            If the system refuses the write.
        """
        written = self._append(self._layout.mark(ALONE if alone else BEGUN, self._places(batch), self._now()))
        self._open_mark = written if self._open_mark is None else self._open_mark

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

    def __enter__(self) -> Self:
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
            if time.monotonic() - self._synced > _SYNC_INTERVAL:
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
