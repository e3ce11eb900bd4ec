"""Friction laws between belt elements and sheaves, each with its derivative.

A law gives the coefficient mu(v) >= 0 of steady sliding at speed v >= 0 [m/s]. Its regularisation about v =
0, tanh(v / v_reg), is a factor of its own (`saturation`), because with friction memory the two are taken at
different speeds: the law at the filtered speed, the saturation at the present one.

**The friction gradient** is defined once, here, for all laws: the slope dmu/dv [s/m] of the law at v -> 0+,
without the regularisation. For every falling law below that is its steepest slope; negative means friction
falls with speed. The speed scale `stribeck_velocity` and one level stay fixed when the gradient varies; the
other level follows from it:

============  =====================================================================  =========================
law           mu(v), g = friction_gradient, v_s = stribeck_velocity                   level kept
============  =====================================================================  =========================
coulomb       mu_k                                                                     mu_k (g must be 0)
linear        max(mu_k - g v_s + g v, mu_k): falls to the floor mu_k at v_s            mu_k
stribeck      mu_k - g v_s exp(-v / v_s)                                               mu_k
hyperbolic    mu_k / (1 + d v), d = -g / mu_k                                          mu_k, here at v = 0
cubic         mu_s - 3/2 (mu_s - mu_k) (x - x^3 / 3), x = v / v_s                    mu_k, its minimum at v_s
table         bilinear in (normal force, speed), held constant outside                 the table
============  =====================================================================  =========================

The cubic law (Thomsen and Fidlin 2003) has mu_s = mu_k - 2/3 g v_s; beyond x = sqrt(3), where the cubic is
back at mu_s, it is held there. For a table the gradient is the slope of its first interval at the lowest
force.

Kernels of lanes take mu alone, from coefficients prepared once (`lane_law`), so that a formula has no
division; plain ones take its slope too. The two differ by round-off.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import decay, fma, like, maximum, minimum
from cvt_hpc.physics.friction_laws import FORMULA_PARAMETERS, FRICTION_LAWS, TABLE_PARAMETERS, Law


class FrictionLaw(NamedTuple):
    """A law with its coefficients, as kernels take it.

    Attributes
    ----------
    kind : int
        One of `Law`.
    kinetic : float
        mu_k [1].
    gradient : float
        dmu/dv at v -> 0+ [s/m].
    speed : float
        v_s [m/s].
    table_force : (nf,) array
        Normal line forces of the table, ascending [N/m].
    table_speed : (nv,) array
        Speeds of the table, ascending [m/s].
    table_mu : (nf, nv) array
        Coefficients [1].
    """

    kind: int
    kinetic: float
    gradient: float
    speed: float
    table_force: np.ndarray
    table_speed: np.ndarray
    table_mu: np.ndarray


def friction_law(
    kind: str,
    kinetic: float,
    gradient: float,
    speed: float,
    table_force: np.ndarray | tuple = (),
    table_speed: np.ndarray | tuple = (),
    table_mu: np.ndarray | tuple = (),
) -> FrictionLaw:
    """Build a law from its name and coefficients.

    Parameters
    ----------
    kind : str
        Name of a `Law`, in lower case.
    kinetic, gradient, speed : float
        mu_k [1], friction gradient [s/m], v_s [m/s].
    table_force, table_speed, table_mu : array_like, shapes (nf,), (nv,), (nf, nv)
        The table [N/m], [m/s], [1]; read by the law `table` only.

    Returns
    -------
    FrictionLaw
        Ready for `friction_coefficient`.

    Raises
    ------
    ValueError
        If there is no such law.
    """
    if kind not in FRICTION_LAWS:
        raise ValueError(f"friction law: expected one of {', '.join(FRICTION_LAWS)}; found {kind}")
    tables = [np.ascontiguousarray(a, dtype=np.float64) for a in (table_force, table_speed, table_mu)]
    tables[2] = tables[2].reshape(tables[0].size, tables[1].size)
    return FrictionLaw(int(Law[kind.upper()]), float(kinetic), float(gradient), float(speed), *tables)


def given_law(parameters: Mapping[str, Any]) -> FrictionLaw:
    """Return the law that flat parameters [SI] of a run declare, by the keys of its table [friction]."""
    keys = (*FORMULA_PARAMETERS, *TABLE_PARAMETERS)
    return friction_law(parameters["friction_law"], *(parameters[key] for key in keys))


@kernel
def _bracket(grid: np.ndarray, value: float) -> tuple[int, float]:
    """Interval of an ascending grid and the position in it, 0..1; held at both ends."""
    last = grid.size - 2
    i = min(max(np.searchsorted(grid, value) - 1, 0), last)
    return i, min(max((value - grid[i]) / (grid[i + 1] - grid[i]), 0.0), 1.0)  # type: ignore[return-value, index, operator]  # i is an int to the compiler


@kernel
def _table_lookup(law: FrictionLaw, speed: float, force: float) -> tuple[float, float]:
    i, a = _bracket(law.table_force, force)
    j, b = _bracket(law.table_speed, speed)
    low = (1.0 - a) * law.table_mu[i, j] + a * law.table_mu[i + 1, j]
    high = (1.0 - a) * law.table_mu[i, j + 1] + a * law.table_mu[i + 1, j + 1]
    inside = law.table_speed[0] <= speed < law.table_speed[-1]
    slope = (high - low) / (law.table_speed[j + 1] - law.table_speed[j]) if inside else 0.0
    return (1.0 - b) * low + b * high, slope


# Each formula twice. In plain numbers: mu and its slope from mu_k, g, v_s and v. In lanes: mu from what
# `lane_law` prepares, mu_k, g v_s, 1 / v_s and -g / mu_k, and v.


def _coulomb(numbers, speed):
    kinetic, gradient, scale = numbers
    return kinetic, 0.0


def _lane_coulomb(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    return kinetic


def _linear(numbers, speed):
    kinetic, gradient, scale = numbers
    mu, slope = kinetic, 0.0
    if speed < scale:
        mu, slope = kinetic + gradient * (speed - scale), gradient
    return mu, slope


def _lane_linear(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    return fma(fall, minimum(speed * per_scale - 1.0, 0.0), kinetic)


def _stribeck(numbers, speed):
    kinetic, gradient, scale = numbers
    fall = gradient * np.exp(-speed / scale)
    return kinetic - scale * fall, fall


def _lane_stribeck(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    return fma(-fall, decay(speed * per_scale), kinetic)


def _hyperbolic(numbers, speed):
    kinetic, gradient, scale = numbers
    denominator = 1.0 - gradient / kinetic * speed
    return kinetic / denominator, gradient / (denominator * denominator)


def _lane_hyperbolic(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    return kinetic / fma(decline, speed, 1.0)


def _cubic(numbers, speed):
    kinetic, gradient, scale = numbers
    x = speed / scale
    span = -2.0 / 3.0 * gradient * scale
    mu, slope = kinetic + span, 0.0
    if x * x < 3.0:
        mu, slope = kinetic + span * (1.0 - 1.5 * (x - x * x * x / 3.0)), gradient * (1.0 - x * x)
    return mu, slope


def _lane_cubic(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    x = minimum(speed * per_scale, 1.7320508075688772)
    return kinetic - fall * (2.0 / 3.0) * (1.0 - 1.5 * (x - x * x * x * (1.0 / 3.0)))


class Formula(NamedTuple):
    """A law's formula in plain numbers and in lanes."""

    plain: Callable[..., Any]
    lanes: Callable[..., Any]


