"""The ladder of models beside each other: what each answers, how well, and what it costs."""

from cvt_hpc.experiments.ladder.loading import load, plan_lines
from cvt_hpc.experiments.ladder.making import make

__all__ = ["load", "make", "plan_lines"]
