"""The transients that answer: those of the elastic belt, coarse or in full."""

from cvt_hpc.models.elastic_belt.transient import batch

__all__ = ["batch"]
