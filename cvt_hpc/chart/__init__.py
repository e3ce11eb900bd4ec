"""Speed against accuracy: cost and error of each method, and the largest source of error."""

import cvt_hpc.analysis  # noqa: F401  first: it keeps a user's settings out of matplotlib
from cvt_hpc.chart.loading import load_chart
from cvt_hpc.chart.making import ChartReport, make_chart
from cvt_hpc.chart.plan import Chart

__all__ = ["Chart", "ChartReport", "load_chart", "make_chart"]
