"""Peaks of a strand's spectrum, each with the mode that the strand moves in there: sums of sines."""

import numpy as np
import pytest

from cvt_hpc.vibration.peaks import COUNT, modal_peaks

RATE, BAND = 20e3, (200.0, 1500.0)
TIME = np.arange(4000) / RATE


def modes(*parts):
    """Amplitudes (time, 2, 5) of parts (strand, half waves, frequency, amplitude)."""
    found = np.zeros((TIME.size, 2, 5))
    for strand, waves, frequency, amplitude in parts:
        found[:, strand, waves - 1] += amplitude * np.sin(2 * np.pi * frequency * TIME + waves)
    return found


def test_each_peak_has_its_own_mode():
    # t2 moves as the belt does at 120 N m: in its first mode, and in its third at twice the frequency
    found = modal_peaks(
        modes((0, 2, 494.0, 9.0), (1, 1, 494.0, 20.0), (1, 2, 494.0, 8.0), (1, 3, 988.0, 12.0)), RATE, BAND
    )
    assert found.mode.tolist() == [[2, 0, 0], [1, 3, 0]]
    # a line is 1.2 Hz apart from the next, and a parabola through three of them finds what lies between
    np.testing.assert_allclose(found.frequency[1, :2], [494.0, 988.0], atol=0.1)
    # Hann's window between two lines: less than 1 % low
    np.testing.assert_allclose(found.amplitude[1, :2], [20.0, 12.0], rtol=0.01)
    np.testing.assert_allclose(found.frequency_ratio[:2], [1.0, 2.0], atol=1e-3)
    assert np.isnan(found.frequency[0, 1:]).all() and np.isnan(found.frequency_ratio[2])


def test_side_lobes_and_what_lies_outside_the_band_are_no_peaks():
    found = modal_peaks(modes((0, 2, 601.3, 10.0), (0, 1, 150.0, 50.0), (1, 1, 1600.0, 5.0)), RATE, BAND)
    assert found.mode[0].tolist() == [2, 0, 0]
    assert not found.mode[1].any() and found.mode.shape == (2, COUNT)


def test_a_band_beyond_half_the_sampling_rate_is_refused():
    with pytest.raises(ValueError, match="band"):
        modal_peaks(modes(), RATE, (200.0, 11e3))
