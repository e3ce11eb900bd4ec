"""Which record of each run counts and where it lies; the records themselves are read when they are needed.

Logs are read whatever happened to the files: damage is named and skipped, never fatal.
"""

import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from io import FileIO
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.storage.files import StorageError, naming_refusals, open_regular
from cvt_hpc.study.batches import Batch
from cvt_hpc.study.description import Study
from cvt_hpc.study.record import log

# A valid record: run index, attempt, time of writing [s], number of its log, its place there [byte], and how
# the run ended.
ENTRY = np.dtype(
    [("run", "i8"), ("attempt", "i8"), ("written", "f8"), ("log", "i4"), ("place", "i8"), ("status", "i1")]
)

BLOCK = 1 << 25  # [bytes] of records that are in memory at a time

Places = range | NDArray[np.int64]  # the index in a study of each run of another, or of itself


class Timing(NamedTuple):
    """Time that a batch took, from its mark to its records."""

    batch: Batch
    seconds: float


@dataclass
class Records:
    """Content of the logs of a study; the records themselves stay there, some 60 bytes a run are in memory.

    Attributes
    ----------
    study : Study
        The study that the records belong to.
    logs : sequence of Path
        The files in which records were searched.
    entries : numpy.ndarray of ENTRY, shape (runs,)
        The record that counts of each run; `log` is -1, `written` NaN where a run has none.
    attempts : numpy.ndarray of int, shape (runs,)
        The attempt that counts, from 1: how often the run was requested.
    died, died_alone : numpy.ndarray of int, shape (runs,)
        How often, in that attempt, a process was at work at the run when it died: in all, and while it did
        that run alone because of earlier deaths. Runs that a living process is at count as well.
    refinements : numpy.ndarray of float, shape (runs,)
        The factor by which the attempt that counts shortens the time step that the run takes else; 1 for
        most.
    timings : list of Timing
        Of the batches that were done as a whole.
    sessions : list of dict
        The starts of the sweep that left records, in order of time.
    warnings : list of str
        One line for each file that is not sound.
    """

    study: Study
    logs: Sequence[Path]
    entries: np.ndarray
    attempts: np.ndarray
    died: np.ndarray
    died_alone: np.ndarray
    refinements: np.ndarray
    timings: list[Timing] = field(default_factory=list)
    sessions: list[log.Session] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def written(self) -> np.ndarray:
        """Time of writing [s] since the epoch, shape (runs,); NaN where a run has no record."""
        return self.entries["written"]

    @property
    def recorded(self) -> np.ndarray:
        """Whether a run has a record, shape (runs,): it is not repeated unless requested."""
        return ~np.isnan(self.written)

    @property
    def status(self) -> np.ndarray:
        """Return the `Status` with which each run ended, shape (runs,)."""
        return self.entries["status"]

    def read(self, runs: np.ndarray | int, name: str | None = None) -> np.ndarray:
        """Return the records of some runs, or one of their quantities, shape (*runs.shape, *quantity's).

        They are blank where a run has none.

        Raises
        ------
        StorageError
            If a log cannot be read, or has changed.
        """
        return _read_rows(self.study, self.logs, self.entries[runs], name)


def _read_rows(
    study: Study, logs: Sequence[Path], entries: np.ndarray, name: str | None = None
) -> np.ndarray:
    """Return the content of some places in the logs; see `Records.read`."""
    dtype, offset = study.record_dtype.fields[name][:2] if name else (study.record_dtype, 0)  # type: ignore[index]  # it has fields
    blank = study.blank_rows()
    rows = np.empty(np.shape(entries), dtype)
    rows[...] = blank[name] if name else blank
    targets = rows.reshape(-1).view(np.uint8).reshape(-1, dtype.itemsize)
    flat = np.reshape(entries, -1)
    for number in np.unique(flat["log"][flat["log"] >= 0]):
        path = logs[number]
        with naming_refusals(path, "a record log that can be read"), open_log(path) as file:
            for i in np.flatnonzero(flat["log"] == number):
                # Read, not mapped: to touch a mapped file that a full disk has cut short ends the process.
                if os.preadv(file.fileno(), [targets[i]], flat["place"][i] + offset) < dtype.itemsize:
                    raise StorageError(f"{path}: expected run {flat['run'][i]}, found the file cut short")
    return rows


def open_log(path: Path) -> FileIO:
    """Open a record log for reading, without a buffer; OSError as of `open_regular`."""
    return open(path, "rb", buffering=0, opener=lambda name, flags: open_regular(path))


