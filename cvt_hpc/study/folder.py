"""The output folder of a study: its files, and the origin of its records.

Parts of a study are for starts that work side by side in one folder, such as the tasks of a job array.
Histories of chosen runs are files beside the records.
"""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from cvt_hpc.errors import InputError, few_of, mismatch, nearest
from cvt_hpc.job.values import Document
from cvt_hpc.storage.files import kind_of, make_own_folder, naming_refusals, sync_folder
from cvt_hpc.storage.locks import BusyError, is_locked, locked
from cvt_hpc.storage.netcdf import store_history
from cvt_hpc.storage.output_folder import DamagedJobError, Kind, OutputFolder
from cvt_hpc.study.description import Study
from cvt_hpc.study.job_difference import have_one_layout, places_in, refuse_other
from cvt_hpc.study.record.index import Places, Records, open_log, read_records
from cvt_hpc.study.record.log import MAGIC
from cvt_hpc.variables import Status

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.job import Job

MOST_NAMED = 5
_PART_LOCKS = ".part-*.lock"
_EARLIER = f"job-{'[0-9a-f]' * 16}"  # files of jobs from which the study has grown
_MOST_RUNS = 10**8
_LARGEST_RECORD = 1 << 26  # [bytes]

_logger = logging.getLogger(__name__)


