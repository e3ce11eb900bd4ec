"""The planar RCM element against its definition, against stored values of another program, and in vibration."""

import numpy as np
import pytest
from scipy.linalg import eigh

from cvt_hpc.models.beam_pushbelt.rcm import RcmBeam, equations_of_motion, line_point, mean_strain
from cvt_hpc.models.beam_pushbelt.ring import close, relaxed_ring
from support.rcm import (
    conserved,
    energies,
    equations,
    internal_coordinates,
    material_point,
    tangent_stiffness,
)

BEAM = RcmBeam(0.7, 0.9, 300.0, 2.0, 0.6)
Q = np.array([0, 0, 0.35, 0.02, 0.015, 0.68, 0.30, 0.52])
U = np.array([0.1, -0.2, 0.3, 0.05, -0.04, 0.15, 0.25, -0.1])


def mass_and_force(beam, q, u, stiff=0.0):
    mass, force = np.empty((8, 8)), np.empty(8)
    equations_of_motion(beam, q, u, stiff, mass, force)
    return mass, force


def test_stored_values(tell):
    # to the digits that are stored
    mass, force = mass_and_force(BEAM, Q, U)
    weight = -9.81 * np.isin(np.arange(8), [1, 6])
    internal = np.empty(8)
    internal_coordinates(BEAM.length, Q, internal)
    stored = {
        "internal": ".336127637377 .156867589998 .349265529012 .055824809306 .032099703692 -.000734470988 .046650296308 .170734470988",
        "diagonal": ".218958097902 .268151023898 .008304583509 .279476217775 .279476217775 .225368828047 .261740293754 .008285941751",
        "row": ".218958097902 -.022651192074 -.01770092519 -.081444847975 -.028902345309 .092836537026 .034581536733 .001323040761",
        "force": "21.948588199039 -4.327793672525 -6.102937419294 -57.840592675032 -2.680191250281 -21.925555819743 -1.857754437773 -1.311295811665",
        "energies": ".0122422155938636 1.01076162351047",
    }
    found = {
        "internal": internal,
        "diagonal": np.diag(mass),
        "row": mass[0],
        "force": force + mass @ weight,  # which were stored with gravity
        "energies": energies(BEAM, Q, U),
    }
    for name, text in stored.items():
        tell("mass, forces and energies by another program", found[name], np.array(text.split(), float))
        digits = 5e-8 if name == "force" else 1e-12  # forces were stored with those of differences
        np.testing.assert_allclose(found[name], np.array(text.split(), float), rtol=digits, atol=1e-12)


def test_straight_element():
    rest = np.array([0.0, 0, 0, 0, 0, 1, 0, 0])
    mass, _ = mass_and_force(RcmBeam(1.0, 1.0, 1.0, 1.0), rest, 0.0 * rest)
    stiff, _ = mass_and_force(RcmBeam(1.0, 1.0, 1.0, 1.0), rest, 0.0 * rest, stiff=1.0)
    bent = [1, 2, 3, 4, 6, 7]  # without x
    upper = np.triu_indices(6)
    stored = """553.15625 114.119792 458.666667 138.666667 76.84375 -28.213542 29.744309 127.283951 51.283951 28.213542
        -10.416184 556.543210 252.543210 138.666667 -51.283951 556.543210 458.666667 -127.283951 553.15625 -114.119792 29.744309"""
    np.testing.assert_allclose(
        1260 * mass[np.ix_(bent, bent)][upper], np.array(stored.split(), float), atol=1e-6
    )
    stored = """57 28.5 144 -144 -57 28.5 15.8821 82.1136 -61.8864 -28.5 12.6179 622.6173 -298.9827 -144 61.8864 622.6173 144
        -82.1136 57 -28.5 15.8821"""
    found = (stiff - mass)[np.ix_(bent, bent)][upper]
    np.testing.assert_allclose(found, np.array(stored.split(), float), atol=1e-4)
    np.testing.assert_allclose(1260 * mass[np.ix_([0, 5], [0, 5])], [[420, 210], [210, 420]], rtol=1e-14)


