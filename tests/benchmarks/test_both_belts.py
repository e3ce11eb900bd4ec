"""Growth of a vibration as `both_belts.py` finds it by the course of its energy, and that calming leaves the line."""

from types import SimpleNamespace

import numpy as np
import pytest
from both_belts import RECORD, calm, growth

RATE, LIMIT = 2e4, 1.2e-6
TIME = np.arange(round(RECORD * RATE)) / RATE


def motions(amplitude, frequency=740.0):
    """Ten probes that move alike with an amplitude (time) [m], beside a decaying mode and chatter."""
    share = np.linspace(0.5, 1.0, 10)
    share /= np.sqrt((share**2).mean())
    phase = 2.0 * np.pi * frequency * TIME[:, None] + np.linspace(0.0, 2.0, 10)
    decaying = np.exp(-300.0 * TIME)[:, None] * np.cos(2.0 * np.pi * 230.0 * TIME)[:, None] * share
    chatter = np.random.default_rng(7).normal(0.0, 2e-8, (TIME.size, 10))
    return 1e-3 + np.sqrt(2.0) * amplitude[:, None] * share * np.sin(phase) + 3e-7 * decaying + chatter


@pytest.mark.parametrize("rate", [60.0, 150.0, 240.0, 400.0])
def test_a_vibration_that_a_cubic_term_limits_has_its_growth_frequency_and_limit(rate):
    """da/dt = sigma a (1 - a^2 / a_inf^2), from 60 nm on."""
    begun = (LIMIT / 6e-8) ** 2 - 1.0
    amplitude = LIMIT / np.sqrt(1.0 + begun * np.exp(-2.0 * rate * TIME))
    found, scatter, frequency, misfit, limit = growth(motions(amplitude), RATE, 900.0)
    assert found == pytest.approx(rate, rel=0.04) and scatter < 0.02 * rate and misfit < 0.05
    assert frequency == pytest.approx(740.0, rel=2e-3) and limit == pytest.approx(LIMIT, rel=0.02)


@pytest.mark.parametrize(
    "amplitude",
    [LIMIT + 0.0 * TIME, LIMIT * np.exp(-200.0 * TIME), 0.0 * TIME],
    ids=["steady", "decays", "none"],
)
def test_what_does_not_grow_has_no_growth_rate(amplitude):
    assert np.isnan(growth(motions(amplitude), RATE, 900.0)).all()


def test_a_growth_of_another_course_has_none():
    """It comes and goes, as beats do."""
    assert np.isnan(growth(motions(LIMIT * np.abs(np.sin(60.0 * np.pi * TIME))), RATE, 900.0)).all()


def test_calming_leaves_a_motion_along_the_line_as_it_is():
    """A circle that turns in itself; a speed outwards is what is lost."""
    angle = 2.0 * np.pi * np.arange(64) / 64
    around = np.array([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)])
    outwards = np.array([0.0 * angle, 0.0 * angle, np.cos(angle), np.sin(angle)])
    elements = (around + 0.1 * outwards).reshape(4, 8, 8)
    calm(SimpleNamespace(_by_field=lambda: elements, _saddle=(0, 1), _speeds=(2, 3)), 0.9)
    np.testing.assert_allclose(elements.reshape(4, -1), around + 0.01 * outwards, atol=1e-12)
