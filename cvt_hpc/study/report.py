"""How a sweep ended, for people and for the exit status."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.study.description import Study
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.index import Records
from cvt_hpc.variables import Status, Vibrates

# exit statuses; 2 is bad input, raised as InputError
DONE, SOME_FAILED, STALLED, STOPPED = 0, 1, 98, 99


@dataclass(frozen=True)
class FailedRun:
    """A run that ended without results.

    Attributes
    ----------
    index : int
        Its place in the grid, in C order, or among the samples.
    at : dict
        Values of the axes there, by name [SI].
    place : str
        The same for people, in the units of the job.
    status : str
        How it failed, e.g. "failed_numerics".
    reason : str
        Why.
    """

    index: int
    at: dict[str, Any]
    place: str
    status: str
    reason: str


@dataclass(frozen=True)
class RunReport:
    """How a sweep, or a part of one, ended; the same on all ranks.

    Attributes
    ----------
    out : Path
        The output folder.
    results : Path or None
        The dataset in it; None where another part is at work, and will gather it.
    total, done, remaining : int
        Number of runs, of the part where one was requested: all, with results, not yet run. While runs of a
        trace remain, it may require more.
    failed : tuple of FailedRun
        The runs that ended without results.
    stopped : str or None
        Why the sweep ended early: the name of a signal, or "time limit". A signal may come when all runs are
        done: then what was to follow must not begin.
    gained : int
        Number of runs recorded since this start.
    unneeded : int
        Number of cells of the grid that a trace does not run.
    undecided, slipping, irregular : int
        Number of runs with results that were too short to be decided, under more load than friction carries,
        and of irregular motion.
    """

    out: Path
    results: Path | None
    total: int
    done: int
    failed: tuple[FailedRun, ...]
    remaining: int
    stopped: str | None
    gained: int
    unneeded: int = 0
    undecided: int = 0
    slipping: int = 0
    irregular: int = 0

    @property
    def exit_status(self) -> int:
        """Return 0 if all runs are done, 1 if some failed, 99 if some remain: the same command continues.

        98 if some remain and none has ended since the start: the same command may get no further.
        """
        if self.remaining:
            return STOPPED if self.gained else STALLED
        return SOME_FAILED if self.failed else DONE

    @property
    def status_of_more(self) -> int | None:
        """Return the exit status if what was to follow must not begin, None if it may."""
        if self.remaining:
            return self.exit_status
        return STOPPED if self.stopped else None


def build_report(
    folder: StudyFolder,
    study: Study,
    records: Records,
    asked: np.ndarray,
    gathered: bool,
    gained: int,
    stopped: str | None,
) -> RunReport:
    """Return the report of a sweep of the runs marked in `asked`, shape (runs,)."""
    status = records.status
    without_results = np.flatnonzero(asked & records.recorded & (status != Status.DONE))
    reasons = records.read(without_results, "reason")
    failed = tuple(
        FailedRun(
            index=int(index),
            at=study.place(int(index)),
            place=study.place_in_words(int(index)),
            status=Status(status[index]).name.lower(),
            reason=reason.decode(errors="replace"),
        )
        for index, reason in zip(without_results, reasons, strict=True)
    )
    return RunReport(
        out=folder.path,
        results=folder.results if gathered else None,
        total=int(asked.sum()),
        done=int((asked & records.recorded & (status == Status.DONE)).sum()),
        failed=failed,
        remaining=int((asked & ~records.recorded).sum()),
        stopped=stopped,
        gained=gained,
        unneeded=int((~asked).sum()) if study.is_traced else 0,
        **count_special(records, asked),
    )


def count_special(records: Records, asked: np.ndarray | None = None) -> dict[str, int]:
    """Return how many runs with results are no plain yes or no, among those marked in `asked`, or all."""
    is_done = records.status == Status.DONE
    done = np.flatnonzero(is_done if asked is None else is_done & asked)
    verdicts = records.read(done, "vibrates")
    kinds = {
        "undecided": Vibrates.UNDECIDED,
        "slipping": Vibrates.SLIPS,
        "irregular": Vibrates.IRREGULAR,
    }
    return {name: int((verdicts == verdict).sum()) for name, verdict in kinds.items()}
