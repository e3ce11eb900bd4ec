"""The best candidates of a search run in full: the results that count of a set."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.fit.evaluating import Evaluation
from cvt_hpc.fit.job import Fit
from cvt_hpc.fit.scoring import Course
from cvt_hpc.fit.search import Found

_START = "start "


@dataclass(frozen=True)
class Confirmed:
    """A set run in full.

    Attributes
    ----------
    name : str
        "start 1" for a start of the job, else the study of the search in which it was found.
    scene : (free,) array
        Values of the free parameters [SI].
    coarse : float
        Score in the search.
    scores : (repeats, target) array
        0 to 1.
    totals : (repeats,) array
        Their weighted means.
    courses : list of dict
        Of each repeat its runs by case.
    """

    name: str
    scene: NDArray[np.float64]
    coarse: float
    scores: NDArray[np.float64]
    totals: NDArray[np.float64]
    courses: list[dict[str, Course]]

    @property
    def is_start(self) -> bool:
        """Whether the job has it as a start."""
        return self.name.startswith(_START)

    @property
    def total(self) -> float:
        """Mean over the repeats."""
        return float(self.totals.mean())

    @property
    def spread(self) -> tuple[float, float]:
        """Smallest and largest score of the repeats."""
        return float(self.totals.min()), float(self.totals.max())

    @property
    def mean(self) -> NDArray[np.float64]:
        """Score of each target, mean over the repeats."""
        return self.scores.mean(axis=0)


def confirm(fit: Fit, evaluation: Evaluation, found: Found) -> list[Confirmed]:
    """Run the best candidates and the job's own starts in full, as often as requested; the best one first.

    Parameters
    ----------
    fit : Fit
        The requested fit.
    evaluation : Evaluation
        Does the runs.
    found : Found
        The candidates of the search, the starts before all others.
    """
    starts = len(fit.starts)
    chosen = list(dict.fromkeys([*range(starts), *found.best(fit.confirmed).tolist()]))
    findings = [
        evaluation.evaluate(name, found.scenes[chosen], settings, fit.values)
        for name, settings in _repeats(fit).items()
    ]
    confirmed = [
        Confirmed(
            f"{_START}{place + 1}" if place < starts else found.stages[place],
            found.scenes[place],
            float(found.totals[place]),
            np.array([one.scores[row] for one in findings]),
            np.array([one.totals[row] for one in findings]),
            [one.courses[row] for one in findings],
        )
        for row, place in enumerate(chosen)
    ]
    return sorted(confirmed, key=lambda one: -one.total)


def _repeats(fit: Fit) -> Mapping[str, Mapping[str, Any]]:
    """Name and settings of the study of each repeat."""
    for key, values in fit.repeat.items():
        return {f"confirmed_{number}": {key: value} for number, value in enumerate(values, 1)}
    return {"confirmed": {}}
