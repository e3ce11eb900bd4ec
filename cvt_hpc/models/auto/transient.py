"""The transients that answer: those of the elastic belt, coarse or in full."""

from cvt_hpc.models.elastic_belt.transient import CHANNELS, batch

__all__ = ["CHANNELS", "batch"]
