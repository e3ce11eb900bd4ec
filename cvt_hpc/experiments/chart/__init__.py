"""Speed against accuracy: cost and error of each method, and the largest source of error."""

from cvt_hpc.experiments.chart.loading import load_chart
from cvt_hpc.experiments.chart.making import make_chart

__all__ = ["load_chart", "make_chart"]
