"""Friction laws against their formulas, written here once more and differentiated by a complex step.

In lanes against plain numbers.
"""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import LaneArray
from cvt_hpc.physics.friction import (
    formula_coefficient,
    friction_coefficient,
    friction_law,
    law_numbers,
    saturation,
    table_coefficient,
)
from cvt_hpc.physics.friction_laws import (
    FRICTION_LAWS,
    Law,
    friction_inert,
    friction_problems,
    largest_friction,
)

# mu(v) of the module's table, for complex v too: mu_k, g, v_s, v
FORMULAS = {
    "coulomb": lambda mu, g, vs, v: mu + 0.0 * v,
    "linear": lambda mu, g, vs, v: mu - g * vs + g * v if np.real(v) < vs else mu + 0.0 * v,
    "stribeck": lambda mu, g, vs, v: mu - g * vs * np.exp(-v / vs),
    "hyperbolic": lambda mu, g, vs, v: mu / (1.0 - g / mu * v),
    "cubic": lambda mu, g, vs, v: (
        thomsen_fidlin(mu, mu - 2.0 / 3.0 * g * vs, v / vs)
        if np.real(v) < np.sqrt(3.0) * vs
        else mu - 2.0 / 3.0 * g * vs + 0.0 * v
    ),
}
GIVEN = {"kinetic_friction": 0.08, "friction_gradient": -0.8, "stribeck_velocity": 0.05}
LAWS = [law.name.lower() for law in Law if law is not Law.TABLE]
FALLING = [kind for kind in LAWS if not friction_problems(GIVEN | {"friction_law": kind})]
# where the level is that of the job, in units of v_s: from the floor on, far out, at rest, at the minimum
KEPT_AT = {"linear": (1.0, 7.0), "stribeck": (60.0,), "hyperbolic": (0.0,), "cubic": (1.0,)}
# A formula of five operations and one exponential on numbers of order 1 loses a few units in the last place.
ROUND_OFF = 1e-14

levels = st.floats(0.01, 0.3)
gradients = st.floats(-5.0, -1e-3)
scales = st.floats(1e-3, 1.0)
# speed over stribeck_velocity: beyond the kinks of the linear law and of the cubic, where the slope is one or the other
shares = st.floats(0.0, 5.0).filter(lambda share: min(abs(share - 1.0), abs(share * share - 3.0)) > 1e-12)


def thomsen_fidlin(mu_k, mu_s, x):
    """The cubic in its authors' form: mu_s at rest, mu_k at x = 1."""
    return mu_s - 1.5 * (mu_s - mu_k) * (x - x * x * x / 3.0)


def test_each_law_has_its_formula_and_its_kept_level_here():
    assert set(FORMULAS) == set(LAWS) and set(KEPT_AT) == set(FALLING)


def coefficient(kind, mu_k, gradient, v_s, speed):
    return friction_coefficient(friction_law(kind, mu_k, gradient, v_s), speed, 1e5)


@pytest.mark.parametrize("kind", LAWS)
@given(levels, gradients, scales, shares)
def test_the_largest_coefficient_is_that_at_rest(kind, mu_k, gradient, v_s, share):
    gradient = 0.0 if kind == "coulomb" else gradient
    given = {"kinetic_friction": mu_k, "friction_gradient": gradient, "stribeck_velocity": v_s}
    largest = largest_friction({"friction_law": kind} | given)
    assert largest == pytest.approx(coefficient(kind, mu_k, gradient, v_s, 0.0)[0], rel=1e-12)
    assert coefficient(kind, mu_k, gradient, v_s, share * v_s)[0] <= largest * (1.0 + 1e-12)


def test_the_largest_coefficient_of_a_table_is_its_largest():
    assert largest_friction({"friction_law": "table", "table_mu": ((0.1, 0.08), (0.12, 0.09))}) == 0.12


@pytest.mark.parametrize("kind", LAWS)
@given(levels, gradients, scales, shares)
def test_law_and_its_slope(kind, mu_k, gradient, v_s, share):
    gradient = 0.0 if kind == "coulomb" else gradient
    speed = share * v_s
    tiny = 1e-30
    expected = FORMULAS[kind](mu_k, gradient, v_s, speed + tiny * 1j)
    found, slope = coefficient(kind, mu_k, gradient, v_s, speed)
    # The level may be the difference of parts as large as g v_s x^3, the slope of such as g x^2; the text's
    # cubic in mu_s - mu_k loses mu_k / v_s besides.
    third, square = min(share, 2.0) ** 3, min(share, 2.0) ** 2
    assert found == pytest.approx(expected.real, abs=ROUND_OFF * (mu_k - gradient * v_s * (1.0 + third)))
    lost = mu_k / v_s - gradient * (1.0 + square)
    assert slope == pytest.approx(expected.imag / tiny, abs=ROUND_OFF * lost)


