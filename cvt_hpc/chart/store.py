"""The output folder of a chart: its origin, and the points measured so far."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from cvt_hpc.archives import Archives, Arrays
from cvt_hpc.chart.measuring import Measurement
from cvt_hpc.chart.plan import Chart, fingerprint_of
from cvt_hpc.files import kind_of
from cvt_hpc.output_folder import CHART_FILE, Kind, OutputFolder
from cvt_hpc.study.job_difference import another_job

_LIMIT = 1 << 26  # [bytes] of a point
_NAME = re.compile(r"[\w-][\w.-]*")
_PLAIN = tuple(f.name for f in fields(Measurement) if f.name != "values")


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
    points : Archives
        Result of each point, by its name.
    """

    kind = Kind("chart", CHART_FILE, ".chart.lock", "cvt_hpc chart 2", ("points",))

    def __init__(self, path: Path, chart: Chart) -> None:
        super().__init__(path)
        self.points = Archives(path / "points", chart.fingerprint(), _LIMIT)
        self.table = path / "chart.csv"
        self.dataset = path / "chart.nc"
        self._chart = chart

    def picture(self, name: str) -> Path:
        """Return where the picture of a scene goes, or "budget"."""
        return self.path / f"{name}.png"

    def document(self, content: Chart) -> dict[str, Any]:
        """Return the content of chart.json."""
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
        """Return files that no start of a chart leaves without a chart.json."""
        own = {self.lock_file, *self.leftovers()}
        points = self.points.folder
        if kind_of(points) == "a folder" and not any(path.name[0] != "." for path in points.iterdir()):
            own.add(points)
        return None if own.issuperset(self.path.iterdir()) else f"one without a {self.job_file.name}"

    def results_tell(self) -> Callable[[Chart], bool] | None:
        """Return a function that decides whether the points are of a chart; None if there are none."""
        fingerprints = self.points.fingerprints()
        return (lambda chart: chart.fingerprint() in fingerprints) if fingerprints else None

    def written(self, found: dict[str, Any] | None) -> Iterator[Path]:
        """Yield the files of a chart: points, table, dataset, and the pictures of its scenes."""
        scenes = found["job"]["scenes"] if found else (scene.name for scene in self._chart.scenes)
        pictures = (self.picture(name) for name in (*scenes, "budget"))
        yield from (*self.points.written(), self.table, self.dataset, *pictures)

    def load_point(self, name: str) -> Measurement | None:
        """Return the result of a point, None if there is none, or no readable one."""
        return self.points.load(name, _unpack)

    def save_point(self, name: str, measurement: Measurement) -> None:
        """Keep the result of a point."""
        plain = {key: getattr(measurement, key) for key in _PLAIN}
        self.points.save(name, plain, measurement.values)


def _unpack(plain: Any, values: Arrays) -> Measurement:
    """Return the measurement that an archive holds."""
    measurement = Measurement(values=values, **plain)
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
    if any(array.dtype.kind != "f" for array in values.values()):
        raise ValueError("no measurement")
    return measurement
