"""Rings on the saddles, in lanes: friction along the belt, one law for both packages of an element.

The slip sigma = v - mean over both lines of t . p' grows by the speeds times (-t, -b a x t, 1). Along t
ring and element are free of each other but for friction, across it the ring goes with the element.
"""

from __future__ import annotations

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.models.pushbelt.friction import ring_friction
from cvt_hpc.models.spatial_pushbelt.belt import (
    CHANGE,
    RESIDUAL,
    RING_DUAL,
    RING_FRICTION,
    RING_LINE,
    RING_SLIP,
    RING_SLOPE,
    SADDLE,
    SPEED,
)
from cvt_hpc.models.spatial_pushbelt.rotations import accumulate, dot, moved, times, vector


@register_jitable
def ring_slip(state, step, j, share):
    """Slip at the old speeds and a share of their change [m/s]."""
    u = moved(vector(state, j, SPEED), share, vector(state, j, CHANGE))
    omega = moved(vector(state, j, SPEED + 3), share, vector(state, j, CHANGE + 3))
    v = state[j, SPEED + 6] + share * state[j, CHANGE + 6]
    return v - dot(vector(step, j, RING_LINE), u) - dot(vector(step, j, RING_LINE + 3), omega)


@kernel
def saddle_forces(belt, state, step, iterate):
    """Friction of an iterate, by the normal force of the last step; adds to the residuals."""
    for j in range(step.rows):
        slip = ring_slip(state, step, j, 1.0)
        grip, slope, dual = ring_friction(belt, slip, state[j, RING_SLIP], state[j, RING_DUAL])
        normal = state[j, SADDLE]
        force = normal * grip
        iterate[j, RING_SLOPE] = normal * slope
        state[j, RING_SLIP], state[j, RING_FRICTION], state[j, RING_DUAL] = slip, force, dual
        accumulate(iterate, j, RESIDUAL, times(force, vector(step, j, RING_LINE)))
        accumulate(iterate, j, RESIDUAL + 3, times(force, vector(step, j, RING_LINE + 3)))
        iterate[j, RESIDUAL + 6] -= force
