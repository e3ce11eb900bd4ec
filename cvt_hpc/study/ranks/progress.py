"""Progress of a sweep, chart or diagram: a bar on a terminal, plain lines where the output goes to a file.

Ranks share the next batch to claim and the number of finished runs: `Counter`.
"""

import math
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from dataclasses import InitVar, dataclass
from typing import NamedTuple, Self

import numpy as np

INTERRUPTED = 2**40  # claims count from here when all are interrupted: beyond every plan

_BAR_INTERVAL = 0.5  # [s]
_FIRST_LINE = 5.0  # [s]; lines then come less and less often, so that a day's output stays readable
_LAST_LINE = 60.0  # [s]
# without the time that tqdm expects by numbers alone: the longest come first
_BAR = "{l_bar}{bar}| {n_fmt}/{total_fmt} [{elapsed}, {rate_fmt}{postfix}]"


class Tally(NamedTuple):
    """Numbers of the runs of this session that are finished, and of those that failed."""

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


@dataclass
class Progress:
    """Shows on stderr how many runs all ranks have finished."""

    counter: Counter  # to which the ranks report
    total: int  # number of runs of the study
    recorded: int  # number of runs that earlier sessions have recorded
    failed: int  # number of failed ones among them
    visible: bool  # whether anything is shown at all
    # predicted durations of the runs to be done, in any unit and in the order in which they are started
    costs: InitVar[np.ndarray]
    unit: str = "run"  # name of the things that are counted

    def __post_init__(self, costs: np.ndarray) -> None:
        self._started = self._shown = time.monotonic()
        self._work = np.cumsum(costs)
        self._bar = None
        self._lines_above = ExitStack()  # where log messages go while the bar is shown
        if self.visible and sys.stderr.isatty():
            from tqdm import tqdm
            from tqdm.contrib.logging import logging_redirect_tqdm

            options = {"unit": self.unit, "dynamic_ncols": True, "bar_format": _BAR}
            self._bar = tqdm(total=self.total, initial=self.recorded, **options)
            self._lines_above.enter_context(logging_redirect_tqdm())

    def expect(self, costs: np.ndarray) -> None:
        """Add runs behind the runs that are to be done; `costs` as before."""
        self.total += costs.size
        self._work = np.append(self._work, self._work[-1] + np.cumsum(costs))

    def show(self) -> None:
        """Show the state of things, if the last time is long enough ago."""
        if not self.visible:
            return
        now = time.monotonic()
        elapsed = now - self._started
        interval = _BAR_INTERVAL if self._bar is not None else min(max(_FIRST_LINE, elapsed / 20), _LAST_LINE)
        if now - self._shown >= interval:
            self._shown = now
            with suppress(OSError):  # the terminal is gone
                self._show(elapsed)

    def tell(self, line: str, tell: Callable[[str], None]) -> None:
        """Print a line, above the bar where there is one."""
        if self._bar is None:
            tell(line)
            return
        with self._bar.external_write_mode(sys.stderr):
            tell(line)

    def to_go(self) -> str:
        """Return the time for the remaining runs, as ", 0:01:00 to go".

        "" before anything has ended, and where none is known to remain: a trace may add runs, and a run that
        is recorded may be prolonged.
        """
        done, elapsed = self.counter.tally().finished, time.monotonic() - self._started
        if not 0 < done < self._work.size or elapsed <= 0.0:
            return ""
        # by their number alone, too long a time would be left
        work = self._work[done - 1]
        return f", {show_duration(elapsed * (self._work[-1] - work) / work)} to go"

    def close(self) -> None:
        """Show the state at the end."""
        if not self.visible:
            return
        with self._lines_above, suppress(OSError):
            self._show(time.monotonic() - self._started)
            if self._bar is not None:
                self._bar.close()

    def _show(self, elapsed: float) -> None:
        tally = self.counter.tally()
        finished, failed = self.recorded + tally.finished, self.failed + tally.failed
        if self._bar is not None:
            self._bar.total = self.total
            self._bar.set_postfix_str(f"{failed} failed{self.to_go()}", refresh=False)
            self._bar.update(finished - self._bar.n)
            self._bar.refresh()
            return
        share = finished / self.total if self.total else 1.0
        line = f"{finished}/{self.total} {self.unit}s ({share:.1%}), {failed} failed"
        if tally.finished and elapsed > 0:
            line += f", {tally.finished / elapsed:.3g} {self.unit}s/s{self.to_go()}"
        print(line, file=sys.stderr, flush=True)


class Steps:
    """Reports things done one after the other by one process: a line for each, and the remaining time.

    On a terminal the lines stand above a bar.

    Parameters
    ----------
    costs : sequence of float
        Predicted durations of the things left to do, in any unit and in the order in which they are done;
        those that are not known (nan) count as the mean of the others.
    done : int
        Number of things that were done before.
    unit : str
        Name of the things that are counted.
    tell : callable
        Given each line.
    """

    def __init__(self, costs: Sequence[float], done: int, unit: str, tell: Callable[[str], None]) -> None:
        known = [cost for cost in costs if not math.isnan(cost)] or [1.0]
        mean = max(sum(known) / len(known), 1e-9)
        filled = np.array([mean if math.isnan(cost) else max(cost, 1e-3 * mean) for cost in costs])
        self._total, self._before, self._tell = done + len(costs), done, tell
        self._counter = Counter()
        visible = bool(costs) and sys.stderr.isatty()
        self._progress = Progress(self._counter, self._total, done, 0, visible, filled, unit)

    def ended(self, line: str, *, failed: bool = False) -> None:
        """Report that the next thing has ended, and how."""
        self._counter.report(1, int(failed))
        tally: Tally = self._counter.tally()
        count = f"{self._before + tally.finished}/{self._total}"
        self._progress.tell(f"{count} {line}{self._progress.to_go()}", self._tell)
        self._progress.show()

    def close(self) -> None:
        """Leave the bar, if any, as it is at the end."""
        self._progress.close()


def show_duration(seconds: float) -> str:
    """Return a time span [s] as "h:mm:ss"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
