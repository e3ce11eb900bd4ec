"""The content of a fit job: free parameters, cases, targets, and the length of the search."""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.fit.scoring import Target
from cvt_hpc.job import Job, rebuild_job
from cvt_hpc.job.sampling import between
from cvt_hpc.parameters import Parameter, positive

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
    """The content of a fit job.

    Attributes
    ----------
    job : Job
        The scene of all runs, without axes.
    free : tuple of Free
        The requested fit.
    along : str
        The swept parameter.
    values : (runs,) array
        Its values in full [SI].
    cases : dict
        By name, in the job's order; the first one is the belt as it is.
    targets : tuple of Target
        The targets to be met.
    starts : (starts, free) array
        Shares of the ranges at which the search begins, beside its samples.
    coarse : dict
        Settings of the runs of search and sensitivities, as the job has them.
    repeat : dict
        A key and its values, for each of which a set is confirmed; empty for once.
    counted : dict
        By quantity, the values between which the motion of a run counts [SI].
    screened, population, generations, seed, every, confirmed, accepted, around, distances, nearby, samples
        As `NUMBERS` declares them.
    """

    job: Job
    free: tuple[Free, ...]
    along: str
    values: NDArray[np.float64]
    cases: dict[str, Case]
    targets: tuple[Target, ...]
    starts: NDArray[np.float64]
    coarse: dict[str, Any]
    repeat: dict[str, tuple]
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
        """Values along the swept parameter that the search runs."""
        return self.values[:: self.every]

    def coarse_job(self) -> Job:
        """Return the scene of the runs of search and sensitivities."""
        document = self.job.resolved()
        return rebuild_job(document, self.job.source, self.job.units, self.coarse, f"[{TABLE}] coarse")

    def scenes(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        """Values [SI] of the free parameters at shares of their ranges, shape (..., free)."""
        columns = zip(self.free, np.moveaxis(shares, -1, 0), strict=True)
        return np.stack([between(*one[1:], share) for one, share in columns], axis=-1)

    def shares(self, scenes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Shares of their ranges at values [SI] of the free parameters; the inverse of `scenes`."""
        columns = zip(self.free, np.moveaxis(scenes, -1, 0), strict=True)
        return np.stack([share_of(one, value) for one, value in columns], axis=-1)

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
