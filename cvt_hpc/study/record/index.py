"""Which record of each run counts and where it lies; the records themselves are read when they are needed."""

import os
from collections.abc import Sequence
from dataclasses import dataclass, field
from io import FileIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.files import StorageError, naming_refusals, open_regular
from cvt_hpc.study.batches import Batch
from cvt_hpc.study.description import Study

# A valid record: run index, attempt, time of writing [s], number of its log, its place there [byte], and how
# the run ended.
ENTRY = np.dtype(
    [("run", "i8"), ("attempt", "i8"), ("written", "f8"), ("log", "i4"), ("place", "i8"), ("status", "i1")]
)

BLOCK = 1 << 25  # [bytes] of records that are in memory at a time


class Timing(NamedTuple):
    """How long a batch took, from its mark to its records."""

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
        Of the batches that were done as a whole, the first of each log excepted: it has loaded kernels.
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
    sessions: list[dict[str, Any]] = field(default_factory=list)
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
        """How each run ended, shape (runs,), a `Status`."""
        return self.entries["status"]

    def read(self, runs: np.ndarray | int, name: str | None = None) -> np.ndarray:
        """Return the records of some runs, or one of their quantities; blank where a run has none.

        Parameters
        ----------
        runs : numpy.ndarray of int
            Run indices.
        name : str, optional
            The quantity; all by default.

        Returns
        -------
        numpy.ndarray, shape (*runs.shape, *quantity's)

        Raises
        ------
        StorageError
            If a log cannot be read, or has changed.
        """
        return read_rows(self.study, self.logs, self.entries[runs], name)


def read_rows(study: Study, logs: Sequence[Path], entries: np.ndarray, name: str | None = None) -> np.ndarray:
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
    study : Study
        The study that the records belong to.
    logs : sequence of Path
        The files, by name.
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
        rows = read_rows(records.study, records.logs, part)
        for entry in part[_differ(rows, records.read(part["run"]), records.study)]:
            chosen = records.logs[records.entries["log"][entry["run"]]]
            lines.append(
                f"{records.logs[entry['log']]}: run {entry['run']} has other numbers than in {chosen.name}, "
                "which counts"
            )
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
