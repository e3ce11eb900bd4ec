"""A transient run of the quasi-static belt."""

from cvt_hpc.models.elastic_belt.sampling import CHANNELS
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.quasi_static_belt.split_run import SplitRun as Transient

__all__ = ["CHANNELS", "TAKES_OVER", "Transient", "batch"]

TAKES_OVER = True  # runs continue from the state of others

batch = batches_of_one(Transient)
