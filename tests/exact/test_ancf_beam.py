"""The planar ANCF element against its definition, in rigid motions, and in vibration."""

import numpy as np
import pytest
from scipy.linalg import eigh

from cvt_hpc.multibody.ancf_beam import beam, energies, random_lengths, tensions
from support.ancf import (
    equations,
    gradient,
    kinetic,
    lost,
    mass_and_stiffness,
    potential,
    ring,
    straight,
)

LENGTHS = random_lengths(1.5, 5, 0.3, 3)
BEAM = beam(LENGTHS, 0.9, 300.0, 2.0, 7.0, 3.0, 0.05, (2.0, -9.81))


def moving(make, seed=0):
    """A chain that is bent, stretched and moved by a few tenths of all that there is."""
    draw = np.random.default_rng(seed)
    q = make(LENGTHS, 1.1)
    return q + 0.1 * draw.normal(size=q.shape), 3.0 * draw.normal(size=q.shape)


@pytest.mark.parametrize("make", [straight, ring])
@pytest.mark.parametrize("alpha", [0.0, 3.0])
def test_forces_and_energies_are_those_of_the_definition(make, alpha, tell):
    q, u = moving(make)
    body = BEAM._replace(mass_damping=alpha)
    expected = -gradient(lambda q: potential(body, q), q) - 0.5 * gradient(lambda u: lost(body, q, u), u)
    _, found = equations(body, q, u)
    # a stage of 1e-12 s takes strain and mass as at an instant; the integral over directions is not exact
    accuracy = 1e-4 if alpha else 1e-10
    tell("forces of beams in absolute nodal coordinates by their energies [N]", found, expected)
    np.testing.assert_allclose(found, expected, rtol=0, atol=accuracy * abs(expected).max())
    assert equations(body, q, u, power=True) == pytest.approx(lost(body, q, u), rel=10.0 * accuracy)
    store = potential(BEAM, q)
    kinetic_energy, elastic, weight = energies(BEAM, q, u)
    assert (kinetic_energy, elastic + weight) == pytest.approx((kinetic(BEAM, u), store), rel=1e-12)


@pytest.mark.parametrize("make", [straight, ring])
def test_the_matrix_is_that_of_the_forces(make):
    """By central differences of a whole stage, which are exact for the cubic terms to 1e-8 of the forces."""
    still = BEAM._replace(mass_damping=0.0)
    q, u = moving(make)
    start, tau, h = 0.5 * u, 0.01, 1e-5
    matrix, _ = equations(still, q, u, start, tau)
    for k in range(u.size):
        step = np.zeros(u.shape)
        step.ravel()[k] = h
        sides = [equations(still, q + c * tau * step, u + c * step, start, tau)[1] for c in (-1, 1)]
        np.testing.assert_allclose(
            (sides[0] - sides[1]) / (2.0 * h), matrix[:, k], rtol=0, atol=1e-7 * abs(matrix).max()
        )


def test_the_damping_matrix_of_a_motion_across(tell):
    """alpha alone: its forces are linear in the speeds."""
    only = beam(LENGTHS, 0.9, 0.0, 0.0, mass_damping=3.0)
    q, u = moving(straight)
    with_damping, without = (equations(b, q, u, tau=1.0)[0] for b in (only, only._replace(mass_damping=0.0)))
    _, force = equations(only, q, u)
    across = -(with_damping - without) @ u.ravel()
    tell("forces of Rayleigh damping across a belt [N]", across, force)
    np.testing.assert_allclose(across, force, rtol=0, atol=1e-12)


def test_rigid_motions_store_and_lose_nothing(tell):
    q, u = moving(straight)
    free = BEAM._replace(gravity=(0.0, 0.0), mass_damping=0.0)
    c, s = np.cos(1.1), np.sin(1.1)
    turn = np.kron(np.eye(2), [[c, -s], [s, c]])
    _, force = equations(free, q, u)
    _, turned = equations(free, q @ turn.T + [3.0, -2.0, 0.0, 0.0], u @ turn.T)
    tell("forces of beams after a rigid motion [N]", turned, (force.reshape(-1, 4) @ turn.T).ravel())
    np.testing.assert_allclose(turned, (force.reshape(-1, 4) @ turn.T).ravel(), rtol=0, atol=1e-9)
    spin = np.stack([-q[:, 1], q[:, 0], -q[:, 3], q[:, 2]], 1)
    spun, still = (equations(free, q, speed)[1] for speed in (2.0 * spin + [1.0, 5.0, 0.0, 0.0], 0.0 * q))
    np.testing.assert_allclose(spun, still, rtol=0, atol=1e-10)
    relaxed = straight(LENGTHS) @ turn.T
    assert abs(equations(free, relaxed, 0.0 * relaxed)[1]).max() < 1e-11


