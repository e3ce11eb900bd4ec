"""A statement of a paper about one of its figures, and what measuring it in a study gives.

Checks of statements read `Kept`: the results of a study and the histories that it keeps.
"""

import json
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from enum import Enum
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr

from cvt_hpc.analysis.profiles import inside
from cvt_hpc.errors import InputError
from cvt_hpc.storage.netcdf import open_netcdf
from cvt_hpc.variables import Status


class Kept(NamedTuple):
    """A study: results, and histories of runs in the order of their indices."""

    results: xr.Dataset
    histories: Sequence[xr.Dataset]

    def run(self, **values: float | str) -> xr.Dataset:
        """Results of the run at values [SI] of axes; InputError where it is not done."""
        found = self.results.sel(values, method="nearest") if values else self.results
        if int(found["status"]) != Status.DONE:
            status = Status(int(found["status"])).name
            raise InputError(f"expected a run that is done at {values}, found {status}")
        return found

    def history(self, **values: float | str) -> xr.Dataset:
        """History of the run at values [SI] of axes."""
        for history in self.histories:
            point = json.loads(history.attrs["point"])
            if all(_is_near(point[key], value) for key, value in values.items()):
                return history
        raise InputError(f"expected the history of the run at {values}, found none")


class Arc(NamedTuple):
    """A quantity over the arc of a pulley: shares of the wrap from the inlet, and values, (n,) each.

    Places are equally far apart, whatever the cells of the belt: means over them are means over lengths.
    """

    share: np.ndarray
    values: np.ndarray

    @property
    def largest(self) -> float:
        """Share of the wrap at which the quantity is largest."""
        return float(self.share[np.argmax(self.values)])


def over_arc(history: xr.Dataset, name: str, pulley: str) -> Arc:
    """A quantity by `position` over the arc of the driving or the driven pulley, both ends included."""
    here = inside(history, pulley)
    angle = history["wrap_angle"].values[here]
    share = np.linspace(0.0, 1.0, angle.size)
    return Arc(share, np.interp(share, angle / angle[-1], history[name].values[here]))


def on_strand(history: xr.Dataset, name: str, strand: str) -> np.ndarray:
    """A quantity between the ends of a strand, at places equally far apart."""
    here = np.flatnonzero(history["region"].values.astype(str) == strand)[1:-1]
    position = history["position"].values[here]
    return np.interp(np.linspace(position[0], position[-1], here.size), position, history[name].values[here])


def courses(kept: Kept, axis: str, *names: str) -> dict[str, xr.DataArray]:
    """Results by name along an axis, which comes first and ascends; InputError where a run is not done."""
    if (kept.results["status"] != Status.DONE).any():
        raise InputError(f"expected runs that are done at each {axis}, found others")
    return {name: kept.results[name].transpose(axis, ...).sortby(axis) for name in names}


@contextmanager
def opened(folder: Path) -> Iterator[Kept]:
    """The study in an output folder, open within."""
    from cvt_hpc.study import open_results

    with ExitStack() as stack:
        results = stack.enter_context(open_results(folder)).load()
        paths = sorted((folder / "histories").glob("run-*.nc"))
        yield Kept(results, [stack.enter_context(open_netcdf(path)) for path in paths])


def _is_near(found: float | str, value: float | str) -> bool:
    if isinstance(value, str):
        return found == value
    return bool(np.isclose(float(found), value, rtol=1e-6, atol=1e-12)) or float(found) == value


class Verdict(Enum):
    """Whether what a paper states is found."""

    REPRODUCED = "reproduced"
    PARTLY = "partly"
    NOT = "not"
    UNKNOWN = "not measured"


class Measured(NamedTuple):
    """Whether each part of a statement holds, and the numbers by which that is told."""

    holds: Iterable[object]
    numbers: str


class Statement(NamedTuple):
    """Statement of a paper on a figure."""

    text: str  # in the paper's words, shortened
    measure: Callable[[Kept], Measured]  # of the study
    why: str = ""  # what is known of the reason where it does not hold


class Finding(NamedTuple):
    """Outcome of a statement."""

    text: str
    verdict: Verdict
    numbers: str
    why: str


def judged(statement: Statement, kept: Kept) -> Finding:
    """Measure a statement: reproduced where all of its parts hold, partly where some do."""
    try:
        measured = statement.measure(kept)
    except InputError as error:  # a run has failed
        return Finding(statement.text, Verdict.UNKNOWN, str(error), statement.why)
    holds = [bool(part) for part in measured.holds]
    verdict = Verdict.REPRODUCED if holds and all(holds) else Verdict.PARTLY if any(holds) else Verdict.NOT
    why = "" if verdict is Verdict.REPRODUCED else statement.why
    return Finding(statement.text, verdict, measured.numbers, why)


def listed(values: Iterable[float], digits: str = ".3g") -> str:
    """Numbers in a row."""
    return ", ".join(format(float(value), digits) for value in values)
