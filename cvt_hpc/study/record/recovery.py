"""Reading logs, whatever happened to the files: damage is named and skipped, never fatal."""

import os
from collections.abc import Iterable, Iterator, Mapping
from io import FileIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.files import naming_refusals
from cvt_hpc.study.description import Study
from cvt_hpc.study.record import log
from cvt_hpc.study.record.index import ENTRY, Records, Timing, choose, open_log

Places = range | NDArray[np.int64]  # the index in a study of each run of another, or of itself


class _Death(NamedTuple):
    """A mark without records after it; equal ones, as in a copied file, are one."""

    run: int
    attempt: int
    alone: bool
    begun: float


def read_records(folder: Path, study: Study, earlier: Mapping[str, Places] | None = None) -> Records:
    """Return which records all logs of a folder hold.

    Of several records of one run that of the latest attempt counts, and of these the earliest written.

    Parameters
    ----------
    folder : Path
        The study's folder of records; may be missing.
    study : Study
        The study that the records have to belong to.
    earlier : mapping, optional
        Studies from which this one has grown, whose records count as well: by fingerprint, which of its runs
        each of theirs is.
    """
    logs = _files(folder)
    reader = _Reader(study, earlier or {})
    for number, path in enumerate(logs):
        try:
            with open_log(path) as file:
                reader.read(number, file)
        except (OSError, log.ForeignLog) as error:
            text = error.strerror if isinstance(error, OSError) else error
            reader.warnings.append(f"{path}: left out: {text}")
    return reader.result(logs)


def _files(folder: Path) -> list[Path]:
    """Return files that may be logs; hidden files are the system's, or probes of a start."""
    with naming_refusals(folder, "a folder that can be read"):
        entries = sorted(folder.iterdir()) if folder.is_dir() else []
    return [path for path in entries if not path.name.startswith(".")]


class _Trace:
    """Follows from mark to mark the runs that a process was doing.

    Parameters
    ----------
    refine : float
        The factor by which the retries that the process begins shorten time steps.

    Attributes
    ----------
    followed : int
        Number of frames.
    timings : list of Timing
        Of the batches that were done as a whole.
    refinements : dict
        That factor, by run index and attempt.
    """

    def __init__(self, refine: float) -> None:
        self.followed = 0
        self.timings: list[Timing] = []
        self.refinements: dict[log.Place, float] = {}
        self._refine = refine
        self._mark: log.Frame | None = None
        self._at_work: dict[int, int] = {}

    def follow(self, frame: log.Frame) -> None:
        """Take in the next frame."""
        self.followed += 1
        if frame.kind == log.RECORD:
            ((index, _),) = frame.places
            was_at_work = self._at_work.pop(index, None) is not None
            if self._mark is not None and was_at_work and not self._at_work:
                batch = tuple(index for index, _ in self._mark.places)
                self.timings.append(Timing(batch, frame.written - self._mark.written))
        elif frame.kind == log.AGAIN:
            self.refinements |= dict.fromkeys(frame.places, self._refine)
        else:
            self._mark, self._at_work = frame, dict(frame.places)

    def deaths(self) -> set[_Death]:
        """Return a death at each run that the process was at in the end."""
        if self._mark is None:
            return set()
        return {
            _Death(index, attempt, self._mark.kind == log.ALONE, self._mark.written)
            for index, attempt in self._at_work.items()
        }


