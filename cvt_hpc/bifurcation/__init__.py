"""Bifurcation diagrams: steady states along the load, where they lose stability, and limit cycles."""

from cvt_hpc.bifurcation.asking import load_diagram
from cvt_hpc.bifurcation.making import make_diagram

__all__ = ["load_diagram", "make_diagram"]
