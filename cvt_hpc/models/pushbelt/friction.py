"""Friction at the flanks of elements and under the rings, in lanes, as an iterate of a step has it.

Forces are those of `physics.contact_laws`, for each newton of normal force. Their slopes take the direction
of friction from a dual, which the iterations carry on.
"""

from numba.extending import register_jitable

from cvt_hpc.lanes import absolute, like, select, sqrt
from cvt_hpc.physics.contact_laws import coefficient, dual_of, friction, remembered


@register_jitable(forceinline=True)
def flank_friction(belt, slip, earlier, dual, filtered, dt):
    """Return the dual of friction at a flank, both forces, and their four slopes [s/m], as lanes.

    Forces are along the meridian of the sheave and in the direction of rotation, slopes those of the first
    and of the second by both velocities. From the sliding velocity [m/s], velocity and dual of the iterate
    before, and the sliding speed at which the law was read at the start of the step [m/s].
    """
    along, around_it = slip
    dual_m, dual_t = dual_of(along, around_it, earlier[0], earlier[1], dual[0], dual[1], belt.friction_speed)
    size = sqrt(along * along + around_it * around_it)
    speed, share = remembered(filtered, size, belt.friction_memory, dt)
    mu, fall = coefficient(belt.flank_law, belt.flank_kinetic, belt.flank_gradient, belt.flank_speed, speed)
    forces = friction(along, around_it, size, dual_m, dual_t, mu, share * fall, belt.friction_speed)
    return (dual_m, dual_t), forces


@register_jitable(forceinline=True)
def filtered_slip(belt, along, around_it, normal, filtered, dt):
    """Sliding speed at which the law of a flank is read at the end of a step [m/s]."""
    size = sqrt(along * along + around_it * around_it)
    found, _ = remembered(filtered, size, belt.friction_memory, dt)
    return select(normal > 0.0, found, size)


@register_jitable(forceinline=True)
def ring_friction(belt, slip, earlier, dual):
    """Friction of the rings, its slope by the slip [s/m], and the dual, from those of the iterate before."""
    width, none = belt.ring_friction_speed, like(0.0, slip)
    dual, _ = dual_of(slip, none, earlier, none, dual, none, width)
    mu = like(belt.ring_friction, slip)
    grip, _, slope, _, _, _ = friction(slip, none, absolute(slip), dual, none, mu, none, width)
    return grip, slope, dual
