"""Which runs are done together, and in which order: full lanes, but no rank without work.

A batch of runs that advance together takes little longer than one of its runs alone, so full batches cost
the least processor time. But each is done by one rank: with few runs on many ranks, full ones would leave
ranks without work. Where there are fewer full batches than ranks they are cut, as evenly and as far as all
can still be done at once: the sweep ends sooner, or at worst at the same time, since a small batch takes no
longer than a large one; the price is processor time of ranks that would have waited.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

Batch = tuple[int, ...]  # run indices


class Assignment(NamedTuple):
    """What one claim gets.

    Attributes
    ----------
    runs : tuple of int
        Run indices.
    alone : bool
        Whether they are done one by one, because processes have died at them, and not together.
    """

    runs: Batch
    alone: bool = False

    def parts(self) -> list[Assignment]:
        """Return what is to be done at a time."""
        return [Assignment((index,), alone=True) for index in self.runs] if self.alone else [self]


def share_out(groups: Sequence[Batch], costs: np.ndarray, ranks: int) -> list[Batch]:
    """Return the batches of a sweep in the order in which they are to be started.

    The longest comes first, so that no rank is left with a long one at the end. Order and batches are a
    matter of speed alone, never of results: the numbers of a run depend on its index only.

    Parameters
    ----------
    groups : sequence of tuple of int
        Run indices that can be done together, in batches as large as the lanes.
    costs : numpy.ndarray, shape (runs,)
        Predicted duration of each run of the study, in any unit.
    ranks : int
        Number of processes that compute.

    Returns
    -------
    list of tuple of int
        Each index of `groups` once; runs of two groups never share a batch.
    """
    most = _largest_batch(groups, ranks)
    batches = [batch for group in groups for batch in _cut(group, most)]
    # Runs that advance together take about as long as the longest of them.
    return sorted(batches, key=lambda batch: (-max(costs[index] for index in batch), -len(batch), batch))


def _largest_batch(groups: Sequence[Batch], ranks: int) -> int:
    """Return the least number of runs in a batch that makes no more batches than can be done at once."""
    largest = max(map(len, groups), default=1)
    at_once = max(ranks, len(groups))
    return next(
        most for most in range(1, largest + 1) if sum(-(-len(group) // most) for group in groups) <= at_once
    )


def _cut(group: Batch, most: int) -> Iterator[Batch]:
    """Yield the parts of a group, of nearly equal size and at most `most` runs."""
    parts = -(-len(group) // most)
    bounds = [len(group) * part // parts for part in range(parts + 1)]
    return (group[first:last] for first, last in zip(bounds, bounds[1:], strict=False))
