"""The job file's schema and its loader: the only room that validates input."""

from cvt_hpc.job.axes import Axis
from cvt_hpc.job.definition import Job
from cvt_hpc.job.loading import build_job, load_job, rebuild_job, stored_job
from cvt_hpc.job.schema import known_keys

__all__ = ["Axis", "Job", "build_job", "known_keys", "load_job", "rebuild_job", "stored_job"]