def choose(study: Study, logs: Sequence[Path], found: np.ndarray, marked: np.ndarray) -> Records:
    """Return of several records of one run that of the latest attempt, and of these the earliest written.

    By content, not by the order in which a folder happens to be listed; equal times, as in a copied file, are
    separated by file name and place.

    Parameters
    ----------
    study, logs
        The study that the records belong to, and the files, by name.
    found : numpy.ndarray of ENTRY
        All valid records.
    marked : numpy.ndarray of int, shape (runs,)
        The latest attempt of each run that a mark names.
    """
    keys = (found["place"], found["log"], found["written"], -found["attempt"], found["run"])
    found = found[np.lexsort(keys)]
    first = np.diff(found["run"], prepend=-1) > 0
    blank = np.zeros((), ENTRY)
    blank["log"], blank["written"] = -1, np.nan
    entries = np.full(study.size, blank)
    entries[found["run"][first]] = found[first]
    attempts = np.maximum(marked, entries["attempt"])
    unharmed = np.zeros_like(attempts)
    records = Records(study, logs, entries, attempts, unharmed, unharmed.copy(), np.ones(study.size))
    later = found[~first]
    records.warnings = _contradictions(records, later[later["attempt"] == entries["attempt"][later["run"]]])
    entries[entries["attempt"] < attempts] = blank  # to be done again, and not done yet
    return records


def _contradictions(records: Records, later: np.ndarray) -> list[str]:
    """Return a line for each later record with other numbers than the valid one."""
    lines = []
    block = block_length(records.study)
    for first in range(0, later.size, block):
        part = later[first : first + block]
        rows = _read_rows(records.study, records.logs, part)
        for entry in part[_differ(rows, records.read(part["run"]), records.study)]:
            chosen = records.logs[records.entries["log"][entry["run"]]]
            where = f"{records.logs[entry['log']]}: run {entry['run']}"
            lines.append(f"{where} has other numbers than in {chosen.name}, which counts")
    return lines


def _differ(one: np.ndarray, other: np.ndarray, study: Study) -> np.ndarray:
    """Return which of two times n records differ in a bit, timings and the like excepted."""
    differ = np.zeros(one.size, bool)
    for name in (variable.name for variable in study.variables if not variable.volatile):
        values = (np.ascontiguousarray(rows[name]) for rows in (one, other))
        bits, others = (found.view(np.uint8).reshape(one.size, -1) for found in values)
        differ |= (bits != others).any(axis=1)
    return differ


def block_length(study: Study) -> int:
    """Return how many records are in memory at a time."""
    return max(BLOCK // study.record_dtype.itemsize, 1)


class _Death(NamedTuple):
    """A mark without records after it; equal ones, as in a copied file, are one."""

    run: int
    attempt: int
    alone: bool
    begun: float


def read_records(folder: Path, study: Study, earlier: Mapping[str, Places] | None = None) -> Records:
    """Return which records all logs of a folder hold.

    Of several records of one run that of the latest attempt counts, and of these the earliest written. The
    folder may be missing. Records of studies from which this one has grown count as well: `earlier` has, by
    fingerprint, which of its runs each of theirs is.
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
    """Follows from mark to mark the runs that a process was doing; its retries shorten steps by a factor."""

    def __init__(self, refine: float) -> None:
        self.followed = 0  # frames
        # of the batches that were done as a whole; of the first one only if it was marked again once its
        # kernels had been loaded
        self.timings: list[Timing] = []
        self.refinements: dict[log.Place, float] = {}  # that factor
        self._refine = refine
        self._mark: log.Frame | None = None
        self._began, self._loads = 0.0, True
        self._at_work: dict[int, int] = {}

    def follow(self, frame: log.Frame) -> None:
        """Take in the next frame."""
        self.followed += 1
        if frame.kind == log.RECORD:
            ((index, _),) = frame.places
            was_at_work = self._at_work.pop(index, None) is not None
            if self._mark is not None and was_at_work and not self._at_work:
                batch = tuple(index for index, _ in self._mark.places)
                if not self._loads:
                    self.timings.append(Timing(batch, frame.written - self._began))
                self._loads = False
        elif frame.kind == log.AGAIN:
            self.refinements |= dict.fromkeys(frame.places, self._refine)
        else:
            places = dict(frame.places)
            if places == self._at_work:
                self._loads = False
            if not (self._at_work and self._at_work.keys() < places.keys()):  # else other runs have joined
                self._began = frame.written
            self._mark, self._at_work = frame, places

    def deaths(self) -> set[_Death]:
        """Return a death at each run that the process was at in the end."""
        if self._mark is None:
            return set()
        alone, begun = self._mark.kind == log.ALONE, self._mark.written
        return {_Death(index, attempt, alone, begun) for index, attempt in self._at_work.items()}


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
        self._sessions: dict[str, log.Session] = {}

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
        self._timings += trace.timings
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