class _Reader:
    """Takes in one log after another."""

    def __init__(self, study: Study, earlier: Mapping[str, Places]) -> None:
        self.warnings: list[str] = []
        self._study = study
        self._sources: dict[str, Places] = {study.fingerprint: range(study.size), **earlier}
        self._found = [np.zeros(0, ENTRY)]
        self._attempts = np.ones(study.size, np.int64)
        self._status = study.record_dtype.fields["status"][1]  # type: ignore[index]  # where it is in a record [byte]
        self._deaths: set[_Death] = set()
        self._refinements: dict[log.Place, float] = {}
        self._timings: list[Timing] = []
        self._sessions: dict[str, dict[str, Any]] = {}

    def read(self, number: int, file: FileIO) -> None:
        """Read a log; damaged parts go to the warnings.

        Raises
        ------
        ForeignLog
            If the file is no log, or a log of another job.
        """
        head = os.pread(file.fileno(), log.PREAMBLE_LIMIT, 0)
        if not head:  # a process that died before its first record
            return
        refusals = []
        for fingerprint, places in self._sources.items():
            try:
                layout = log.RecordFormat(fingerprint, self._study.record_dtype)
                return self._read_as(layout, places, number, file, head)
            except log.ForeignLog as error:
                refusals.append(error)
        raise refusals[0]

    def _read_as(
        self, layout: log.RecordFormat, places: Places, number: int, file: FileIO, head: bytes
    ) -> None:
        """Read a log of a study whose runs have these places in this one; errors as of `read`."""
        session, start = log.read_preamble(head, layout)
        flaws: list[str] = []
        trace = _Trace((session or {}).get("refine", 1.0))
        frames = self._sound_frames(layout, places, file, start, flaws)
        found = np.fromiter(self._entries(frames, number, trace), ENTRY)
        if session is None and not trace.followed:
            known = head.startswith(log.MAGIC)
            raise log.ForeignLog("no record of this study in it" if known else "not a record log")
        if session is None:
            self.warnings.append(f"{file.name}: the header is damaged; the records found in it count")
        self.warnings.extend(f"{file.name}: {flaw}; left out" for flaw in flaws)
        if session is not None and found.size:
            self._sessions[session["id"]] = session
        self._found.append(found)
        self._timings += trace.timings[1:]
        self._deaths |= trace.deaths()
        self._refinements |= trace.refinements

    def result(self, logs: list[Path]) -> Records:
        """Return the content of all logs."""
        records = choose(self._study, logs, np.concatenate(self._found), self._attempts)
        for death in self._deaths:
            if death.attempt == records.attempts[death.run] and not records.recorded[death.run]:
                records.died[death.run] += 1
                records.died_alone[death.run] += death.alone
        for (index, attempt), factor in self._refinements.items():
            if attempt == records.attempts[index]:
                records.refinements[index] = factor
        records.timings = self._timings
        records.sessions = sorted(self._sessions.values(), key=lambda s: (s["started"], s["id"]))
        records.warnings[:0] = self.warnings
        return records

    def _sound_frames(
        self, layout: log.RecordFormat, places: Places, file: FileIO, start: int, flaws: list[str]
    ) -> Iterator[tuple[int, log.Frame]]:
        """Yield place and content of sound frames, with runs as the study numbers them; others are flaws."""
        size = os.fstat(file.fileno()).st_size
        for begin, end, frame in layout.frames(file, start, size):
            if frame is not None:
                named = [(int(places[run]), attempt) for run, attempt in frame.places]
                yield begin, frame._replace(places=named)
            elif end == size and end - begin < layout.record_size:
                flaws.append(f"the last {end - begin} bytes are an unfinished record")
            else:
                flaws.append(f"bytes {begin} to {end} are damaged")

    def _entries(
        self, frames: Iterable[tuple[int, log.Frame]], number: int, trace: _Trace
    ) -> Iterator[tuple[int, int, float, int, int, int]]:
        """Yield the records of a log as an ENTRY has them, and follow the runs of its process."""
        for begin, frame in frames:
            trace.follow(frame)
            if frame.kind == log.RECORD:
                ((index, attempt),) = frame.places
                place = begin + log.HEAD.size + log.PLACE.size
                yield index, attempt, frame.written, number, place, frame.row[self._status]
            else:
                for index, attempt in frame.places:
                    self._attempts[index] = max(self._attempts[index], attempt)
