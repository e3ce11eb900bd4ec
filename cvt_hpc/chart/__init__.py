"""Speed against accuracy: what each method costs, what error it buys, and which error is the largest."""

import cvt_hpc.analysis  # noqa: F401  first: it keeps a user's settings out of matplotlib
from cvt_hpc.chart.loading import load_chart
from cvt_hpc.chart.making import ChartReport, make_chart
from cvt_hpc.chart.plan import Chart

__all__ = ["Chart", "ChartReport", "load_chart", "make_chart"]
