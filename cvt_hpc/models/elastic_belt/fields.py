"""Layouts of the elastic belt's state, of its pulleys' laws and of its powers: rows and entries, by name."""

from collections.abc import Mapping


def names_from(first: str, constants: Mapping[str, object]) -> tuple[str, ...]:
    """Names in lower case of a module's constants, in their order, from the first to the last one so far."""
    names = list(constants)
    return tuple(name.lower() for name in names[names.index(first) :])


# Constants of the laws, in SI units: mobilities are 1 / J, or 1 / (T_1 k) of the driving sheave, 0 where the
# speed or the position is given; `tilt_rate` is 1 / T_1, 0 without a lag; `..._tilt` is kappa [m/N], and
# `..._free` is c [m]; `tracking` is how fast Q_0 follows, `need` [1/m] the force per torque at r.
DRIVING_MOBILITY, DRIVEN_MOBILITY, DRIVE_SLOPE, DRIVING_AXIAL_MOBILITY = range(4)
DRIVING_THRUST, DRIVING_SPRING_RATE, DRIVEN_SPRING_RATE, DRIVING_OIL, DRIVEN_OIL = range(4, 9)
TRACKING, RATIO_GAIN, RATIO_RATE, NEED, CLAMPING_GAIN, CLAMPING_RATE, LEAST_THRUST, MOST_THRUST = range(9, 17)
TILT_RATE, DRIVING_TILT, DRIVEN_TILT, DRIVING_FREE, DRIVEN_FREE = range(17, 22)
LAWS = names_from("DRIVING_MOBILITY", globals())

# States of the pulleys beside the driven one's speed and position: the excess of the driving pulley's speed
# over its course, and its opening above the one given; openings q of both grooves; the controllers'
# integrals.
EXCESS, SHIFT, DRIVING_COS, DRIVING_SIN, DRIVEN_COS, DRIVEN_SIN, RATIO_SUM, CLAMPING_SUM = range(8)
STATES = CLAMPING_SUM + 1

# Rows of a state
W, U, V_ELEMENT, V_RING, V_FILTERED, N_ELEMENT, N_RING = range(7)
FIELDS = names_from("W", globals())
# One more where elements tilt: their angle against the rings, forwards with the outer end [rad]
ELEMENT_TILT = len(FIELDS)

# Scalars of a state: the time, the driven pulley's two, the work of the layers' dampers until it is read [J],
# and from FIRST_STATE on STATES of the pulleys, which are 0 where a pulley does not have them
TIME, DRIVEN_SPEED, DRIVEN_POSITION, LAYER_WORK, FIRST_STATE = range(5)
SCALARS = FIRST_STATE + STATES

# Powers of an audit: terms of the balance [W], and the stored energy [J]
DRIVING_POWER, LOAD_POWER, THRUST_POWER, DRIVING_FLANK_LOSS, DRIVEN_FLANK_LOSS, RING_LOSS = range(6)
BELT_LOSS, LAYER_LOSS, LAG_LOSS, SEATING_LOSS, TILT_LOSS, STORED_ENERGY = range(6, 12)
POWERS = names_from("DRIVING_POWER", globals())
LOSSES = tuple(name for name in POWERS if name.endswith("_loss"))
