"""The output folder of a chart: whose it is, and the points measured so far."""

from __future__ import annotations

import io
import json
import logging
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.chart.measuring import Measurement
from cvt_hpc.chart.plan import Chart, fingerprint_of
from cvt_hpc.files import StorageError, kind_of, read_regular, written_aside
from cvt_hpc.output_folder import CHART_FILE, Kind, OutputFolder
from cvt_hpc.provenance import git_revision, machine, versions
from cvt_hpc.study.job_difference import another_job

_LIMIT = 1 << 26  # [bytes] of the file of a point, and of what it holds unpacked
_NAME = re.compile(r"[\w-][\w.-]*")
_PLAIN = tuple(f.name for f in fields(Measurement) if f.name != "values")
# what an archive raises depends on the byte that is damaged
_DAMAGE = (
    *(ArithmeticError, AttributeError, EOFError, LookupError, MemoryError, OSError, RuntimeError),
    *(struct.error, SyntaxError, TypeError, ValueError, zipfile.BadZipFile, zlib.error),
)
_logger = logging.getLogger(__name__)


class ChartFolder(OutputFolder[Chart]):
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

    kind = Kind("chart", CHART_FILE, ".chart.lock", "cvt_hpc chart 2", ("points",))

    def __init__(self, path: Path, chart: Chart) -> None:
        super().__init__(path)
        self.points = path / "points"
        self.table = path / "chart.csv"
        self.dataset = path / "chart.nc"
        self.makers: list[dict[str, Any]] = []
        self._chart = chart
        self._fingerprint = chart.fingerprint()
        self._maker = {"versions": versions(), "git_revision": git_revision(), "machine": machine()}

    def picture(self, name: str) -> Path:
        """Return where the picture of a scene goes, or "budget"."""
        return self.path / f"{name}.png"

    def document(self, content: Chart) -> dict[str, Any]:
        """Return what chart.json says of a chart."""
        return {"fingerprint": content.fingerprint(), "job": content.resolved()}

    def accept(self, entry: dict[str, Any]) -> dict[str, Any]:
        """Return a sound chart.json."""
        if not isinstance(entry["fingerprint"], str):
            raise ValueError("no fingerprint")
        if not all(_NAME.fullmatch(name) for name in entry["job"]["scenes"].keys()):
            raise ValueError("scenes without a name")  # of which names of files are made
        return entry

    def check_unsigned(self, entry: dict[str, Any]) -> None:
        """Raise ValueError unless the job of an earlier version gives the fingerprint that stands there."""
        if fingerprint_of(entry["job"]) != entry["fingerprint"]:
            raise ValueError("it has no checksum, and its job does not give its fingerprint")

    def refuse_other(self, found: dict[str, Any], asked: Chart) -> None:
        """Raise InputError unless the folder is that of the chart."""
        if found["fingerprint"] != asked.fingerprint():
            raise another_job(self.path, found["job"], asked.resolved())

    def unexplained(self) -> str | None:
        """Return what is here that no start of a chart leaves without a chart.json."""
        own = {self.lock_file, *self.leftovers()}
        if kind_of(self.points) == "a folder" and not any(
            path.name[0] != "." for path in self.points.iterdir()
        ):
            own.add(self.points)
        return None if own.issuperset(self.path.iterdir()) else f"one without a {self.job_file.name}"

    def results_tell(self) -> Callable[[Chart], bool] | None:
        """Return what tells whether the points are of a chart; None if there are none, of whatever chart."""
        fingerprints = set()
        for path in self._points():
            try:
                fingerprints.add(_unpack(read_regular(path, _LIMIT))[1])
            except _DAMAGE:
                continue
        return (lambda chart: chart.fingerprint() in fingerprints) if fingerprints else None

    def written(self, found: dict[str, Any] | None) -> Iterator[Path]:
        """Yield what a chart has left: points, table, dataset, and the pictures of its scenes."""
        scenes = found["job"]["scenes"] if found else (scene.name for scene in self._chart.scenes)
        pictures = (self.picture(name) for name in (*scenes, "budget"))
        yield from (*self._points(), self.table, self.dataset, *pictures)

    def _points(self) -> list[Path]:
        """Return the files of points; none where a link stands in the place of their folder."""
        return [*self.points.glob("*.npz")] if kind_of(self.points) == "a folder" else []

    def load_point(self, name: str) -> Measurement | None:
        """Return what was measured at a point, None if nothing was, or nothing that can be read."""
        path = self.points / f"{name}.npz"
        if kind_of(path) is None:
            return None
        try:
            measurement, fingerprint, maker = _unpack(read_regular(path, _LIMIT))
            if fingerprint != self._fingerprint:
                raise ValueError("of another chart")
        except PermissionError as error:
            raise StorageError(
                f"{path}: expected a file that can be read, found: {error.strerror}"
            ) from error
        except _DAMAGE as error:
            _logger.warning("%s: damaged (%s); measured again", path, error or "it is empty")
            return None
        self._remember(maker)
        return measurement

    def save_point(self, name: str, measurement: Measurement) -> None:
        """Keep what was measured at a point."""
        plain = {key: getattr(measurement, key) for key in _PLAIN}
        head = json.dumps({"plain": plain, "fingerprint": self._fingerprint, "maker": self._maker})
        arrays: dict[str, Any] = {f"values {key}": array for key, array in measurement.values.items()}
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


def _is_maker(maker: Any) -> bool:
    """Whether these are the versions, the revision and the machine by which a point was measured."""
    own = {"versions": dict, "git_revision": str, "machine": dict}
    return all(isinstance(maker[key], kind) for key, kind in own.items())


def _unpack(data: bytes) -> tuple[Measurement, str, dict[str, Any]]:
    """Return what the file of a point holds: the measurement, the chart's fingerprint, and its maker."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(entry.file_size for entry in archive.infolist()) > _LIMIT:
            raise ValueError("it holds more than a point")
    with np.load(io.BytesIO(data)) as file:
        head = json.loads(str(file["head"]))
        values = {key.removeprefix("values "): file[key] for key in file.files if key != "head"}
    measurement, maker = Measurement(values=values, **head["plain"]), head["maker"]
    numbers = [
        measurement.cost,
        measurement.core_seconds,
        measurement.simulated,
        *measurement.counters.values(),
    ]
    if not isinstance(measurement.reason, str) or not all(
        isinstance(number, (int, float)) for number in numbers
    ):
        raise ValueError("no measurement")
    if any(array.dtype.kind != "f" for array in values.values()) or not _is_maker(maker):
        raise ValueError("no measurement")
    return measurement, str(head["fingerprint"]), maker
