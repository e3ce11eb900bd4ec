"""The equations of the oscillator: smoothed for steppers in general, with set-valued friction for `moreau`.

Coulomb friction with a higher level at rest is smoothed to mu_k tanh(s / v_reg) + (mu_s - mu_k) p(s / (6
v_reg)), p(x) = x exp((1 - x^2) / 2): the hump p is 1 at x = 1, where the tanh is 1 but for 1e-5, so that the
largest friction is mu_s whatever the width, and the law without smoothing is its limit.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.physics.friction import FrictionLaw, friction_coefficient, friction_law, saturation
from cvt_hpc.steppers.system import SetValuedSystem, System

X, V = range(2)
HUMP = 6.0  # speed of the largest friction at rest, in units of v_reg


class Oscillator(NamedTuple):
    """Constants of the oscillator.

    Attributes
    ----------
    mass, stiffness, damping : float
        [kg], [N/m], [N s/m].
    belt_speed, normal_load : float
        [m/s], [N].
    law : FrictionLaw
        Friction in steady sliding.
    excess : float
        Level at rest above that of the law [1].
    width : float
        Regularisation speed [m/s].
    """

    mass: float
    stiffness: float
    damping: float
    belt_speed: float
    normal_load: float
    law: FrictionLaw
    excess: float
    width: float


def oscillator(parameters: Mapping[str, Any]) -> Oscillator:
    """Constants from flat parameters [SI]."""
    p = parameters
    law = friction_law(
        p["friction_law"],
        p["kinetic_friction"],
        p["friction_gradient"],
        p["stribeck_velocity"],
        *((p["table_force"], p["table_speed"], p["table_mu"]) if p["friction_law"] == "table" else ()),
    )
    at_rest = p["static_friction"] - p["kinetic_friction"] if p["friction_law"] == "coulomb" else 0.0
    mechanics = (float(p[key]) for key in ("mass", "stiffness", "damping", "belt_speed", "normal_load"))
    return Oscillator(*mechanics, law, float(at_rest), float(p["friction_speed"]))


@kernel
def regularised_friction(o: Oscillator, sliding: float) -> float:
    """Friction force on the mass [N] at a sliding speed of the belt under it [m/s], the jump smoothed."""
    mu = friction_coefficient(o.law, abs(sliding), o.normal_load)[0]
    hump = sliding / (HUMP * o.width)
    at_rest = o.excess * hump * np.exp(0.5 * (1.0 - hump * hump))
    return o.normal_load * (mu * saturation(sliding, o.width)[0] + at_rest)


def friction_at_rest(o: Oscillator) -> float:
    """Largest friction force at rest [N]."""
    return o.normal_load * (friction_coefficient(o.law, 0.0, o.normal_load)[0] + o.excess)


def largest_rate(o: Oscillator) -> float:
    """Rate of the decay of sliding at rest under smoothed friction [1/s]."""
    mu = friction_coefficient(o.law, 0.0, o.normal_load)[0]
    slope = (mu + o.excess * np.exp(0.5) / HUMP) / o.width
    return (o.normal_load * slope + o.damping) / o.mass


@kernel
def smoothed_rates(o: Oscillator, t: float, y: np.ndarray, out: np.ndarray) -> bool:
    """Rates of displacement and speed with smoothed friction; see `System`."""
    friction = regularised_friction(o, o.belt_speed - y[V])
    out[X] = y[V]
    out[V] = (friction - o.stiffness * y[X] - o.damping * y[V]) / o.mass
    return True


@kernel
def free_rates(o: Oscillator, t: float, y: np.ndarray, out: np.ndarray) -> bool:
    """Rates without friction; see `SetValuedSystem`."""
    out[X] = y[V]
    out[V] = -(o.stiffness * y[X] + o.damping * y[V]) / o.mass
    return True


@kernel
def friction_bounds(
    o: Oscillator,
    t: float,
    y: np.ndarray,
    held: np.ndarray,
    speed: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    restitution: np.ndarray,
) -> bool:
    """Bounds of the friction force, larger while the mass sticks; see `SetValuedSystem`."""
    speed[0] = y[V] - o.belt_speed
    sliding = 0.0 if held[0] else abs(speed[0])
    mu = friction_coefficient(o.law, sliding, o.normal_load)[0] + (o.excess if held[0] else 0.0)
    high[0], low[0], restitution[0] = o.normal_load * mu, -o.normal_load * mu, 0.0
    return True


def _unknowns(o: Oscillator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Which unknowns are velocities, their positions, and typical sizes."""
    frequency = np.sqrt(o.stiffness / o.mass)
    pull = friction_at_rest(o) / o.stiffness
    speed = o.belt_speed if o.belt_speed > 0.0 else frequency * pull
    return np.array([False, True]), np.array([-1, X]), np.array([pull + speed / frequency, speed])


def system(parameters: Mapping[str, Any]) -> System:
    """Equations with smoothed friction, from flat parameters [SI]; unknowns: displacement, speed."""
    o = oscillator(parameters)
    return System(smoothed_rates, o, *_unknowns(o))


def set_valued_system(parameters: Mapping[str, Any]) -> SetValuedSystem:
    """Equations with friction as it is, from flat parameters [SI]; unknowns: displacement, speed."""
    o = oscillator(parameters)
    return SetValuedSystem(
        free_rates,
        o,
        *_unknowns(o),
        friction_bounds,
        np.array([[0.0, 1.0]]),
        np.array([[0.0], [1.0 / o.mass]]),
    )


def initial_state(parameters: Mapping[str, Any]) -> np.ndarray:
    """Displacement [m] and speed [m/s] at the start, from flat parameters."""
    return np.array([parameters["initial_displacement"], parameters["initial_speed"]], dtype=np.float64)
