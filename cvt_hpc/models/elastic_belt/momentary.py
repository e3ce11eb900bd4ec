"""Speeds and forces along the belt at each sample of a run's end, for histories that are kept.

Off by default: nothing is then computed, nor held in memory. The kernel adds the profiles of each sample to
the sums of the judged part; here it adds them to zero first, sample by sample, which gives the same bits.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.models.elastic_belt.along_belt import ELSEWHERE, NEEDED, SLIDING
from cvt_hpc.models.elastic_belt.sampling import PROFILES
from cvt_hpc.parameters import Parameters
from cvt_hpc.recording import sample_count

if TYPE_CHECKING:
    from cvt_hpc.lanes import LaneArray

COLUMNS = [PROFILES.index(name) for name in NEEDED]
PATH_SPEED = ("element speed", "m s-1", "rate of an element's path coordinate: v_0 / (1 + kappa w)")
WORDS = {**ELSEWHERE, **SLIDING, "element_speed": PATH_SPEED}
PRECISION = np.dtype(np.float32)


def profiled_samples(parameters: Parameters) -> int:
    """Samples of a run whose profiles are kept, the last ones."""
    p = parameters
    return min(round(p["profile_duration"] * p["sampling_rate"]), sample_count(p))


def profile_bytes(parameters: Parameters) -> int:
    """Size of the profiles over time of one run [byte]: in memory, and at most in its history."""
    values = profiled_samples(parameters) * parameters["stations"]
    return values * PRECISION.itemsize * max(len(NEEDED), len(WORDS))


class Momentary:
    """Profiles of the last samples of the runs of a batch, alike in sampling and duration, of N stations.

    Those whose profile_duration is 0 keep none. Before the first one that is kept there are `first` samples;
    all, where none is.
    """

    def __init__(self, points: Sequence[Parameters], stations: int) -> None:
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
