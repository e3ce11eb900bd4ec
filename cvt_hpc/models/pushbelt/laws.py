"""Laws of contacts in lanes: unilateral contact, and friction with slopes by which Newton's method converges.

A friction force mu N v / q, q = sqrt(v^2 + v_reg^2), has a slope that is nearly zero where it slides and very
steep where it sticks. Newton's method with that slope goes back and forth between both. The primal-dual
method of Chan, Golub and Mulet (1999) keeps the direction h = v / q of each contact as an unknown of its own:
the linearised equation q h = v gives the slope mu N (1 - h v / q) / q, and the next h, cut off at size 1.
"""

from __future__ import annotations

from numba.extending import register_jitable

from cvt_hpc.lanes import like, maximum, minimum, select, sqrt
from cvt_hpc.physics.friction import formula_coefficient, law_numbers


@register_jitable
def pressed(gap, stiffness):
    """Force [N] of a one-sided elastic contact at a gap [m], and its decrease by the gap [N/m]."""
    return maximum(-stiffness * gap, 0.0), select(gap < 0.0, like(stiffness, gap), 0.0)


@register_jitable
def coefficient(kind, kinetic, gradient, scale, speed):
    """Coefficient of friction [1] at sliding speeds >= 0 [m/s], and its slope [s/m]."""
    found = formula_coefficient(kind, law_numbers(kinetic, gradient, scale), speed)
    return found


@register_jitable
def sliding(v, earlier, dual, regularisation):
    """Size q of a sliding speed v [m/s] and its dual, from those of the iterate before."""
    square = regularisation * regularisation
    per_q = 1.0 / sqrt(earlier * earlier + square)
    dual = (v - dual * (earlier * (v - earlier)) * per_q) * per_q
    return sqrt(v * v + square), minimum(maximum(dual, -1.0), 1.0)


@register_jitable
def sliding_in_a_plane(v, w, earlier_v, earlier_w, dual_v, dual_w, regularisation):
    """`sliding` with two components of the speed."""
    square = regularisation * regularisation
    per_q = 1.0 / sqrt(earlier_v * earlier_v + earlier_w * earlier_w + square)
    along = (earlier_v * (v - earlier_v) + earlier_w * (w - earlier_w)) * per_q
    dual_v, dual_w = (v - dual_v * along) * per_q, (w - dual_w * along) * per_q
    size = 1.0 / sqrt(maximum(dual_v * dual_v + dual_w * dual_w, 1.0))
    return sqrt(v * v + w * w + square), dual_v * size, dual_w * size


@register_jitable
def friction(v, q, dual, mu):
    """Friction force for each newton of normal force at a sliding speed v [m/s], and its slope [s/m]."""
    per_q = 1.0 / q
    direction = v * per_q
    return mu * direction, mu * per_q * (1.0 - dual * direction)


@register_jitable
def friction_in_a_plane(v, w, q, dual_v, dual_w, mu, mu_slope):
    """`friction` with two components and a slope of mu: both forces, and the slopes of each by v and w."""
    per_q = 1.0 / q
    a, b = v * per_q, w * per_q
    steep = mu * per_q
    size = sqrt(v * v + w * w)
    fall = mu_slope * q / maximum(size, 1e-12)
    return (
        mu * a,
        mu * b,
        steep * (1.0 - dual_v * a) + fall * a * a,
        fall * a * b - steep * dual_v * b,
        fall * a * b - steep * dual_w * a,
        steep * (1.0 - dual_w * b) + fall * b * b,
    )
