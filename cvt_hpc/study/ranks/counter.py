"""Data that ranks share while they compute: the next batch to claim, and the number of finished runs."""

from typing import NamedTuple, Self

INTERRUPTED = 2**40  # claims count from here when all are interrupted: beyond every plan


class Tally(NamedTuple):
    """How many runs of this session are finished, and how many of those failed."""

    finished: int
    failed: int


class Counter:
    """The one thing that ranks share while they compute; this one is of a process alone."""

    def __init__(self) -> None:
        self._next = 0
        self._tally = Tally(0, 0)

    def claim(self) -> int:
        """Return a position that no other claim gets: 0, 1, 2, ... over all ranks."""
        self._next += 1
        return self._next - 1

    def rewind(self) -> None:
        """Let claims begin at 0 again, unless all are interrupted; by one rank, while none claims."""
        self._next = 0 if self._next < INTERRUPTED else INTERRUPTED

    def report(self, finished: int, failed: int) -> None:
        """Count finished runs, and the failed ones among them."""
        self._tally = Tally(self._tally.finished + finished, self._tally.failed + failed)

    def tally(self) -> Tally:
        """Return the reports of all ranks."""
        return self._tally

    def interrupt_all(self) -> None:
        """Let no rank claim another batch, and let all stop their present one."""
        self._next = INTERRUPTED

    def is_interrupted(self) -> bool:
        """Return whether some rank has interrupted all."""
        return self._next >= INTERRUPTED

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *others: object) -> None:
        return
