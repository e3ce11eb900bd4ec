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

A formula stands once, for lanes and for plain numbers. It takes coefficients that are prepared beforehand
(`law_numbers`), which spares divisions. The two differ by the round-off of the exponential alone.
"""

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable

from cvt_hpc.kernels import kernel, merged_kernel
from cvt_hpc.lanes import absolute, decay, fma, like, maximum, minimum, select, with_sign_of
from cvt_hpc.physics.friction_laws import FORMULA_PARAMETERS, FRICTION_LAWS, TABLE_PARAMETERS, Law

_ROOT_3 = 1.7320508075688772


class FrictionLaw(NamedTuple):
    """A law with its coefficients, as kernels take it."""

    kind: int  # one of `Law`
    kinetic: float  # mu_k [1]
    gradient: float  # dmu/dv at v -> 0+ [s/m]
    speed: float  # v_s [m/s]
    table_force: np.ndarray  # normal line forces of the table, (nf,), ascending [N/m]
    table_speed: np.ndarray  # speeds of the table, (nv,), ascending [m/s]
    table_mu: np.ndarray  # coefficients, (nf, nv) [1]


def friction_law(
    kind: str,
    kinetic: float,
    gradient: float,
    speed: float,
    table_force: np.ndarray | tuple = (),
    table_speed: np.ndarray | tuple = (),
    table_mu: np.ndarray | tuple = (),
) -> FrictionLaw:
    """Build a law from the name of a `Law`, in lower case, and coefficients as of `FrictionLaw`.

    The table is read by the law `table` only. ValueError if there is no such law.
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


def softened(law: FrictionLaw, share: float) -> FrictionLaw:
    """Law whose fall is a share of a given law's; 0: constant, for a table its least coefficient."""
    least = law.table_mu.min() if law.table_mu.size else 0.0
    return law._replace(gradient=share * law.gradient, table_mu=least + share * (law.table_mu - least))


FORMULAS: dict[Law, Callable[..., Any]] = {}  # checked in this order


def _formula_of(law: Law) -> Callable[..., Any]:
    """Register a function as the formula of a law: mu and its slope, from the numbers of `law_numbers` and v.

    Kernels that take mu alone do not compute the slope: the compiler drops unused results.
    """

    def note(formula: Callable[..., Any]) -> Callable[..., Any]:
        FORMULAS[law] = formula
        return formula

    return note


