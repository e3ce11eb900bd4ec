"""Contacts in lanes: one-sided contact, its share in a step, and friction's coefficient and memory.

Regularised friction has slopes by which Newton's method converges. A friction force mu N tanh(|v| / v_reg) v
/ |v| has a slope that is nearly zero where it slides and very steep where it sticks. Newton's method with
that slope goes back and forth between both. The primal-dual method of Chan, Golub and Mulet (1999) keeps the
direction h = v / q, q = |v| / tanh(|v| / v_reg), of each contact as an unknown of its own: the linearised
equation q h = v gives the slope mu N (1 - h q' v / |v|) / q, with q' = dq / d|v|, and the next h, cut off at
size 1.
"""

from numba.extending import register_jitable

from cvt_hpc.lanes import like, maximum, select, sqrt
from cvt_hpc.physics.friction import formula_coefficient, law_numbers, saturation

LEAST_SHARE_OF_WIDTH = 1e-3  # of v_reg: below it friction is linear to 3e-7


@register_jitable
def pressed(gap, stiffness):
    """Force [N] of a one-sided elastic contact at a gap [m], and its decrease by the gap [N/m]."""
    # in this order a gap that is not a number gives a force that is none
    return maximum(0.0, -stiffness * gap), select(gap < 0.0, like(stiffness, gap), 0.0)


@register_jitable
def coefficient(kind, kinetic, gradient, scale, speed):
    """Coefficient of friction [1] at sliding speeds >= 0 [m/s], and its slope [s/m]."""
    found = formula_coefficient(kind, law_numbers(kinetic, gradient, scale), speed)
    return found


@register_jitable
def remembered(filtered, size, memory, dt):
    """Filtered sliding speed at the end of a step [m/s], and its slope by the present one.

    Implicit Euler of memory v_f' = |v| - v_f [s], from v_f at the start and |v| [m/s] at the end.
    """
    share = dt / (dt + memory)
    return memory / (dt + memory) * filtered + share * size, share


@register_jitable
def taken(gap, change, stiffness, force):
    """Energy [J] that a step takes at a one-sided contact, by its mean gap and change [m], and its force [N].

    By a force of that gap alone it is 0 where the contact stays closed or open. Where it closes, the step
    gives what it takes where the contact opens as fast. Dampers are included.
    """
    before, after = maximum(0.5 * change - gap, 0.0), maximum(-0.5 * change - gap, 0.0)
    return 0.5 * stiffness * (before * before - after * after) - force * change


@register_jitable
def smoothed(size, regularisation):
    """1 / q [s/m] of a sliding speed's size [m/s], and q' over that size [s/m]."""
    size = maximum(size, LEAST_SHARE_OF_WIDTH * regularisation)
    factor, slope = saturation(size, 1.0 / regularisation)
    per_size = 1.0 / size
    return factor * per_size, (factor * per_size - slope) / (factor * factor)


@register_jitable
def dual_of(v, w, earlier_v, earlier_w, dual_v, dual_w, regularisation):
    """Dual of a sliding velocity [m/s] of two components, from velocity and dual of the iterate before."""
    per_q, bend = smoothed(sqrt(earlier_v * earlier_v + earlier_w * earlier_w), regularisation)
    along = (earlier_v * (v - earlier_v) + earlier_w * (w - earlier_w)) * bend
    dual_v, dual_w = (v - dual_v * along) * per_q, (w - dual_w * along) * per_q
    size = 1.0 / sqrt(maximum(dual_v * dual_v + dual_w * dual_w, 1.0))
    return dual_v * size, dual_w * size


@register_jitable
def friction(v, w, size, dual_v, dual_w, mu, mu_slope, regularisation):
    """Friction forces for each newton of normal force, and the slopes of each by both components [s/m].

    The sliding velocity has the components v, w [m/s] and the size `size`; `mu_slope` is by that size [s/m].
    """
    per_q, bend = smoothed(size, regularisation)
    a, b = v * per_q, w * per_q
    steep = mu * per_q
    along_v, along_w = bend * v, bend * w
    per_size = 1.0 / maximum(size, 1e-12)
    fall_v, fall_w = mu_slope * v * per_size, mu_slope * w * per_size
    return (
        mu * a,
        mu * b,
        steep * (1.0 - dual_v * along_v) + fall_v * a,
        fall_w * a - steep * dual_v * along_w,
        fall_v * b - steep * dual_w * along_v,
        steep * (1.0 - dual_w * along_w) + fall_w * b,
    )
