"""Rings on the saddles, in lanes: friction along the belt, one law for both packages of an element.

The slip sigma = v - mean over both lines of t . p' grows by the speeds times (-t, -b a x t, 1). Along t
ring and element are free of each other but for friction, across it the ring goes with the element.
"""

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.models.pushbelt.friction import ring_friction
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import vectors as vec
from cvt_hpc.models.spatial_pushbelt.chain import motion


@register_jitable
def ring_slip(state, step, j, share):
    """Slip at the old speeds and a share of their change [m/s]."""
    (u, omega), (line, lever) = motion(state, j, share), vec.screw(step, j, f.RING_LINE)
    v = state[j, f.V] + share * state[j, f.CHANGE + f.ROW_V]
    return v - vec.dot(line, u) - vec.dot(lever, omega)


@kernel
def saddle_forces(belt, state, step, iterate):
    """Friction of an iterate, by the normal force of the last step; adds to the residuals."""
    for j in range(step.rows):
        slip = ring_slip(state, step, j, 1.0)
        grip, slope, dual = ring_friction(belt, slip, state[j, f.RING_SLIP], state[j, f.RING_DUAL])
        normal = state[j, f.SADDLE]
        force = normal * grip
        iterate[j, f.RING_SLOPE] = normal * slope
        state[j, f.RING_SLIP], state[j, f.RING_FRICTION], state[j, f.RING_DUAL] = slip, force, dual
        vec.add_screw(iterate, j, f.RESIDUAL, vec.both_times(force, vec.screw(step, j, f.RING_LINE)))
        iterate[j, f.RESIDUAL + f.ROW_V] -= force
