"""Laws of a stack of ring layers on the elements' saddles: how they press on each other, and how they rub.

Surfaces are counted from the saddle, 0, to that between the outermost layer and the elements' ears, n. The
forces per length g_k = (T_k - m_k v^2) kappa press layer k inward. Layers are in contact with a neighbour or
not: those that would leave the stack outward bear on the ears.
"""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import absolute, decay, fma, maximum, select
from cvt_hpc.physics.friction import saturation

LEAST_SLIDING = 1e-9  # [m/s]: below it friction is linear, and its slope the law's


@kernel
def stack_forces(inward: np.ndarray, normal: np.ndarray) -> None:
    """Normal line forces of the surfaces of a stack (Bullinger et al. 2005, eqs 44 and 48).

    Equilibrium of each layer is N_k - N_k+1 = g_k with N >= 0. Below the layer where the sum of g from the
    saddle on is largest all layers press inward, above it outward: N_k is that sum less the sum below surface
    k, and where every layer presses inward the sum of g from layer k outward.

    Parameters
    ----------
    inward : (n,) array
        g_k of the layers, innermost first [N/m].
    normal : (n + 1,) array
        Result: saddle, between layers, ears [N/m].
    """
    below = largest = 0.0
    for k in range(inward.size):
        normal[k] = -below
        below += inward[k]
        largest = max(largest, below)
    normal[inward.size] = -below
    normal += largest


@merged_kernel
def ring_coefficient(speed, kinetic, static_excess, per_stribeck, per_width):
    """Friction coefficient of the rings with the sign of sliding, and its slope where that is not negative.

    mu = mu_k (1 + (mu_s / mu_k - 1) exp(-|v| / v_st)) tanh(v / v_reg)

    Parameters
    ----------
    speed
        Sliding speed, any sign [m/s]; lanes or a plain number, as all that follow.
    kinetic, static_excess
        mu_k, and mu_s / mu_k - 1.
    per_stribeck, per_width
        1 / v_st, 1 / v_reg [s/m].

    Returns
    -------
    coefficient, slope
        [1], and its derivative by the tanh alone [s/m].
    """
    level = kinetic * fma(static_excess, decay(absolute(speed) * per_stribeck), 1.0)
    factor, slope = saturation(speed, per_width)
    return level * factor, level * slope


@merged_kernel
def resisting_slope(slope, drag, speed, inertia_rate):
    """Slope with which a linearised step of friction does not turn sliding about by itself [N s/m^2].

    The slope of the law, or, where friction would stop the surfaces' inertia within a step, as much of the
    secant drag / speed as that takes.

    Parameters
    ----------
    slope, drag, speed
        Of the law [N s/m^2], the line force [N/m] and the sliding speed [m/s].
    inertia_rate
        Reduced mass per length of what slides, over the step [N s/m^2].
    """
    secant = drag / select(absolute(speed) > LEAST_SLIDING, speed, LEAST_SLIDING)
    stiff = maximum(slope, secant - inertia_rate)
    return stiff