# The definition, in the coordinates of the centre and for complex numbers: a derivative by a complex step is exact.


def centre_coordinates(l0, q):
    x1, y1, p1, a1, a2, x2, y2, p2 = q
    mean, step = (p1 + p2) / 2, p2 - p1
    c, s = np.cos(step / 2), np.sin(step / 2)
    along = (x2 - x1) * np.cos(mean) + (y2 - y1) * np.sin(mean)
    across = (y2 - y1) * np.cos(mean) - (x2 - x1) * np.sin(mean)
    total, apart = 16 / 9 * (a1 + a2) + 5 / 36 * l0 * step, across / c
    eps = (along - s * total) / (l0 * c) - 1
    tilt = (11 / 2 * apart - 8 * (a1 - a2)) / l0
    al, ar, bl, br = (total + apart) / 2, (total - apart) / 2, (step + tilt) / 2, (step - tilt) / 2
    x = x1 + (1 + eps) * l0 / 2 * np.cos(p1) - al * np.sin(p1)
    y = y1 + (1 + eps) * l0 / 2 * np.sin(p1) + al * np.cos(p1)
    return x, y, p1 + bl, eps, al, bl, ar, br


def quartic(l0, q, first):
    """Deflection of a half as a polynomial of the material coordinate."""
    *_, al, bl, ar, br = centre_coordinates(l0, q)
    s = np.polynomial.Polynomial([0, 1])
    if first:
        bracket = bl * l0 * (2 * l0 - 5 * s) * (l0 + 2 * s) ** 2
        bracket -= s * ((8 * ar - 3 * br * l0) * (l0 + 2 * s) ** 2 + 8 * al * (l0**2 - 4 * l0 * s - 8 * s**2))
    else:
        bracket = -br * l0 * (2 * l0 + 5 * s) * (l0 - 2 * s) ** 2
        bracket -= s * ((8 * al - 3 * bl * l0) * (l0 - 2 * s) ** 2 + 8 * ar * (l0**2 + 4 * l0 * s - 8 * s**2))
    return s * bracket / (2 * l0**4)


def stations(l0):
    """Gauss points of both halves: 5 are exact for squares of quartics."""
    x, weight = np.polynomial.legendre.leggauss(5)
    half = [(0.25 * l0 * (x + side), 0.25 * l0 * weight, side < 0) for side in (-1, 1)]
    return [(s, w, first) for x, weight, first in half for s, w in zip(x, weight, strict=True)]


def position(l0, q, s, first):
    x, y, phi, eps, _, bl, _, br = centre_coordinates(l0, q)
    angle, w = (phi - bl if first else phi + br), quartic(l0, q, first)(s)
    c, sn = np.cos(angle), np.sin(angle)
    return np.array([x + (1 + eps) * s * c - w * sn, y + (1 + eps) * s * sn + w * c])


def gradient(function, q, step=1e-30):
    columns = [np.imag(function(q + 1j * step * unit)) / step for unit in np.eye(8)]
    return np.stack(columns, axis=-1)


def potential(beam, q):
    l0, eps = beam.length, centre_coordinates(beam.length, q)[3]
    w = {first: quartic(l0, q, first) for first in (True, False)}
    sloped = sum(weight * w[first].deriv()(s) ** 2 for s, weight, first in stations(l0))
    curved = sum(weight * (w[first].deriv(2)(s) - beam.curvature) ** 2 for s, weight, first in stations(l0))
    strain = eps + (1 + eps) / (2 * l0) * sloped
    return 0.5 * beam.axial_stiffness * l0 * strain**2 + 0.5 * beam.bending_stiffness * curved


