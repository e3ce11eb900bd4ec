"""Histories of chosen runs, a file each beside the records."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import numpy as np

from cvt_hpc.netcdf import store_history
from cvt_hpc.study.folder import StudyFolder
from cvt_hpc.study.record.index import Records
from cvt_hpc.variables import Status

if TYPE_CHECKING:
    import xarray as xr

    from cvt_hpc.job import Job


def keep_histories(folder: StudyFolder, histories: Iterable[tuple[int, xr.Dataset]]) -> None:
    """Write histories, by run index; before the records, so that a run on record has its history.

    Raises
    ------
    StorageError
        If the system refuses.
    """
    for index, history in histories:
        folder.make_histories()
        store_history(history, folder.history(index))


def leave_out_missing(job: Job, folder: StudyFolder, records: Records) -> None:
    """Mark runs as not recorded that are done, but lack a requested history; the logs stay.

    The history was requested later, or has been removed.
    """
    done = records.status == Status.DONE
    missing = [index for index in job.histories if done[index] and not folder.history(index).exists()]
    records.written[missing] = np.nan
    records.status[missing] = Status.NOT_RUN
