"""Report of a study, one page to hand on: sentences, maps with values, failures, cost, quality."""

from cvt_hpc.report.page import write_report

__all__ = ["write_report"]
