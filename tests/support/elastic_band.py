"""A drive by one elastic band with mass on rigid sheaves: closed formulas of its running equilibrium.

The band carries the same mass flow m v_0 everywhere and is stretched to v = v_0 (1 + F / EA). It enters each
pulley with the speed of its rim and keeps it, so that its force there is EA (r omega / v_0 - 1), until it
slips over an arc at the exit, where Euler and Eytelwein's formula holds for the force beyond K = m v_0^2 EA /
(EA - m v_0^2), that of a band which bends around a pulley without pressing on it.

The formulas are those of a public program (github wangzhanrock/CVT_VelocityInit, 2012).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.optimize import fsolve


class Band(NamedTuple):
    """Equilibrium of the band.

    Attributes
    ----------
    flow_speed : float
        v_0, the speed of the band without force [m/s].
    driven_speed : float
        [rad/s]
    driving_force, driven_force : float
        Of the band that enters the driving and the driven pulley [N]; the first is the larger.
    slip_arc : float
        Angle over which it slips at the exit of each pulley [rad].
    driving_thrust, driven_thrust : float
        Axial forces on a sheave [N].
    """

    flow_speed: float
    driven_speed: float
    driving_force: float
    driven_force: float
    slip_arc: float
    driving_thrust: float
    driven_thrust: float


def elastic_band(
    radii: tuple[float, float],
    driving_speed: float,
    driven_moment: float,
    driven_thrust: float,
    driven_wrap: float,
    stiffness: float,
    mass: float,
    friction: float,
    half_wedge_angle: float,
) -> Band:
    """Equilibrium under a moment and a thrust on the driven pulley.

    Parameters
    ----------
    radii : (float, float)
        Of the band on the driving and the driven pulley [m].
    driving_speed : float
        [rad/s]
    driven_moment : float
        Load on the driven pulley, 0 or more [N m]; at 0 both forces are equal and nothing slips.
    driven_thrust : float
        Axial force on the driven sheave [N].
    driven_wrap : float
        Angle of wrap of the driven pulley; the driving one has the rest of 2 pi [rad].
    stiffness, mass : float
        EA [N] and mass per length [kg/m].
    friction, half_wedge_angle : float
        mu [1], delta_0 [rad].

    Raises
    ------
    ValueError
        If the band has no equilibrium: the moment is more than friction carries.
    """
    driving_radius, driven_radius = radii
    wedged = friction / np.sin(half_wedge_angle)
    squeeze = 2.0 * np.tan(half_wedge_angle)

    def thrust(wrap: float, stretch: float, step: float, slip: float, pull: float) -> float:
        # the band that keeps its force, and the part of the slip, integral of F - K = step / wedged
        kept = (stiffness - pull) * (stretch - 1.0) - pull
        slipping = (1.0 - pull / stiffness) * step / wedged
        return (kept * (wrap - slip) + slipping) / squeeze

    def band(unknown: np.ndarray) -> Band:
        flow, driven_speed = map(float, unknown)
        pull = mass * flow * flow
        bent = pull * stiffness / (stiffness - pull)
        stretches = driving_radius * driving_speed / flow, driven_radius * driven_speed / flow
        driving, driven = (stiffness * (stretch - 1.0) for stretch in stretches)
        slip = float(np.log((driving - bent) / (driven - bent))) / wedged
        wraps = 2.0 * np.pi - driven_wrap, driven_wrap
        thrusts = [
            thrust(wrap, stretch, driving - driven, slip, pull)
            for wrap, stretch in zip(wraps, stretches, strict=True)
        ]
        return Band(flow, driven_speed, driving, driven, slip, *thrusts)

    def left(unknown: np.ndarray) -> list[float]:
        found = band(unknown)
        moment = (found.driving_force - found.driven_force) * driven_radius
        return [(moment - driven_moment) / typical, found.driven_thrust / driven_thrust - 1.0]

    # both pulleys' forces from their mean, m v^2 left out, to begin with
    mean, rim = squeeze * driven_thrust / driven_wrap, driving_radius * driving_speed
    typical = driven_moment + mean * driven_radius
    flow = rim / (1.0 + (mean + 0.5 * driven_moment / driven_radius) / stiffness)
    driven = flow * (1.0 + (mean - 0.5 * driven_moment / driven_radius) / stiffness) / driven_radius
    with np.errstate(invalid="ignore"):
        found, _, _, why = fsolve(left, [flow, driven], xtol=1e-14, full_output=True)
        missed = np.max(np.abs(left(found)))
    if not missed < 1e-9:
        raise ValueError(f"the band has no equilibrium: {why}")
    return band(found)
