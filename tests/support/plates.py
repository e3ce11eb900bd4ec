"""Kirchhoff's annular plate, clamped inside and free outside, harmonic by harmonic: exact solutions to test by."""

from functools import partial

import numpy as np
from scipy.optimize import brentq
from scipy.special import iv, ivp, jv, jvp, kv, kvp, yv, yvp

POISSON = 0.3


def rigidity(modulus, thickness):
    return modulus * thickness**3 / (12.0 * (1.0 - POISSON**2))


def _power(p, log, r):
    """r^p, or r^p ln r, and three derivatives."""
    factors = [1.0, p, p * (p - 1), p * (p - 1) * (p - 2)]
    plain = [f * r ** (p - k) for k, f in enumerate(factors)]
    if not log:
        return plain
    # Leibniz: d^k (r^p ln r) = ln r d^k r^p + sum of binomials d^(k-i) r^p (-1)^(i-1) (i-1)! / r^i
    value, first, second, third = plain
    ln = np.log(r)
    return [
        value * ln,
        first * ln + value / r,
        second * ln + 2 * first / r - value / r**2,
        third * ln + 3 * second / r - 3 * first / r**2 + 2 * value / r**3,
    ]


def _forms(n):
    if n == 0:
        return [(0, False), (0, True), (2, False), (2, True)]
    if n == 1:
        return [(1, False), (-1, False), (3, False), (1, True)]
    return [(n, False), (-n, False), (n + 2, False), (2 - n, False)]


def _moment(d, n, r):
    return d[2] + POISSON * (d[1] / r - n * n * d[0] / r**2)


def _slope_of_laplacian(d, n, r):
    return d[3] + d[2] / r - (1 + n * n) * d[1] / r**2 + 2 * n * n * d[0] / r**3


def _shear(d, n, r):
    """Kirchhoff's effective shear over -D."""
    return _slope_of_laplacian(d, n, r) - (1 - POISSON) * n * n / r * (d[1] / r - d[0] / r**2)


def deflection(n, inner, outer, radius, stiffness):
    """Amplitude of cos(n phi) at the radius of a unit point force [m/N]."""
    forms = [partial(_power, *form) for form in _forms(n)]
    at = {r: np.array([form(r) for form in forms]).T for r in (inner, radius, outer)}
    here = at[radius]
    zero = np.zeros(4)
    line = 1.0 / ((np.pi if n else 2.0 * np.pi) * radius)
    rows = [np.r_[at[inner][k], zero] for k in (0, 1)]
    rows += [np.r_[-here[k], here[k]] for k in range(4)]
    rows += [np.r_[zero, f(at[outer], n, outer)] for f in (_moment, _shear)]
    found = np.linalg.solve(rows, [0, 0, 0, 0, 0, line / stiffness, 0, 0])
    return here[0] @ found[:4]


def frequency(n, inner, outer, stiffness, mass):
    """Lowest frequency [Hz] of harmonic n, `mass` per area [kg/m^2]."""
    kinds = ((jv, jvp, -1.0), (yv, yvp, -1.0), (iv, ivp, 1.0), (kv, kvp, 1.0))

    def determinant(x):
        wave = x / outer

        def column(kind, r):
            f, fp, sign = kind
            d = [
                f(n, wave * r),
                wave * fp(n, wave * r, 1),
                wave**2 * fp(n, wave * r, 2),
                wave**3 * fp(n, wave * r, 3),
            ]
            return d

        size = [abs(kind[0](n, wave * outer)) + 1e-30 for kind in kinds]
        rows = []
        for r, ends in ((inner, (lambda d, r: d[0], lambda d, r: d[1])), (outer, (lambda d, r: _moment(d, n, r), lambda d, r: _shear(d, n, r)))):  # fmt: skip
            for k, end in enumerate(ends):
                scale = wave ** (k if r == inner else k + 2)
                rows.append(
                    [end(column(kind, r), r) / scale / s for kind, s in zip(kinds, size, strict=True)]
                )
        return np.linalg.det(rows)

    grid = np.arange(2.0, 12.0, 0.25)
    values = [determinant(x) for x in grid]
    first = next(k for k in range(len(grid) - 1) if values[k] * values[k + 1] < 0.0)
    root = brentq(determinant, grid[first], grid[first + 1])
    return (root / outer) ** 2 * np.sqrt(stiffness / mass) / (2.0 * np.pi)
