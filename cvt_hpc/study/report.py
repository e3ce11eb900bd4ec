"""How a sweep ended, for people and for the exit status."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from cvt_hpc.study.description import Study
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.records import Records
from cvt_hpc.variables import Status

DONE, SOME_FAILED, STOPPED = 0, 1, 99  # exit statuses; 2 is bad input, raised as InputError


@dataclass(frozen=True)
class FailedRun:
    """A run that ended without results.

    Attributes
    ----------
    index : int
        Its place in the grid, in C order.
    at : dict
        Values of the axes there, by name [SI].
    status : str
        How it failed, e.g. "failed_numerics".
    reason : str
        Why.
    """

    index: int
    at: dict[str, Any]
    status: str
    reason: str


@dataclass(frozen=True)
class RunReport:
    """How a sweep ended; the same on all ranks.

    Attributes
    ----------
    out, results : Path
        The output folder, and the dataset in it.
    total, done, remaining : int
        Number of runs: all, with results, not yet run.
    failed : tuple of FailedRun
        The runs that ended without results.
    stopped : str or None
        Why the sweep ended early: the name of a signal, or "time limit".
    """

    out: Path
    results: Path
    total: int
    done: int
    failed: tuple[FailedRun, ...]
    remaining: int
    stopped: str | None

    @property
    def exit_status(self) -> int:
        """Return 0 if all runs are done, 1 if some failed, 99 if some remain: the same command goes on."""
        if self.remaining:
            return STOPPED
        return SOME_FAILED if self.failed else DONE


def build_report(folder: StudyFolder, study: Study, records: Records, stopped: str | None) -> RunReport:
    """Return the report of a sweep that left these records."""
    status = records.status
    without_results = np.flatnonzero(records.recorded & (status != Status.DONE))
    reasons = records.read(without_results, "reason")
    failed = tuple(
        FailedRun(
            index=int(index),
            at=study.place(int(index)),
            status=Status(status[index]).name.lower(),
            reason=reason.decode(errors="replace"),
        )
        for index, reason in zip(without_results, reasons, strict=True)
    )
    return RunReport(
        out=folder.path,
        results=folder.results,
        total=study.size,
        done=int((status == Status.DONE).sum()),
        failed=failed,
        remaining=int((~records.recorded).sum()),
        stopped=stopped,
    )
