"""A sheave whose collar tilts freely before it bears: the effect of a clearance on the contact of a wrap.

With the clearance c, as opening of the groove [m], collar and shaft open it by q = (q_1, q_2), in the
notation of `compliance.py` and with the collar's compliance kappa = a r^2 / c_tilt,

    q = (kappa + c / |s|) s,   s = sum_k U_k h_k f_k;   |q| <= c where s = 0.

For a given set of closed stations the forces are linear in an opening c p that is added, p = s / |s|, and
so is the tilting force of the sheave: s = s_0 - L p, with s_0 that without clearance, L = c M (I + kappa
M)^-1 and M the stiffness of the closed stations against tilting [N/m]. With sigma = |s| that is one equation
in one number,

    (sigma I + L) p = s_0,   |p| = 1.

L is symmetric and positive semi-definite, so |p| falls with sigma and 1 / |p| is concave: the "secular
equation" of a trust region (Conn, Gould and Toint 2000, sec. 7.3). Newton's iteration for 1 / |p| = 1 then
rises to the root from any number below it and never passes it. It begins at |s_0| less the larger eigenvalue
of L, mostly takes one or two steps and knows nothing of the last time step. It ends where |p| is 1 within
`error`: the opening by the clearance is too large by that share at most.

**Within the clearance** the sheave does not bear. A wrap of less than half a turn is there without load only,
and with a single closed station q is not unique: the sheave hangs loose. So sigma is kept above a `least`
load, the round-off of the forces: a spring of the stiffness least / c holds the sheave in the middle of its
clearance, and |s| <= least stands for s = 0.

The search for the closed set ends as without clearance. c |s| is convex, so that the forces minimise a
strictly convex function; with any stations held open or closed they are unique, and no more is needed of the
matrix for Murty's argument.
"""

from typing import Any

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import anywhere, fma, maximum, select, sqrt

# Slowest is a load at the edge of the clearance, where closed stations hardly resist one way of tilting: the
# deviation then falls by 2.3 a step down to the least load.
MOST_STEPS = 60
TINY = 1e-30


@kernel
def principal_axes(one: Any, between: Any, other: Any) -> tuple[Any, Any, Any, Any]:
    """Direction of the larger eigenvalue of ((one, between), (between, other)), and both, none below 0.

    Cosine, sine, the larger and the lesser eigenvalue: numbers or lanes.
    """
    half = 0.5 * (one - other)
    apart = sqrt(fma(half, half, between * between))
    larger = 0.5 * (one + other) + apart
    lesser = maximum(one * other - between * between, 0.0) / maximum(larger, TINY)
    # of two multiples of the direction the one without cancellation
    lies = half >= 0.0
    along, across = select(lies, apart + half, between), select(lies, between, apart - half)
    size = sqrt(fma(along, along, across * across))
    per_size = 1.0 / maximum(size, TINY)
    return select(size > TINY, along * per_size, 1.0), across * per_size, larger, lesser


@kernel
def bearing_direction(
    one: Any, other: Any, larger: Any, lesser: Any, least: Any, error: Any
) -> tuple[Any, Any, Any]:
    """Direction p of the sheave that bears, a unit vector within `error`, or shorter within its clearance.

    From s_0 = (one, other) in the principal axes of L and the eigenvalues `larger` and `lesser` of L [N];
    from the load `least` on [N] the sheave bears. Returns p_1, p_2 in these axes, and whether |p| is still
    beyond `error`.
    """
    load = maximum(sqrt(fma(one, one, other * other)) - larger, least)
    for _ in range(MOST_STEPS):
        p_1, p_2, size = _directed(one, other, load + larger, load + lesser)
        if not anywhere(size - 1.0 > error):
            break
        slope = fma(p_1, p_1 / (load + larger), p_2 * (p_2 / (load + lesser)))
        risen = load + (size - 1.0) * (size * size / slope)
        load = select(size - 1.0 > error, risen, load)
    p_1, p_2, size = _directed(one, other, load + larger, load + lesser)
    return p_1, p_2, size - 1.0 > error


@kernel
def _directed(one: Any, other: Any, stiff: Any, soft: Any) -> tuple[Any, Any, Any]:
    p_1, p_2 = one / stiff, other / soft
    return p_1, p_2, sqrt(fma(p_1, p_1, p_2 * p_2))
