"""Speeds and forces along the belt at each sample of a run's end, for histories that are kept.

Off by default: nothing is then computed, nor held in memory. The kernel adds the profiles of each sample to
the sums of the judged part; here it adds them to zero first, sample by sample, which gives the same bits.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.models.elastic_belt.along_belt import (
    ELSEWHERE,
    NEEDED,
    SLIDING,
    along_belt,
    curvature_at_stations,
    elsewhere,
)
from cvt_hpc.models.elastic_belt.pulley_settings import PULLEY_DEFAULTS
from cvt_hpc.models.elastic_belt.sampling import PROFILES
from cvt_hpc.recording import sample_count

if TYPE_CHECKING:
    from cvt_hpc.lanes import LaneArray
    from cvt_hpc.models.elastic_belt.recorded_run import RecordedRun

COLUMNS = [PROFILES.index(name) for name in NEEDED]
PATH_SPEED = ("element speed", "m s-1", "rate of an element's path coordinate: v_0 / (1 + kappa w)")
WORDS = {**ELSEWHERE, **SLIDING, "element_speed": PATH_SPEED}
PREFIX = "momentary_"  # of the names of quantities over time and position
PRECISION = np.dtype(np.float32)


def profiled_samples(parameters: Mapping[str, Any]) -> int:
    """Samples of a run whose profiles are kept, the last ones."""
    p = parameters
    return min(round(p["profile_duration"] * p["sampling_rate"]), sample_count(p))


def profile_bytes(parameters: Mapping[str, Any]) -> int:
    """Size of the profiles over time of one run [byte]: in memory, and at most in its history."""
    values = profiled_samples(parameters) * parameters["stations"]
    return values * PRECISION.itemsize * max(len(NEEDED), len(WORDS))


class Momentary:
    """Profiles of the last samples of the runs of a batch.

    Parameters
    ----------
    points : sequence of mapping
        Parameters of the runs [SI], alike in sampling and duration; those whose profile_duration is 0 keep
        none.
    stations : int
        N

    Attributes
    ----------
    first : int
        Samples before the first one that is kept; all, where none is.
    """

    def __init__(self, points: Sequence[Mapping[str, Any]], stations: int) -> None:
        counts = [profiled_samples(point) for point in points]
        self.first = sample_count(points[0]) - max(counts)
        self._kept = [lane for lane, count in enumerate(counts) if count]
        self._values = np.full((max(counts), len(self._kept), len(NEEDED), stations), np.nan, PRECISION)

    def note(self, sample: int, profiles: LaneArray) -> None:
        """Keep PROFILES of a sample."""
        self._values[sample - self.first] = profiles.data[:, COLUMNS][:, :, self._kept].transpose(2, 1, 0)

    def of(self, lane: int) -> np.ndarray | None:
        """NEEDED of the last samples of a run, (sample, quantity, N); None where none are kept."""
        return self._values[:, self._kept.index(lane)] if lane in self._kept else None


def last_profiles(run: RecordedRun) -> dict[str, tuple[np.ndarray, str, str, str]]:
    """Quantities of WORDS over the last samples of a run as far as it came, (sample, N), with their words.

    Empty where its profiles are not kept, or the run ended before them.
    """
    kept = run.momentary
    if kept is None or (count := len(kept) - (run.samples - run.done)) <= 0:
        return {}
    sample = dict(zip(NEEDED, kept[:count].transpose(1, 0, 2), strict=True))
    samples = slice(run.done - count, run.done)
    # speeds are counted from the course of the driving speed, which is constant where the drive has inertia
    is_given = np.isinf((PULLEY_DEFAULTS | dict(run.parameters))["driving_inertia"])
    course = run.channel("driving_speed")[samples, None] if is_given else run.parameters["driving_speed"]
    belt_speed = course * run.path.driving_radius
    lengthened = 1.0 + curvature_at_stations(run.mesh) * sample["mean_displacement"]
    found = elsewhere(sample) | along_belt(sample, run.mesh, run.parameters)
    found["element_speed"] = (belt_speed + sample["element_speed"]) / lengthened
    return {name: (found[name].astype(PRECISION), *words) for name, words in WORDS.items()}
