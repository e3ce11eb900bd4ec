"""The transients that answer: those of the elastic belt, coarse or in full."""

from cvt_hpc.models.elastic_belt import transient

CHANNELS, batch = transient.CHANNELS, transient.batch
