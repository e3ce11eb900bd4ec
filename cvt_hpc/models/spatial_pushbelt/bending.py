"""Lateral bending of the ring packages in lanes: shear and change of slope from element to element.

Shear (z_j - z_i) / h - (psi_i + psi_j) / 2 and change of slope psi_j - psi_i have constant directions. Both
laws act at the mean BETA q_{k+1} + (1 - 2 BETA) q_k + BETA q_{k-1}: with BETA 1/4 the step is stable for
any stiffness and damps nothing, and the frequency f of a mode errs by -(2 pi f dt)^2 / 12 of itself. So
does the spring that turns an element with the ring's slope.
"""

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import ahead
from cvt_hpc.models.spatial_pushbelt import fields as f

BETA = 0.25


@register_jitable
def bending_slopes(belt, dt):
    """Increase of the shear force by the rate of shear, and of the moment by the rate of change of slope."""
    return BETA * dt * belt.ring_shear * belt.pitch, BETA * dt * belt.ring_bending / belt.pitch


@kernel
def predict_bending(belt, state, step):
    """Shear and change of slope at q_k."""
    per_pitch = 1.0 / belt.pitch
    for j in range(state.rows):
        here, there = state[j, f.SLOPE], ahead(state, j, f.SLOPE)
        rise = ahead(state, j, f.POSITION + f.AXIAL) - state[j, f.POSITION + f.AXIAL]
        step[j, f.SHEAR] = per_pitch * rise - 0.5 * (here + there)
        step[j, f.BEND] = there - here


@kernel
def bending_forces(belt, state, step, iterate, dt):
    """Add to the pairs' forces."""
    per_pitch = 1.0 / belt.pitch
    for_shear, for_bend = belt.ring_shear * belt.pitch, belt.ring_bending / belt.pitch
    steep, steep_bend = bending_slopes(belt, dt)
    for j in range(step.rows):
        here, there = state[j, f.CHANGE + f.ROW_P], ahead(state, j, f.CHANGE + f.ROW_P)
        rise = ahead(state, j, f.CHANGE + f.AXIAL) - state[j, f.CHANGE + f.AXIAL]
        shear = for_shear * step[j, f.SHEAR] + steep * (per_pitch * rise - 0.5 * (here + there))
        moment = for_bend * step[j, f.BEND] + steep_bend * (there - here)
        force = per_pitch * shear
        iterate[j, f.PAIR_I + f.AXIAL] += force
        iterate[j, f.PAIR_J + f.AXIAL] -= force
        iterate[j, f.PAIR_I + f.ROW_P] = 0.5 * shear + moment
        iterate[j, f.PAIR_J + f.ROW_P] = 0.5 * shear - moment
