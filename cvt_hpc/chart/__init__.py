"""Speed against accuracy: what each method costs, what error it buys, and which error is the largest."""

from cvt_hpc.chart.loading import load_chart
from cvt_hpc.chart.making import ChartReport, make_chart
from cvt_hpc.chart.plan import Chart

__all__ = ["Chart", "ChartReport", "load_chart", "make_chart"]
