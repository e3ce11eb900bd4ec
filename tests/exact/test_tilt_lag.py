"""Lag of the sheaves' tilt in belts of rigid elements: S (a + T a') = s, a sum of axial forces by cos and sin."""

import numpy as np
import pytest

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import like
from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.belt import workspace
from cvt_hpc.models.pushbelt.border import accept_border, border_residuals, close_border
from cvt_hpc.solvers.linked_blocks import solve_small
from support.pushbelts import given, start

STIFFNESS, LAG, DURATION = ((6e8, 3e8, 2e8, 9e8),) * 2, 6e-4, 3e-3  # [N/m], [s], [s]
TILTING = (1, 2)  # modes


@kernel
def step_border(belt, state, work, force, dt):
    """A step of the border alone, under the same axial force of every mode [N]."""
    none = like(0.0, state.elements[0, f.U_Y])
    for k in range(2 * belt.modal_stiffness.shape[1]):
        for lane in range(work.scratch.data.shape[2]):
            work.scratch.data[0, k, lane] = force / work.scratch.data.shape[2]
    changes = state.increments, work.increments
    border_residuals(belt, changes, state.openings, 0.0, none, none, work.scratch, work.border, dt)
    close_border(belt, work.sums, work.border, dt)
    solve_small(work.border)
    for k in range(state.increments.size):
        state.increments[k] = work.border[k, state.increments.size]
    accept_border(belt, state, work, work.inputs, dt)


def opened(dt, force, lag=LAG):
    """Openings (step, 2, 4) [m] under axial forces force(t) [N] of every mode, and what the lag takes [J]."""
    belt, state = start(given(nodes=64, modal_stiffness=STIFFNESS, tilt_lag=lag))
    work, found = workspace(belt, 64), []
    for k in range(round(DURATION / dt)):
        work.increments[:], state.increments[:] = state.increments, 0.0
        work.sums.data[:] = 0.0
        step_border(belt, state, work, force((k + 1) * dt), dt)
        found.append(state.openings.copy())
    return np.array(found), state.totals[f.LAG_LOSS]


def rise(t):
    """A force that begins without a kink [N]."""
    return 1e4 * (1.0 - np.exp(-t / 2e-3) * (1.0 + t / 2e-3))


def exact(t, stiffness):
    """Opening under that force [m]: a' = (s / S - a) / T, from rest, by its three exponentials."""
    b, c = 1.0 / 2e-3, 1.0 / LAG
    # of e^-bt (1 + b t): particular solution e^-bt (p + q t)
    q = c * b / (c - b)
    p = (c - q) / (c - b)
    return 1e4 / stiffness * (1.0 - np.exp(-b * t) * (p + q * t) - (1.0 - p) * np.exp(-c * t))


def test_tilt_follows_a_force_by_its_lag_and_with_the_step_to_second_order():
    errors = []
    for dt in (2e-5, 1e-5):
        found, _ = opened(dt, rise)
        t = dt * np.arange(1, len(found) + 1)
        for mode in TILTING:
            wanted = exact(t, STIFFNESS[0][mode])
            errors.append(abs(found[:, 0, mode] - wanted).max() / wanted.max())
        assert np.array_equal(found[:, 0], found[:, 1])
    coarse, fine = errors[0], errors[2]
    assert fine < 2e-4 and 3.6 < coarse / fine < 4.4


def test_all_other_openings_follow_at_once():
    found, _ = opened(1e-5, rise)
    t = 1e-5 * np.arange(1, len(found) + 1)
    for mode in (0, 3):
        assert found[:, 0, mode] == pytest.approx(rise(t) / STIFFNESS[0][mode], rel=1e-12)


@pytest.mark.parametrize("lag", [1e-9, 1e-6, 1e-5, 1e-4, 1e-3])
def test_no_lag_is_too_short_for_a_step(lag):
    """A force that jumps within a step of 10 us."""
    found, _ = opened(1e-5, lambda t: 1e4, lag)
    share = found[:, 0, 1] * STIFFNESS[0][1] / 1e4
    assert 0.0 < share.min() and share.max() < 1.03
    assert share[-1] == pytest.approx(1.0 - np.exp(-DURATION / lag), rel=2e-3)


def test_the_lag_takes_what_the_force_gives_and_springs_do_not_store():
    dt = 2e-6
    found, taken = opened(dt, rise)
    steps = np.diff(found, axis=0, prepend=0.0)
    forces = rise(dt * (np.arange(len(found)) + 0.5))
    given_ = 2.0 * (forces[:, None, None] * steps).sum()  # of both sheaves of a pulley
    stored = (np.array(STIFFNESS) * found[-1] ** 2).sum()
    assert taken == pytest.approx(given_ - stored, rel=2e-3) and taken > 0.05 * stored
