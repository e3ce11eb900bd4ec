"""Bifurcation diagrams: steady states along the load, where they lose stability, and limit cycles."""

import cvt_hpc.analysis  # noqa: F401  first: it keeps a user's settings out of matplotlib
from cvt_hpc.bifurcation.diagram import make_diagram
from cvt_hpc.bifurcation.job import load_diagram

__all__ = ["load_diagram", "make_diagram"]
