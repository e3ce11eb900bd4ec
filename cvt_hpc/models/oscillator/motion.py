"""The equations of the oscillator: smoothed for steppers in general, with set-valued friction for `moreau`.

Coulomb friction with a higher level at rest is smoothed to mu_k tanh(s / v_reg) + (mu_s - mu_k) p(s / (6
v_reg)), p(x) = x exp((1 - x^2) / 2): the hump p is 1 at x = 1, where the tanh is 1 but for 1e-5, so that the
largest friction is mu_s whatever the width, and the law without smoothing is its limit.

The constants of an oscillator, as its kernels take them.

Steady sliding of the mass, and small motions about it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.kernels import kernel
from cvt_hpc.physics.friction import FrictionLaw, friction_coefficient, given_law, saturation
from cvt_hpc.steppers.system import SetValuedSystem, System

_MECHANICS = (
    "mass",
    "stiffness",
    "damping",
    "belt_speed",
    "normal_load",
    "normal_stiffness",
    "preload",
)

X, V = range(2)
HUMP = 6.0  # speed of the largest friction at rest, in units of v_reg

MOST_ROUNDS = 200  # of a table of friction over the load, which the friction itself changes
# Of the load: central differences are exact, N mu being of the second order in N even in a table.
BESIDE = 1e-3


class Oscillator(NamedTuple):
    """Constants of the oscillator."""

    mass: float  # [kg]
    stiffness: float  # [N/m]
    damping: float  # [N s/m]
    belt_speed: float  # [m/s]
    normal_load: float  # N_0 [N]
    normal_stiffness: float  # n [N/m]
    preload: float  # P [N]
    law: FrictionLaw  # friction in steady sliding
    excess: float  # level at rest above that of the law [1]
    width: float  # regularisation speed [m/s]


def oscillator(parameters: Mapping[str, Any]) -> Oscillator:
    """Constants from flat parameters [SI]."""
    p = parameters
    at_rest = p["static_friction"] - p["kinetic_friction"] if p["friction_law"] == "coulomb" else 0.0
    mechanics = {key: float(p[key]) for key in _MECHANICS}
    return Oscillator(**mechanics, law=given_law(p), excess=float(at_rest), width=float(p["friction_speed"]))


def together(each: Sequence[Oscillator]) -> Any:
    """An Oscillator of several, each number an array (run,); their laws share kind and table."""

    def arrays(parts: Sequence[Any], *keys: str) -> dict[str, Any]:
        return {key: np.array([getattr(part, key) for part in parts]) for key in keys}

    law = each[0].law._replace(**arrays([o.law for o in each], "kinetic", "gradient", "speed"))
    return Oscillator(**arrays(each, *_MECHANICS, "excess", "width"), law=law)


@kernel
def one_of(several: Any, k: int) -> Oscillator:
    """Return the constants of one of the oscillators that are `together`."""
    o, law = several, several.law
    kinetic, gradient, scale = law.kinetic[k], law.gradient[k], law.speed[k]
    own = FrictionLaw(law.kind, kinetic, gradient, scale, law.table_force, law.table_speed, law.table_mu)
    mass, stiffness, damping, speed = o.mass[k], o.stiffness[k], o.damping[k], o.belt_speed[k]
    load, fall, preload = o.normal_load[k], o.normal_stiffness[k], o.preload[k]
    return Oscillator(mass, stiffness, damping, speed, load, fall, preload, own, o.excess[k], o.width[k])


@kernel
def normal_load(o: Oscillator, x: float) -> float:
    """Normal load [N] at a displacement [m]."""
    return o.normal_load - o.normal_stiffness * x


@kernel
def regularised_friction(o: Oscillator, sliding: float, load: float) -> float:
    """Friction force on the mass [N] at a sliding speed of the belt under it [m/s], the jump smoothed."""
    mu = friction_coefficient(o.law, abs(sliding), load)[0]
    hump = sliding / (HUMP * o.width)
    at_rest = o.excess * hump * np.exp(0.5 * (1.0 - hump * hump))
    return load * (mu * saturation(sliding, 1.0 / o.width)[0] + at_rest)


@kernel
def regularised_frictions(o: Oscillator, sliding: np.ndarray, load: np.ndarray) -> np.ndarray:
    """Regularised friction of arrays (n,), by the law of `regularised_friction`."""
    found = np.empty_like(sliding)
    for k in range(sliding.size):
        found[k] = regularised_friction(o, sliding[k], load[k])
    return found


@kernel
def friction_forces(several: Any, rows: np.ndarray, slowest: np.ndarray, is_set_valued: bool) -> np.ndarray:
    """Friction forces (run, n) [N] at states (run, n, 2).

    Friction as it is holds the mass where it slides no faster than `slowest` (run,) [m/s].
    """
    found = np.empty(rows.shape[:2])
    for k in range(len(rows)):
        o = one_of(several, k)
        for i in range(rows.shape[1]):
            x, v = rows[k, i, X], rows[k, i, V]
            sliding, load = o.belt_speed - v, normal_load(o, x)
            if not is_set_valued:
                found[k, i] = regularised_friction(o, sliding, load)
            elif abs(sliding) <= slowest[k]:
                found[k, i] = o.stiffness * x + o.damping * v - o.preload
            else:
                mu = friction_coefficient(o.law, abs(sliding), load)[0]
                found[k, i] = np.copysign(load * mu, sliding)
    return found


@kernel
def friction_at_rest(o: Oscillator) -> float:
    """Largest friction force at rest [N]."""
    mu = friction_coefficient(o.law, 0.0, o.normal_load)[0]
    return o.normal_load * (mu + o.excess)


def largest_rate(o: Oscillator) -> float:
    """Rate of the decay of sliding at rest under smoothed friction [1/s]."""
    mu = friction_coefficient(o.law, 0.0, o.normal_load)[0]
    slope = (mu + o.excess * np.exp(0.5) / HUMP) / o.width
    return (o.normal_load * slope + o.damping) / o.mass


@kernel
def _smoothed_rates(o: Oscillator, t: float, y: np.ndarray, out: np.ndarray) -> bool:
    """Rates of displacement and speed with smoothed friction; see `System`."""
    load = normal_load(o, y[X])
    friction = regularised_friction(o, o.belt_speed - y[V], load)
    out[X] = y[V]
    out[V] = (o.preload + friction - o.stiffness * y[X] - o.damping * y[V]) / o.mass
    return load > 0.0


@kernel
def free_rates(o: Oscillator, t: float, y: np.ndarray, out: np.ndarray) -> bool:
    """Rates without friction; see `SetValuedSystem`."""
    out[X] = y[V]
    out[V] = (o.preload - o.stiffness * y[X] - o.damping * y[V]) / o.mass
    return True


@kernel
def _friction_bounds(
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
    load = normal_load(o, y[X])
    mu = friction_coefficient(o.law, sliding, load)[0] + (o.excess if held[0] else 0.0)
    high[0], low[0], restitution[0] = load * mu, -load * mu, 0.0
    return load > 0.0


def _unknowns(o: Oscillator) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return which unknowns are velocities, their positions, and typical sizes."""
    return np.array([False, True]), np.array([-1, X]), np.array(typical_sizes(o))