@pytest.mark.parametrize("kind", LAWS)
@given(levels, gradients, scales, st.floats(0.0, 5.0))
def test_slope_is_between_the_differences_to_both_sides(kind, mu_k, gradient, v_s, share):
    gradient = 0.0 if kind == "coulomb" else gradient
    speed, h = (share + 1e-5) * v_s, 1e-5 * v_s
    below, (here, slope), above = (coefficient(kind, mu_k, gradient, v_s, speed + d) for d in (-h, 0.0, h))
    sides = (here - below[0]) / h, (above[0] - here) / h
    # round-off of the coefficients over h, and the curvature's own change within it
    left = 1e-15 * (mu_k - 10.0 * gradient * v_s) / h - 1e-6 * gradient
    assert min(sides) - left <= slope <= max(sides) + left


@pytest.mark.parametrize("kind", FALLING)
@given(levels, gradients, scales, shares)
def test_gradient_is_the_slope_at_rest_and_the_steepest(kind, mu_k, gradient, v_s, share):
    assert coefficient(kind, mu_k, gradient, v_s, 0.0)[1] == pytest.approx(gradient, rel=ROUND_OFF)
    assert coefficient(kind, mu_k, gradient, v_s, share * v_s)[1] >= gradient * (1.0 + ROUND_OFF)


@pytest.mark.parametrize(
    ("kind", "where"), [(kind, where) for kind in FALLING for where in KEPT_AT.get(kind, ())]
)
@given(levels, gradients, scales)
def test_kept_level_does_not_move_with_the_gradient(kind, where, mu_k, gradient, v_s):
    # exp(-60) is 1e-26: nothing is left of the falling part
    found, _ = coefficient(kind, mu_k, gradient, v_s, where * v_s)
    assert found == pytest.approx(mu_k, rel=1e-13 * (1.0 + abs(gradient) * v_s / mu_k))


@given(levels, gradients, scales, st.floats(0.0, 5.0))
def test_cubic_falls_to_its_minimum_returns_and_is_held(mu_k, gradient, v_s, share):
    at_rest, _ = coefficient("cubic", mu_k, gradient, v_s, 0.0)
    assert at_rest == pytest.approx(mu_k - 2.0 / 3.0 * gradient * v_s, rel=1e-13)
    lowest, slope = coefficient("cubic", mu_k, gradient, v_s, v_s)
    # v_s times the rounded 1 / v_s is 1 but for a unit in the last place
    assert slope == pytest.approx(0.0, abs=-ROUND_OFF * gradient)
    found, _ = coefficient("cubic", mu_k, gradient, v_s, share * v_s)
    assert lowest - 1e-12 <= found <= at_rest + 1e-12
    held, slope = coefficient("cubic", mu_k, gradient, v_s, (np.sqrt(3.0) + share) * v_s * (1.0 + 1e-12))
    # just below sqrt(3) the slope is -2 g: a relative offset of 1e-12 in speed shows as 1e-12 g v_s
    assert held == pytest.approx(at_rest, abs=1e-11 * (mu_k + abs(gradient) * v_s))
    assert slope == 0.0


@st.composite
def tables(draw):
    forces = draw(st.lists(st.floats(0.0, 1e6), min_size=2, max_size=5, unique_by=lambda f: round(f, -3)))
    speeds = draw(st.lists(st.floats(0.0, 2.0), min_size=2, max_size=5, unique_by=lambda v: round(v, 2)))
    mu = [[draw(st.floats(0.01, 0.5)) for _ in speeds] for _ in forces]
    return np.sort(forces), np.sort(speeds), np.array(mu)


def bilinear(forces, speeds, mu, speed, force):
    """Interpolation by numpy, row by row; np.interp holds the ends."""
    return np.interp(force, forces, [np.interp(speed, speeds, row) for row in mu])


@given(tables(), st.floats(0.0, 3.0), st.floats(0.0, 2e6))
def test_table_is_bilinear_and_held_outside(tell, table, speed, force):
    law = friction_law("table", 0.08, 0.0, 0.05, *table)
    found, slope = friction_coefficient(law, speed, force)
    # positions in an interval carry the round-off of the grid's values, up to a hundred times the interval
    tell("coefficient of a table by bilinear interpolation", found, bilinear(*table, speed, force))
    assert found == pytest.approx(bilinear(*table, speed, force), abs=1e-12)
    forces, speeds, mu = table
    if speed < speeds[0] or speed >= speeds[-1]:
        assert slope == 0.0
    else:
        j = np.searchsorted(speeds, speed, side="right") - 1  # at a knot: the interval above
        ends = [bilinear(*table, v, force) for v in speeds[j : j + 2]]
        assert slope == pytest.approx((ends[1] - ends[0]) / (speeds[j + 1] - speeds[j]), abs=1e-9)