FORMULAS = {
    Law.STRIBECK: Formula(_stribeck, _lane_stribeck),
    Law.COULOMB: Formula(_coulomb, _lane_coulomb),
    Law.LINEAR: Formula(_linear, _lane_linear),
    Law.HYPERBOLIC: Formula(_hyperbolic, _lane_hyperbolic),
    Law.CUBIC: Formula(_cubic, _lane_cubic),
}
if missing := set(Law) - {Law.TABLE} - set(FORMULAS):
    raise NotImplementedError(f"friction laws without a formula: {missing}")


# `friction_law` refuses what is no law. Should a kernel meet one, the run ends, since its state is not a
# number: an exception would cost each station a test for it.


def _unknown(kind, numbers, speed):
    return np.nan, np.nan


def _lane_unknown(kind, numbers, speed):
    return like(np.nan, speed)


def _by_kind(formulas: list[tuple[Law, Any]], otherwise: Any, merged: bool = False) -> Any:
    """What takes a kind and a formula's numbers: the formula of that kind, for others `otherwise`."""
    if not formulas:
        return register_jitable(forceinline=merged)(otherwise)
    own, formula = int(formulas[0][0]), register_jitable(forceinline=merged)(formulas[0][1])
    others = _by_kind(formulas[1:], otherwise, merged)

    @register_jitable(forceinline=merged)
    def find(kind, numbers, speed):
        if kind == own:
            found = formula(numbers, speed)
        else:
            found = others(kind, numbers, speed)
        return found

    return find


