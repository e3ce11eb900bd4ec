"""Laws of a stack of ring layers on the elements' saddles: how they press on each other, and how they rub.

Surfaces are counted from the saddle, 0, to that between the outermost layer and the elements' ears, n. The
forces per length g_k = (T_k - m_k v^2) kappa press layer k inward. Layers are in contact with a neighbour or
not: layers that would leave the stack outward bear on the ears.
"""

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import absolute, fma, halving, maximum

_PER_LN_2 = 1.4426950408889634


@kernel
def stack_forces(inward: np.ndarray, normal: np.ndarray) -> None:
    """Normal line forces of the surfaces of a stack (Bullinger et al. 2005, eqs 44 and 48).

    Equilibrium of each layer is N_k - N_k+1 = g_k with N >= 0. Below the layer where the sum of g from the
    saddle on is largest all layers press inward, above it outward: N_k is that sum less the sum below surface
    k, and where every layer presses inward the sum of g from layer k outward. `inward` is g_k (n,), innermost
    first; the result goes into `normal` (n + 1,): saddle, between layers, ears [N/m].
    """
    below = largest = 0.0
    for k in range(inward.size):
        normal[k] = -below
        below += inward[k]
        largest = max(largest, below)
    normal[inward.size] = -below
    normal += largest


@merged_kernel
def ring_friction(speed, kinetic, falls, static_excess, per_stribeck, per_width, least):
    """Friction coefficient of the rings by the size of their sliding: its secant and its slope [s/m].

        mu = mu_k (1 + (mu_s / mu_k - 1) exp(-|v| / v_st)) tanh(|v| / v_reg)

    The secant is mu / |v|, the slope the derivative of mu by the tanh alone, which is not negative. All
    arguments but `falls` are lanes or plain numbers: the sliding speed, of any sign [m/s]; mu_k, or that
    times a normal force, which then is in the results; whether mu_s is larger than mu_k anywhere; mu_s / mu_k
    - 1; 1 / v_st and 1 / v_reg [s/m]; the sliding speed below which friction is linear, 1e-3 v_reg and less
    [m/s].
    """
    size = maximum(absolute(speed), least)
    level = kinetic
    if falls:
        level = kinetic * fma(static_excess, halving(size * (_PER_LN_2 * per_stribeck)), 1.0)
    # tanh(x) = (1 - e) / (1 + e) and its slope 4 e / (1 + e)^2, with e = e^-2x, and 1 / |v| by one division
    rest = halving(size * (2.0 * _PER_LN_2 * per_width))
    per_both = 1.0 / ((1.0 + rest) * size)
    per_sum = size * per_both
    secant = level * ((1.0 - rest) * per_both)
    slope = (level * (4.0 * per_width)) * (rest * per_sum * per_sum)
    return secant, slope
