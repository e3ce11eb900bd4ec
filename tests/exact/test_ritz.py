"""Discs with inertia: a mode alone against its exact motion, at rest, under force and turning; contact at rest."""

import numpy as np
import pytest

from cvt_hpc.lanes import LaneArray
from cvt_hpc.physics import compliance
from cvt_hpc.physics.compliance import lane_contact, solve_contact
from cvt_hpc.physics.moving_discs import AHEAD, GIVES, PLACE, lane_discs, open_gaps, settle, turn_discs
from cvt_hpc.physics.ritz import modal_flexibilities, moving_modes
from support.wraps import ARC, RADIUS, STATIONS, courses, random_wrap

SPACING = ARC / (STATIONS - 1)
WRAP = (SPACING / RADIUS * np.arange(STATIONS), np.full(STATIONS, SPACING / RADIUS))
FLEXIBILITY, FREQUENCY, DAMPING, HARMONIC = 4e-9, 4730.0, 0.01, 2.0
PACE = 2.0 * np.pi * FREQUENCY
TABLE = (np.array([HARMONIC]), np.array([FLEXIBILITY]), np.array([1.0 / (FLEXIBILITY * PACE**2)]))
WEIGHT = np.ones(STATIONS)


def mode(step, damping=DAMPING):
    found = moving_modes(TABLE, 2e4, damping, step, WRAP)
    return found, lane_discs([found], [1.0], np.float64)


def march(discs, step, turning, pushes):
    """Displacements of cosine and sine at the end of each step, (steps, 2), under forces of the stations there [N]."""
    stations, found, states = LaneArray(STATIONS, 2, 1), [], discs.states.data[:, :, 0]
    for push in pushes:
        found.append(states[:, AHEAD] + states[:, GIVES] * (discs.shapes @ push))
        stations.data[:, 1, 0] = push
        turn_discs(discs, WEIGHT, stations, 1, turning, step)
    return np.array(found)


def test_a_free_mode_vibrates_by_newmarks_rule():
    # without damping the amplitude stays, the frequency is (2 / dt) atan(omega dt / 2)
    step = 4.6e-6
    modes, discs = mode(step, 0.0)
    settle(discs, 0, modes, 1.0, np.ones(STATIONS))
    first = discs.states.data[:, PLACE, 0].copy()
    # the force ends at once, in a step of its own: from there on the mode is free
    free = march(discs, step, 0.0, np.zeros((400, STATIONS)))[1:]
    pace = 2.0 / step * np.arctan(0.5 * PACE * step)
    shape = np.linalg.lstsq(
        np.array([np.cos(pace * step * np.arange(399)), np.sin(pace * step * np.arange(399))]).T,
        free,
        rcond=None,
    )
    assert np.sqrt(shape[1].max() / 399) < 1e-9 * np.abs(first).max()
    assert np.linalg.norm(shape[0], axis=0) == pytest.approx(np.abs(first), rel=0.01)


def test_a_force_that_vibrates_is_amplified_as_the_frequencies_say():
    step, driven = 4.6e-6, 600.0
    modes, discs = mode(step, 0.05)
    shape = modes.shapes[0]
    time = step * np.arange(1, 6001)
    phase = 2.0 * np.pi * driven * time
    found = march(discs, step, 0.0, np.cos(phase)[:, None] * shape)[-2000:, 0]
    pushed = shape @ shape
    share = driven / FREQUENCY
    expected = FLEXIBILITY * pushed / np.hypot(1.0 - share**2, 2.0 * 0.05 * share)
    fit = np.linalg.lstsq(np.array([np.cos(phase), np.sin(phase)]).T[-2000:], found, rcond=None)[0]
    assert np.hypot(*fit) == pytest.approx(expected, rel=1e-4)
    assert expected > 1.016 * FLEXIBILITY * pushed


