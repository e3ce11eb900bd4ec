"""The pin of each element in the hole of the next one, in lanes: what holds neighbours side by side.

The pin's centre P lies at the front of element i, the hole's centre at the rear of element j, both
`pin_height` above the saddle. Their offset across x_j is free up to the clearance in all directions;
beyond, the hole pushes back elastically and without friction, along the offset.

Its size grows by the speeds times (n, (P - r_i) x n) of element i and -(n, (P - r_j) x n) of j, n being its
direction. This is the contact of a circle with the ellipse in which its plane cuts the hole (Schindler
2008, eq. 25), but for the clearance times 1 - cos of the tilt between both: a nanometre at 3 mrad.
"""

from numba.extending import register_jitable

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import fma, maximum, sqrt
from cvt_hpc.models.spatial_pushbelt import fields as f
from cvt_hpc.models.spatial_pushbelt import vectors as vec
from cvt_hpc.physics.contact_laws import pressed

_LEAST = 1e-12  # offset that has a direction [m]


@register_jitable
def pin_offset(ri, xi, oi, rj, xj, oj, thickness, height):
    """Offset of pin and hole across x_j, its size [m], and P - r_i."""
    arm = vec.moved(vec.times(0.5 * thickness, xi), height, oi)
    d = vec.moved(vec.moved(vec.plus(vec.minus(ri, rj), arm), 0.5 * thickness, xj), -height, oj)
    d = vec.moved(d, -vec.dot(d, xj), xj)
    return d, sqrt(vec.dot(d, d)), arm


@kernel
def predict_pins(belt, state, step):
    """Gaps at q*, directions and levers at q_k."""
    thickness, height = belt.thickness, belt.pin_height
    for j in range(state.rows):
        ri, rj = vec.at(state, j, f.POSITION), vec.ahead(state, j, f.POSITION)
        xi, xj = vec.at(state, j, f.HEADING), vec.ahead(state, j, f.HEADING)
        oi, oj = vec.at(state, j, f.OUTWARD), vec.ahead(state, j, f.OUTWARD)
        d, size, arm = pin_offset(ri, xi, oi, rj, xj, oj, thickness, height)
        n = vec.times(1.0 / maximum(size, _LEAST), d)
        vec.store(step, j, f.PIN_NORMAL, n)
        vec.store(step, j, f.PIN_LEVER_I, vec.cross(arm, n))
        vec.store(step, j, f.PIN_LEVER_J, vec.cross(vec.plus(vec.minus(ri, rj), arm), n))
        si, sj = vec.at(step, j, f.PREDICTED_POSITION), vec.ahead(step, j, f.PREDICTED_POSITION)
        yi, yj = vec.at(step, j, f.PREDICTED_HEADING), vec.ahead(step, j, f.PREDICTED_HEADING)
        pi, pj = vec.at(step, j, f.PREDICTED_OUTWARD), vec.ahead(step, j, f.PREDICTED_OUTWARD)
        _, size, _ = pin_offset(si, yi, pi, sj, yj, pj, thickness, height)
        step[j, f.PIN_GAP] = belt.pin_clearance - size


@kernel
def pin_forces(belt, state, step, iterate, dt):
    """Forces and their slopes of an iterate; adds to the pairs' forces."""
    for j in range(step.rows):
        n = vec.at(step, j, f.PIN_NORMAL)
        a, b = vec.at(step, j, f.PIN_LEVER_I), vec.at(step, j, f.PIN_LEVER_J)
        wi, wj = vec.at(state, j, f.CHANGE + f.ROW_W), vec.ahead(state, j, f.CHANGE + f.ROW_W)
        du = vec.minus(vec.at(state, j, f.CHANGE), vec.ahead(state, j, f.CHANGE))
        parting = vec.dot(n, du) + vec.dot(a, wi) - vec.dot(b, wj)
        gap = fma(-dt, parting, step[j, f.PIN_GAP])
        force, k = pressed(gap, belt.pin_stiffness)
        state[j, f.PIN], iterate[j, f.PIN_REACHED], iterate[j, f.PIN_SLOPE] = force, gap, dt * k
        vec.add_screw(iterate, j, f.PAIR_I, vec.both_times(-force, (n, a)))
        vec.add_screw(iterate, j, f.PAIR_J, vec.both_times(force, (n, b)))
