"""Layouts of the elastic belt's state and of its pulleys' laws: rows and entries, by name."""

# Constants of the laws, in SI units: mobilities are 1 / J, or 1 / (T_1 k) of the driving sheave, 0 where the
# speed or the position is given; `tilt_rate` is 1 / T_1, 0 without a lag; `..._tilt` is kappa [m/N], and
# `..._free` is c [m]; `tracking` is how fast Q_0 follows, `need` [1/m] the force per torque at r.
LAWS = (
    "driving_mobility",
    "driven_mobility",
    "drive_slope",
    "driving_axial_mobility",
    "driving_thrust",
    "driving_spring_rate",
    "driven_spring_rate",
    "driving_oil",
    "driven_oil",
    "tracking",
    "ratio_gain",
    "ratio_rate",
    "need",
    "clamping_gain",
    "clamping_rate",
    "least_thrust",
    "most_thrust",
    "tilt_rate",
    "driving_tilt",
    "driven_tilt",
    "driving_free",
    "driven_free",
)
(
    DRIVING_MOBILITY,
    DRIVEN_MOBILITY,
    DRIVE_SLOPE,
    DRIVING_AXIAL_MOBILITY,
    DRIVING_THRUST,
    DRIVING_SPRING_RATE,
    DRIVEN_SPRING_RATE,
    DRIVING_OIL,
    DRIVEN_OIL,
    TRACKING,
    RATIO_GAIN,
    RATIO_RATE,
    NEED,
    CLAMPING_GAIN,
    CLAMPING_RATE,
    LEAST_THRUST,
    MOST_THRUST,
    TILT_RATE,
    DRIVING_TILT,
    DRIVEN_TILT,
    DRIVING_FREE,
    DRIVEN_FREE,
) = range(len(LAWS))

# States of the pulleys beside the driven one's speed and position: the excess of the driving pulley's speed
# over its course, and its opening above the one given; openings q of both grooves; the controllers'
# integrals.
STATES = (
    "driving_excess",
    "driving_shift",
    "driving_tilt_cos",
    "driving_tilt_sin",
    "driven_tilt_cos",
    "driven_tilt_sin",
    "ratio_integral",
    "clamping_integral",
)
EXCESS, SHIFT, DRIVING_COS, DRIVING_SIN, DRIVEN_COS, DRIVEN_SIN, RATIO_SUM, CLAMPING_SUM = range(len(STATES))

FIELDS = ("w", "u", "v_element", "v_ring", "v_filtered", "n_element", "n_ring")
W, U, V_ELEMENT, V_RING, V_FILTERED, N_ELEMENT, N_RING = range(len(FIELDS))
SCALARS = ("time", "driven_speed", "driven_position", "layer_work", *STATES)
TIME, DRIVEN_SPEED, DRIVEN_POSITION, LAYER_WORK = range(4)
FIRST_STATE = 4  # of the pulleys' states, which are 0 where a pulley does not have them