_plain = _by_kind([(law, formula.plain) for law, formula in FORMULAS.items()], _unknown)
# a call from an inner loop costs more than the formula
_lanes = _by_kind([(law, formula.lanes) for law, formula in FORMULAS.items()], _lane_unknown, merged=True)


@kernel
def formula_coefficient(
    kind: int, kinetic: float, gradient: float, scale: float, speed: float
) -> tuple[float, float]:
    """`friction_coefficient` of the laws that are formulas, from plain numbers.

    Kernels call this one in their inner loops: handing over a `FrictionLaw` costs more than the law itself.
    Not a number comes of a kind that is no such law.
    """
    return _plain(kind, (kinetic, gradient, scale), speed)


@merged_kernel
def friction_coefficient(law: FrictionLaw, speed: float, force: float) -> tuple[float, float]:
    """Coefficient of friction in steady sliding and its slope.

    Parameters
    ----------
    law : FrictionLaw
        The law.
    speed : float
        Sliding speed, >= 0 [m/s].
    force : float
        Normal line force [N/m]; only a table reads it.

    Returns
    -------
    mu : float
        Coefficient [1].
    slope : float
        dmu/dspeed [s/m].
    """
    if law.kind == Law.TABLE:
        return _table_lookup(law, speed, force)
    return formula_coefficient(law.kind, law.kinetic, law.gradient, law.speed, speed)


@kernel
def friction_coefficients(law: FrictionLaw, speeds: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Coefficients of friction (n,) [1] at sliding speeds (n,) [m/s] under normal line forces (n,) [N/m]."""
    found = np.empty_like(speeds)
    for k in range(speeds.size):
        found[k] = friction_coefficient(law, speeds[k], forces[k])[0]
    return found


@kernel
def saturation(speed: float, width: float) -> tuple[float, float]:
    """Regularisation of Coulomb friction about zero speed: tanh(speed / width) and its slope.

    Parameters
    ----------
    speed : float
        Sliding speed, any sign [m/s].
    width : float
        Regularisation speed v_reg, > 0 [m/s].

    Returns
    -------
    factor, slope : float
        tanh(speed / width) [1] and its derivative [s/m].
    """
    # tanh by one exponential: a third of the cost of the library's
    decay = np.exp(-2.0 * abs(speed) / width)
    factor = (1.0 - decay) / (1.0 + decay)
    return np.copysign(factor, speed), (1.0 - factor * factor) / width


@merged_kernel
def lane_saturation(speed, per_width):
    """tanh(speed / width) of speeds >= 0 [m/s], from 1 / width [s/m], in lanes."""
    left = decay(speed * (2.0 * per_width))
    return (1.0 - left) / (1.0 + left)


@merged_kernel
def lane_law(kinetic, gradient, scale):
    """Coefficients of a law as `lane_coefficient` takes them, from mu_k [1], g [s/m] and v_s [m/s]."""
    return kinetic, gradient * scale, 1.0 / scale, -gradient / kinetic


@merged_kernel
def lane_coefficient(kind: int, coefficients, speed):
    """Coefficient of friction in steady sliding by a law that is a formula, in lanes.

    Parameters
    ----------
    kind : int
        One of `Law`, the same in all lanes; not a number comes of any other.
    coefficients
        What `lane_law` made of the law's numbers.
    speed
        Sliding speed, >= 0 [m/s].
    """
    mu = _lanes(kind, coefficients, speed)
    return mu


@kernel
def lane_table(table: tuple[np.ndarray, np.ndarray, np.ndarray], speed, force):
    """Coefficient by a table that all lanes share: bilinear, held constant outside.

    `table` holds forces (nf,) [N/m], speeds (nv,) [m/s] and coefficients (nf, nv). Kernels choose between it
    and `lane_coefficient` themselves: handing over the table in an inner loop counts references to its
    arrays, which costs a fifth of all that is done of sliding. Written as a sum over its intervals, of which
    each lane fills those below its place.
    """
    table_force, table_speed, table_mu = table
    mu = mu_below = like(0.0, speed)
    for i in range(table_force.size):
        row = like(table_mu[i, 0], speed)
        for j in range(table_speed.size - 1):
            width = table_speed[j + 1] - table_speed[j]
            filled = minimum(maximum(speed - table_speed[j], 0.0), width)
            row += filled * ((table_mu[i, j + 1] - table_mu[i, j]) / width)
        if i == 0:
            mu = row
        else:
            span = table_force[i] - table_force[i - 1]
            mu += (row - mu_below) * minimum(maximum((force - table_force[i - 1]) / span, 0.0), 1.0)
        mu_below = row
    return mu
