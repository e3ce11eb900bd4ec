"""Contacts in lanes: one-sided contact, its share in a step, and friction's coefficient and memory."""

from numba.extending import register_jitable

from cvt_hpc.lanes import like, maximum, select
from cvt_hpc.physics.friction import formula_coefficient, law_numbers


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
def damped(gap, change, stiffness):
    """Energy [J] that a step takes at a one-sided contact, by the gap at its end and its mean change [m]."""
    now, before = maximum(-gap, 0.0), maximum(2.0 * change - gap, 0.0)
    return stiffness * (0.25 * (before * before - now * now) - now * change)