def test_a_belt_that_runs_along_itself_loses_nothing():
    """A circle turns in itself; cubics differ from it by 5e-4 (l0 / R)^4 of the gradient."""
    lengths = np.full(40, 0.025)
    belt = beam(lengths, 0.1, 1e4, 0.02, 20.0, 5.0, 2e-3)
    q = ring(lengths, 1.01)
    u = 10.0 * np.stack([-q[:, 1], q[:, 0], -q[:, 3], q[:, 2]], 1)
    outward = 10.0 * np.stack([q[:, 0], q[:, 1], 0 * q[:, 2], 0 * q[:, 3]], 1)
    assert lost(belt, q, u) < 1e-6 * lost(belt, q, outward)
    forces = [equations(belt, q, speed)[1] for speed in (u, 0 * u)]
    np.testing.assert_allclose(*forces, rtol=0, atol=1e-3)  # of 67 N that the tension presses a node


def test_axial_force():
    q = straight(LENGTHS, 1.02)
    np.testing.assert_allclose(tensions(BEAM, q), 300.0 * 0.5 * (1.02**2 - 1.0) * 1.02, rtol=1e-12)


@pytest.mark.parametrize(
    ("axial", "bending", "stretch"), [(1e6, 26.0, 1.0), (1e5, 0.026, 1.002), (1e3, 3.0, 1.3)]
)
def test_frequencies_of_a_pinned_beam_and_string(axial, bending, stretch, tell):
    """m w^2 = N k^2 + EI k^4 in the length without load, N = EA e: exact for a beam stretched evenly."""
    lengths = random_lengths(0.45, 18, 0.12, 1)
    q = straight(lengths, stretch)
    mass, stiffness = mass_and_stiffness(beam(lengths, 0.1, axial, bending), q)
    across = np.arange(q.size).reshape(-1, 4)[:, [1, 3]].ravel()
    free = across[[k for k in range(across.size) if k not in (0, across.size - 2)]]
    squares = eigh(stiffness[np.ix_(free, free)], mass[np.ix_(free, free)], eigvals_only=True)[:4]
    k = np.arange(1, 5) * np.pi / 0.45
    exact = (0.5 * axial * (stretch**2 - 1.0) * k**2 + bending * k**4) / 0.1
    # from above, as Rayleigh's quotient: by (k l0)^4 / 720 for bending, of elements up to 12 % longer
    ratio = squares / exact
    tell("squares of the frequencies of pinned beams and strings", ratio, 1.0)
    assert (ratio > 1.0 - 1e-9).all() and (ratio < 1.0 + 2.0 * (k * 0.028) ** 4 / 720 + 1e-9).all()


def test_frequencies_along_a_free_bar():
    """n pi / L sqrt(EA / m), from above: by 1.1e-4 at the third mode, four elements a wave."""
    lengths = np.full(6, 0.1)
    q = straight(lengths)
    mass, stiffness = mass_and_stiffness(beam(lengths, 0.5, 2000.0, 1e-6), q)
    along = np.arange(q.size).reshape(-1, 4)[:, [0, 2]].ravel()
    squares = eigh(stiffness[np.ix_(along, along)], mass[np.ix_(along, along)], eigvals_only=True)[:4]
    exact = np.arange(4) * np.pi / 0.6 * np.sqrt(2000.0 / 0.5)
    np.testing.assert_allclose(np.sqrt(abs(squares)), exact, rtol=1.2e-4, atol=1e-3)


def test_random_lengths():
    lengths = random_lengths(1.2, 48, 0.12, 7)
    assert lengths.sum() == pytest.approx(1.2, rel=1e-14)  # eq. 3 asks for 0.1 mm
    mean = lengths / 0.025
    assert 0.85 < mean.min() < 0.9 and 1.1 < mean.max() < 1.16  # 12 %, and as much as the sum was off
    assert (lengths == random_lengths(1.2, 48, 0.12, 7)).all() and (
        lengths != random_lengths(1.2, 48, 0.12, 8)
    ).all()