def test_table_by_hand():
    law = friction_law(
        "table", 0.08, 0.0, 0.05, (1e4, 3e4), (0.0, 0.1, 0.3), ((0.1, 0.2, 0.4), (0.5, 0.8, 0.2))
    )
    assert friction_coefficient(law, 0.05, 2e4) == pytest.approx((0.4, 2.0))
    assert friction_coefficient(law, 0.2, 1.5e4) == pytest.approx((0.35, -0.25 * 3.0 + 0.75))
    assert friction_coefficient(law, 1.0, 1e9) == pytest.approx((0.2, 0.0))
    # the gradient that the module defines for a table: first interval, lowest force
    assert friction_coefficient(law, 0.0, 0.0) == pytest.approx((0.1, 1.0))


@given(st.floats(-3.0, 3.0), st.floats(1e-3, 1.0))
def test_saturation(speed, width):
    tiny = 1e-30
    exact = np.tanh((speed + tiny * 1j) / width)
    factor, slope = saturation(speed, 1.0 / width)
    assert factor == pytest.approx(exact.real, abs=ROUND_OFF)
    # 1 - tanh^2 is formed by a difference: absolute, not relative, in units of 1 / width
    assert slope == pytest.approx(exact.imag / tiny, abs=ROUND_OFF / width)
    assert saturation(-speed, 1.0 / width) == pytest.approx((-factor, slope), abs=0.0)


WIDTHS = {np.float64: 8, np.float32: 16}
# A formula of some ten operations and an exponential on numbers of order 1, of which it may take differences.
LANE_ROUND_OFF = {np.float64: 2e-14, np.float32: 1e-5}
MU, GRADIENT, SCALE, SPEED, FORCE, FOUND, SLOPE = range(7)
TABLE = (
    (1e4, 3e4, 2e5),
    (0.0, 0.05, 0.1, 0.8),
    ((0.10, 0.20, 0.15, 0.08), (0.5, 0.3, 0.2, 0.1), (0.07, 0.09, 0.3, 0.2)),
)
ONE_SPEED = ((1e4, 3e4), (0.1, 0.3), ((0.1, 0.2), (0.3, 0.2)))


@kernel
def coefficients(kind: int, table: tuple[np.ndarray, np.ndarray, np.ndarray], a: LaneArray) -> None:
    for j in range(a.rows):
        numbers = law_numbers(a[j, MU], a[j, GRADIENT], a[j, SCALE])
        if kind == Law.TABLE:
            a[j, FOUND], a[j, SLOPE] = table_coefficient(table, a[j, SPEED], a[j, FORCE])
        else:
            a[j, FOUND], a[j, SLOPE] = formula_coefficient(kind, numbers, a[j, SPEED])


@kernel
def saturations(a: LaneArray) -> None:
    for j in range(a.rows):
        a[j, FOUND], a[j, SLOPE] = saturation(a[j, SPEED], 1.0 / a[j, SCALE])


def arguments(dtype, rows=500):
    """Coefficients and speeds of each lane, at rest and at the laws' kinks too."""
    random, lanes = np.random.default_rng(1), WIDTHS[dtype]
    a = LaneArray(rows, 7, lanes, dtype)
    shape = rows, lanes
    a.data[:, MU] = random.uniform(0.01, 0.3, shape)
    a.data[:, GRADIENT] = random.uniform(-5.0, 0.0, shape)
    a.data[:, SCALE] = random.uniform(1e-3, 1.0, shape)
    share = random.uniform(0.0, 3.0, shape)
    share[:, 0], share[0], share[1] = 0.0, 1.0, np.sqrt(3.0)
    a.data[:, SPEED] = share * a.data[:, SCALE]
    a.data[:, FORCE] = random.uniform(0.0, 3e5, shape)
    return a


def no_table(dtype):
    return tuple(np.zeros(shape, dtype) for shape in (0, 0, (0, 0)))


def each(a):
    """All places of the array, one after the other, in double precision."""
    return a.data.astype(float).transpose(0, 2, 1).reshape(-1, 7)


