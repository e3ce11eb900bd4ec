"""The content of a fit job: free parameters, cases, targets, and the length of the search.

The runs of a candidate meet a statement by a score from 0 to 1, by one law for each measure. A score counts a
run by its own class: a run that failed, is undecided or irregular neither vibrates nor is quiet. A run that
slips, that the model refuses since no belt carries its load, or that lies beyond a bound of `counted` such as
one near gross slip, does not count: it does not vibrate, whatever it does, and silence is required of the
other runs alone.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.job import Job, rebuild_job
from cvt_hpc.job.design import between
from cvt_hpc.parameters import Parameter, positive
from cvt_hpc.vibration.classes import OccurrenceClass

QUIET, VIBRATING = OccurrenceClass.QUIET, OccurrenceClass.VIBRATING
REPRODUCED, _NOT_REPRODUCED = 0.95, 0.05  # scores from which, and to which, a statement counts so

TABLE = "fit"
NUMBERS = {
    "screened": Parameter(64, "", "samples that the search begins with; a power of 2", minimum=2),
    "population": Parameter(16, "", "candidates of a generation", minimum=5),
    "generations": Parameter(8, "", "of the search", minimum=0),
    "seed": Parameter(1, "", "of samples and search", minimum=0),
    "every": Parameter(1, "", "of the values along that the search runs, every so many", minimum=1),
    "confirmed": Parameter(4, "", "best candidates that are run in full", minimum=1),
    "accepted": Parameter(
        0.95, "", "share of the best score from which a candidate counts as as good", minimum=0.0, maximum=1.0
    ),
    "around": Parameter(
        "best",
        "",
        "sets around which parameters are moved: the best one, or all starts too",
        choices=("best", "starts"),
    ),
    "distances": Parameter(
        (0.5, 0.7, 0.8, 0.9, 0.95, 1.05, 1.1, 1.2, 1.4, 2.0),
        "",
        "factors by which each parameter is moved alone",
    ),
    "nearby": positive(0.1, "", "part by which all parameters are moved together for their sensitivities"),
    "samples": Parameter(
        16, "", "of the sensitivities, for each parameter and twice more; a power of 2; 0: none", minimum=0
    ),
}


@dataclass(frozen=True)
class Course:
    """The runs of one case of a candidate along the swept parameter."""

    values: NDArray[np.float64]  # shape (runs,): of that parameter, ascending [SI]
    classes: NDArray[np.int8]  # shape (runs,): `OccurrenceClass` of each run
    counted: NDArray[np.bool_]  # shape (runs,): whether its motion counts
    # shape (runs,): recorded values by name [SI], of the strand or pulley that moves most
    quantities: Mapping[str, NDArray[np.float64]]

    @property
    def vibrates(self) -> NDArray[np.bool_]:
        """Tell which runs vibrate, and count."""
        return (self.classes == VIBRATING) & self.counted

    def between(self, low: float, high: float) -> Course:
        """Return the runs from one value to another, both included but for rounding."""
        slack = 1e-9 * np.abs(self.values).max()
        chosen = (self.values >= low - slack) & (self.values <= high + slack)
        quantities = {name: values[chosen] for name, values in self.quantities.items()}
        return Course(self.values[chosen], self.classes[chosen], self.counted[chosen], quantities)


@dataclass(frozen=True)
class Target:
    """A statement that can be measured."""

    # name, statement: one word, and the statement as its source has it
    name: str
    statement: str
    case: str  # name of the case
    measure: str  # one of MEASURES
    # low, high: ends of the swept parameter [SI]: the runs between them count
    low: float
    high: float
    quantity: str = ""  # recorded quantity for `within` and `least`; "" for the other measures
    bounds: tuple[float, ...] = ()  # of the quantity, or of the onset [SI]; () where nothing is bounded
    # distance [SI] from the bounds at which nothing is left of the score; for `least` from 0, at which half
    # of it is
    fading: float = 1.0
    count: int = 1  # of separate areas
    than: str = ""  # case that is exceeded
    by: float = 1.0  # factor of amplitude that earns the whole score
    weight: float = 1.0  # in the mean of all targets


def score(target: Target, courses: Mapping[str, Course]) -> float:
    """Return how well the courses of a candidate, by case, meet a target: 0 to 1."""
    asked = courses[target.case].between(target.low, target.high)
    other = courses[target.than].between(target.low, target.high) if target.than else asked
    return float(MEASURES[target.measure](target, asked, other))


def total(targets: Sequence[Target], scores: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the weighted mean of scores, shape (..., target)."""
    return np.average(scores, axis=-1, weights=[target.weight for target in targets])


def verdict(value: float) -> str:
    """Return the meaning of a score for a statement, in words."""
    if value >= REPRODUCED:
        return "reproduced"
    return "not reproduced" if value <= _NOT_REPRODUCED else "partly"


def areas(course: Course) -> list[tuple[float, float]]:
    """Return first and last value of each area of vibration; a quiet run lies between two areas."""
    found: list[tuple[float, float]] = []
    parted = True
    for value, vibrates, kind in zip(course.values, course.vibrates, course.classes, strict=True):
        if vibrates:
            found = [*found, (value, value)] if parted else [*found[:-1], (found[-1][0], value)]
            parted = False
        parted = parted or kind == QUIET
    return found


