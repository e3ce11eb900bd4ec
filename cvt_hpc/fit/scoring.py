"""How well the runs of a candidate meet a statement: a score from 0 to 1, by one law for each measure.

A score counts a run by its own class: a run that failed, is undecided or irregular neither vibrates
nor is quiet. A run that slips, that the model refuses since no belt carries its load, or that lies beyond a
bound of `counted` such as one near gross slip, does not count: it does not vibrate, whatever it does, and
silence is required of the other runs alone.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.vibration.classes import OccurrenceClass

QUIET, VIBRATING = OccurrenceClass.QUIET, OccurrenceClass.VIBRATING
REPRODUCED, NOT_REPRODUCED = 0.95, 0.05  # scores from which, and to which, a statement counts so


@dataclass(frozen=True)
class Course:
    """The runs of one case of a candidate along the swept parameter.

    Attributes
    ----------
    values : (runs,) array
        Of that parameter, ascending [SI].
    classes : (runs,) array
        `OccurrenceClass` of each run.
    counted : (runs,) array of bool
        Whether its motion counts.
    quantities : mapping of (runs,) arrays
        Recorded values by name [SI], of the strand or pulley that moves most.
    """

    values: NDArray[np.float64]
    classes: NDArray[np.int8]
    counted: NDArray[np.bool_]
    quantities: Mapping[str, NDArray[np.float64]]

    @property
    def vibrates(self) -> NDArray[np.bool_]:
        """Which runs vibrate, and count."""
        return (self.classes == VIBRATING) & self.counted

    def between(self, low: float, high: float) -> Course:
        """The runs from one value to another, both included but for rounding."""
        slack = 1e-9 * np.abs(self.values).max()
        chosen = (self.values >= low - slack) & (self.values <= high + slack)
        quantities = {name: values[chosen] for name, values in self.quantities.items()}
        return Course(self.values[chosen], self.classes[chosen], self.counted[chosen], quantities)


@dataclass(frozen=True)
class Target:
    """A statement that can be measured.

    Attributes
    ----------
    name, statement : str
        One word, and the statement as its source has it.
    case : str
        Name of the case.
    measure : str
        One of MEASURES.
    low, high : float
        Ends of the swept parameter [SI]: the runs between them count.
    quantity : str
        Recorded quantity for `within`; "" for the other measures.
    bounds : tuple of float
        Of the quantity, or of the onset [SI]; () where nothing is bounded.
    fading : float
        Distance [SI] from the bounds at which nothing is left of the score.
    count : int
        Of separate areas.
    than : str
        Case that is exceeded.
    by : float
        Factor of amplitude that earns the whole score.
    weight : float
        In the mean of all targets.
    """

    name: str
    statement: str
    case: str
    measure: str
    low: float
    high: float
    quantity: str = ""
    bounds: tuple[float, ...] = ()
    fading: float = 1.0
    count: int = 1
    than: str = ""
    by: float = 1.0
    weight: float = 1.0


def score(target: Target, courses: Mapping[str, Course]) -> float:
    """Return how well the courses of a candidate, by case, meet a target: 0 to 1."""
    asked = courses[target.case].between(target.low, target.high)
    other = courses[target.than].between(target.low, target.high) if target.than else asked
    return float(MEASURES[target.measure](target, asked, other))


def total(targets: Sequence[Target], scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weighted mean of scores, shape (..., target)."""
    return np.average(scores, axis=-1, weights=[target.weight for target in targets])


def verdict(value: float) -> str:
    """The meaning of a score for a statement, in words."""
    if value >= REPRODUCED:
        return "reproduced"
    return "not reproduced" if value <= NOT_REPRODUCED else "partly"


def areas(course: Course) -> list[tuple[float, float]]:
    """First and last value of each area of vibration; two areas have a quiet run between them."""
    found: list[tuple[float, float]] = []
    parted = True
    for value, vibrates, kind in zip(course.values, course.vibrates, course.classes, strict=True):
        if vibrates:
            found = [*found, (value, value)] if parted else [*found[:-1], (found[-1][0], value)]
            parted = False
        parted = parted or kind == QUIET
    return found


def _vibrating(target: Target, asked: Course, other: Course) -> float:
    """Share of the runs that vibrate."""
    return float(asked.vibrates.mean())


def _quiet(target: Target, asked: Course, other: Course) -> float:
    """Share of the counted runs that are quiet; 0 where none counts."""
    return float((asked.classes[asked.counted] == QUIET).mean()) if asked.counted.any() else 0.0


def _within(target: Target, asked: Course, other: Course) -> float:
    """Mean over the vibrating runs of how near the quantity is to its bounds; 0 where none vibrates."""
    if not asked.vibrates.any():
        return 0.0
    return float(_near(asked.quantities[target.quantity][asked.vibrates], target).mean())


def _areas(target: Target, asked: Course, other: Course) -> float:
    """Whether so many separate areas vibrate; each that is missing or too many costs its share."""
    return max(0.0, 1.0 - abs(len(areas(asked)) - target.count) / target.count)


def _onset(target: Target, asked: Course, other: Course) -> float:
    """How near the first vibrating run is to its bounds; 0 where none vibrates."""
    first = asked.values[asked.vibrates][:1]
    return float(_near(first, target).sum())


def _larger(target: Target, asked: Course, other: Course) -> float:
    """By how much the largest amplitude exceeds that of the other case; 0 where one of them is silent."""
    if not (asked.vibrates.any() and other.vibrates.any()):
        return 0.0
    of_each = (one.quantities["amplitude"][one.vibrates].max() for one in (asked, other))
    return float(np.clip(np.log(np.divide(*of_each)) / np.log(target.by), 0.0, 1.0))


def _near(values: NDArray[np.float64], target: Target) -> NDArray[np.float64]:
    """1 between the bounds, falling linearly to 0 at the distance `fading` from them."""
    low, high = target.bounds
    distance = np.maximum(np.maximum(low - values, values - high), 0.0)
    return np.clip(1.0 - distance / target.fading, 0.0, 1.0)


MEASURES: Mapping[str, Callable[[Target, Course, Course], float]] = {
    "vibrating": _vibrating,
    "quiet": _quiet,
    "within": _within,
    "areas": _areas,
    "onset": _onset,
    "larger": _larger,
}