STATES = [(Q, U)]
for seed in range(4):
    draw = np.random.default_rng(seed)
    spread = np.array([0.3, 0.3, 0.6, 0.05, 0.05, 0.3, 0.3, 0.6])
    turn = 3.0 * seed  # the element may point anywhere
    STATES.append(
        (
            spread * draw.uniform(-1, 1, 8)
            + [0, 0, turn, 0, 0, 0.7 * np.cos(turn), 0.7 * np.sin(turn), turn],
            5 * draw.normal(size=8),
        )
    )


@pytest.mark.parametrize(("q", "u"), STATES)
def test_mass_forces_and_energies_are_those_of_the_definition(q, u):
    beam = BEAM
    l0, mass, force, kinetic = beam.length, np.zeros((8, 8)), np.zeros(8), 0.0
    for s, weight, first in stations(l0):

        def jacobian(q, s=s, first=first):
            return gradient(lambda q: position(l0, q, s, first), q)

        at = jacobian(q)
        mass += beam.line_mass * weight * at.T @ at
        kinetic += 0.5 * beam.line_mass * weight * np.sum((at @ u) ** 2)
        h = 2e-5  # differences of fourth order: 1e-12 of rounding over h
        sides = [jacobian(q + k * h * u) @ u for k in (-2, -1, 1, 2)]
        acceleration = np.dot([1 / 12, -2 / 3, 2 / 3, -1 / 12], sides) / h
        force -= beam.line_mass * weight * at.T @ acceleration
    force -= gradient(lambda q: potential(beam, q), q)
    found_mass, found_force = mass_and_force(beam, q, u)
    np.testing.assert_allclose(found_mass, mass, rtol=0, atol=1e-13)
    np.testing.assert_allclose(found_force, force, rtol=0, atol=1e-9 * abs(force).max())
    np.testing.assert_allclose(energies(beam, q, u), [kinetic, potential(beam, q)], rtol=1e-12)
    for s in (-0.35, -0.2, -1e-9, 0.0, 0.1, 0.35):
        *found, angle = material_point(l0, q, s)
        np.testing.assert_allclose(found, position(l0, q, s, s < 0), rtol=0, atol=1e-14)
        of_end = q[2] if s < 0 else q[7]
        assert angle == pytest.approx(of_end + quartic(l0, q, s < 0).deriv()(s), abs=1e-12)


def test_line_and_its_rates():
    # against differences of the position along the line and by the coordinates: rounding over their steps
    l0, h = BEAM.length, 1e-5

    def tangent(q, s):
        sides = [np.array(material_point(l0, q, s + k * h)[:2]) for k in (-2, -1, 1, 2)]
        return np.dot([1 / 12, -2 / 3, 2 / 3, -1 / 12], sides) / h

    def angle(q, s):
        return np.arctan2(*tangent(q, s)[::-1])

    for s in (-0.31, -0.2, -0.03, 0.04, 0.1, 0.33):
        rows = np.empty((2, 8))
        point = line_point(l0, Q, s, *rows)
        t = np.array([point.cos, point.sin])
        np.testing.assert_allclose([point.x, point.y], material_point(l0, Q, s)[:2], rtol=0, atol=1e-15)
        np.testing.assert_allclose(point.stretch * t, tangent(Q, s), rtol=0, atol=1e-10)
        assert point.bend == pytest.approx((angle(Q, s + h) - angle(Q, s - h)) / (2 * h), abs=1e-5)
        for k, unit in enumerate(np.eye(8)):
            sides = [np.array(material_point(l0, Q + sign * h * unit, s)[:2]) for sign in (1, -1)]
            rate = (sides[0] - sides[1]) / (2 * h)
            expected = [t @ rate, t[0] * rate[1] - t[1] * rate[0]]
            np.testing.assert_allclose(rows[:, k], expected, rtol=0, atol=1e-5)
    stretched = Q.copy()
    stretched[5:7] += 0.01 * l0 * np.array([np.cos(0.41), np.sin(0.41)])  # nearly along the element
    assert mean_strain(l0, stretched) - mean_strain(l0, Q) == pytest.approx(0.01, rel=0.02)


