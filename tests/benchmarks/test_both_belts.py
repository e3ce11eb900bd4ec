"""Growth of small motions as `both_belts.py` finds it: of a known motion, and while that is small."""

from types import SimpleNamespace

import numpy as np
import pytest
from both_belts import RECORD, SMALL, calm, strongest

RATE = 2e4


def motions(size, growth=240.0, frequency=570.0):
    time = np.arange(round(RECORD * RATE)) / RATE
    shape, other = np.linspace(0.5, 1.0, 10), np.cos(np.arange(10.0))
    moved = np.exp(growth * time)[:, None] * np.sin(2.0 * np.pi * frequency * time[:, None] + shape)
    decaying = np.exp(-190.0 * time)[:, None] * np.cos(2.0 * np.pi * 300.0 * time)[:, None] * other
    return 1e-3 + size * np.array([moved * shape + 0.3 * decaying] * 3)


def test_a_growing_motion_has_its_growth_and_frequency():
    growth, scatter, frequency = strongest(motions(0.05 * SMALL), RATE, 900.0)
    assert growth == pytest.approx(240.0, abs=5.0) and frequency == pytest.approx(570.0, rel=2e-3)
    assert scatter < 5.0


def test_a_large_motion_has_none():
    assert np.isnan(strongest(motions(10.0 * SMALL), RATE, 900.0)).all()


def test_calming_leaves_a_motion_along_the_line_as_it_is():
    """A circle that turns in itself; a speed outwards is what is lost."""
    angle = 2.0 * np.pi * np.arange(64) / 64
    around = np.array([np.cos(angle), np.sin(angle), -np.sin(angle), np.cos(angle)])
    outwards = np.array([0.0 * angle, 0.0 * angle, np.cos(angle), np.sin(angle)])
    elements = (around + 0.1 * outwards).reshape(4, 8, 8)
    calm(SimpleNamespace(_by_field=lambda: elements, _saddle=(0, 1), _speeds=(2, 3)))
    np.testing.assert_allclose(elements.reshape(4, -1), around + 0.06 * outwards, atol=1e-12)
