"""Reading records back, whatever happened to the files: damage is named and skipped, never fatal."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.files import naming_refusals
from cvt_hpc.study.batches import Batch
from cvt_hpc.study.description import Study
from cvt_hpc.study.frames import AGAIN, ALONE, RECORD, ForeignLog, Frame, RecordFormat, read_preamble


class Timing(NamedTuple):
    """How long a batch took, from its mark to its records."""

    batch: Batch
    seconds: float


@dataclass
class Records:
    """What the logs of a study hold.

    Attributes
    ----------
    rows : numpy.ndarray, shape (runs,)
        Records by run index; blank where a run has none.
    written : numpy.ndarray, shape (runs,)
        Time of writing [s] since the epoch; NaN where a run has no record.
    attempts : numpy.ndarray of int, shape (runs,)
        The attempt that counts, from 1: how often the run was asked for.
    died, died_alone : numpy.ndarray of int, shape (runs,)
        How often, in that attempt, a process was at work at the run when it died: in all, and while it did
        that run alone because of earlier deaths. Runs that a living process is at count as well.
    timings : list of Timing
        Of the batches that were done as a whole, the first of each log excepted: it has loaded kernels.
    sessions : list of dict
        The starts of the sweep that left records, in order of time.
    warnings : list of str
        One line for each file that is not sound.
    """

    rows: np.ndarray
    written: np.ndarray
    attempts: np.ndarray
    died: np.ndarray
    died_alone: np.ndarray
    timings: list[Timing] = field(default_factory=list)
    sessions: list[dict[str, Any]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def recorded(self) -> np.ndarray:
        """Whether a run has a record, shape (runs,): it is not repeated unless asked for."""
        return ~np.isnan(self.written)


class _Found(NamedTuple):
    """A record that was found; of several of one run the least counts."""

    # By content, not by the order in which a folder happens to be listed: the latest attempt counts, and of
    # it the earliest written record; equal times, as in a copied file, are told apart by name and position.
    order: tuple[int, float, str, int]
    path: Path


class _Death(NamedTuple):
    """A mark without records after it; equal ones, as in a copied file, are one."""

    index: int
    attempt: int
    alone: bool
    begun: float


def read_records(folder: Path, study: Study) -> Records:
    """Return the records that all logs of a folder hold.

    Of several records of one run that of the latest attempt counts, and of these the earliest written.

    Parameters
    ----------
    folder : Path
        The study's folder of records; may be missing.
    study : Study
        The study that the records have to belong to.
    """
    reader = _Reader(study)
    for path in _files(folder):
        try:
            reader.read(path, path.read_bytes())
        except (OSError, ForeignLog) as error:
            text = error.strerror if isinstance(error, OSError) else error
            reader.records.warnings.append(f"{path}: left out: {text}")
    return reader.result()


def _files(folder: Path) -> list[Path]:
    """Return what may be logs; hidden files are the system's, or those of a start that tries to write."""
    with naming_refusals(folder, "a folder that can be read"):
        entries = sorted(folder.iterdir()) if folder.is_dir() else []
    return [path for path in entries if not path.name.startswith(".")]


class _Reader:
    """Takes in one log after another."""

    def __init__(self, study: Study) -> None:
        zeros = np.zeros(study.size, np.int64)
        blank = study.blank_rows(study.size)
        self.records = Records(blank, np.full(study.size, np.nan), zeros + 1, zeros.copy(), zeros.copy())
        self._study = study
        self._layout = RecordFormat(study.fingerprint, study.record_dtype)
        self._chosen: dict[int, _Found] = {}
        self._deaths: set[_Death] = set()
        self._sessions: dict[str, dict[str, Any]] = {}

    def read(self, path: Path, data: bytes) -> None:
        """Take in a log; what is damaged goes to the warnings.

        Raises
        ------
        ForeignLog
            If the file is no log, or a log of another job.
        """
        if not data:  # a process that died before its first record
            return
        session, start = read_preamble(data, self._layout)
        frames, flaws = self._sound_frames(path, data, start)
        if session is None and not frames:
            raise ForeignLog("no record of this study in it")
        if session is None:
            self.records.warnings.append(f"{path}: the header is damaged; the records found in it count")
        self.records.warnings.extend(flaws)
        if session is not None and any(frame.kind == RECORD for frame in frames):
            self._sessions[session["id"]] = session
        self._take_in(path, data, frames)

    def result(self) -> Records:
        """Return what all logs hold."""
        records = self.records
        for index, found in self._chosen.items():
            if -found.order[0] < records.attempts[index]:  # it is to be done again, and has not been yet
                records.rows[index] = self._study.blank_rows()
                records.written[index] = np.nan
        for death in self._deaths:
            if death.attempt == records.attempts[death.index] and np.isnan(records.written[death.index]):
                records.died[death.index] += 1
                records.died_alone[death.index] += death.alone
        records.sessions = sorted(self._sessions.values(), key=lambda s: (s["started"], s["id"]))
        return records

    def _sound_frames(self, path: Path, data: bytes, start: int) -> tuple[list[Frame], list[str]]:
        frames, flaws = [], []
        for begin, end, frame in self._layout.frames(data, start):
            if frame is not None and all(0 <= index < self._study.size for index, _ in frame.places):
                frames.append(frame)
            elif end == len(data) and end - begin < self._layout.record_size:
                flaws.append(f"{path}: the last {end - begin} bytes are an unfinished record; left out")
            else:
                flaws.append(f"{path}: bytes {begin} to {end} are damaged; left out")
        return frames, flaws

    def _take_in(self, path: Path, data: bytes, frames: list[Frame]) -> None:
        """Enter the records of a log, and follow from mark to mark what its process was at."""
        mark: Frame | None = None
        at_work: dict[int, int] = {}
        batches = 0
        for frame in frames:
            for index, attempt in frame.places:
                self.records.attempts[index] = max(self.records.attempts[index], attempt)
            if frame.kind == RECORD:
                ((index, _),) = frame.places
                self._choose(frame, path, data)
                if at_work.pop(index, None) is not None and not at_work:
                    batches += 1
                    if batches > 1:
                        seconds = frame.written - mark.written
                        self.records.timings.append(Timing(tuple(i for i, _ in mark.places), seconds))
            elif frame.kind != AGAIN:
                mark, at_work = frame, dict(frame.places)
        for index, attempt in at_work.items():
            self._deaths.add(_Death(index, attempt, mark.kind == ALONE, mark.written))

    def _choose(self, frame: Frame, path: Path, data: bytes) -> None:
        """Enter a record, unless one that counts before it is there."""
        ((index, attempt),) = frame.places
        row, records = self._layout.row(data, frame), self.records
        found = _Found((-attempt, frame.written, path.name, frame.start), path)
        rival = self._chosen.get(index)
        if rival is not None:
            same_attempt = rival.order[0] == found.order[0]
            if same_attempt and not _same_numbers(row, records.rows[index], self._study):
                first, second = sorted((rival, found), key=lambda f: f.order)
                records.warnings.append(
                    f"{second.path}: run {index} has other numbers than in {first.path.name}, which counts"
                )
            if rival.order < found.order:
                return
        self._chosen[index] = found
        records.rows[index] = row
        records.written[index] = frame.written


def _same_numbers(one: np.void, other: np.void, study: Study) -> bool:
    """Return whether two records agree bitwise, timings and the like excepted."""
    names = [variable.name for variable in study.variables if not variable.volatile]
    return all(one[name].tobytes() == other[name].tobytes() for name in names)