@pytest.mark.parametrize("dtype", WIDTHS)
@pytest.mark.parametrize("law", [law for law in Law if law is not Law.TABLE], ids=lambda law: law.name)
def test_laws_in_lanes_are_the_plain_ones(law, dtype):
    a = arguments(dtype)
    coefficients(int(law), no_table(dtype), a)
    for mu, gradient, scale, speed, force, found, slope in each(a):
        kept = friction_law(law.name.lower(), mu, gradient, scale)
        expected, expected_slope = friction_coefficient(kept, speed, force)
        # parts as large as g v_s x^3 are subtracted from each other
        share = min(speed / scale, 2.0)
        lost = mu - gradient * scale * (1.0 + share**3)
        assert found == pytest.approx(expected, abs=LANE_ROUND_OFF[dtype] * lost)
        if dtype is np.float64 and law is not Law.STRIBECK:  # whose exponential is another one
            assert (found, slope) == (expected, expected_slope)
        # at a kink the slope is one or the other
        if min(abs(share - 1.0), abs(share * share - 3.0)) > LANE_ROUND_OFF[dtype]:
            assert slope == pytest.approx(expected_slope, abs=LANE_ROUND_OFF[dtype] * lost / scale)


@pytest.mark.parametrize("dtype", WIDTHS)
@pytest.mark.parametrize("table", [TABLE, ONE_SPEED], ids=["table", "table from a speed on"])
def test_tables_in_lanes_are_the_plain_ones(table, dtype):
    a = arguments(dtype)
    # at every knot, and outside
    knots = [(speed, force) for speed in (*table[1], 0.0, 99.0) for force in (*table[0], 0.0, 1e9)]
    for j, (speed, force) in enumerate(knots):
        a.data[j, SPEED, 0], a.data[j, FORCE, 0] = speed, force
    coefficients(int(Law.TABLE), tuple(np.array(part, dtype) for part in table), a)
    law = friction_law("table", 0.08, 0.0, 0.05, *table)
    for _, _, _, speed, force, found, slope in each(a):
        expected, expected_slope = friction_coefficient(law, speed, force)
        # sums over intervals; single precision knows knots to 6e-8, on slopes of 6 s/m
        assert found == pytest.approx(expected, abs=LANE_ROUND_OFF[dtype])
        # at a knot it is that of the one interval or of the other
        if dtype is np.float64 or np.abs(np.subtract(table[1], speed)).min() > 1e-6:
            assert slope == pytest.approx(expected_slope, abs=10.0 * LANE_ROUND_OFF[dtype])


@pytest.mark.parametrize("dtype", WIDTHS)
def test_saturation_in_lanes_is_the_plain_one(dtype):
    a = arguments(dtype)
    a.data[1, SPEED] = 1e6  # what is left there is held within the exponent's range
    saturations(a)
    for _, _, width, speed, _, factor, slope in each(a):
        expected, expected_slope = saturation(speed, 1.0 / width)
        assert factor == pytest.approx(expected, abs=LANE_ROUND_OFF[dtype])
        assert slope == pytest.approx(expected_slope, abs=LANE_ROUND_OFF[dtype] / width)


def test_every_law_that_a_job_may_name_has_all_its_parts():
    """A law is declared in `friction_laws`, and has its formula in `friction`: nothing else knows of it."""
    values = GIVEN | {
        "table_force": (0.0, 1.0),
        "table_speed": (0.0, 1.0),
        "table_mu": ((0.1, 0.1), (0.1, 0.1)),
    }
    for name in FRICTION_LAWS:
        p = values | {"friction_law": name}
        assert [key for key, *_ in friction_problems(p)] == ["friction_gradient"] * (name == "coulomb")
        idle = friction_inert(p)
        law = friction_law(name, *values.values())
        for key in ("friction_gradient", "stribeck_velocity"):
            other = friction_law(name, *(values | {key: 1.1 * values[key]}).values())
            moved = friction_coefficient(law, 0.03, 0.5) != friction_coefficient(other, 0.03, 0.5)
            assert moved == (key not in idle) or (name, key) == ("coulomb", "friction_gradient"), (name, key)
        a = arguments(np.float64, rows=2)
        coefficients(law.kind, (law.table_force, law.table_speed, law.table_mu), a)
        assert np.isfinite(a.data[:, FOUND]).all(), name


def test_a_law_that_is_none_is_an_error_and_never_another_law():
    none = max(Law) + 1
    with pytest.raises(ValueError, match="expected one of coulomb, .*; found viscous"):
        friction_law("viscous", 0.08, -0.8, 0.05)
    law = friction_law("stribeck", 0.08, -0.8, 0.05)._replace(kind=none)
    assert np.isnan(friction_coefficient(law, 0.1, 1e5)).all()
    a = arguments(np.float64, rows=2)
    coefficients(none, no_table(np.float64), a)
    assert np.isnan(a.data[:, [FOUND, SLOPE]]).all()
