"""Time that a batch will take: predicted costs times a factor of the machine that is fitted while running.

The logarithm of (time taken / predicted cost) is taken to scatter normally about that of the machine's
factor; batches with runs that are refined or prolonged widen the scatter. Each rank fits its own factor to
its own batches: nodes differ, and nothing has to be sent. It starts from rank 0's fit to the batches on
record, so that the first claim of a resumed sweep is informed; that fit counts as a few batches at most, and
soon gives way to the rank's own measurements.

A forecast for any number of ranks simulates the schedule, claim by claim. The batches are the result of
`share_out` for that number of ranks, in the order in which they are claimed. A claim travels to the counter,
waits for earlier ones, is served, and its batch begins. The duration of batches is drawn anew in each repeat:
the predicted cost times a factor, whose logarithm scatters as in the fit. Left out: ranks of one node share
its memory and its clock rate, and files are written.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from heapq import heapreplace
from typing import NamedTuple

import numpy as np

from cvt_hpc.study.batches import Batch, Turns, batch_cost, one_turn, share_out

# Until batches are measured, costs are taken to be right within a factor of two, at two standard
# deviations; this counts as much as two batches.
_PRIOR_SPREAD = math.log(2.0) / 2
_PRIOR_WEIGHT = 2
_MOST_INHERITED = 8  # batches that an inherited fit counts as
_DEVIATIONS = 2.0  # standard deviations of the margin: one batch in forty takes longer

_EVENTS = 1_000_000  # claims to be simulated in all repeats, as far as their least number allows
MOST_RANKS = 1_000_000  # each takes some us of every repeat
_FEWEST_REPEATS, _MOST_REPEATS = 20, 200
_INTERVAL = (0.025, 0.975)  # quantiles between which 95 % of the repeats lie
CURVE = tuple(np.unique(np.logspace(0, 4, 25).round().astype(int)).tolist())  # ranks, for a picture


class Fit(NamedTuple):
    """The logarithm of the machine's factor, as far as it is known."""

    batches: int = 0  # how many it is fitted to
    mean: float = 0.0  # mean of the logarithm of (time taken [s] / cost)
    squares: float = 0.0  # sum of the squared deviations from it

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
    costs, turns
        As of `batch_cost`.
    fit : Fit, optional
        The fit that is known beforehand.
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
    costs: np.ndarray, timings: Iterable[tuple[Batch, float]], done: np.ndarray, turns: Turns = one_turn
) -> Fit:
    """Return the fit to batches on record.

    Parameters
    ----------
    costs, turns
        As of `batch_cost`.
    timings : iterable of (batch, seconds)
        How long batches have taken [s].
    done : numpy.ndarray of bool, shape (runs,)
        Runs with results. A batch without any ended before its time, and is left out.
    """
    model = CostModel(costs, turns=turns)
    for batch, seconds in timings:
        if any(done[index] for index in batch):
            model.learn(batch, seconds)
    return model.fit


class ClaimTimes(NamedTuple):
    """Duration of a claim."""

    service: float  # time [s] for which the counter serves one claim and no other
    latency: float  # time [s] on the way there and back, its median
    scatter: float  # standard deviation of the logarithm of the latency

    def draw_latencies(self, generator: np.random.Generator, count: int) -> np.ndarray:
        """Return latencies [s] of some claims, shape (count,)."""
        return self.latency * np.exp(self.scatter * generator.standard_normal(count))


# Between processes that share no memory 0.05 to 0.08 ms were measured, 11 ms at most, which is taken for one
# claim in 10^4, at 3.7 standard deviations. That a larger network does no worse is an assumption.
NETWORK = ClaimTimes(2e-6, 65e-6, math.log(11e-3 / 65e-6) / 3.7)


class Forecast(NamedTuple):
    """Expected time of a sweep."""

    ranks: int  # number of processes that compute
    batches: int  # number of batches that the runs make on them
    # time [s] from the first claim to the end of the last batch: median, and between which 95 % lie
    makespan: tuple[float, float, float]
    # median of the time [s] that no schedule of these batches can undercut: all work over all ranks, or the
    # longest batch
    bound: float
    # time of one rank, which does full batches, over the makespan times the ranks: median, and 95 %
    efficiency: tuple[float, float, float]

    @property
    def core_seconds(self) -> float:
        """Processor time [s] that is taken up, waiting included; median."""
        return self.ranks * self.makespan[0]


def forecast(
    groups: Sequence[Batch],
    costs: np.ndarray,
    fit: Fit,
    ranks: int,
    claims: ClaimTimes = NETWORK,
    seed: int = 0,
    turns: Turns = one_turn,
) -> Forecast:
    """Return the expected time of a sweep, by repeated simulation.

    Parameters
    ----------
    groups, costs, ranks, turns
        As of `share_out`.
    fit : Fit
        Time [s] of a batch over its predicted cost.
    claims : ClaimTimes
        Time that a claim takes.
    seed : int
        Of the random numbers.
    """
    planned = np.array([batch_cost(batch, costs, turns) for batch in share_out(groups, costs, ranks, turns)])
    # Cost of empty lanes, which keep all ranks at work.
    use_of_lanes = sum(batch_cost(batch, costs, turns) for batch in groups) / planned.sum()
    generator = np.random.default_rng(seed)
    repeats = min(max(_EVENTS // (ranks + planned.size), _FEWEST_REPEATS), _MOST_REPEATS)
    makespans, bounds, efficiencies = np.empty((3, repeats))
    for repeat in range(repeats):
        seconds = planned * fit.draw(generator, planned.size)
        makespans[repeat] = simulate_schedule(seconds, ranks, claims, generator)
        bounds[repeat] = least_makespan(seconds, ranks)
        efficiencies[repeat] = use_of_lanes * seconds.sum() / (ranks * makespans[repeat])
    bound = float(np.median(bounds))
    return Forecast(ranks, planned.size, _summary(makespans), bound, _summary(efficiencies))


def simulate_schedule(
    seconds: np.ndarray, ranks: int, claims: ClaimTimes, generator: np.random.Generator
) -> float:
    """Return when the last batch ends [s], if all ranks make their first claim at 0.

    Parameters
    ----------
    seconds : numpy.ndarray, shape (batches,)
        How long each batch takes [s], in the order in which they are claimed.
    ranks, claims
        As of `forecast`.
    generator : numpy.random.Generator
        Of the latencies.
    """
    latencies = claims.draw_latencies(generator, ranks + len(seconds))
    # next claim of each rank at the counter; sorted, it is a heap
    arrivals = np.sort(latencies[:ranks]).tolist()
    free = end = 0.0
    for duration, latency in zip(seconds.tolist(), latencies[ranks:].tolist(), strict=True):
        free = max(free, arrivals[0]) + claims.service
        done = free + duration
        heapreplace(arrivals, done + latency)
        end = max(end, done)
    return end


def least_makespan(seconds: np.ndarray, ranks: int) -> float:
    """Return the time [s] that no schedule can undercut: all work over all ranks, or the longest batch."""
    return float(max(seconds.sum() / ranks, seconds.max()))


def _summary(values: np.ndarray) -> tuple[float, float, float]:
    low, high = np.quantile(values, _INTERVAL)
    return float(np.median(values)), float(low), float(high)
