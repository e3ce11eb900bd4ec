"""The generalised-alpha method for y' = f(y) (Jansen, Whiting and Hulbert 2000), one implicit stage a step.

With y_f = y + alpha_f (y+ - y) and y'_m = y' + alpha_m (y'+ - y'), where y+ = y + h y' + h gamma (y'+ - y'),
a step solves y'_m = f(y_f). Elimination of y+ and y'+ leaves a step of the implicit Euler method,

    y_f = y_a + tau y'_m,    y_a = y + (alpha_f h - tau) y',    tau = h alpha_f gamma / alpha_m,

from which y+ = y + (y_f - y) / alpha_f and y'+ = y' + (y'_m - y') / alpha_m. Applied to positions as well as
to speeds of a mechanical system it does not overshoot (Kadapa, Dettmer and Peric 2017).
"""

from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel


class Scheme(NamedTuple):
    """Weights of a step: `generalised_alpha(rho)`, or (1, 1, 1), which is the implicit Euler method."""

    alpha_m: float
    alpha_f: float
    gamma: float


@register_jitable
def generalised_alpha(spectral_radius: float) -> Scheme:
    """The scheme of second order that damps vibrations which the step does not resolve.

    A step leaves the share `spectral_radius` of such a vibration, 0 to 1; 1 is the implicit midpoint rule.
    """
    alpha_m = 0.5 * (3.0 - spectral_radius) / (1.0 + spectral_radius)
    alpha_f = 1.0 / (1.0 + spectral_radius)
    return Scheme(alpha_m, alpha_f, 0.5 + alpha_m - alpha_f)


@kernel
def stage_length(scheme: Scheme, h: float) -> float:
    """The step tau [s] of a stage, of a whole step h [s]."""
    return scheme.alpha_f * scheme.gamma / scheme.alpha_m * h


@kernel
def begin(scheme: Scheme, h: float, value: np.ndarray, rate: np.ndarray, start: np.ndarray) -> None:
    """Put y_a in `start`, from y and y' at the begin of a step; arrays of one shape (n, m)."""
    share = scheme.alpha_f * h - stage_length(scheme, h)
    for i in range(value.shape[0]):
        for k in range(value.shape[1]):
            start[i, k] = value[i, k] + share * rate[i, k]


@kernel
def finish(
    scheme: Scheme, h: float, stage: np.ndarray, start: np.ndarray, value: np.ndarray, rate: np.ndarray
) -> None:
    """Turn y and y' at the begin of a step into those at its end, by y_f in `stage` and y_a in `start`."""
    tau = stage_length(scheme, h)
    for i in range(value.shape[0]):
        for k in range(value.shape[1]):
            value[i, k] += (stage[i, k] - value[i, k]) / scheme.alpha_f
            rate[i, k] += ((stage[i, k] - start[i, k]) / tau - rate[i, k]) / scheme.alpha_m