def test_a_matrix_for_implicit_steps():
    # the stiffness of the straight stretched element without directions, by differences
    beam = BEAM._replace(curvature=0.0)
    rest = np.array([0.0, 0, 0, 0, 0, 0.71, 0, 0])
    mass, force = mass_and_force(beam, rest, 0 * rest)
    stiffness = (mass_and_force(beam, rest, 0 * rest, stiff=0.3)[0] - mass) / 0.3
    # but for what tension does by way of directions, of some EA eps = 4 N
    _, there = mass_and_force(beam, rest + 1e-6 * U, 0 * rest)
    assert abs(there - force + 1e-6 * stiffness @ U).max() < 5 * 1e-6
    assert np.linalg.eigvalsh(stiffness).min() > -1e-11


# Vibration: E = 5e7 N/m^2, density 920 kg/m^3, section 0.1 m x 0.1 m


def section(length, curvature=0.0):
    return RcmBeam(length, 9.2, 5e5, 5e7 * 0.1**4 / 12, curvature)


@pytest.mark.parametrize(
    ("elements", "ratios"),
    [
        (1, [1.00030, 1.00057]),
        (2, [1.00000, 1.00030, 1.0031, 1.00057]),
        (4, [1.00000, 1.00000, 1.00003, 1.00030]),
    ],
)
def test_frequencies_of_a_pinned_beam(elements, ratios):
    beam, size = section(1.5 / elements), 5 * elements + 3
    q = np.zeros(size)
    q[0::5] = beam.length * np.arange(elements + 1)

    def forces(q, of_mass=False):
        whole, total = np.zeros((size, size)), np.zeros(size)
        for i in range(0, size - 3, 5):
            mass, force = mass_and_force(beam, q[i : i + 8], np.zeros(8))
            whole[i : i + 8, i : i + 8] += mass
            total[i : i + 8] += force
        return whole if of_mass else total

    mass, stiffness = forces(q, of_mass=True), tangent_stiffness(forces, q)
    bent = [k for k in range(size) if k % 5 and k not in (1, 5 * elements + 1)]
    squares = eigh(stiffness[np.ix_(bent, bent)], mass[np.ix_(bent, bent)], eigvals_only=True)
    exact = np.array([29.5201, 118.0804, 265.6808, 472.3215])[: len(ratios)]
    np.testing.assert_allclose(np.sqrt(squares[: len(ratios)]) / exact, ratios, rtol=4e-5)


@pytest.mark.parametrize(
    ("elements", "ratios", "energy"),
    [(8, [1.024, 1.051, 1.052], 1.5), (12, [1.0021, 1.0083, 1.0166], 0.081)],
)
def test_frequencies_of_a_free_ring(elements, ratios, energy, tell):
    ring = relaxed_ring(section(np.pi / elements, 2.0), elements)
    stored = conserved(ring)[-1]
    assert stored == pytest.approx(energy, rel=0.02)

    def forces(q):
        ring.q[:-3] = q
        close(ring)
        return equations(ring)[1]

    q = ring.q[:-3].copy()
    for _ in range(4):  # to its equilibrium: what is stored otherwise softens some modes by 5 %
        q += np.linalg.lstsq(tangent_stiffness(forces, q), forces(q), rcond=1e-8)[0]
    assert abs(forces(q)).max() < 1e-6
    mass, _ = equations(ring)
    squares = eigh(tangent_stiffness(forces, q), mass, eigvals_only=True)
    assert abs(squares[:3]).max() < 1e-2  # rigid motions; others are some 5000
    thin_ring = np.array([72.232, 204.302, 391.73])
    tell("frequencies of a ring of beams over a thin ring's", np.sqrt(squares[[3, 5, 7]]) / thin_ring, 1.0)
    np.testing.assert_allclose(np.sqrt(squares[[3, 5, 7]]) / thin_ring, ratios, atol=5e-4)
