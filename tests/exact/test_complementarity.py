"""Lemke's solver: published problems, random ones, and problems without a solution."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from support.complementarity import ComplementarityError, solve_lcp


def murty(n):
    """The matrix on which pivoting may take 2^n steps: ones on the diagonal, twos above."""
    return np.eye(n) + 2.0 * np.triu(np.ones((n, n)), 1)


@pytest.mark.parametrize(
    ("matrix", "q", "solution"),
    [
        ([[2, 1], [1, 2]], [-5, -6], [4 / 3, 7 / 3]),
        (
            [[0, 0, -1, -1], [0, 0, 1, -2], [1, -1, 2, -2], [1, 2, -2, 4]],
            [2, 2, -2, -6],
            [2.8, 0, 0.8, 1.2],
        ),
        *((murty(n), -np.ones(n), [0] * (n - 1) + [1]) for n in (2, 5, 8)),
        ([[2, 1], [1, 2]], [5, 0], [0, 0]),
    ],
    ids=["two-by-two", "skew part", "murty 2", "murty 5", "murty 8", "nothing to do"],
)
def test_published_problems(matrix, q, solution):
    # a handful of pivots on small integers
    assert solve_lcp(matrix, q) == pytest.approx(solution, abs=1e-13)


def cantilever():
    """Deflection at i by a force at j of a clamped beam, EI 2800 N m^2, points at 0.1, 0.15 and 0.2 m."""
    near, far = np.minimum.outer(*[(0.1, 0.15, 0.2)] * 2), np.maximum.outer(*[(0.1, 0.15, 0.2)] * 2)
    return near**2 * (3.0 * far - near) / (6.0 * 2800.0)


@pytest.mark.parametrize(
    ("overlap", "force", "gap"),
    [
        ((10, 10, 10), (84, 0, 0), (0, 7.5, 15)),
        ((10, 20, 20), (0, 49.7778, 0), (0.37037, 0, 10)),
        ((10, 19, 29), (36, 0, 19.2), (0, 0.0714286, 0)),
    ],
)
def test_contact_on_a_cantilever_opens_in_spite_of_overlap(overlap, force, gap):
    # Bullinger et al. 2005, fig. 14: g~ < 0 everywhere, but not every point carries. [N], [um], to the digits
    # given
    flexibility, rigid = cantilever(), -1e-6 * np.array(overlap)
    found = solve_lcp(flexibility, rigid)
    assert found == pytest.approx(force, rel=1e-6)
    assert 1e6 * (rigid + flexibility @ found) == pytest.approx(gap, rel=2e-6, abs=1e-9)


@st.composite
def p_problems(draw, largest=7):
    """A positive definite matrix with a skew part: its problem has one solution."""
    n = draw(st.integers(1, largest))
    random = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    half = random.normal(size=(n, n))
    skew = random.normal(size=(n, n))
    matrix = half @ half.T + 0.1 * np.eye(n) + draw(st.sampled_from([0.0, 1.0, 5.0])) * (skew - skew.T)
    return matrix, random.normal(size=n)


def by_enumeration(matrix, q):
    """The solution by trying every set of positive unknowns."""
    n = q.size
    for chosen in product([False, True], repeat=n):
        active = np.flatnonzero(chosen)
        z = np.zeros(n)
        z[active] = np.linalg.solve(matrix[np.ix_(active, active)], -q[active])
        if np.all(z >= -1e-12) and np.all(matrix @ z + q >= -1e-10):
            return z
    raise AssertionError("a P-matrix has a solution for every q")


@given(p_problems())
@settings(max_examples=60)
def test_random_problems_against_enumeration(problem):
    # a symmetric part of at least 0.1 bounds the inverse of every block by 10: round-off of some 10^3 eps
    matrix, q = problem
    assert solve_lcp(matrix, q) == pytest.approx(by_enumeration(matrix, q), abs=1e-10)


@pytest.mark.parametrize("flexibility", [1e-12, 1.0, 1e9])
@pytest.mark.parametrize("gap", [1e-9, 1.0, 1e9])
def test_units_do_not_matter(flexibility, gap):
    # gaps in metres and flexibilities in m/N are small numbers; the pivots are those of the problem in other
    # units
    random = np.random.default_rng(1)
    for _ in range(200):
        half = random.normal(size=(6, 6))
        matrix, q = half @ half.T + 0.1 * np.eye(6), random.normal(size=6)
        found = solve_lcp(flexibility * matrix, gap * q) * (flexibility / gap)
        assert found == pytest.approx(solve_lcp(matrix, q), abs=1e-10)


@given(p_problems(largest=40))
def test_residuals_of_larger_problems(problem):
    matrix, q = problem
    z = solve_lcp(matrix, q)
    w = matrix @ z + q
    # complementary pivoting: each pair has one exact zero in z or one solved row in w
    tolerance = 1e-9 * (1.0 + np.abs(matrix).sum(axis=1).max() * np.abs(z).max())
    assert z.min() >= 0.0
    assert w.min() >= -tolerance
    assert np.abs(np.minimum(z, w)).max() <= tolerance


@pytest.mark.parametrize(
    ("matrix", "q"),
    [([[0.0]], [-1.0]), ([[-1.0]], [-1.0]), ([[1.0, 0.0], [0.0, 0.0]], [-1.0, -1.0])],
)
def test_no_solution_is_said(matrix, q):
    with pytest.raises(ComplementarityError, match="ray"):
        solve_lcp(matrix, q)


def test_too_few_pivots_are_said():
    with pytest.raises(ComplementarityError, match="limit"):
        solve_lcp(murty(5), -np.arange(1.0, 6.0), max_pivots=1)
