"""Stiffness of a belt drive about a state, against second differences of its energy and against bristles."""

import numpy as np
import pytest

from cvt_hpc.models.belt_drive import contact, pulleys
from cvt_hpc.models.belt_drive.drive import Drive, matrices, state
from cvt_hpc.models.belt_drive.friction import Friction, Treatment
from cvt_hpc.multibody.ancf_beam import at_places, beam, energies
from cvt_hpc.physics.friction import friction_law
from support.ancf import ring

LENGTHS = np.array([0.09, 0.1, 0.12, 0.08, 0.1, 0.11])
CENTRE, RADIUS = np.array([[0.0, 0.0], [0.15, 0.01]]), np.array([0.11, 0.09])
STIFFNESS, SHEAR = 4e4, 1e5


def pressed(treatment):
    """A ring pressed by a pulley inside and by one that reaches in from outside, at rest; all contacts slide."""
    rubbing = Friction(treatment, friction_law("coulomb", 0.3, 0.0, 1.0), 1e-3, 1e6, 1e-9, SHEAR)
    touching = contact.Contact(contact.contact_shapes(3), STIFFNESS, 300.0, rubbing, np.zeros((6, 3)), 0.0)
    arms = pulleys.Arms(np.zeros((0, 2)), *[np.zeros(0)] * 6, 0.0, pulleys.no_struts(0))
    turning = pulleys.Pulleys(
        CENTRE, RADIUS, np.array([0.0, 0.02]), np.array([-1, -1]), arms, *np.zeros((2, 2))
    )
    made = Drive(beam(LENGTHS, 0.9, 300.0, 2.0), turning, touching)
    q = ring(LENGTHS, 1.0) + 2e-3 * np.random.default_rng(5).normal(size=(6, 4))
    found = state(made, q, np.zeros_like(q), np.zeros(2))
    depth, weight = depths(made, q)
    found.touch.normal[:] = weight * STIFFNESS * np.maximum(depth, 0.0)
    found.touch.memory.side[:] = 1
    found.touch.memory.slip[:] = 1.0
    return made, found


def depths(made, q):
    """How deep points are in the pulleys, (P, k, C) [m], and lengths that count for them."""
    away = at_places(made.beam, q, made.contact.shape) - CENTRE[:, None, None]
    weight = LENGTHS[:, None] / len(made.contact.shape)
    return RADIUS[:, None, None] - np.hypot(*np.moveaxis(away, -1, 0)), weight


@pytest.mark.parametrize("treatment", [Treatment.REGULARISED, Treatment.BRISTLE])
def test_the_stiffness_of_a_belt_that_slides_is_the_slope_of_its_elastic_forces(treatment):
    """Of belt and contacts; normal forces turn with the points that they press."""
    made, found = pressed(treatment)
    q = found.chain.q

    def energy(at):
        depth, weight = depths(made, at)
        pressing = 0.5 * (weight * STIFFNESS * np.maximum(depth, 0.0) ** 2).sum()
        return energies(made.beam, at, np.zeros_like(at))[1] + pressing

    stiffness = matrices(made, found)[1].toarray()
    turned = (found.touch.normal / (RADIUS[:, None, None] - depths(made, q)[0])).sum()
    assert turned > 0.01 * abs(stiffness).max()  # what is sought is not too small to be seen
    draw, h = np.random.default_rng(6), 1e-5
    for _ in range(8):
        way = draw.normal(size=q.shape)
        second = (energy(q + h * way) - 2.0 * energy(q) + energy(q - h * way)) / h**2
        along = np.append(way.ravel(), 0.0)
        assert along @ stiffness @ along == pytest.approx(second, rel=1e-5)


@pytest.mark.parametrize("pulley", [0, 1])
def test_bristles_tie_the_belt_to_a_pulley_at_which_it_sticks(pulley):
    """A belt that turns about a pulley shears them by its distance, and not if the pulley turns with it."""
    made, found = pressed(Treatment.BRISTLE)
    free = matrices(made, found)[1]
    found.touch.memory.side[pulley, ::2] = 0
    tied = matrices(made, found)[1] - free
    depth, weight = depths(made, found.chain.q)
    held = np.where(found.touch.normal > 0.0, weight * SHEAR * (RADIUS[:, None, None] - depth) ** 2, 0.0)
    wanted = held[pulley, ::2].sum()
    assert 0.0 < wanted < held[pulley].sum()
    q = found.chain.q - np.append(CENTRE[pulley], [0.0, 0.0])
    turning = np.stack([-q[:, 1], q[:, 0], -q[:, 3], q[:, 2]], 1).ravel()
    belt, driven = np.append(turning, 0.0), np.append(np.zeros_like(turning), 1.0)
    assert belt @ tied @ belt == pytest.approx(wanted, rel=1e-9)
    assert driven @ tied @ driven == pytest.approx((0.0, wanted)[pulley], rel=1e-9)
    assert abs(tied @ (belt + driven)).max() < 1e-9 * wanted or pulley == 0