class Part(NamedTuple):
    """One of several parts of a study; every run belongs to exactly one of them."""

    number: int  # which one, from 1
    parts: int  # how many there are

    def __str__(self) -> str:
        return f"{self.number}/{self.parts}"

    def holds(self, index: np.ndarray) -> np.ndarray:
        """Return whether runs belong to this part, by their index alone, without communication.

        The runs are dealt out in turn, and each round begins one part further: otherwise an axis with as many
        values as there are parts would give all runs at its costliest value to one of them.
        """
        return (index + index // self.parts) % self.parts == self.number - 1


def read_part(text: str) -> Part:
    """Return the part that is written as "K/N", such as "3/16"; InputError if the text is none."""
    numbers = re.fullmatch(r"([1-9]\d*)/([1-9]\d*)", text, re.ASCII)
    if numbers is None or int(numbers[1]) > int(numbers[2]):
        raise mismatch("part", "K/N with K from 1 to N, such as 3/16", f'"{text}"')
    return Part(int(numbers[1]), int(numbers[2]))


def study_instead(path: Path) -> str:
    """Return advice where no study is found: take that of the nearest name beside it, or make one."""
    if path.suffix == ".toml":
        return f"`cvt-hpc run {path}` computes its results, in out/NAME unless --out says otherwise"
    if inside := sorted(folder.parent.name for folder in path.glob("*/job.json")):
        return f"studies in it: {few_of(inside, MOST_NAMED)}"
    beside = [str(folder.parent) for folder in path.parent.glob("*/job.json")]
    if near := nearest(str(path), beside):
        return f"did you mean {near}?"
    return "`cvt-hpc run JOB.toml` makes one"


class StudyFolder(OutputFolder[Study]):
    """The places in an output folder of a study.

    Parameters
    ----------
    path : str or Path
        The folder; it need not exist.
    """

    # The lock is held by a run of the whole, and shared by runs of parts.
    kind = Kind("run", "job.json", "run.lock", "cvt_hpc study 1", ("records",))

    def __init__(self, path: str | Path) -> None:
        super().__init__(path)
        self.records = self.path / "records"
        self.results = self.path / "results.nc"
        self.gather_lock = self.path / "gather.lock"
        self.crash_log = self.path / "crash.log"
        self.histories = self.path / "histories"

    def history(self, index: int) -> Path:
        """Return the file of the history of run `index`."""
        return self.histories / f"run-{index:06d}.nc"

    def read_records(self, study: Study) -> Records:
        """Return which records of a study the logs hold, also from before it has grown."""
        earlier, flaws = self._earlier_places(study)
        records = read_records(self.records, study, earlier)
        records.warnings[:0] = flaws
        return records

    def keep_histories(self, histories: Iterable[tuple[int, xr.Dataset]]) -> None:
        """Write histories, by run index; before the records, so that a run on record has its history.

        Raises
        ------
        StorageError
            If something else stands in the place of their folder, or the system refuses.
        """
        for index, history in histories:
            with naming_refusals(self.histories, "a folder that histories can be written to"):
                make_own_folder(self.histories)
            store_history(history, self.history(index))

    def load(self) -> Study:
        """Return the study that the folder holds.

        Raises
        ------
        InputError
            If the folder is missing or holds none, or none that can be believed.
        """
        with naming_refusals(self.path, "a folder that can be read"):
            if not self.path.is_dir():
                found = "a file" if self.path.exists() else "nothing"
                raise mismatch(str(self.path), "the output folder of a run", found, study_instead(self.path))
            anew = "`cvt-hpc run` of its job goes on and writes it anew"
            try:
                study = self.read_job()
            except DamagedJobError as error:
                then = f"; {anew}" if error.entry or self._has_logs() else ""
                raise InputError(f"{error}{then}") from error
            if study is None:
                then = anew if self._has_logs() else study_instead(self.path)
                raise mismatch(str(self.path), "the output folder of a run", "no job.json in it", then)
        return study

    def part_lock(self, part: Part) -> AbstractContextManager[None]:
        """Return the lock of a part, to be held beside that of the folder."""
        return locked(self.path / f".part-{part.number}-of-{part.parts}.lock", f"a part {part}")

    def locks(self) -> list[Path]:
        """Return the lock files that are, or may be, in the folder."""
        return [self.lock_file, self.gather_lock, *self.path.glob(_PART_LOCKS)]

    def is_in_use(self) -> bool:
        """Return whether a run is at work in the folder, of the whole or of a part."""
        return any(map(is_locked, [self.lock_file, *self.path.glob(_PART_LOCKS)]))

    def leftovers(self) -> list[Path]:
        """Return the half-written files of processes that died while they wrote."""
        own = (".results.nc.*.part", f".{_EARLIER}.json.*.part")
        return [*(path for pattern in own for path in self.path.glob(pattern)), *super().leftovers()]

    def half_histories(self) -> list[Path]:
        """Return the same of histories; only a process that works alone can separate unfinished ones."""
        return [*self._inside(self.histories, ".run-*.nc.*.part")]

    def document(self, content: Study) -> Document:
        """Return the content of a study's job.json."""
        return content.to_json()

    def accept(self, entry: Document) -> Study:
        """Return the study of a sound job.json."""
        study = Study.from_json(entry)
        if study.size > _MOST_RUNS or study.record_dtype.itemsize > _LARGEST_RECORD:
            most = f"{_MOST_RUNS} runs, and records of {_LARGEST_RECORD >> 20} MiB"
            raise ValueError(f"it has more than {most}")
        return study

    def refuse_other(self, found: Study, asked: Study) -> None:
        """Raise InputError unless the folder is that of the study, with the quantities of this version."""
        refuse_other(self.path, found, asked)

    def agrees(self, found: Study, asked: Study) -> bool:
        """Return whether two studies of one fingerprint agree in all entries that determine numbers."""
        return _numbers(found) == _numbers(asked)

    def unexplained(self) -> str | None:
        """Return files that only a job.json explains; hidden files are probes of another start."""
        for path in (self.results, self.records):
            if (kind := kind_of(path)) == "a folder":
                kind = next((path.name for path in path.iterdir() if path.name[0] != "."), None)
            if kind is not None:
                return f"{path.name} without a job.json"
        return None

    def results_tell(self) -> Callable[[Study], bool] | None:
        """Return a function that decides whether the logs are of a study; None if there are none."""
        if not self._has_logs():
            return None
        return lambda study: bool(self.read_records(study).recorded.any())

    def written(self, found: Study | None) -> Iterator[Path]:
        """Yield the files that runs have left: results, histories, records."""
        yield from (self.results, self.crash_log, *self.path.glob(_PART_LOCKS))
        yield from self.path.glob(f"{_EARLIER}.json")
        yield from self._inside(self.histories, "run-*.nc")
        for folder in self._inside(self.histories, _EARLIER):
            yield from (*self._inside(folder, "run-*.nc"), folder)
        yield from self.half_histories()
        if kind_of(self.histories) == "a link":
            yield self.histories
        yield from self._inside(self.records, "rank-*.log")

    @contextmanager
    def claimed(
        self, asked: Study, *, fresh: bool = False, inner: AbstractContextManager | None = None
    ) -> Iterator[None]:
        """Be at work in the folder, as of `OutputFolder.claimed`; a study grows while nobody else is."""
        if inner is not None and self._grows(asked):
            try:
                with super().claimed(asked):
                    pass
            except BusyError:
                if self._grows(asked):  # else another part of the same study was faster
                    raise
        with super().claimed(asked, fresh=fresh, inner=inner):
            self._number_histories(asked)
            yield

    def replace(self, found: Study, asked: Study) -> None:
        """Keep the job from which a study grows, and set its histories aside until they have new numbers.

        At any moment the records belong to the one job that job.json holds, and to the other one.
        """
        if found.fingerprint == asked.fingerprint:
            super().replace(found, asked)
            return
        self.write_job(self.path / f"{_stem(found.fingerprint)}.json", found)
        if histories := list(self._inside(self.histories, "run-*.nc")):
            aside = self.histories / _stem(found.fingerprint)
            with naming_refusals(aside, "a folder that histories can be moved to"):
                make_own_folder(aside)
                for path in histories:
                    path.replace(aside / path.name)
                for folder in (aside, self.histories):
                    sync_folder(folder)
        told = "%s: the study grows from %d to %d runs, which have new numbers"
        _logger.warning(told, self.path, found.size, asked.size)

    def _grows(self, asked: Study) -> bool:
        found = self.check_free_for(asked, fresh=False)
        return found is not None and found.fingerprint != asked.fingerprint

    def _earlier_places(self, study: Study) -> tuple[dict[str, Places], list[str]]:
        """Return the places of the runs of studies that have grown to this one, by fingerprint; and flaws."""
        found: dict[str, Places] = {}
        flaws = []
        for path in sorted(self.path.glob(f"{_EARLIER}.json")):
            folder = StudyFolder(self.path)
            folder.job_file = path
            try:
                earlier = folder.read_job()
            except InputError as error:
                flaws.append(f"{error}; the records of this job are left out")
                continue
            places = places_in(earlier.job, study.job) if have_one_layout(earlier, study) else None
            if places is not None and places.size == earlier.size:
                found[earlier.fingerprint] = places
        return found, flaws

    def _number_histories(self, study: Study) -> None:
        """Give histories that were set aside the numbers that their runs have in a study."""
        if not (asides := [*self._inside(self.histories, _EARLIER)]):
            return
        earlier, _ = self._earlier_places(study)
        places = {_stem(one): numbers for one, numbers in earlier.items()}
        places[_stem(study.fingerprint)] = range(study.size)
        for aside in asides:
            numbers = places.get(aside.name, range(0))
            for path in list(self._inside(aside, "run-*.nc")):
                named = re.fullmatch(r"run-(\d{6,9})\.nc", path.name)
                if named and int(named[1]) < len(numbers):
                    with naming_refusals(path, "a history that can be moved"), suppress(FileNotFoundError):
                        path.replace(self.history(int(numbers[int(named[1])])))
            with suppress(OSError):
                aside.rmdir()

    def _has_logs(self) -> bool:
        """Return whether runs have left logs here, of whatever job."""
        return any(_is_log(path) for path in self._inside(self.records, "rank-*.log"))

    def _inside(self, folder: Path, pattern: str) -> Iterator[Path]:
        """Yield files in a folder of this one; none where a link stands in its place."""
        if kind_of(folder) == "a folder":
            yield from folder.glob(pattern)


def _stem(fingerprint: str) -> str:
    """Return the name, without suffix, of what a job leaves from which a study has grown."""
    return f"job-{fingerprint[:16]}"


def _is_log(path: Path) -> bool:
    try:
        with open_log(path) as file:
            return file.read(len(MAGIC)) == MAGIC
    except OSError:
        return False


def _numbers(study: Study) -> str:
    """Return all of a study that has to do with numbers: names, descriptions, units for people may change."""
    entry = study.to_json()
    for table in (*entry["axes"], *entry["derived"]):
        del table["job_units"]
    del entry["units"], entry["files"]
    job = {key: value for key, value in entry["job"].items() if key not in ("name", "description")}
    return json.dumps({**entry, "job": job, "name": "", "description": ""})


def leave_out_missing(job: Job, folder: StudyFolder, records: Records) -> None:
    """Mark runs as not recorded that are done, but lack a requested history; the logs stay.

    The history was requested later, or has been removed.
    """
    done = records.status == Status.DONE
    missing = [index for index in job.histories if done[index] and not folder.history(index).exists()]
    records.written[missing] = np.nan
    records.status[missing] = Status.NOT_RUN
