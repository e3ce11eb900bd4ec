"""Reading records back, whatever happened to the files: damage is named and skipped, never fatal."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.files import naming_refusals
from cvt_hpc.study.description import Study
from cvt_hpc.study.record import FORMAT_VERSION, FRAME, MAGIC, MARKER, PREAMBLE, RecordFormat, header_check


@dataclass
class Records:
    """What the logs of a study hold.

    Attributes
    ----------
    rows : numpy.ndarray, shape (runs,)
        Records by run index; blank where a run has none.
    written : numpy.ndarray, shape (runs,)
        Time of writing [s] since the epoch; NaN where a run has no record.
    sessions : list of dict
        The starts of the sweep that left records, in order of time.
    warnings : list of str
        One line for each file that is not sound.
    """

    rows: np.ndarray
    written: np.ndarray
    sessions: list[dict[str, Any]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def recorded(self) -> np.ndarray:
        """Whether a run has a record, shape (runs,): it is never repeated, however it ended."""
        return ~np.isnan(self.written)


@dataclass(frozen=True)
class _Frame:
    """Where a valid record was found; frames compare in the order in which they count."""

    written: float
    path: Path
    start: int
    index: int

    @property
    def order(self) -> tuple[float, str, int]:
        # By content, not by the order in which a folder happens to be listed: the earliest written record of
        # a run counts; equal times, as in a copied file, are told apart by file name and position.
        return (self.written, self.path.name, self.start)


class _Foreign(Exception):
    """A file that does not hold records of the study."""


def read_records(folder: Path, study: Study) -> Records:
    """Return the records that all logs of a folder hold.

    Of several records of one run the earliest written counts.

    Parameters
    ----------
    folder : Path
        The study's folder of records; may be missing.
    study : Study
        The study that the records have to belong to.
    """
    layout = RecordFormat(study.fingerprint, study.record_dtype)
    records = Records(study.blank_rows(study.size), np.full(study.size, np.nan))
    chosen: dict[int, _Frame] = {}
    sessions: dict[str, dict[str, Any]] = {}
    for path in _files(folder):
        try:
            data = path.read_bytes()
            session, frames = _read_log(path, data, layout, study.size, records.warnings)
        except (OSError, _Foreign) as error:
            text = error.strerror if isinstance(error, OSError) else error
            records.warnings.append(f"{path}: left out: {text}")
            continue
        if session is not None and frames:
            sessions[session["id"]] = session
        for frame in frames:
            _choose(frame, data, chosen, records, study)
    records.sessions = sorted(sessions.values(), key=lambda session: (session["started"], session["id"]))
    return records


def _files(folder: Path) -> list[Path]:
    """Return what may be logs; hidden files are the system's, or those of a start that tries to write."""
    with naming_refusals(folder, "a folder that can be read"):
        entries = sorted(folder.iterdir()) if folder.is_dir() else []
    return [path for path in entries if not path.name.startswith(".")]


def _choose(frame: _Frame, data: bytes, chosen: dict[int, _Frame], records: Records, study: Study) -> None:
    """Enter a record, unless an earlier one of the same run is there."""
    row = np.frombuffer(data, study.record_dtype, 1, frame.start + FRAME.size)[0]
    rival = chosen.get(frame.index)
    if rival is not None:
        if not _same_numbers(row, records.rows[frame.index], study):
            first, second = sorted((rival, frame), key=lambda f: f.order)
            records.warnings.append(
                f"{second.path}: run {frame.index} has other numbers than in {first.path.name}, which counts"
            )
        if rival.order < frame.order:
            return
    chosen[frame.index] = frame
    records.rows[frame.index] = row
    records.written[frame.index] = frame.written


def _same_numbers(one: np.void, other: np.void, study: Study) -> bool:
    """Return whether two records agree bitwise, timings and the like excepted."""
    names = [variable.name for variable in study.variables if not variable.volatile]
    return all(one[name].tobytes() == other[name].tobytes() for name in names)


def _read_log(
    path: Path, data: bytes, layout: RecordFormat, size: int, warnings: list[str]
) -> tuple[dict[str, Any] | None, list[_Frame]]:
    """Return the session of a log and its valid frames; what is damaged goes to `warnings`.

    Raises
    ------
    _Foreign
        If the file is no log, or a log of another job.
    """
    if not data:  # a process that died before its first record
        return None, []
    session, start = _read_preamble(data, layout)
    frames, flaws = [], []
    for begin, end, found in _frames(data, start, layout):
        if found is not None and 0 <= found[0] < size:
            frames.append(_Frame(found[1], path, begin, found[0]))
        elif end == len(data) and end - begin < layout.frame_size:
            flaws.append(f"{path}: the last {end - begin} bytes are an unfinished record; left out")
        else:
            flaws.append(f"{path}: bytes {begin} to {end} are damaged; left out")
    if session is None and not frames:
        raise _Foreign("no record of this study in it")
    if session is None:
        warnings.append(f"{path}: the header is damaged; the records found in it count")
    warnings.extend(flaws)
    return session, frames


def _read_preamble(data: bytes, layout: RecordFormat) -> tuple[dict[str, Any] | None, int]:
    """Return a log's session, None if its header is damaged, and where its frames begin.

    Raises
    ------
    _Foreign
        If a sound header says that the file is not of this study, or nothing in it looks like a log.
    """
    if not data.startswith(MAGIC):
        if MARKER not in data:
            raise _Foreign("not a record log")
        return None, 0
    if len(data) < PREAMBLE.size:
        return None, len(data)
    _, version, length, check = PREAMBLE.unpack_from(data)
    text = data[PREAMBLE.size : PREAMBLE.size + length]
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


def _frames(
    data: bytes, start: int, layout: RecordFormat
) -> Iterator[tuple[int, int, tuple[int, float] | None]]:
    """Yield begin, end and (index, time of writing) of each frame; None for a stretch that is not valid."""
    while start < len(data):
        found = layout.unframe(data, start)
        if found is not None:
            yield start, start + layout.frame_size, found
            start += layout.frame_size
            continue
        begin = start
        while start >= 0 and layout.unframe(data, start) is None:
            start = data.find(MARKER, start + 1)
        if start < 0:
            start = len(data)
        yield begin, start, None