@kernel
def typical_sizes(o: Oscillator) -> tuple[float, float]:
    """Typical displacement [m] and speed [m/s]."""
    frequency = np.sqrt(o.stiffness / o.mass)
    pull = (friction_at_rest(o) + abs(o.preload)) / o.stiffness
    speed = o.belt_speed if o.belt_speed > 0.0 else frequency * pull
    return pull + speed / frequency, speed


def system(parameters: Mapping[str, Any]) -> System:
    """Equations with smoothed friction, from flat parameters [SI]; unknowns: displacement, speed."""
    o = oscillator(parameters)
    return System(_smoothed_rates, o, *_unknowns(o))


def set_valued_system(parameters: Mapping[str, Any]) -> SetValuedSystem:
    """Equations with friction as it is, from flat parameters [SI]; unknowns: displacement, speed."""
    o = oscillator(parameters)
    return SetValuedSystem(
        free_rates,
        o,
        *_unknowns(o),
        _friction_bounds,
        np.array([[0.0, 1.0]]),
        np.array([[0.0], [1.0 / o.mass]]),
    )


def initial_state(parameters: Mapping[str, Any], steady: SteadySliding | None = None) -> np.ndarray:
    """Displacement [m] and speed [m/s] at the start, from flat parameters, and steady sliding where known."""
    p = parameters
    if p["start"] == "given":
        return np.array([p["initial_displacement"], p["initial_speed"]], dtype=np.float64)
    displacement = (steady or steady_sliding(oscillator(p))).displacement + p["initial_displacement"]
    return np.array([displacement, p["belt_speed"] if p["start"] == "sticking" else 0.0])


class SteadySliding(NamedTuple):
    """The mass at rest on the belt that slides under it, friction without regularisation."""

    displacement: float  # x_s [m]
    # of the small motions about it the one with the larger imaginary, or else real, part [1/s]
    eigenvalue: complex


def steady_sliding(o: Oscillator) -> SteadySliding:
    """Steady sliding of an oscillator: x_s = (P + N_0 mu) / (k + n mu)."""
    return sliding_with(*about_sliding(o))


def sliding_with(displacement: float, half: float, square: float) -> SteadySliding:
    """Return steady sliding by the numbers of `about_sliding`."""
    return SteadySliding(displacement, complex(half + np.sqrt(complex(half) * half - square)))


@kernel
def about_sliding(o: Oscillator) -> tuple[float, float, float]:
    """x_s [m], and p [1/s], q [1/s^2] of small motions exp(s t) about it: s^2 - 2 p s + q = 0."""
    load, displacement, mu, slope = o.normal_load, np.nan, 0.0, 0.0
    for _ in range(MOST_ROUNDS):
        mu, slope = friction_coefficient(o.law, o.belt_speed, load)
        last = displacement
        displacement = (o.preload + o.normal_load * mu) / (o.stiffness + o.normal_stiffness * mu)
        load = normal_load(o, displacement)
        if displacement == last:
            break
    more, less = load * (1.0 + BESIDE), load * (1.0 - BESIDE)
    at_more = friction_coefficient(o.law, o.belt_speed, more)[0]
    at_less = friction_coefficient(o.law, o.belt_speed, less)[0]
    by_load = (more * at_more - less * at_less) / (more - less)
    stiffness = o.stiffness + o.normal_stiffness * by_load
    return displacement, -0.5 * (o.damping + load * slope) / o.mass, stiffness / o.mass
