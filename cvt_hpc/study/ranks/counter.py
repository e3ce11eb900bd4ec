"""Data that ranks share while they compute: the next batch to claim, and the number of finished runs."""

from __future__ import annotations

from typing import NamedTuple, Protocol, Self

INTERRUPTED = 2**40  # claims count from here when all are interrupted: beyond every plan


class Tally(NamedTuple):
    """How many runs of this session are finished, and how many of those failed."""

    finished: int
    failed: int


class Counter(Protocol):
    """The one thing that ranks share while they compute."""

    def claim(self) -> int:
        """Return a position that no other claim gets: 0, 1, 2, ... over all ranks."""

    def rewind(self) -> None:
        """Let claims begin at 0 again, unless all are interrupted; by one rank, while none claims."""

    def report(self, finished: int, failed: int) -> None:
        """Count finished runs, and the failed ones among them."""

    def tally(self) -> Tally:
        """Return the reports of all ranks."""

    def interrupt_all(self) -> None:
        """Let no rank claim another batch, and let all stop their present one."""

    def is_interrupted(self) -> bool:
        """Return whether some rank has interrupted all."""

    def __enter__(self) -> Self: ...

    def __exit__(self, kind: type[BaseException] | None, /, *others: object) -> None: ...


class SerialCounter:
    """The counter of a process alone."""

    def __init__(self) -> None:
        self._next = 0
        self._finished = 0
        self._failed = 0

    def claim(self) -> int:
        """Return the next position."""
        self._next += 1
        return self._next - 1

    def rewind(self) -> None:
        """Let claims begin at 0 again, unless interrupted."""
        self._next = 0 if self._next < INTERRUPTED else INTERRUPTED

    def report(self, finished: int, failed: int) -> None:
        """Count finished runs, and the failed ones among them."""
        self._finished += finished
        self._failed += failed

    def tally(self) -> Tally:
        """Return the reports."""
        return Tally(self._finished, self._failed)

    def interrupt_all(self) -> None:
        """Let no further position be one of a plan."""
        self._next = INTERRUPTED

    def is_interrupted(self) -> bool:
        """Return whether the sweep is interrupted."""
        return self._next >= INTERRUPTED

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *exception: object) -> None:
        return
