"""Waves on a straight moving belt under the fast step: it neither damps them nor feeds them."""

import numpy as np
import pytest

from cvt_hpc.models.elastic_belt import fields as f
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.step_choice import REFERENCE_STEP as STEP
from support.fast_runs import FastRuns
from support.straight import LENGTH, WAVE, moving_straight, straight_belt

SIZE = 1e-8  # amplitude [m]


def downstream(number, spacing, share):
    """Circular frequency of a wave with the belt, central differences on the mesh: v + c, but for (k h)^2."""
    drift = np.sin(number * spacing) / spacing * share * WAVE
    stiff = 2.0 * np.sin(0.5 * number * spacing) / spacing * WAVE
    return drift + np.sqrt(drift**2 + stiff**2 * (1.0 - share**2))


@pytest.mark.parametrize("share", [0.0, 0.15, 0.5])
def test_waves_keep_amplitude_and_frequency(share):
    belt = straight_belt(40, share * WAVE)
    state = moving_straight(belt)
    number = 6.0 * np.pi / LENGTH  # six waves around, 13 stations each
    phase = number * belt.cell[0] * np.arange(belt.cell.size)
    omega = downstream(number, belt.cell[0], share)
    # u half a step before w
    state.fields[f.W] = SIZE * np.cos(phase)
    state.fields[f.U] = SIZE * omega * np.sin(phase + 0.5 * omega * STEP)
    run = FastRuns([belt], [state])
    track, stride = [], 10
    for _ in range(8000 // stride):
        run.advance(stride, STEP)
        track.append(2.0 * np.exp(1j * phase) @ run.state().fields[f.W] / (belt.cell.size * SIZE))
    assert run.outcome() is Outcome.OK
    # Leapfrog and the gyroscopic term by the mean speed of a step keep amplitudes. Taken half a step late it would
    # feed k v omega dt / 2, ten per second and more.
    assert np.abs(track[-1]) == pytest.approx(np.abs(track[0]), rel=2e-3)
    turned = np.unwrap(np.angle(track))
    # leapfrog: (omega dt)^2 / 24, the mean speed (omega dt)^2 / 8 of the gyroscopic part
    found = (turned[-1] - turned[0]) / ((len(track) - 1) * stride * STEP)
    assert found == pytest.approx(omega, rel=0.2 * (omega * STEP) ** 2)
