"""The output folder of a chart: its origin, and the points measured so far."""

import re
from collections.abc import Callable, Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any

from cvt_hpc.archives import Archives
from cvt_hpc.chart.measuring import Measurement
from cvt_hpc.chart.plan import Chart
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

    def accept(self, entry: dict[str, Any]) -> dict[str, Any]:
        """Return a sound chart.json."""
        if not all(_NAME.fullmatch(name) for name in entry["job"]["scenes"].keys()):
            raise ValueError("scenes without a name")  # of which names of files are made
        return entry

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
        return self.points.load(name, lambda plain, values: Measurement(values=values, **plain))

    def save_point(self, name: str, measurement: Measurement) -> None:
        """Keep the result of a point."""
        plain = {key: getattr(measurement, key) for key in _PLAIN}
        self.points.save(name, plain, measurement.values)
