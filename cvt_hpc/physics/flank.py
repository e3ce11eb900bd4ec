"""Forces between an element's flanks and the sheaves at one station, of plain numbers and of lanes."""

from cvt_hpc.kernels import merged_kernel
from cvt_hpc.lanes import fma, maximum, sqrt
from cvt_hpc.physics.friction import saturation

# Of the regularisation speed: below it the direction of sliding is of no effect, friction is linear there
LEAST_SHARE = 3e-8


@merged_kernel
def flank_sliding(v_radial, v_tangential, per_cosine):
    """Sliding speed |v| in the plane of the flank, and the part of it along the meridian [m/s].

    From the speed of the element against the sheave, radial and along the belt [m/s]. The flank is inclined:
    its meridian speed is v_radial times `per_cosine`, 1 / cosine of the half wedge angle.
    """
    meridian = v_radial * per_cosine
    return sqrt(fma(meridian, meridian, v_tangential * v_tangential)), meridian


@merged_kernel
def flank_shares(mu, climb, sine, cosine):
    """Axial and radial force of a flank over its normal force (Bullinger et al. 2005, eqs 37-38).

    From the coefficient of friction `mu` [1], with its regularisation, the share `climb` of the meridian in
    the sliding speed [1], and sine and cosine of the half wedge angle.
    """
    upward = mu * climb
    return fma(upward, sine, cosine), fma(-upward, cosine, sine)


@merged_kernel
def flank_forces(
    coefficient: float,
    width: float,
    sine: float,
    cosine: float,
    axial: float,
    v_radial: float,
    v_tangential: float,
) -> tuple[float, float]:
    """Line forces of both flanks on the belt, outward and along it [N/m] (Bullinger et al. 2005, eqs 37-39).

    From the friction law's `coefficient`, without regularisation [1], the regularisation speed `width` [m/s],
    sine and cosine of the half wedge angle, the axial line force of one flank `axial` >= 0 [N/m], and the
    speed of the element against the sheave, radial and along the belt [m/s].
    """
    speed, meridian = flank_sliding(v_radial, v_tangential, 1.0 / cosine)
    speed = maximum(speed, LEAST_SHARE * width)
    factor, _ = saturation(speed, 1.0 / width)
    mu = coefficient * factor
    axial_share, radial_share = flank_shares(mu, meridian / speed, sine, cosine)
    twice_normal = 2.0 * axial / axial_share
    return twice_normal * radial_share, -twice_normal * mu * v_tangential / speed


@merged_kernel
def tangential_sliding(v_element, w, turning, surface):
    """Speed of an element against the sheave along the belt [m/s].

    From the element's speed less the belt speed [m/s], its displacement `w` [m], the pulley's speed `turning`
    [rad/s] and that of its `surface` at the pitch radius, less the belt speed [m/s].
    """
    return v_element - fma(turning, w, surface)
