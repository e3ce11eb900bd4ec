"""Candidates put to the test: a study of all their runs, and the score of each target."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import InputError
from cvt_hpc.experiments.fit.job import Case, Course, Fit, score, total
from cvt_hpc.job import Job, rebuild_job
from cvt_hpc.storage.files import refuse_link
from cvt_hpc.study import open_results, run
from cvt_hpc.variables import Status
from cvt_hpc.vibration.classes import OccurrenceClass, classify_runs

if TYPE_CHECKING:
    import xarray as xr

_NOT_RUN: dict[str, Any] = {"class": OccurrenceClass.NOT_RUN, "counted": False}


class Stopped(Exception):
    """A study of a fit was stopped early, with an exit status; the same command continues it."""

    def __init__(self, status: int) -> None:
        super().__init__("stopped early")
        self.status = status


class Findings(NamedTuple):
    """Results of candidates."""

    scenes: NDArray[np.float64]  # shape (candidates, free): values of the free parameters [SI]
    scores: NDArray[np.float64]  # shape (candidates, target): 0 to 1
    totals: NDArray[np.float64]  # shape (candidates,): their weighted means
    courses: list[dict[str, Course]]  # of each candidate its runs by case


class Evaluation:
    """Studies of a fit, each in a folder of its own below one folder; the same on all ranks.

    A `fresh` one removes the results of earlier studies in a folder instead of continuing from them. `runs`
    and `core_seconds` are those of all studies so far, those of earlier starts included.
    """

    def __init__(self, fit: Fit, out: Path, *, fresh: bool = False) -> None:
        self._fit, self._out, self._fresh = fit, out, fresh
        self.runs, self.core_seconds = 0, 0.0

    def evaluate(
        self,
        name: str,
        scenes: NDArray[np.float64],
        settings: Mapping[str, Any],
        values: NDArray[np.float64],
        cases: Sequence[str] = (),
    ) -> Findings:
        """Do the runs of candidates, and score them.

        Parameters
        ----------
        name : str
            Of the study, and of its folder.
        scenes : (candidates, free) array
            Values of the free parameters [SI].
        settings : mapping
            Further keys of these runs.
        values : (runs,) array
            Of the swept parameter.
        cases : sequence of str
            Names of the cases that are run; all by default. With fewer there are courses and no scores.

        Raises
        ------
        Stopped
            If runs are left.
        InputError
            If the folder holds another job, or the model refuses all runs.
        """
        asked = {case: self._fit.cases[case] for case in cases or self._fit.cases}
        job, legal = study_of(self._fit, name, scenes, settings, values, asked)
        folder = self._out / name
        refuse_link(folder)
        report = run(job, folder, fresh=self._fresh, raises=False)
        if status := report.status_of_more:
            raise Stopped(status)
        with open_results(folder) as dataset:
            courses = self._courses(dataset, legal, list(asked), values)
            self.runs += job.size
            self.core_seconds += float(np.nansum(dataset["core_seconds"]))
        targets = self._fit.targets if not cases else ()
        scores = np.array([[score(target, of_one) for target in targets] for of_one in courses])
        totals = total(targets, scores) if targets else np.full(len(scenes), np.nan)
        return Findings(scenes, scores, totals, courses)

    def _courses(
        self, dataset: xr.Dataset, legal: NDArray[np.bool_], cases: Sequence[str], values: NDArray[np.float64]
    ) -> list[dict[str, Course]]:
        fields = {}
        for name, found in _fields(self._fit, dataset).items():
            array = fields[name] = np.full(legal.shape, _NOT_RUN.get(name, np.nan), found.dtype)
            array[legal] = found
        classes, counted = fields.pop("class"), fields.pop("counted")
        return [
            {
                case: Course(
                    values, classes[k, j], counted[k, j], {name: of[k, j] for name, of in fields.items()}
                )
                for j, case in enumerate(cases)
            }
            for k in range(len(legal))
        ]


def study_of(
    fit: Fit,
    name: str,
    scenes: NDArray[np.float64],
    settings: Mapping[str, Any],
    values: NDArray[np.float64],
    cases: Mapping[str, Case],
) -> tuple[Job, NDArray[np.bool_]]:
    """Return the study of candidates, and which runs it has, (candidates, case, value).

    It has a run for each candidate, case and value, the last one fastest, but none that the model refuses, as
    under more torque than any belt carries; these do not count. Arguments are those of `Evaluation.evaluate`,
    but for the cases by name.
    """
    own = {key: fit.job.parameters[key] for case in cases.values() for key in (*case.set, *case.factor)}
    base = {**own, **dict(zip((one.name for one in fit.free), scenes.T, strict=True))}
    shape = len(scenes), len(cases), len(values)
    axes = {}
    for key, of_candidates in base.items():
        column = np.empty(shape)
        for j, case in enumerate(cases.values()):
            of_case = case.set.get(key, of_candidates)
            column[:, j, :] = np.reshape(of_case * np.float64(case.factor.get(key, 1.0)), (-1, 1))
        axes[key] = column
    axes[fit.along] = np.broadcast_to(values, shape)
    document, known = fit.job.resolved(), (fit.job.source, fit.job.units, dict(settings), "[fit]")
    # of a parameter that follows from an axis the scene has no value of its own
    follow = {gives.key for key in base if (gives := fit.job.schema.parameters[key].gives)}
    for table in fit.job.schema.sections:
        document[table] = {key: value for key, value in document[table].items() if key not in follow}
    scene = rebuild_job(document, *known)
    legal = np.empty(shape, dtype=bool)
    for place in np.ndindex(shape):
        legal[place] = _is_legal(scene, {key: float(column[place]) for key, column in axes.items()})
    if not legal.any():
        legal[:] = True  # the study states the reason
    document |= {
        "name": f"{fit.job.name}_{name}",
        "axes": {key: column[legal].tolist() for key, column in axes.items()},
        "design": {"kind": "listed", "runs": int(legal.sum())},
    }
    return rebuild_job(document, *known), legal


def _is_legal(scene: Job, at: Mapping[str, float]) -> bool:
    try:
        scene.point_at(at)
    except InputError:
        return False
    return True


def _fields(fit: Fit, dataset: xr.Dataset) -> dict[str, NDArray]:
    """Return arrays over the runs: class, whether they count, and the quantities of the targets."""
    status, vibrates = dataset["status"].values, dataset["vibrates"].values
    classes = classify_runs(status, vibrates)
    names = {"amplitude", *(target.quantity for target in fit.targets), *fit.counted} - {""}
    found = {name: _quantity(dataset, name) for name in names if name.split()[0] in dataset}
    counted = classes != OccurrenceClass.SLIPPING
    for name, (low, high) in fit.counted.items():
        # a failed run has no number, and must not be left out like a run that need not be quiet
        counted &= (status != Status.DONE) | ((found[name] >= low) & (found[name] <= high))
    return {"class": classes, "counted": counted, **found}


def _quantity(dataset: xr.Dataset, name: str) -> NDArray[np.float64]:
    """Return a number of each run, of the strand or pulley that is named, or else that moves most."""
    variable, _, label = name.partition(" ")
    array = dataset[variable].transpose("run", ...)
    values = array.values.astype(float)
    if array.ndim == 1:
        return values
    dim = array.dims[1]
    if label:
        return values[:, list(dataset[dim].values.astype(str)).index(label)]
    size = dataset["amplitude"] if "amplitude" in dataset and dim in dataset["amplitude"].dims else array
    size = np.nan_to_num(np.abs(size.transpose("run", dim).values.astype(float)), nan=-1.0)
    return values[np.arange(len(values)), size.argmax(axis=1)]
