"""Forces between an element's flanks and the sheaves at one station."""

from __future__ import annotations

import numpy as np

from cvt_hpc.kernels import merged_kernel
from cvt_hpc.lanes import fma, sqrt
from cvt_hpc.physics.friction import saturation

LEAST_SPEED = 1e-9  # [m/s]: below it the direction of sliding is of no effect, friction is linear there


@merged_kernel
def sliding(v_radial: float, v_tangential: float, cosine: float) -> tuple[float, float]:
    """Sliding speed in the plane of the flank and the part of it along the meridian.

    Parameters
    ----------
    v_radial, v_tangential : float
        Speed of the element against the sheave, radial and along the belt [m/s].
    cosine : float
        Cosine of the half wedge angle: the flank is inclined, so the meridian speed is v_radial / cosine.

    Returns
    -------
    speed, meridian : float
        |v| and v_meridian [m/s].
    """
    meridian = v_radial / cosine
    return max(np.sqrt(meridian * meridian + v_tangential * v_tangential), LEAST_SPEED), meridian


@merged_kernel
def flank_forces(
    coefficient: float,
    width: float,
    sine: float,
    cosine: float,
    axial: float,
    v_radial: float,
    v_tangential: float,
) -> tuple[float, float, float, float]:
    """Line forces of both flanks on the belt (Bullinger et al. 2005, eqs 37-39).

    Parameters
    ----------
    coefficient : float
        Friction law's value, without regularisation [1].
    width : float
        Regularisation speed [m/s].
    sine, cosine : float
        Of the half wedge angle.
    axial : float
        Axial line force f_ax of one flank, >= 0 [N/m].
    v_radial, v_tangential : float
        Speed of the element against the sheave [m/s].

    Returns
    -------
    radial, tangential : float
        Forces of both flanks, outward and along the belt [N/m].
    along, across : float
        Minus the slope of the friction force with speed, in the direction of sliding (law's value kept) and
        across it [N s/m^2]; both >= 0.
    """
    speed, meridian = sliding(v_radial, v_tangential, cosine)
    factor, slope = saturation(speed, width)
    mu = coefficient * factor
    share = mu * meridian / speed
    twice_normal = 2.0 * axial / (cosine + share * sine)
    radial = twice_normal * (sine - share * cosine)
    tangential = -twice_normal * mu * v_tangential / speed
    return radial, tangential, twice_normal * coefficient * slope, twice_normal * mu / speed


@merged_kernel
def tangential_sliding(v_element, w, turning, surface):
    """Speed of an element against the sheave along the belt [m/s], in lanes.

    Parameters
    ----------
    v_element
        Element's speed less the belt speed [m/s].
    w
        Its displacement [m].
    turning, surface
        Pulley's speed [rad/s] and that of its surface at the pitch radius, less the belt speed [m/s].
    """
    return v_element - fma(turning, w, surface)


@merged_kernel
def flank_sliding(v_radial, v_tangential, per_cosine):
    """`sliding` in lanes, from the reciprocal of the cosine; the speed has no least value here."""
    meridian = v_radial * per_cosine
    return sqrt(fma(meridian, meridian, v_tangential * v_tangential)), meridian


@merged_kernel
def flank_shares(mu, climb, sine, cosine):
    """Axial and radial force of a flank over its normal force (Bullinger et al. 2005, eqs 37-38), in lanes.

    Parameters
    ----------
    mu
        Coefficient of friction, with its regularisation [1].
    climb
        Share of the meridian in the sliding speed [1].
    sine, cosine
        Of the half wedge angle.
    """
    upward = mu * climb
    return fma(upward, sine, cosine), fma(-upward, cosine, sine)
