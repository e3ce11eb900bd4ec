"""Parameters found by the targets that they are to meet: candidates run as a sweep, an optimiser between."""

from cvt_hpc.experiments.fit.loading import load
from cvt_hpc.experiments.fit.making import make, plan_lines

__all__ = ["load", "make", "plan_lines"]
