"""Speed against accuracy: cost and error of each method, and the largest source of error."""

from cvt_hpc.experiments.chart.loading import load
from cvt_hpc.experiments.chart.making import make
from cvt_hpc.experiments.chart.measuring import plan_lines

__all__ = ["load", "make", "plan_lines"]
