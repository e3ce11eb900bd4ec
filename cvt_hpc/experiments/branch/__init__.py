"""Bifurcation diagrams: steady states along the load, where they lose stability, and limit cycles."""

from cvt_hpc.experiments.branch.diagram import make
from cvt_hpc.experiments.branch.job import load, plan_lines

__all__ = ["load", "make", "plan_lines"]