@_formula_of(Law.STRIBECK)
def _stribeck(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    left = decay(speed * per_scale)
    return fma(-fall, left, kinetic), fall * per_scale * left


@_formula_of(Law.COULOMB)
def _coulomb(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    return like(kinetic, speed), like(0.0, speed)


@_formula_of(Law.LINEAR)
def _linear(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    below = minimum(speed * per_scale - 1.0, 0.0)
    return fma(fall, below, kinetic), select(below < 0.0, like(fall * per_scale, speed), 0.0)


@_formula_of(Law.HYPERBOLIC)
def _hyperbolic(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    denominator = fma(decline, speed, 1.0)
    mu = kinetic / denominator
    return mu, -decline * mu / denominator


@_formula_of(Law.CUBIC)
def _cubic(numbers, speed):
    kinetic, fall, per_scale, decline = numbers
    x = minimum(speed * per_scale, _ROOT_3)
    mu = kinetic - fall * (2.0 / 3.0) * (1.0 - 1.5 * (x - x * x * x * (1.0 / 3.0)))
    return mu, select(x < _ROOT_3, fall * per_scale * (1.0 - x * x), 0.0)


if missing := set(Law) - {Law.TABLE} - set(FORMULAS):
    raise NotImplementedError(f"friction laws without a formula: {missing}")


# `friction_law` refuses unknown laws. Should a kernel meet one, the run ends, since its state is not a
# number: an exception would cost each station a test for it.


def _unknown(kind, numbers, speed):
    return like(np.nan, speed), like(np.nan, speed)


def _by_kind(formulas: list[tuple[Law, Any]]) -> Any:
    """Function of a kind and a formula's numbers: the formula of that kind, for others `_unknown`."""
    # merged, as a call from an inner loop costs more than the formula
    if not formulas:
        return register_jitable(forceinline=True)(_unknown)
    own, formula = int(formulas[0][0]), register_jitable(forceinline=True)(formulas[0][1])
    others = _by_kind(formulas[1:])

    @register_jitable(forceinline=True)
    def find(kind, numbers, speed):
        if kind == own:
            found = formula(numbers, speed)
        else:
            found = others(kind, numbers, speed)
        return found

    return find


_formula = _by_kind(list(FORMULAS.items()))


@merged_kernel
def law_numbers(kinetic, gradient, scale):
    """Coefficients of a law as `formula_coefficient` takes them, from mu_k [1], g [s/m] and v_s [m/s]."""
    return kinetic, gradient * scale, 1.0 / scale, -gradient / kinetic


@merged_kernel
def formula_coefficient(kind: int, numbers, speed):
    """Coefficient of friction in steady sliding by a formula [1], and its slope dmu/dspeed [s/m].

    `kind` is one of `Law`, the same in all lanes; not a number comes of any other. `numbers` are those of
    `law_numbers`, `speed` is that of sliding, >= 0 [m/s]: lanes or a plain number.
    """
    found = _formula(kind, numbers, speed)
    return found


@kernel
def table_coefficient(table: tuple[np.ndarray, np.ndarray, np.ndarray], speed, force):
    """`formula_coefficient` by a table that all lanes share: bilinear, held constant outside.

    `table` holds forces (nf,) [N/m], speeds (nv,) [m/s] and coefficients (nf, nv). Kernels of lanes choose
    between it and `formula_coefficient` themselves: handing over the table in an inner loop counts references
    to its arrays, which costs a fifth of all work on sliding. Written as a sum over its intervals, of
    which each lane fills those below its place. At a knot the slope is that of the interval above.
    """
    table_force, table_speed, table_mu = table
    mu = slope = mu_below = slope_below = like(0.0, speed)
    for i in range(table_force.size):
        row, rise = like(table_mu[i, 0], speed), like(0.0, speed)
        for j in range(table_speed.size - 1):
            width = table_speed[j + 1] - table_speed[j]
            steepness = (table_mu[i, j + 1] - table_mu[i, j]) / width
            row += minimum(maximum(speed - table_speed[j], 0.0), width) * steepness
            rise = select(speed >= table_speed[j], like(steepness, speed), rise)
        rise = select(speed < table_speed[-1], rise, 0.0)
        if i == 0:
            mu, slope = row, rise
        else:
            span = table_force[i] - table_force[i - 1]
            share = minimum(maximum((force - table_force[i - 1]) / span, 0.0), 1.0)
            mu += (row - mu_below) * share
            slope += (rise - slope_below) * share
        mu_below, slope_below = row, rise
    return mu, slope


@merged_kernel
def friction_coefficient(law: FrictionLaw, speed: float, force: float) -> tuple[float, float]:
    """Coefficient of friction in steady sliding [1] and its slope dmu/dspeed [s/m].

    At a sliding speed >= 0 [m/s], under a normal line force [N/m], which only a table reads.
    """
    if law.kind == Law.TABLE:
        found = table_coefficient((law.table_force, law.table_speed, law.table_mu), speed, force)
    else:
        numbers = law_numbers(law.kinetic, law.gradient, law.speed)
        found = formula_coefficient(law.kind, numbers, speed)
    return found


@kernel
def friction_coefficients(law: FrictionLaw, speeds: np.ndarray, forces: np.ndarray) -> np.ndarray:
    """Coefficients of friction (n,) [1] at sliding speeds (n,) [m/s] under normal line forces (n,) [N/m]."""
    found = np.empty_like(speeds)
    if law.kind == Law.TABLE:
        table = law.table_force, law.table_speed, law.table_mu
        for k in range(speeds.size):
            found[k] = table_coefficient(table, speeds[k], forces[k])[0]
    else:  # apart, so that the compiler fills registers
        numbers = law_numbers(law.kinetic, law.gradient, law.speed)
        for k in range(speeds.size):
            found[k] = formula_coefficient(law.kind, numbers, speeds[k])[0]
    return found


@merged_kernel
def saturation(speed, per_width):
    """Regularisation of Coulomb friction about zero speed: tanh(speed / v_reg) [1] and its slope [s/m].

    Of lanes or of plain numbers: sliding speed of any sign [m/s], `per_width` 1 / v_reg > 0 [s/m].
    """
    # tanh by one exponential: a third of the cost of the library's
    left = decay(absolute(speed) * (2.0 * per_width))
    factor = (1.0 - left) / (1.0 + left)
    return with_sign_of(factor, speed), (1.0 - factor * factor) * per_width
