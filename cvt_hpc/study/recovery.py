"""Reading records back, whatever happened to the files: damage is named and skipped, never fatal."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.files import naming_refusals
from cvt_hpc.study.description import Study
from cvt_hpc.study.record import FORMAT_VERSION, FRAME, MAGIC, MARKER, PREAMBLE, RecordFormat, header_check
from cvt_hpc.study.records import ENTRY, Records, choose

PREAMBLE_LIMIT = 1 << 20  # [bytes]; beyond is none
WINDOW = 1 << 22  # [bytes] of a log that are in memory at a time


class _Foreign(Exception):
    """A file that does not hold records of the study."""


def read_records(folder: Path, study: Study) -> Records:
    """Return which records all logs of a folder hold.

    Of several records of one run the earliest written counts.

    Parameters
    ----------
    folder : Path
        The study's folder of records; may be missing.
    study : Study
        The study that the records have to belong to.
    """
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    sessions: dict[str, dict[str, Any]] = {}
    found, warnings = [np.zeros(0, ENTRY)], []
    logs = _files(folder)
    for number, path in enumerate(logs):
        try:
            with path.open("rb", buffering=0) as file:
                session, entries = _read_log(file, layout, study.size, warnings)
        except (OSError, _Foreign) as error:
            text = error.strerror if isinstance(error, OSError) else error
            warnings.append(f"{path}: left out: {text}")
            continue
        if session is not None and entries.size:
            sessions[session["id"]] = session
        entries["log"] = number
        found.append(entries)
    records = choose(study, logs, np.concatenate(found))
    records.warnings[:0] = warnings
    records.sessions = sorted(sessions.values(), key=lambda session: (session["started"], session["id"]))
    return records


def _files(folder: Path) -> list[Path]:
    """Return what may be logs; hidden files are the system's, or those of a start that tries to write."""
    with naming_refusals(folder, "a folder that can be read"):
        entries = sorted(folder.iterdir()) if folder.is_dir() else []
    return [path for path in entries if not path.name.startswith(".")]


def _read_log(
    file: FileIO, layout: RecordFormat, runs: int, warnings: list[str]
) -> tuple[dict[str, Any] | None, np.ndarray]:
    """Return the session of a log and its valid records; what is damaged goes to `warnings`.

    Raises
    ------
    _Foreign
        If the file is no log, or a log of another job.
    """
    size = os.fstat(file.fileno()).st_size
    head = os.pread(file.fileno(), PREAMBLE_LIMIT, 0)
    if not head:  # a process that died before its first record
        return None, np.zeros(0, ENTRY)
    session, start = _read_preamble(head, layout)
    flaws: list[str] = []
    entries = np.fromiter(_entries(file, start, size, layout, runs, flaws), ENTRY)
    if session is None and not entries.size:
        raise _Foreign("no record of this study in it" if head.startswith(MAGIC) else "not a record log")
    if session is None:
        warnings.append(f"{file.name}: the header is damaged; the records found in it count")
    warnings.extend(f"{file.name}: {flaw}; left out" for flaw in flaws)
    return session, entries


def _read_preamble(head: bytes, layout: RecordFormat) -> tuple[dict[str, Any] | None, int]:
    """Return a log's session, None if its header is damaged, and where its frames begin.

    Raises
    ------
    _Foreign
        If a sound header says that the file is not of this study.
    """
    if not head.startswith(MAGIC):
        return None, 0
    if len(head) < PREAMBLE.size:
        return None, len(head)
    _, version, length, check = PREAMBLE.unpack_from(head)
    text = head[PREAMBLE.size : PREAMBLE.size + length]
    if check != header_check(version, text):
        return None, len(MAGIC)
    if version != FORMAT_VERSION:
        raise _Foreign(f"expected format {FORMAT_VERSION} of the record log, found {version}")
    header = json.loads(text)
    if header["fingerprint"] != layout.fingerprint:
        raise _Foreign(f"a record log of another job (fingerprint {header['fingerprint'][:12]})")
    if header["dtype"] != layout.descr:
        raise _Foreign("a record log of this job with other recorded quantities")
    return header["session"], PREAMBLE.size + length


def _entries(
    file: FileIO, start: int, size: int, layout: RecordFormat, runs: int, flaws: list[str]
) -> Iterator[tuple[int, float, int, int, int]]:
    """Yield the valid records of a log as an ENTRY has them; what is damaged goes to `flaws`."""
    for begin, end, frame in _frames(file, start, size, layout):
        if frame is not None and 0 <= frame[0] < runs:
            index, written, status = frame
            yield index, written, -1, begin + FRAME.size, status
        elif end == size and end - begin < layout.frame_size:
            flaws.append(f"the last {end - begin} bytes are an unfinished record")
        else:
            flaws.append(f"bytes {begin} to {end} are damaged")


def _frames(
    file: FileIO, start: int, size: int, layout: RecordFormat
) -> Iterator[tuple[int, int, tuple[int, float, int] | None]]:
    """Yield begin, end and (index, time of writing, status) of each frame; None for what is not valid."""
    status = FRAME.size + layout.dtype.fields["status"][1]
    place, damaged = start, None  # where a stretch without a valid frame begins
    for base in range(start, size, WINDOW):
        # So much longer than its step that a frame which begins in a window is whole in it.
        data = os.pread(file.fileno(), WINDOW + layout.frame_size, base)
        while place < min(base + WINDOW, size):
            at = place - base
            frame = layout.unframe(data, at)
            if frame is None:
                damaged = place if damaged is None else damaged
                ahead = data.find(MARKER, at + 1)
                place = base + (ahead if ahead >= 0 else WINDOW)
                continue
            if damaged is not None:
                yield damaged, place, None
                damaged = None
            yield place, place + layout.frame_size, (*frame, data[at + status])
            place += layout.frame_size
    if damaged is not None:
        yield damaged, size, None
