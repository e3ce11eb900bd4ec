"""The page of a study while a sweep is at work in its folder: written again and again, from the records."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

from cvt_hpc.analysis.conversion import standard
from cvt_hpc.report.page import Progress, write_report
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.gather import recorded_results
from cvt_hpc.study.status import StudyStatus, status_of

_PAUSE = 3.0  # times as long as a page takes, at least: the cores are for the sweep


def follow_report(
    path: Path, out: Path, every: float, rows: Callable[[StudyStatus], Sequence[tuple[str, str]]]
) -> Path:
    """Write the page of a study every so often [s] until no sweep is at work, or until Ctrl-C.

    The time between two pages is longer where a page takes long. The last page is as `write_report` makes it;
    a second Ctrl-C leaves the one before it. `rows` tells the status of the study, by names and values.
    InputError if `path` is not the folder of a run, or the system refuses.
    """
    folder, is_left = StudyFolder(path), False
    while True:
        try:
            began = time.monotonic()
            study = folder.load()
            is_running = folder.is_in_use()  # before the records are read, which are then all
            records = folder.read_records(study)
            status = status_of(folder, records, is_running)
            made = time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime())
            share = 1.0 - status.left / status.total
            lasting = None if is_left or not is_running else every
            with recorded_results(records) as dataset:
                told = [*rows(status), *(("warning", line) for line in status.warnings)]
                progress = Progress(told, share, made, lasting)
                write_report(standard(dataset, str(path)), out, str(path), path, progress=progress)
            if lasting is None:
                return out
            time.sleep(max(every, _PAUSE * (time.monotonic() - began)))
        except KeyboardInterrupt:
            if is_left:
                raise
            is_left = True
