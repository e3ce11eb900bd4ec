"""Distribution of runs: all ranks compute, and each claims its next batch from one counter."""

from collections.abc import Callable, Iterator, Sequence

from cvt_hpc.study.batches import Assignment, Batch
from cvt_hpc.study.ranks.launch import Team
from cvt_hpc.study.ranks.progress import Counter


def open_counter(team: Team) -> Counter:
    """Return the counter of a team, at zero."""
    if team.communicator is None:
        return Counter()
    from cvt_hpc.study.ranks.shared_counter import SharedCounter

    return SharedCounter(team.communicator)


def claimed_batches(
    plan: Sequence[Assignment],
    counter: Counter,
    may_claim: Callable[[], bool],
    fits: Callable[[Batch], bool],
) -> Iterator[Assignment]:
    """Yield the work of this rank, one batch at a time.

    Parameters
    ----------
    plan : sequence of Assignment
        All batches to be done, in the order in which they start; the same on all ranks.
    counter : Counter
        Where positions in `plan` are claimed.
    may_claim : callable
        Called before each batch; if it returns False, there are no more.
    fits : callable
        Whether there is time for a batch. A batch that does not fit is passed over, and no rank does it in
        this session; shorter ones stand later in the plan.
    """
    while may_claim():
        position = counter.claim()
        if position >= len(plan):
            return
        for place, part in enumerate(plan[position].parts()):
            if place > 0 and not may_claim():
                return
            if fits(part.runs):
                yield part
