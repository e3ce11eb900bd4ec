"""Sums of forces, speeds and their products at each station, for the fluctuations' audit."""

from cvt_hpc.kernels import merged_kernel
from cvt_hpc.lanes import LaneArray, fma, like
from cvt_hpc.models.elastic_belt.fields import names_from

# Line forces at stations [N/m] are those on their whole length. Of stations but for the stresses, which are
# the cells' behind them [N]; `saddle_friction` is [N], and powers are per length [W/m] but for `saddle_power`
# and `stress_power` [W]. Layers' speeds are as in `LaneState`, less the belt speed; radial and sliding
# speed are those in the groove, and the elements' speed across is w_t + v_0 w_s.
FLANK_POWER, RADIAL_FRICTION, TANGENTIAL_FRICTION, RADIAL_SPEED, SLIDING_SPEED = range(5)
ACROSS_SPEED, ACROSS_SPEED_SQUARED, SADDLE_POWER, SADDLE_FRICTION, SADDLE_SPEED = range(5, 10)
TRANSVERSE_POWER, TRANSVERSE_FORCE, TRANSVERSE_SPEED = range(10, 13)
ELEMENT_POWER, ELEMENT_FORCE, ELEMENT_SPEED, RING_SPEED = range(13, 17)
STRESS_POWER, RING_TENSION, PUSH_FORCE, PUSH_DAMPING = range(17, 21)
MOMENTS = names_from("FLANK_POWER", globals())


@merged_kernel
def add(profiles: LaneArray, j: int, k: int, value) -> None:
    """Add lanes of any precision to field k of station j."""
    profiles[j, k] = profiles[j, k] + like(value, profiles[j, k])


@merged_kernel
def add_flanks(profiles: LaneArray, j: int, radial, tangential, v_radial, v_tangential) -> None:
    """Friction of the flanks on the belt [N/m], and the speeds at which it works [m/s]."""
    add(profiles, j, FLANK_POWER, fma(radial, v_radial, tangential * v_tangential))
    add(profiles, j, RADIAL_FRICTION, radial)
    add(profiles, j, TANGENTIAL_FRICTION, tangential)
    add(profiles, j, RADIAL_SPEED, v_radial)
    add(profiles, j, SLIDING_SPEED, v_tangential)


@merged_kernel
def add_saddles(profiles: LaneArray, j: int, drag, sliding) -> None:
    """Friction of the elements' saddles on the rings [N], and the saddles' speed against them [m/s]."""
    add(profiles, j, SADDLE_POWER, drag * sliding)
    add(profiles, j, SADDLE_FRICTION, drag)
    add(profiles, j, SADDLE_SPEED, sliding)


@merged_kernel
def add_speeds(profiles: LaneArray, j: int, v_across, u, v_element, v_ring) -> None:
    """Speeds of a station [m/s]."""
    add(profiles, j, ACROSS_SPEED, v_across)
    add(profiles, j, ACROSS_SPEED_SQUARED, v_across * v_across)
    add(profiles, j, TRANSVERSE_SPEED, u)
    add(profiles, j, ELEMENT_SPEED, v_element)
    add(profiles, j, RING_SPEED, v_ring)


@merged_kernel
def add_forces(profiles: LaneArray, j: int, across, u, along, v_element) -> None:
    """Line forces that are no stresses: across the belt but for the contact's own, and along the elements."""
    add(profiles, j, TRANSVERSE_POWER, across * u)
    add(profiles, j, TRANSVERSE_FORCE, across)
    add(profiles, j, ELEMENT_POWER, along * v_element)
    add(profiles, j, ELEMENT_FORCE, along)


@merged_kernel
def add_stresses(profiles: LaneArray, j: int, power, tension, push, damped) -> None:
    """Power of the stresses [W], tension, push without its damper, and the damper's part [N]."""
    add(profiles, j, STRESS_POWER, power)
    add(profiles, j, RING_TENSION, tension)
    add(profiles, j, PUSH_FORCE, push)
    add(profiles, j, PUSH_DAMPING, damped)
