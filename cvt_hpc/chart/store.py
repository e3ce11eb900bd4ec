"""The output folder of a chart: whose it is, and the points measured so far."""

from __future__ import annotations

import io
import json
import logging
import zipfile
import zlib
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.chart.measuring import Measurement
from cvt_hpc.chart.plan import Chart
from cvt_hpc.errors import InputError
from cvt_hpc.files import naming_refusals, written_aside
from cvt_hpc.study.folder import CHART_FILE, DamagedJobError
from cvt_hpc.study.job_difference import another_job
from cvt_hpc.study.lock import locked
from cvt_hpc.study.provenance import git_revision, machine, versions

FORMAT = "cvt_hpc chart 2"
_PLAIN = tuple(f.name for f in fields(Measurement) if f.name != "values")
# what an archive raises depends on the byte that is damaged
_DAMAGE = (zipfile.BadZipFile, zlib.error, EOFError, KeyError, OSError, RuntimeError, ValueError)
_logger = logging.getLogger(__name__)


class ChartFolder:
    """The output folder of a chart, and the places in it.

    Parameters
    ----------
    path : Path
        The folder; it need not exist.
    chart : Chart
        The chart that is to be made in it.

    Attributes
    ----------
    makers : list of dict
        Versions, revision and machine by which the points that were loaded or saved have been measured.
    """

    def __init__(self, path: Path, chart: Chart) -> None:
        self.path = path
        self.job_file = path / CHART_FILE
        self.points = path / "points"
        self.table = path / "chart.csv"
        self.dataset = path / "chart.nc"
        self.makers: list[dict[str, Any]] = []
        self._lock_file = path / ".chart.lock"
        self._chart = chart
        self._fingerprint = chart.fingerprint()
        self._maker = {"versions": versions(), "git_revision": git_revision(), "machine": machine()}

    def picture(self, name: str) -> Path:
        """Return where the picture of a scene goes, or "budget"."""
        return self.path / f"{name}.png"

    @contextmanager
    def occupied(self, fresh: bool) -> Iterator[None]:
        """Be at work in the folder for the time of a `with`, alone.

        Raises
        ------
        InputError
            If it holds another chart or other files and is not to be used afresh, if another process is at
            work in it, or the system refuses.
        """
        expected = "a folder for the results of a chart"
        with naming_refusals(self.path, expected):
            self._check_free(fresh)
            self.path.mkdir(parents=True, exist_ok=True)
        with locked(self._lock_file):
            with naming_refusals(self.path, expected):
                found = self._check_free(fresh)  # again: another may have been there before the lock
                if fresh:
                    self._clear(found["job"]["scenes"] if found else (s.name for s in self._chart.scenes))
            if found is None or fresh:
                entry = {"format": FORMAT, "fingerprint": self._fingerprint, "job": self._chart.resolved()}
                with written_aside(self.job_file) as aside:
                    aside.write_text(json.dumps(entry, indent=1))
            with naming_refusals(self.path, expected):
                self.points.mkdir(exist_ok=True)
            yield

    def load(self, name: str) -> Measurement | None:
        """Return what was measured at a point, None if nothing was, or nothing that can be read."""
        path = self.points / f"{name}.npz"
        if not path.exists():
            return None
        with naming_refusals(path, "a file that can be read"):
            data = path.read_bytes()
        try:
            measurement, fingerprint, maker = _unpack(data)
            if fingerprint != self._fingerprint:
                raise ValueError("of another chart")
        except _DAMAGE as error:
            _logger.warning("%s: damaged (%s); measured again", path, error or "it is empty")
            return None
        self._remember(maker)
        return measurement

    def save(self, name: str, measurement: Measurement) -> None:
        """Keep what was measured at a point."""
        plain = {key: getattr(measurement, key) for key in _PLAIN}
        head = json.dumps({"plain": plain, "fingerprint": self._fingerprint, "maker": self._maker})
        arrays = {f"values {key}": array for key, array in measurement.values.items()}
        with written_aside(self.points / f"{name}.npz") as aside, aside.open("wb") as file:
            np.savez_compressed(file, head=np.array(head), **arrays)
        self._remember(self._maker)

    def warn_of_others(self) -> None:
        """Warn if points that were loaded were measured by another program or machine than this."""
        if any(maker != self._maker for maker in self.makers):
            _logger.warning(
                "%s: earlier points were measured with other versions or on another machine (%s names them "
                "in its attributes `versions`, `git_revision` and `machine`); --fresh repeats them",
                self.path,
                self.dataset.name,
            )

    def _remember(self, maker: dict[str, Any]) -> None:
        if maker not in self.makers:
            self.makers.append(maker)

    def _check_free(self, fresh: bool) -> dict[str, Any] | None:
        """Return chart.json, None if it is missing or damaged; raise unless the folder may be used."""
        if not self.path.exists():
            return None
        if not self.path.is_dir():
            raise InputError(f"{self.path}: expected a folder for the results, found a file")
        try:
            found = self._read_job()
        except DamagedJobError as error:
            self._ask_points(fresh, str(error))
            return None
        if found is None and any(path != self._lock_file for path in self.path.iterdir()):
            expected = "an empty folder or that of an earlier chart"
            self._ask_points(
                fresh, f"{self.path}: expected {expected}, found one without a {self.job_file.name}"
            )
        if found is not None and not fresh and found["fingerprint"] != self._fingerprint:
            raise another_job(self.path, found["job"], self._chart.resolved())
        return found

    def _read_job(self) -> dict[str, Any] | None:
        """Return what chart.json holds, None if there is none."""
        if not self.job_file.exists():
            return None
        expected = f"{self.job_file}: expected the job of a chart, found damage"
        try:
            entry = json.loads(self.job_file.read_bytes())
        except ValueError as error:
            raise DamagedJobError(f"{expected} ({error})") from error
        if not isinstance(entry, dict) or entry.get("format") != FORMAT:
            raise InputError(
                f'{self.job_file}: expected format "{FORMAT}", found another; choose another --out'
            )
        if not {"fingerprint", "job"} <= entry.keys():
            raise DamagedJobError(f"{expected} (no job in it)")
        return entry

    def _ask_points(self, fresh: bool, complaint: str) -> None:
        """Raise the complaint unless points make up for chart.json: they are to go, or are of this chart."""
        fingerprints = set()
        for path in self.points.glob("*.npz"):
            try:
                fingerprints.add(_unpack(path.read_bytes())[1])
            except _DAMAGE:
                continue
        if not fingerprints or not (fresh or self._fingerprint in fingerprints):
            advice = ", or --fresh to throw away its points, which are of another job" if fingerprints else ""
            raise InputError(f"{complaint}; choose another --out{advice}")

    def _clear(self, scenes: Iterable[str]) -> None:
        """Remove what a chart of these scenes has written, and last the file that vouches for it."""
        pictures = [self.picture(name) for name in (*scenes, "budget")]
        for path in [*self.points.glob("*.npz"), self.table, self.dataset, *pictures, self.job_file]:
            path.unlink(missing_ok=True)


def _unpack(data: bytes) -> tuple[Measurement, str, dict[str, Any]]:
    """Return what the file of a point holds: the measurement, the chart's fingerprint, and its maker."""
    with np.load(io.BytesIO(data)) as file:
        head = json.loads(str(file["head"]))
        values = {key.removeprefix("values "): file[key] for key in file.files if key != "head"}
    return Measurement(values=values, **head["plain"]), head["fingerprint"], head["maker"]
