"""The output folder of a study: whose it is, who is at work in it, and what of it may be removed."""

from __future__ import annotations

import json
import logging
import os
import platform
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path

from cvt_hpc.errors import InputError
from cvt_hpc.files import naming_refusals, written_aside
from cvt_hpc.study.description import Study
from cvt_hpc.study.job_difference import refuse_other
from cvt_hpc.study.lock import is_locked, locked
from cvt_hpc.study.part import Part
from cvt_hpc.study.record.frames import MAGIC
from cvt_hpc.study.record.recovery import read_records

FORMAT = "cvt_hpc study 1"
CHART_FILE = "chart.json"  # what the other kind of output folder is known by
_PART_LOCKS = ".part-*.lock"
_logger = logging.getLogger(__name__)


class DamagedJobError(InputError):
    """The file that says whose an output folder is cannot be read; what lies beside it may tell."""


class StudyFolder:
    """The places in an output folder.

    Parameters
    ----------
    path : str or Path
        The folder; it need not exist.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.job_file = self.path / "job.json"
        self.records = self.path / "records"
        self.results = self.path / "results.nc"
        self.lock_file = self.path / "run.lock"  # held by a run of the whole, shared by runs of parts
        self.gather_lock = self.path / "gather.lock"
        self.crash_log = self.path / "crash.log"
        self.histories = self.path / "histories"

    def history(self, index: int) -> Path:
        """Return the file of the history of run `index`."""
        return self.histories / f"run-{index:06d}.nc"

    def load(self) -> Study:
        """Return the study that the folder holds.

        Raises
        ------
        InputError
            If the folder is missing or holds none.
        """
        with naming_refusals(self.path, "a folder that can be read"):
            if not self.path.is_dir():
                found = "a file" if self.path.exists() else "nothing"
                raise InputError(f"{self.path}: expected the output folder of a run, found {found}")
            advice = "; `cvt-hpc run` of its job goes on and writes it anew" if self._has_logs() else ""
            try:
                study = self._read_job()
            except DamagedJobError as error:
                raise InputError(f"{error}{advice}") from error
        if study is None:
            found = f"no job.json in it{advice}"
            raise InputError(f"{self.path}: expected the output folder of a run, found {found}")
        return study

    def check_free_for(self, study: Study, fresh: bool) -> None:
        """Make sure that the folder may be used for a study; touches nothing.

        Parameters
        ----------
        study : Study
            What is to be run.
        fresh : bool
            Whether earlier results may be thrown away.

        Raises
        ------
        InputError
            If the folder is a file or that of a chart, holds another job, or holds results that neither a
            job.json nor the logs explain.
        """
        with naming_refusals(self.path, "a folder that can be read"):
            if self.path.is_dir():
                expected = f"{self.path}: expected an empty folder or that of an earlier run, found"
                if (self.path / CHART_FILE).exists():
                    raise InputError(f"{expected} that of a chart; choose another --out")
                # In this order: a run of another part writes its job.json before any records.
                unexplained = self._results_or_records()
                try:
                    found = self._read_job()
                except DamagedJobError as error:
                    self._ask_logs(study, fresh, str(error))
                    return
                if found is None and unexplained is not None:
                    self._ask_logs(study, fresh, f"{expected} {unexplained.name} without a job.json")
                if found is not None and not fresh:
                    refuse_other(self.path, found, study)
            elif self.path.exists():
                raise InputError(f"{self.path}: expected a folder for the results, found a file")

    def create(self) -> None:
        """Make the folder and its folder of records, and try that files can be written there.

        Raises
        ------
        InputError
            If the system refuses.
        """
        probe = self.records / f".probe-{platform.node()}-{os.getpid()}"
        with naming_refusals(self.path, "a folder that results can be written to"):
            self.records.mkdir(parents=True, exist_ok=True)
            probe.write_bytes(b"x")
            probe.unlink()

    def save(self, study: Study) -> None:
        """Write job.json, unless a sound one is there."""
        with suppress(DamagedJobError):
            if self._read_job() is not None:
                return
        if self._has_logs():
            _logger.warning(
                "%s: damaged or gone; written anew, since the records are of this job", self.job_file
            )
        text = json.dumps({"format": FORMAT, **study.to_json()}, indent=1, allow_nan=False)
        with written_aside(self.job_file) as aside:
            aside.write_text(text)

    def clear(self) -> None:
        """Remove what runs have written: results, records, and last the job.json that vouches for them."""
        logs = self.records.glob("rank-*.log")
        locks = self.path.glob(_PART_LOCKS)
        histories = [*self.histories.glob("run-*.nc"), *self.half_histories()]
        with naming_refusals(self.path, "a folder that results can be removed from"):
            for path in [self.results, self.crash_log, *self.leftovers(), *locks, *histories, *logs]:
                path.unlink(missing_ok=True)
            self.job_file.unlink(missing_ok=True)

    def leftovers(self) -> list[Path]:
        """Return the half-written files of processes that died while they wrote."""
        return [*self.path.glob(".results.nc.*.part"), *self.path.glob(".job.json.*.part")]

    def half_histories(self) -> list[Path]:
        """Return the same of histories; only who is alone at work can tell them from those being written."""
        return [*self.histories.glob(".run-*.nc.*.part")]

    @contextmanager
    def occupied(self, part: Part | None) -> Iterator[None]:
        """Be at work in the folder for the time of a `with`, alone or beside runs of other parts.

        Raises
        ------
        InputError
            If a run of the whole, or of the same part, is at work.
        """
        with ExitStack() as held:
            held.enter_context(locked(self.lock_file, shared=part is not None))
            if part is not None:
                lock = self.path / f".part-{part.number}-of-{part.parts}.lock"
                held.enter_context(locked(lock, f"a part {part}"))
            yield

    def is_in_use(self) -> bool:
        """Return whether a run is at work in the folder, of the whole or of a part."""
        return any(map(is_locked, [self.lock_file, *self.path.glob(_PART_LOCKS)]))

    def _read_job(self) -> Study | None:
        """Return the study of job.json, None if there is no such file."""
        try:
            entry = json.loads(self.job_file.read_bytes())
        except FileNotFoundError:
            return None
        except ValueError as error:
            found = f"damage ({error})"
            raise DamagedJobError(f"{self.job_file}: expected the job of a run, found {found}") from error
        found = entry.get("format") if isinstance(entry, dict) else None
        if found != FORMAT:
            raise InputError(f'{self.job_file}: expected format "{FORMAT}", found {json.dumps(found)}')
        try:
            return Study.from_json(entry)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            found = f"damage ({error!r})"
            raise DamagedJobError(f"{self.job_file}: expected the job of a run, found {found}") from error

    def _has_logs(self) -> bool:
        """Return whether runs have left logs here, of whatever job."""
        logs = (path for path in self.records.glob("rank-*.log") if path.is_file())
        for log in logs:
            with log.open("rb") as file:
                if file.read(len(MAGIC)) == MAGIC:
                    return True
        return False

    def _ask_logs(self, study: Study, fresh: bool, complaint: str) -> None:
        """Raise the complaint unless the logs make up for job.json: they are to go, or are of this study."""
        has_logs = self._has_logs()
        if has_logs and (fresh or read_records(self.records, study).recorded.any()):
            return
        advice = ", or --fresh to throw away its logs, which hold no record of this job" if has_logs else ""
        raise InputError(f"{complaint}; choose another --out{advice}")

    def _results_or_records(self) -> Path | None:
        """Return what is here that only a job.json explains; hidden files are probes of another start."""
        for path in (self.results, self.records):
            if path.is_file() or (path.is_dir() and any(p.name[0] != "." for p in path.iterdir())):
                return path
        return None
