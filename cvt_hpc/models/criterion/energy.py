"""A metre of flank that slides: its radial frequency and damping, and the energy that a cycle gains."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.physics.friction import (
    FrictionLaw,
    friction_coefficient,
    friction_coefficients,
    given_law,
    saturation,
)

PHASES = 512  # of a cycle: errors of its square at a corner of the law, of 1/512 at a jump (v_reg -> 0)


class Flank(NamedTuple):
    """A metre of belt in steady sliding, both of its flanks together.

    Attributes
    ----------
    law : FrictionLaw
        Friction in steady sliding.
    width, memory : float
        Regularisation speed [m/s] and time constant of the filtered speed [s].
    normal_force : float
        Normal line force of one flank [N/m].
    contact_force : float
        Axial line force of one flank f_ax [N/m].
    radial_speed, speed : float
        v_r and |v| [m/s].
    mass, stiffness : float
        Per length: m [kg/m], and the stiffness against a radial displacement [N/m^2]; 0 or less: nothing
        brings it back.
    damping : (4,) array
        Shares of the radial damping [N s/m^2]: the belt's; of friction its present slope, its falling law in
        phase with the speed, and its turning with the direction of sliding.
    gradient : float
        Slope of friction over |v|, in phase with the speed [s/m].
    """

    law: FrictionLaw
    width: float
    memory: float
    normal_force: float
    contact_force: float
    radial_speed: float
    speed: float
    mass: float
    stiffness: float
    damping: np.ndarray
    gradient: float

    @property
    def angular_frequency(self) -> float:
        """Of the undamped radial vibration [rad/s]."""
        return np.sqrt(max(self.stiffness, 0.0) / self.mass)

    @property
    def radial_share(self) -> float:
        """sin(gamma) = v_r / |v|."""
        return self.radial_speed / self.speed


def flank(parameters: Mapping[str, Any]) -> Flank:
    """Steady sliding, from flat parameters [SI]."""
    p = parameters
    law = given_law(p)
    tangent = np.tan(p["half_wedge_angle"])
    force = p["contact_force"]
    normal_force = force / np.cos(p["half_wedge_angle"])
    speed = float(np.hypot(p["radial_speed"], p["tangential_speed"]))
    share = p["radial_speed"] / speed
    value, fall = friction_coefficient(law, speed, normal_force)
    factor, rise = saturation(speed, 1.0 / p["friction_speed"])
    mu = value * factor
    mass = p["element_mass"] + p["ring_mass"]
    stiffness = p["belt_stiffness"] + 2.0 * p["contact_stiffness"] * tangent * (tangent + mu * share)
    delay = max(stiffness, 0.0) / mass * p["friction_memory"] ** 2
    slopes = np.array([value * rise, factor * fall / (1.0 + delay)])
    friction = 2.0 * force * np.append(slopes * share**2, mu / speed * (1.0 - share**2))
    return Flank(
        law,
        p["friction_speed"],
        p["friction_memory"],
        normal_force,
        force,
        p["radial_speed"],
        speed,
        mass,
        stiffness,
        np.append(p["transverse_damping"], friction),
        float(slopes.sum()),
    )


def energy_per_cycle(f: Flank, amplitudes: np.ndarray) -> np.ndarray:
    """Energy that a harmonic radial motion gains in a period, the friction law taken as it is.

    Parameters
    ----------
    f : Flank
        In steady sliding, with stiffness > 0.
    amplitudes : (n,) array
        Of the displacement [m].

    Returns
    -------
    (n,) array
        Energy per length of belt [J/m]; positive: fed.
    """
    w = f.angular_frequency
    swing = np.multiply.outer(w * amplitudes, np.sin(2.0 * np.pi * np.arange(PHASES) / PHASES))
    tangential = np.sqrt(f.speed**2 - f.radial_speed**2)
    force = f.damping[0] * swing + 2.0 * f.contact_force * _radial_friction(
        f, f.radial_speed + swing, tangential
    )
    return -2.0 * np.pi / w * np.mean(force * swing, axis=-1)


def _radial_friction(f: Flank, radial: np.ndarray, tangential: float) -> np.ndarray:
    """Coefficient of friction times the radial share of sliding, over a periodic course of radial speeds."""
    speed = np.hypot(radial, tangential)
    harmonics = np.arange(PHASES // 2 + 1)
    filtered = np.fft.rfft(speed) / (1.0 + 1j * harmonics * f.angular_frequency * f.memory)
    # where sliding comes to rest, the cut-off harmonics of a speed that is 0 there may leave less
    remembered = np.maximum(np.fft.irfft(filtered, PHASES), 0.0)
    forces = np.full(speed.size, f.normal_force)
    mu = friction_coefficients(f.law, remembered.ravel(), forces).reshape(speed.shape)
    direction = np.divide(radial, speed, out=np.zeros_like(speed), where=speed > 0.0)
    return mu * np.tanh(speed / f.width) * direction
