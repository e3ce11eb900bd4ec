"""Places of the powers of an audit: terms of the balance [W], and the stored energy [J]."""

from cvt_hpc.models.elastic_belt.fields import names_from

DRIVING_POWER, LOAD_POWER, THRUST_POWER, DRIVING_FLANK_LOSS, DRIVEN_FLANK_LOSS, RING_LOSS = range(6)
BELT_LOSS, LAYER_LOSS, LAG_LOSS, SEATING_LOSS, TILT_LOSS, STORED_ENERGY = range(6, 12)
POWERS = names_from("DRIVING_POWER", globals())
LOSSES = tuple(name for name in POWERS if name.endswith("_loss"))
