"""The output folder of a chart: whose it is, and the points measured so far."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import fields
from pathlib import Path

import numpy as np

from cvt_hpc.chart.measuring import Measurement
from cvt_hpc.chart.plan import Chart
from cvt_hpc.errors import InputError
from cvt_hpc.files import naming_refusals, written_aside
from cvt_hpc.study.difference import describe_difference

FORMAT = "cvt_hpc chart 1"
_PLAIN = tuple(f.name for f in fields(Measurement) if f.name != "values")


class ChartFolder:
    """The places in an output folder.

    Parameters
    ----------
    path : Path
        The folder; it need not exist.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.job_file = path / "chart.json"
        self.points = path / "points"
        self.table = path / "chart.csv"
        self.dataset = path / "chart.nc"

    def picture(self, name: str) -> Path:
        """Return where the picture of a scene goes, or "budget"."""
        return self.path / f"{name}.png"

    def prepare(self, chart: Chart, fresh: bool) -> None:
        """Make the folder ready for a chart.

        Raises
        ------
        InputError
            If it holds another chart or other files and is not to be used afresh, or the system refuses.
        """
        with naming_refusals(self.path, "a folder for the results of a chart"):
            found = self._read_job()
            if found is None and self.path.is_dir() and any(self.path.iterdir()):
                raise InputError(
                    f"{self.path}: expected an empty folder or that of an earlier chart, found one without a "
                    f"{self.job_file.name}; choose another --out"
                )
            if found is not None and not fresh and found["fingerprint"] != chart.fingerprint():
                difference = describe_difference(found["job"], chart.resolved())
                raise InputError(
                    f"{self.path}: expected the folder of this job, found that of another ({difference}); "
                    "choose another --out, or --fresh to throw its results away"
                )
            if found is not None and fresh:
                self._clear(found["job"]["scenes"])
            self.points.mkdir(parents=True, exist_ok=True)
        entry = {"format": FORMAT, "fingerprint": chart.fingerprint(), "job": chart.resolved()}
        with written_aside(self.job_file) as aside:
            aside.write_text(json.dumps(entry, indent=1))

    def load(self, name: str) -> Measurement | None:
        """Return what was measured at a point, None if nothing was."""
        path = self.points / f"{name}.npz"
        if not path.exists():
            return None
        try:
            with np.load(path) as file:
                plain = json.loads(str(file["plain"]))
                values = {key.removeprefix("values "): file[key] for key in file.files if key != "plain"}
        except (OSError, ValueError, KeyError) as error:
            raise InputError(f"{path}: expected a point as charts write it, found: {error}") from error
        return Measurement(values=values, **plain)

    def save(self, name: str, measurement: Measurement) -> None:
        """Keep what was measured at a point."""
        plain = {key: getattr(measurement, key) for key in _PLAIN}
        arrays = {f"values {key}": array for key, array in measurement.values.items()}
        with written_aside(self.points / f"{name}.npz") as aside, aside.open("wb") as file:
            np.savez_compressed(file, plain=np.array(json.dumps(plain)), **arrays)

    def _read_job(self) -> dict | None:
        if self.path.exists() and not self.path.is_dir():
            raise InputError(f"{self.path}: expected a folder for the results, found a file")
        if not self.job_file.exists():
            return None
        try:
            entry = json.loads(self.job_file.read_bytes())
        except ValueError as error:
            raise InputError(f"{self.job_file}: expected the job of a chart, found: {error}") from error
        if not isinstance(entry, dict) or entry.get("format") != FORMAT:
            raise InputError(f'{self.job_file}: expected format "{FORMAT}", found another')
        return entry

    def _clear(self, scenes: Iterable[str]) -> None:
        """Remove what a chart of these scenes has written, and last the file that vouches for it."""
        pictures = [self.picture(name) for name in (*scenes, "budget")]
        for path in [*self.points.glob("*.npz"), self.table, self.dataset, *pictures, self.job_file]:
            path.unlink(missing_ok=True)