@pytest.mark.parametrize("steps", [1, 2])
def test_a_disc_that_turns_under_a_steady_force_sags_downstream(steps):
    # in axes at rest q = a + i b turns with i n W: (w^2 - n^2 W^2 - 2 i zeta w n W) q = c w^2 F of a force at 0
    step, turning, damping = 4e-6 / steps, 5000.0, 0.1
    modes, discs = mode(step, damping)
    push = np.zeros(STATIONS)
    push[0] = 1.0
    found = march(discs, step, turning, np.tile(push, (2000 * steps, 1)))[-1]
    turned = HARMONIC * turning
    force = FLEXIBILITY * PACE**2 * modes.shapes[0, 0]
    exact = force / (PACE**2 - turned**2 - 2j * damping * PACE * turned)
    assert exact.imag > 0.03 * exact.real
    # what is left is of second order in the step
    assert found == pytest.approx([exact.real, exact.imag], rel=4e-4 / steps**2)


def test_modes_at_rest_are_flexibilities():
    found = modal_flexibilities(TABLE[0], TABLE[1], *WRAP)
    apart = SPACING / RADIUS * (np.arange(STATIONS)[:, None] - np.arange(STATIONS))
    spread = np.sinc(0.5 * HARMONIC * SPACING / (np.pi * RADIUS)) ** 4
    assert found == pytest.approx(FLEXIBILITY * spread * np.cos(HARMONIC * apart), abs=1e-9 * FLEXIBILITY)


def solved(contact, gaps):
    contact.stations.data[:, compliance.GAP] = gaps
    if contact.discs.place.size:
        open_gaps(contact.discs, contact.stations, compliance.GAP)
    solve_contact(contact, 300)
    return np.where(
        contact.stations.data[:, compliance.CLOSED] > 0.5,
        np.maximum(contact.stations.data[:, compliance.PUSH], 0.0),
        0.0,
    )


def test_contact_with_discs_at_rest_is_that_of_flexibilities():
    random = np.random.default_rng(3)
    table = (np.array([0.0, 1.0, 2.0, 2.0, 5.0]), 1e-9 * np.array([2.0, 4.6, 3.8, 0.1, 0.4]), np.array([0.5, 0.2, 0.2, 0.8, 0.0]))  # fmt: skip
    modes = moving_modes(table, 2e4, DAMPING, 4.6e-6, WRAP)
    assert modes.place.size == 4  # the fifth has no mass
    flexibilities = modal_flexibilities(table[0], table[1], *WRAP)
    wraps = []
    for stiffness in (1.0, 0.5, np.inf) * 2 + (1.0, 0.5):
        wrap = random_wrap(random, 1.0)._replace(flexibilities=flexibilities, disc_compliance=1.0 / stiffness)
        wraps.append(wrap)
    gaps = courses(random, 8)[0]
    still = lane_contact(wraps, np.float64)
    expected = solved(still, gaps)
    moving = lane_contact([wrap._replace(modes=modes) for wrap in wraps], np.float64)
    assert np.abs(moving.matrix.data - still.matrix.data)[:, :STATIONS].max() > 1e-3
    for lane, wrap in enumerate(wraps):
        settle(moving.discs, lane, modes, wrap.disc_compliance, wrap.weight * expected[:, lane])
    size = expected.max()
    for _ in range(3):
        found = solved(moving, gaps)
        assert found == pytest.approx(expected, abs=1e-8 * size)
        # and they stay at rest
        before = moving.discs.states.data[:, AHEAD].copy()
        moving.stations.data[:, compliance.FORCED] = found
        turn_discs(moving.discs, wraps[0].weight, moving.stations, compliance.FORCED, 0.0, 4.6e-6)
        assert moving.discs.states.data[:, AHEAD] == pytest.approx(before, abs=1e-8 * np.abs(before).max())


def test_modes_above_the_limit_have_no_inertia():
    assert moving_modes(TABLE, 4700.0, DAMPING, 1e-6, WRAP).place.size == 0
    assert moving_modes(TABLE, 4760.0, DAMPING, 1e-6, WRAP).place.size == 1
    assert moving_modes(TABLE, 0.0, DAMPING, 1e-6, WRAP).place.size == 0
