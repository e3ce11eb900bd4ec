"""Where the powers of an audit stand: terms of the balance [W], and the stored energy [J]."""

POWERS = (
    "driving_power",
    "load_power",
    "thrust_power",
    "driving_flank_loss",
    "driven_flank_loss",
    "ring_loss",
    "belt_loss",
    "layer_loss",
    "lag_loss",
    "seating_loss",
    "stored_energy",
)
(
    DRIVING_POWER,
    LOAD_POWER,
    THRUST_POWER,
    DRIVING_FLANK_LOSS,
    DRIVEN_FLANK_LOSS,
    RING_LOSS,
    BELT_LOSS,
    LAYER_LOSS,
    LAG_LOSS,
    SEATING_LOSS,
    STORED_ENERGY,
) = range(len(POWERS))