def _vibrating(target: Target, asked: Course, other: Course) -> float:
    """Return the share of the runs that vibrate."""
    return float(asked.vibrates.mean())


def _quiet(target: Target, asked: Course, other: Course) -> float:
    """Return the share of the counted runs that are quiet; 0 where none counts."""
    return float((asked.classes[asked.counted] == QUIET).mean()) if asked.counted.any() else 0.0


def _within(target: Target, asked: Course, other: Course) -> float:
    """Return the mean score of the quantity over the vibrating runs; 0 where none vibrates."""
    if not asked.vibrates.any():
        return 0.0
    return float(_near(asked.quantities[target.quantity][asked.vibrates], target).mean())


def _least(target: Target, asked: Course, other: Course) -> float:
    """Score the largest size of the quantity: 1 for none, a half at `fading`; 0 where a run has no value."""
    largest = float(np.abs(asked.quantities[target.quantity]).max())
    return target.fading / (target.fading + largest) if np.isfinite(largest) else 0.0


def _areas(target: Target, asked: Course, other: Course) -> float:
    """Score the number of separate areas; each that is missing or too many costs its share."""
    return max(0.0, 1.0 - abs(len(areas(asked)) - target.count) / target.count)


def _onset(target: Target, asked: Course, other: Course) -> float:
    """Score the first vibrating run by its bounds; 0 where none vibrates."""
    first = asked.values[asked.vibrates][:1]
    return float(_near(first, target).sum())


def _larger(target: Target, asked: Course, other: Course) -> float:
    """Score the ratio of the largest amplitudes of two cases; 0 where one of them is silent."""
    if not (asked.vibrates.any() and other.vibrates.any()):
        return 0.0
    of_each = (one.quantities["amplitude"][one.vibrates].max() for one in (asked, other))
    return float(np.clip(np.log(np.divide(*of_each)) / np.log(target.by), 0.0, 1.0))


def _near(values: NDArray[np.float64], target: Target) -> NDArray[np.float64]:
    """Return 1 between the bounds, falling linearly to 0 at the distance `fading` from them."""
    low, high = target.bounds
    distance = np.maximum(np.maximum(low - values, values - high), 0.0)
    return np.clip(1.0 - distance / target.fading, 0.0, 1.0)


MEASURES: Mapping[str, Callable[[Target, Course, Course], float]] = {
    "vibrating": _vibrating,
    "quiet": _quiet,
    "within": _within,
    "least": _least,
    "areas": _areas,
    "onset": _onset,
    "larger": _larger,
}


class Free(NamedTuple):
    """A free parameter: its name, the ends of its range [SI], and how it is spaced between them."""

    name: str
    low: float
    high: float
    spacing: str


class Case(NamedTuple):
    """Other values of the scene: values that are set [SI], and factors on values of a candidate."""

    set: Mapping[str, float]
    factor: Mapping[str, float]


@dataclass(frozen=True)
class Fit:
    """The content of a fit job; numbers not described here are as `NUMBERS` declares them."""

    job: Job  # the scene of all runs, without axes
    free: tuple[Free, ...]
    along: str  # the swept parameter
    values: NDArray[np.float64]  # its values in full [SI], (runs,)
    cases: dict[str, Case]  # by name, in the job's order; the first one is the belt as it is
    targets: tuple[Target, ...]  # to be met
    # (starts, free): shares of the ranges at which the search begins, beside its samples
    starts: NDArray[np.float64]
    coarse: dict[str, Any]  # settings of the runs of search and sensitivities, as the job has them
    repeat: dict[str, tuple]  # a key and its values, for each of which a set is confirmed; empty for once
    # by quantity, the values between which the motion of a run counts [SI]
    counted: dict[str, tuple[float, float]]
    screened: int
    population: int
    generations: int
    seed: int
    every: int
    confirmed: int
    accepted: float
    around: str
    distances: tuple[float, ...]
    nearby: float
    samples: int

    @property
    def thinned(self) -> NDArray[np.float64]:
        """Return the values along the swept parameter that the search runs."""
        return self.values[:: self.every]

    def coarse_job(self) -> Job:
        """Return the scene of the runs of search and sensitivities."""
        document = self.job.resolved()
        return rebuild_job(document, self.job.source, self.job.units, self.coarse, f"[{TABLE}] coarse")

    def scenes(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return values [SI] of the free parameters at shares of their ranges, shape (..., free)."""
        columns = zip(self.free, np.moveaxis(shares, -1, 0), strict=True)
        return np.stack([between(*one[1:], share) for one, share in columns], axis=-1)

    def resolved(self) -> dict[str, Any]:
        """Return all entries that determine the numbers, in JSON types."""
        own = {key: getattr(self, key) for key in (*NUMBERS, "along", "coarse", "repeat", "counted")}
        arrays = {"values": self.values.tolist(), "starts": self.starts.tolist()}
        named = {
            "free": [one._asdict() for one in self.free],
            "targets": [asdict(one) for one in self.targets],
            "cases": {name: case._asdict() for name, case in self.cases.items()},
        }
        return {**self.job.resolved(), TABLE: {**own, **arrays, **named}}


def share_of(free: Free, value: Any) -> Any:
    """Return the share of its range at values [SI] of a free parameter."""
    if free.spacing == "log":
        return np.log(value / free.low) / math.log(free.high / free.low)
    return (value - free.low) / (free.high - free.low)
