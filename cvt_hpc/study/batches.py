"""The runs that are done together, and their order: full lanes, but no rank without work.

Runs that advance together take little longer than one of them alone, so full lanes cost the least processor
time. A batch fills the lanes several times. Each filling is a turn. Runs that need more than one transient
then fill the lanes again; with more turns these lanes are fuller. But each batch is done by one rank. Batches
therefore become smaller towards the end, down to one turn: none takes more than half of its rank's share of
the work that is left (guided self-scheduling, Polychronopoulos and Kuck 1987, who take all of it).

Small batches need not cost full lanes: when the first transients of a batch are done, its rank claims the
next one, and if this is of the same kind, its runs join. What is left of all of them then fills the lanes.

Where even batches of one turn are fewer than ranks they are cut, as evenly and as far as all can still be
done at once. The sweep then ends sooner, or at worst at the same time, since few lanes take no longer than
all. The price is processor time of ranks that would have waited.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

import numpy as np

Batch = tuple[int, ...]  # run indices
Turns = Callable[[int], int]  # how many times so many runs fill the lanes
SHARE = 0.5  # of the work that is left, which one more batch for each rank may take


class Assignment(NamedTuple):
    """The result of one claim."""

    runs: Batch  # run indices
    # whether they are done one by one, because processes have died at them, and not together
    alone: bool = False
    joins: bool = False  # whether runs may be done with those of other batches

    def parts(self) -> list[Assignment]:
        """Return the runs of each batch."""
        return [Assignment((index,), alone=True) for index in self.runs] if self.alone else [self]


def one_turn(runs: int) -> int:
    """Return 1: lanes for any number of runs."""
    return 1


def batch_cost(batch: Batch, costs: np.ndarray, turns: Turns = one_turn) -> float:
    """Return the predicted cost of a batch: runs that advance together take as long as the longest.

    Parameters
    ----------
    batch : tuple of int
        Run indices.
    costs : numpy.ndarray, shape (runs,)
        Predicted duration of each run of the study, in any unit.
    turns : callable
        How many times so many runs fill the lanes.
    """
    return turns(len(batch)) * float(costs[list(batch)].max())


def share_out(groups: Sequence[Batch], costs: np.ndarray, ranks: int, turns: Turns = one_turn) -> list[Batch]:
    """Return the batches of a sweep in the order in which they start.

    The longest comes first, so that no rank is left with a long one at the end. Order and batches are a
    matter of speed alone, never of results: the numbers of a run depend on its index only.

    Parameters
    ----------
    groups : sequence of tuple of int
        Run indices that can be done together, in batches as large as may be.
    costs, turns
        As of `batch_cost`.
    ranks : int
        Number of processes that compute.

    Returns
    -------
    list of tuple of int
        Each index of `groups` once; runs of two groups never share a batch.
    """
    groups = list(_guided(groups, costs, ranks, turns))
    most = _largest_batch(groups, ranks)
    batches = [batch for group in groups for batch in in_parts(group, -(-len(group) // most))]
    return sorted(batches, key=lambda batch: (-batch_cost(batch, costs, turns), -len(batch), batch))


def _guided(groups: Sequence[Batch], costs: np.ndarray, ranks: int, turns: Turns) -> Iterator[Batch]:
    """Yield the parts of groups, the longest first: none of more turns than its share of the work left."""
    longest = [batch_cost(group, costs) for group in groups]
    left = sum(turns(len(group)) * a_turn for group, a_turn in zip(groups, longest, strict=True))
    for place in sorted(range(len(groups)), key=lambda place: -longest[place]):
        rest, a_turn = groups[place], longest[place]
        while rest:
            whole = turns(len(rest))
            share = int(SHARE * left / (ranks * a_turn)) if a_turn > 0.0 else whole
            first = len(rest) * min(max(share, 1), whole) // whole
            yield rest[:first]
            left -= min(max(share, 1), whole) * a_turn
            rest = rest[first:]


def _largest_batch(groups: Sequence[Batch], ranks: int) -> int:
    """Return the least number of runs in a batch that makes no more batches than can be done at once."""
    largest = max(map(len, groups), default=1)
    if ranks <= len(groups):
        return largest
    sizes = range(1, largest + 1)
    return next(most for most in sizes if sum(-(-len(group) // most) for group in groups) <= ranks)


def in_parts(group: Batch, parts: int) -> Iterator[Batch]:
    """Yield the parts of a group, of nearly equal size."""
    bounds = [len(group) * part // parts for part in range(parts + 1)]
    return (group[first:last] for first, last in zip(bounds, bounds[1:], strict=False))
