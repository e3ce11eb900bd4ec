"""Many runs of one job: the grid, its schedule over MPI ranks, the durable record, and the dataset."""

from cvt_hpc.study.gather import gather, open_results
from cvt_hpc.study.ranks.launch import process_rank
from cvt_hpc.study.status import FailedRun, RunReport, StudyStatus, read_status
from cvt_hpc.study.sweep import check_start, run

__all__ = [
    "FailedRun", "RunReport", "StudyStatus", "check_start", "gather", "open_results", "process_rank",
    "read_status", "run",
]  # fmt: skip
