"""How long a sweep will take on any number of ranks: its schedule, simulated claim by claim.

The batches are the result of `share_out` for that number of ranks, in the order in which they are claimed. A
claim travels to the counter, waits for earlier ones, is served, and its batch begins. The duration of batches
is drawn anew in each repeat: the predicted cost times a factor, whose logarithm scatters as in the fit. Left
out: ranks of one node share its memory and its clock rate, and files are written.
"""

import math
from collections.abc import Sequence
from heapq import heapreplace
from typing import NamedTuple

import numpy as np

from cvt_hpc.study.batches import Batch, Turns, batch_cost, one_turn, share_out
from cvt_hpc.study.forecast.cost_model import Fit

_EVENTS = 1_000_000  # claims to be simulated in all repeats, as far as their least number allows
MOST_RANKS = 1_000_000  # each takes some us of every repeat
_FEWEST_REPEATS, _MOST_REPEATS = 20, 200
_INTERVAL = (0.025, 0.975)  # quantiles between which 95 % of the repeats lie
CURVE = tuple(np.unique(np.logspace(0, 4, 25).round().astype(int)).tolist())  # ranks, for a picture


class ClaimTimes(NamedTuple):
    """Duration of a claim.

    Attributes
    ----------
    service : float
        Time [s] for which the counter serves one claim and no other.
    latency : float
        Time [s] on the way there and back, its median.
    scatter : float
        Standard deviation of the logarithm of the latency.
    """

    service: float
    latency: float
    scatter: float

    def draw_latencies(self, generator: np.random.Generator, count: int) -> np.ndarray:
        """Return latencies [s] of some claims, shape (count,)."""
        return self.latency * np.exp(self.scatter * generator.standard_normal(count))


# Between processes that share no memory 0.05 to 0.08 ms were measured, 11 ms at most, which is taken for one
# claim in 10^4, at 3.7 standard deviations. That a larger network does no worse is an assumption.
NETWORK = ClaimTimes(2e-6, 65e-6, math.log(11e-3 / 65e-6) / 3.7)


class Forecast(NamedTuple):
    """Expected time of a sweep.

    Attributes
    ----------
    ranks : int
        Number of processes that compute.
    batches : int
        Number of batches that the runs make on them.
    makespan : (float, float, float)
        Time [s] from the first claim to the end of the last batch: median, and between which 95 % lie.
    bound : float
        Median of the time [s] that no schedule of these batches can undercut: all work over all ranks, or the
        longest batch.
    efficiency : (float, float, float)
        Time of one rank, which does full batches, over the makespan times the ranks: median, and 95 %.
    """

    ranks: int
    batches: int
    makespan: tuple[float, float, float]
    bound: float
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
    groups : sequence of tuple of int
        Run indices that can be done together, in batches as large as may be.
    costs : numpy.ndarray, shape (runs,)
        Predicted duration of each run of the study, in any unit.
    fit : Fit
        Time [s] of a batch over its predicted cost.
    ranks : int
        Number of processes that compute.
    claims : ClaimTimes
        Time that a claim takes.
    seed : int
        Of the random numbers.
    turns : callable
        How many times so many runs fill the lanes.
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
    return Forecast(
        ranks, planned.size, _summary(makespans), float(np.median(bounds)), _summary(efficiencies)
    )


def simulate_schedule(
    seconds: np.ndarray, ranks: int, claims: ClaimTimes, generator: np.random.Generator
) -> float:
    """Return when the last batch ends [s], if all ranks make their first claim at 0.

    Parameters
    ----------
    seconds : numpy.ndarray, shape (batches,)
        How long each batch takes [s], in the order in which they are claimed.
    ranks : int
        Number of processes that compute.
    claims : ClaimTimes
        Time that a claim takes.
    generator : numpy.random.Generator
        Of the latencies.
    """
    latencies = claims.draw_latencies(generator, ranks + len(seconds))
    arrivals = np.sort(
        latencies[:ranks]
    ).tolist()  # next claim of each rank at the counter; sorted, it is a heap
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
