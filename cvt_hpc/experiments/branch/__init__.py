"""Bifurcation diagrams: steady states along the load, where they lose stability, and limit cycles."""

from cvt_hpc.experiments.branch.diagram import make_diagram
from cvt_hpc.experiments.branch.job import load_diagram

__all__ = ["load_diagram", "make_diagram"]
