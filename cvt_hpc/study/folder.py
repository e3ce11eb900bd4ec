"""The output folder of a study: whose it is, who is at work in it, and what of it may be removed."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from cvt_hpc.errors import InputError
from cvt_hpc.files import naming_refusals, written_aside
from cvt_hpc.study.description import Study
from cvt_hpc.study.lock import is_locked, locked
from cvt_hpc.study.part import Part

FORMAT = "cvt_hpc study 1"
_PART_LOCKS = ".part-*.lock"


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
            study = self._read_job()
        if study is None:
            raise InputError(f"{self.path}: expected the output folder of a run, found no job.json in it")
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
            If the folder is a file, holds another job, or holds results that no job.json explains.
        """
        with naming_refusals(self.path, "a folder that can be read"):
            if self.path.is_dir():
                # In this order: a run of another part writes its job.json before any records.
                unexplained = self._results_or_records()
                found = self._read_job()
                if found is None and unexplained is not None:
                    raise InputError(
                        f"{self.path}: expected an empty folder or that of an earlier run, found "
                        f"{unexplained.name} without a job.json; choose another --out"
                    )
                if found is not None and not fresh:
                    self._refuse_other(found, study)
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
        """Write job.json, unless it is there."""
        if not self.job_file.exists():
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
        except (OSError, ValueError) as error:
            raise InputError(f"{self.job_file}: expected the job of a run, found: {error}") from error
        found = entry.get("format") if isinstance(entry, dict) else None
        if found != FORMAT:
            raise InputError(f'{self.job_file}: expected format "{FORMAT}", found {json.dumps(found)}')
        try:
            return Study.from_json(entry)
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(f"{self.job_file}: expected a job as runs write it, found: {error!r}") from error

    def _results_or_records(self) -> Path | None:
        """Return what is here that only a job.json explains; hidden files are probes of another start."""
        for path in (self.results, self.records):
            if path.is_file() or (path.is_dir() and any(p.name[0] != "." for p in path.iterdir())):
                return path
        return None

    def _refuse_other(self, found: Study, study: Study) -> None:
        if found.fingerprint != study.fingerprint:
            difference = describe_difference(found.job, study.job)
            raise InputError(
                f"{self.path}: expected the folder of this job, found that of another (job {found.name}: "
                f"{difference}); choose another --out, or --fresh to throw its results away"
            )
        if _layout(found) != _layout(study):
            raise InputError(
                f"{self.path}: expected records with the quantities of this version, found others; choose "
                "another --out, or --fresh to throw them away"
            )


def describe_difference(found: dict[str, Any], asked: dict[str, Any]) -> str:
    """Return the first few entries in which two resolved jobs differ, as "key is 1 there, 2 here"."""
    there, here = _flatten(found), _flatten(asked)
    keys = [key for key in {**there, **here} if there.get(key) != here.get(key)]
    shown = [f"{key} is {_short(there.get(key))} there, {_short(here.get(key))} here" for key in keys[:3]]
    return "; ".join(shown) + ("; ..." if len(keys) > 3 else "")


def _layout(study: Study) -> dict[str, Any]:
    """Return what records must agree in to be of one dataset."""
    return {
        "quantities": [(v.name, v.dims, v.dtype) for v in study.variables],
        "coordinates": [(dimension.name, dimension.values) for dimension in study.coordinates],
    }


def _flatten(entry: Any, prefix: str = "") -> dict[str, Any]:
    if not isinstance(entry, dict):
        return {prefix: entry}
    parts = (_flatten(value, f"{prefix}.{key}" if prefix else key) for key, value in entry.items())
    return {key: value for part in parts for key, value in part.items()}


def _short(value: Any) -> str:
    text = "not set" if value is None else json.dumps(value)
    return text if len(text) <= 40 else text[:37] + "..."
