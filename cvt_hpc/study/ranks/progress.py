"""How far a sweep is: a bar on a terminal, plain lines where the output goes to a file."""

from __future__ import annotations

import sys
import time
from contextlib import ExitStack

import numpy as np

from cvt_hpc.study.ranks.counter import Counter

_BAR_INTERVAL = 0.5  # [s]
_FIRST_LINE = 5.0  # [s]; lines then come less and less often, so that a day's output stays readable
_LAST_LINE = 60.0  # [s]


class Progress:
    """Shows on stderr how many runs all ranks have finished.

    Parameters
    ----------
    counter : Counter
        What the ranks report to.
    total : int
        Number of runs of the study.
    recorded, failed : int
        Number of runs that earlier sessions have recorded, and of the failed ones among them.
    visible : bool
        Whether anything is shown at all.
    costs : numpy.ndarray
        Predicted durations of the runs to be done, in any unit and in the order in which they are started.
    """

    def __init__(
        self, counter: Counter, total: int, recorded: int, failed: int, visible: bool, costs: np.ndarray
    ) -> None:
        self._counter = counter
        self._total = total
        self._recorded = recorded
        self._failed = failed
        self._started = self._shown = time.monotonic()
        self._visible = visible
        self._work = np.cumsum(costs)
        self._bar = None
        self._lines_above = ExitStack()  # where what is logged goes while the bar is there
        if visible and sys.stderr.isatty():
            from tqdm import tqdm
            from tqdm.contrib.logging import logging_redirect_tqdm

            self._bar = tqdm(total=total, initial=recorded, unit="run", dynamic_ncols=True)
            self._lines_above.enter_context(logging_redirect_tqdm())

    def expect(self, costs: np.ndarray) -> None:
        """Add runs to those that are to be done, after all of these; `costs` as before."""
        self._total += costs.size
        self._work = np.append(self._work, self._work[-1] + np.cumsum(costs))

    def show(self) -> None:
        """Show the state of things, if the last time is long enough ago."""
        if not self._visible:
            return
        now = time.monotonic()
        elapsed = now - self._started
        interval = _BAR_INTERVAL if self._bar is not None else min(max(_FIRST_LINE, elapsed / 20), _LAST_LINE)
        if now - self._shown >= interval:
            self._shown = now
            self._show(elapsed)

    def close(self) -> None:
        """Show the state at the end."""
        if not self._visible:
            return
        self._show(time.monotonic() - self._started)
        if self._bar is not None:
            self._bar.close()
            self._lines_above.close()

    def _show(self, elapsed: float) -> None:
        tally = self._counter.tally()
        finished, failed = self._recorded + tally.finished, self._failed + tally.failed
        if self._bar is not None:
            self._bar.total = self._total
            self._bar.set_postfix_str(f"{failed} failed", refresh=False)
            self._bar.update(finished - self._bar.n)
            self._bar.refresh()
            return
        share = finished / self._total if self._total else 1.0
        line = f"{finished}/{self._total} runs ({share:.1%}), {failed} failed"
        if tally.finished and elapsed > 0:
            rate = tally.finished / elapsed
            # The longest come first: by their number alone, too long a time would be left.
            done = self._work[tally.finished - 1]
            to_go = elapsed * (self._work[-1] - done) / done
            line += f", {rate:.3g} runs/s, {show_duration(to_go)} to go"
        print(line, file=sys.stderr, flush=True)


def show_duration(seconds: float) -> str:
    """Return a time span [s] as "h:mm:ss"."""
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}"
