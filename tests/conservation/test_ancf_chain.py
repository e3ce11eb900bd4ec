"""ANCF chains that nothing holds: what the steps conserve, their order, falling and rotating beams."""

import numpy as np
import pytest

from cvt_hpc.multibody.ancf_beam import SHAPES, WEIGHTS, at_places, beam, energies
from cvt_hpc.multibody.ancf_equations import chain
from cvt_hpc.solvers.generalised_alpha import Scheme, generalised_alpha
from support.ancf import accelerate, advance, cross, ring, straight

LENGTHS = np.array([0.09, 0.12, 0.1, 0.08, 0.11, 0.1])
GRAVITY = np.array([2.0, -9.81])
MIDPOINT, EULER = generalised_alpha(1.0), Scheme(1.0, 1.0, 1.0)


def conserved(body, moved):
    """Momentum along x and y, angular momentum about the origin, total energy."""
    mass = body.line_mass * body.lengths[:, None] * WEIGHTS
    position, speed = (at_places(body, nodes, SHAPES[:, 0]) for nodes in (moved.q, moved.v))
    momentum = (mass[..., None] * speed).sum((0, 1))
    return np.array([*momentum, (mass * cross(position, speed)).sum(), sum(energies(body, moved.q, moved.v))])


def centre(body, q):
    """Centre of mass [m]."""
    weight = (body.lengths[:, None] * WEIGHTS)[..., None]
    return (weight * at_places(body, q, SHAPES[:, 0])).sum((0, 1)) / body.lengths.sum()


def tumbling(make, shaken=0.3, **constants):
    """Thrown, turning and bent: waves of 63 m/s along 0.1 m elements, which a step of 1 ms does not resolve."""
    body = beam(LENGTHS, 0.5, 2000.0, 0.05, **constants)
    q = make(LENGTHS, 1.05)
    spin = np.stack([-q[:, 1], q[:, 0], -q[:, 3], q[:, 2]], 1)
    v = 8.0 * spin + [1.0, 2.0, 0.0, 0.0] + shaken * np.random.default_rng(1).normal(size=q.shape)
    return body, chain(q, v)


def moved(body, flying, scheme, dt, duration):
    steps = round(duration / dt)
    assert accelerate(body, flying)
    assert advance(body, flying, scheme, dt, steps, 1e-12, 20) == steps
    return flying


@pytest.mark.parametrize("make", [ring, straight])
def test_the_midpoint_rule_conserves_momenta_and_energy(make, tell):
    body, flying = tumbling(make)
    before = conserved(body, flying)
    after = conserved(body, moved(body, flying, MIDPOINT, 1e-3, 0.3))
    tell("momenta and energy of beams that share nodes", after / before, 1.0)
    # to what stages leave open, 1e-12 m/s each
    np.testing.assert_allclose(after, before, rtol=1e-9)


def test_a_falling_beam():
    body, flying = tumbling(straight, gravity=tuple(GRAVITY))
    before = conserved(body, flying)
    start = centre(body, flying.q)
    after = conserved(body, moved(body, flying, MIDPOINT, 1e-3, 0.2))
    np.testing.assert_allclose(after[:2], before[:2] + 0.2 * 0.5 * 0.6 * GRAVITY, rtol=1e-10)
    assert after[3] == pytest.approx(before[3], rel=1e-10)
    fallen = centre(body, flying.q) - start
    np.testing.assert_allclose(fallen, 0.2 * before[:2] / 0.3 + 0.5 * 0.2**2 * GRAVITY, rtol=1e-9)


def test_a_rotating_bar():
    """It stands still in the turning frame: EA r'' = -m w^2 r with free ends, r = sin(c s) / (c cos(c L / 2)).

    That is of first order in the strain, here up to 4e-4.
    """
    stiffness, speed, half = 2e4, 20.0, 0.3
    body = beam(LENGTHS, 0.5, stiffness, 0.05)
    q = straight(LENGTHS)
    s, c = q[:, 0] - half, speed * np.sqrt(0.5 / stiffness)
    q[:, 0], q[:, 2] = (
        np.sin(c * s) / (c * np.cos(c * half)),
        np.cos(c * s) / np.cos(c * half),
    )
    v = speed * np.stack([-q[:, 1], q[:, 0], -q[:, 3], q[:, 2]], 1)
    flying, strain = chain(q, v), q[3, 2] - 1.0
    assert 4e-4 < strain < 5e-4
    moved(body, flying, MIDPOINT, 2e-4, 0.5)  # 1.6 turns
    radius = np.hypot(flying.q[:, 0], flying.q[:, 1])
    elongation = 2.0 * (radius[[0, -1]].mean() - half)
    expected = 2.0 * (abs(q[0, 0]) - half)
    assert elongation == pytest.approx(expected, rel=5e-3)
    # the midpoint rule turns by 2 atan(w dt / 2) a step
    turned = np.arctan2(flying.q[-1, 1], flying.q[-1, 0])
    angle = 0.5 / 2e-4 * 2.0 * np.arctan(speed * 1e-4)
    assert np.angle(np.exp(1j * (turned - angle))) == pytest.approx(0.0, abs=1e-4)


@pytest.mark.parametrize(
    ("scheme", "order"),
    [(MIDPOINT, 2.0), (generalised_alpha(0.5), 2.0), (generalised_alpha(0.0), 2.0), (EULER, 1.0)],
)
def test_order(scheme, order):
    ends = []
    for steps in (200, 400, 800):
        body, flying = tumbling(
            straight, shaken=0.0, axial_damping=0.3, bending_damping=1e-4, mass_damping=1.0
        )
        moved(body, flying, scheme, 0.02 / steps, 0.02)
        ends.append(flying.q.copy())
    ratio = np.linalg.norm(ends[1] - ends[0]) / np.linalg.norm(ends[2] - ends[1])
    assert np.log2(ratio) == pytest.approx(order, abs=0.1)


def test_what_the_step_does_not_resolve_is_damped_as_asked():
    """A bar vibrates along itself so fast that a step turns it by hundreds of periods."""
    left = []
    for radius in (1.0, 0.7, 0.3):
        body = beam(np.full(4, 0.01), 0.1, 1e9, 1e-3)
        q = straight(body.lengths)
        v = np.zeros_like(q)
        v[:, 0] = 1e-3 * (-1.0) ** np.arange(5)
        flying = chain(q, v)
        before = conserved(body, flying)[3]
        moved(body, flying, generalised_alpha(radius), 1e-4, 2e-3)
        left.append(conserved(body, flying)[3] / before)
    assert left[0] == pytest.approx(1.0, rel=1e-6)
    assert left[1] < 0.7**38 * 40 and left[2] < 1e-10
