"""How long a batch will take: predicted costs times a factor of the machine that is fitted while running.

The logarithm of (time taken / predicted cost) is taken to scatter normally about that of the machine's
factor; batches with runs that are refined or prolonged widen the scatter. Each rank fits its own factor to
its own batches: nodes differ, and nothing has to be sent. It starts from rank 0's fit to the batches on
record, so that the first claim of a resumed sweep is informed; that fit counts as a few batches at most, and
soon gives way to the rank's own measurements.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from cvt_hpc.study.batches import Batch, Turns, batch_cost, one_turn

# Until batches are measured, costs are taken to be right within a factor of two, at two standard
# deviations; this counts as much as two batches.
_PRIOR_SPREAD = math.log(2.0) / 2
_PRIOR_WEIGHT = 2
_MOST_INHERITED = 8  # batches that an inherited fit counts as
_DEVIATIONS = 2.0  # standard deviations of the margin: one batch in forty takes longer


class Fit(NamedTuple):
    """The logarithm of the machine's factor, as far as it is known.

    Attributes
    ----------
    batches : int
        How many it is fitted to.
    mean : float
        Mean of the logarithm of (time taken [s] / cost).
    squares : float
        Sum of the squared deviations from it.
    """

    batches: int = 0
    mean: float = 0.0
    squares: float = 0.0

    def with_ratio(self, ratio: float) -> Fit:
        """Return the fit to one more batch (Welford 1962)."""
        batches = self.batches + 1
        deviation = math.log(ratio) - self.mean
        mean = self.mean + deviation / batches
        return Fit(batches, mean, self.squares + deviation * (math.log(ratio) - mean))

    def inherited(self) -> Fit:
        """Return the fit with no more weight than that of a few batches."""
        share = min(1.0, _MOST_INHERITED / max(self.batches, 1))
        return Fit(min(self.batches, _MOST_INHERITED), self.mean, self.squares * share)

    def likely(self) -> float:
        """Return the machine's factor [s per unit of cost], its median."""
        return math.exp(self.mean)

    def upper(self) -> float:
        """Return a factor that one batch in forty exceeds; without any batch there is none, and it is 0."""
        if self.batches == 0:
            return 0.0
        # The mean itself is uncertain as well, the more so the fewer batches there are.
        return math.exp(self.mean + _DEVIATIONS * self.spread() * math.sqrt(1 + 1 / self.batches))

    def spread(self) -> float:
        """Return the standard deviation of the logarithm, by the batches and the prior."""
        freedom = _PRIOR_WEIGHT + max(self.batches - 1, 0)
        return math.sqrt((_PRIOR_WEIGHT * _PRIOR_SPREAD**2 + self.squares) / freedom)

    def draw(self, generator: np.random.Generator, count: int) -> np.ndarray:
        """Return factors of `count` batches of one sweep, drawn from the known distribution.

        All share the error of the mean, which without any batch is as large as their own scatter.
        """
        spread = self.spread()
        mean = self.mean + spread * generator.standard_normal() / math.sqrt(max(self.batches, 1))
        return np.exp(mean + spread * generator.standard_normal(count))


class CostModel:
    """Predicts batches, and learns from each that was done.

    Parameters
    ----------
    costs : numpy.ndarray, shape (runs,)
        Predicted duration of each run of the study, in any unit.
    fit : Fit, optional
        The fit that is known beforehand.
    turns : callable
        How many times so many runs fill the lanes.
    """

    def __init__(self, costs: np.ndarray, fit: Fit | None = None, turns: Turns = one_turn) -> None:
        self._costs, self._turns = costs, turns
        self.fit = fit or Fit()

    def learn(self, batch: Batch, seconds: float) -> None:
        """Add the time [s] of a batch; a time that no clock has measured is left out."""
        cost = self.cost(batch)
        if 0 < seconds < math.inf and cost > 0:
            self.fit = self.fit.with_ratio(seconds / cost)

    def upper(self, batch: Batch) -> float:
        """Return the time [s] that a batch takes, with the margin; 0 while nothing is known."""
        return self.fit.upper() * self.cost(batch)

    def cost(self, batch: Batch) -> float:
        """Return the predicted cost of a batch, see `batch_cost`."""
        return batch_cost(batch, self._costs, self._turns)


def fit_recorded(
    costs: np.ndarray,
    timings: Iterable[tuple[Batch, float]],
    done: np.ndarray,
    turns: Turns = one_turn,
) -> Fit:
    """Return the fit to batches on record.

    Parameters
    ----------
    costs : numpy.ndarray, shape (runs,)
        Predicted duration of each run of the study, in any unit.
    timings : iterable of (batch, seconds)
        How long batches have taken [s].
    done : numpy.ndarray of bool, shape (runs,)
        Runs with results. A batch without any ended before its time, and is left out.
    turns : callable
        How many times so many runs fill the lanes.
    """
    model = CostModel(costs, turns=turns)
    for batch, seconds in timings:
        if any(done[index] for index in batch):
            model.learn(batch, seconds)
    return model.fit
