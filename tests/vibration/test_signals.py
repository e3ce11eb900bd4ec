"""Signals whose amplitude, frequency and growth are known exactly."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvt_hpc.vibration import signals
from cvt_hpc.vibration.settings import fitting_window
from cvt_hpc.vibration.signals import SHORTEST_SEGMENT

RATE = 20_000.0
BAND = (100.0, 1500.0)
BINS = np.linspace(0.0, 1500.0, 151)
SHORT = 0.05  # [s], the shortest record that a study is expected to judge as a whole

# Away from the band's edges by 4/L of a 50 ms record, so that the sine's whole main lobe is inside.
frequencies = st.floats(180.0, 1420.0)
phases = st.floats(0.0, 2 * np.pi)
sizes = st.floats(-9.0, 0.0).map(lambda exponent: 10**exponent)
durations = st.sampled_from([SHORT, 0.0837, 0.15, 0.3])


def clock(duration=SHORT):
    return np.arange(round(duration * RATE)) / RATE


def sine(frequency, phase=0.0, duration=SHORT):
    return np.sin(2 * np.pi * frequency * clock(duration) + phase)


@given(frequencies, phases, sizes, durations)
@settings(deadline=None)
def test_amplitude_of_a_sine(frequency, phase, size, duration):
    # 0.1 % is promised; what Hann's side lobes carry out of the band is some 1e-5.
    found = signals.band_amplitude(size * sine(frequency, phase, duration), RATE, BAND)
    assert found == pytest.approx(size, rel=1e-3)


@given(frequencies, phases, durations)
@settings(deadline=None)
def test_frequency_of_a_sine(frequency, phase, duration):
    # 0.001/L is promised: a thousandth of the spacing of spectral lines.
    found = signals.dominant_frequency(sine(frequency, phase, duration), RATE, BAND)
    assert abs(found - frequency) < 1e-3 / duration


@given(frequencies, phases, durations)
@settings(deadline=None)
def test_spectrum_shows_a_sine_wherever_it_falls_between_bins(frequency, phase, duration):
    spectrum = signals.amplitude_spectrum(1e-5 * sine(frequency, phase, duration), RATE, BINS)
    assert spectrum.shape == BINS.shape
    nearest = np.argmin(np.abs(BINS - frequency))
    assert spectrum[nearest] == pytest.approx(1e-5, rel=1e-2)
    assert spectrum.max() <= 1e-5 * 1.001
    # Beyond three resolved lines and half a bin only side lobes are left: Hann's highest has 2.7 %.
    far = np.abs(BINS - frequency) > 3 / duration + 5
    assert spectrum[far].max() < 0.027e-5


def test_bins_finer_than_the_record_resolves_trace_the_peak():
    bins = np.arange(500.0, 700.0, 0.5)
    spectrum = signals.amplitude_spectrum(1e-5 * sine(612.3, 0.7), RATE, bins)
    assert spectrum.max() == pytest.approx(1e-5, rel=1e-3)
    assert abs(bins[np.argmax(spectrum)] - 612.3) <= 0.5
    assert (
        np.count_nonzero(spectrum > 0.999 * spectrum.max()) < 5
    )  # flat on top over 1 Hz, not over a line's 20


@given(frequencies, phases, st.floats(-300.0, 300.0))
@settings(deadline=None)
def test_growth_of_an_exponential_sine(frequency, phase, rate):
    # Windows of 40 ms resolve 25 Hz, so that 4/length from the band's edges is 200 .. 1400 Hz.
    frequency = 200.0 + (frequency - 180.0) * 1200.0 / 1240.0
    signal = 1e-6 * np.exp(rate * clock(0.15)) * sine(frequency, phase, 0.15)
    growth = signals.envelope_growth(signal, RATE, BAND, length=0.04)
    # The leakage that is left varies from window to window by 1e-4 at most, whatever the rate.
    assert growth.rate == pytest.approx(rate, rel=1e-3, abs=1e-3)
    assert growth.standard_error < 0.01


def test_growth_of_a_short_record():
    signal = np.exp(-80 * clock()) * sine(612.0, 0.3)
    growth = signals.envelope_growth(signal, RATE, BAND)
    assert growth.rate == pytest.approx(-80, abs=0.1)


def test_standard_error_covers_the_scatter_of_noise():
    generator = np.random.default_rng(7)
    noise = generator.standard_normal((len(clock(0.3)), 400))
    growth = signals.envelope_growth(noise, RATE, BAND)
    # Steady noise: 400 rates scatter about 0, and their standard errors say by how much. The mean of 400 has a
    # 20th of the scatter of one, the scatter of 400 is known to 3.5 %.
    scatter = growth.rate.std()
    assert abs(growth.rate.mean()) < 4 * scatter / 20
    assert np.sqrt(np.mean(growth.standard_error**2)) == pytest.approx(scatter, rel=0.2)


def test_two_tones_add_as_powers_and_the_larger_dominates():
    # 140 Hz apart: 7 lines of a 50 ms record, out of each other's main lobe.
    signal = 3e-6 * sine(560.0, 0.4) + 4e-6 * sine(700.0, 1.9)
    assert signals.band_amplitude(signal, RATE, BAND) == pytest.approx(5e-6, rel=1e-3)
    # The other tone's side lobe, below 1e-3 of it at 7 lines, tilts the peak by less than 0.01 lines.
    assert signals.dominant_frequency(signal, RATE, BAND) == pytest.approx(700.0, abs=0.2)
    spectrum = signals.amplitude_spectrum(signal, RATE, BINS)
    assert spectrum[[56, 70]] == pytest.approx([3e-6, 4e-6], rel=0.01)


def test_the_flank_of_a_tone_is_no_peak():
    assert np.isnan(signals.dominant_frequency(sine(600.0), RATE, (606.0, 620.0)))


def test_tones_outside_the_band_do_not_count():
    signal = 2e-6 * sine(600.0) + 50e-6 * sine(3000.0) + 50e-6 * sine(20.0)
    assert signals.band_amplitude(signal, RATE, BAND) == pytest.approx(2e-6, rel=0.01)


SETTLING = {
    "straight": lambda t: t / t[-1],
    "exponential, 10 ms": lambda t: np.exp(-t / 0.01),
    "exponential, slow": lambda t: np.exp(-t / t[-1]),
    "parabola": lambda t: (t / t[-1]) ** 2,
    "half a swing": lambda t: np.cos(np.pi * t / t[-1]),
}


@pytest.mark.parametrize("duration", [0.02, SHORT, 0.3])
@pytest.mark.parametrize("course", SETTLING.values(), ids=SETTLING.keys())
def test_settling_by_100_um_does_not_leak_into_the_band(course, duration):
    t = clock(duration)
    settling = 0.075 + 1e-4 * course(t)
    # 0.1 um: a tenth of the amplitude from which a strand vibrates.
    assert signals.band_amplitude(settling, RATE, BAND) < 1e-7
    spectrum = signals.amplitude_spectrum(settling, RATE, BINS)
    assert spectrum[BINS >= 300].max() < 1e-8
    # and it does not disturb what vibrates on top of it
    vibrating = settling + 1e-6 * sine(612.0, 0.2, duration)
    assert signals.band_amplitude(vibrating, RATE, BAND) == pytest.approx(1e-6, rel=0.02)
    assert signals.dominant_frequency(vibrating, RATE, (300.0, 1500.0)) == pytest.approx(
        612.0, abs=0.1 / duration
    )


def test_noise_amplitude_is_its_power_in_the_band():
    noise = 1e-7 * np.random.default_rng(3).standard_normal((len(clock(0.3)), 200))
    # White noise of 10 kHz bandwidth: the band of 1400 Hz holds 0.14 of its power. 200 records know it to 0.3 %.
    expected = 1e-7 * np.sqrt(2 * 0.14)
    amplitudes = signals.band_amplitude(noise, RATE, BAND)
    assert np.sqrt(np.mean(amplitudes**2)) == pytest.approx(expected, rel=0.015)


def test_windows_end_with_the_record_and_overlap_by_half():
    t = clock(0.11)
    signal = np.where(t < 0.0899, 1.0, 3.0) * sine(600.0, 0.0, 0.11)
    centres, amplitudes = signals.window_amplitudes(signal, RATE, BAND, 0.02)
    assert centres == pytest.approx(0.01 * np.arange(1, 11), abs=1 / RATE)
    assert amplitudes[:8] == pytest.approx(1.0, rel=0.01)
    assert amplitudes[-1] == pytest.approx(3.0, rel=0.01)
    # What does not fill a window is left out at the start, never at the end.
    late, _ = signals.window_amplitudes(signal[70:], RATE, BAND, 0.02)
    assert late[-1] == pytest.approx(centres[-1] - 70 / RATE, abs=1 / RATE)


@given(st.integers(90, 4000))
def test_fitting_window_leaves_four_windows(samples):
    window = fitting_window(samples / RATE, wanted=10.0)
    centres, _ = signals.window_amplitudes(np.zeros(samples), RATE, BAND, window)
    assert len(centres) >= 4
    assert fitting_window(samples / RATE, wanted=1e-4) == 1e-4


def test_channels_are_independent():
    columns = np.stack([sine(300.0), 2e-6 * sine(612.0), np.zeros(len(clock()))], axis=1)
    grid = np.stack([columns, 5 * columns], axis=1)
    for measure in (
        lambda x: signals.band_amplitude(x, RATE, BAND),
        lambda x: signals.dominant_frequency(x, RATE, BAND),
        lambda x: signals.amplitude_spectrum(x, RATE, BINS),
        lambda x: signals.window_amplitudes(x, RATE, BAND, 0.02)[1],
        lambda x: signals.envelope_growth(x, RATE, BAND).rate,
        lambda x: signals.envelope_growth(x, RATE, BAND).standard_error,
    ):
        together = np.asarray(measure(grid))
        assert together.shape[-2:] == (2, 3)
        alone = measure(grid[:, 1, 1])
        # Sums run in another order: rounding apart the same; what is rounding itself, here a growth of 0, to 1e-6.
        np.testing.assert_allclose(together[..., 1, 1], alone, rtol=1e-9, atol=1e-6 * (np.ndim(alone) == 0))
    assert signals.band_amplitude(grid, RATE, BAND) == pytest.approx(
        np.array([[1.0, 2e-6, 0.0], [5.0, 1e-5, 0.0]]), rel=1e-3
    )


@pytest.mark.parametrize("duration", [0.02, SHORT, 0.3])
@pytest.mark.parametrize("level", [0.0, 0.0751, -3e7])
@pytest.mark.parametrize("slope", [0.0, 0.37])
def test_what_does_not_vibrate_has_amplitude_zero_and_no_frequency(duration, level, slope):
    still = level + slope * clock(duration)
    assert signals.band_amplitude(still, RATE, BAND) == 0
    assert not signals.amplitude_spectrum(still, RATE, BINS).any()
    assert np.isnan(signals.dominant_frequency(still, RATE, BAND))
    assert np.isnan(signals.envelope_growth(still, RATE, BAND)).all()


def test_a_value_that_is_not_finite_spoils_its_channel_only():
    columns = np.stack([sine(612.0), sine(612.0)], axis=1)
    columns[100, 0] = np.nan
    for measured in (
        signals.band_amplitude(columns, RATE, BAND),
        signals.dominant_frequency(columns, RATE, BAND),
        signals.envelope_growth(columns, RATE, BAND).rate,
    ):
        assert list(np.isnan(measured)) == [True, False]


def test_growth_of_too_few_windows_is_unknown():
    growth = signals.growth_fit([0.0, 0.1], np.ones((2, 3)))
    assert np.isnan(growth.rate).tolist() == [True] * 3
    assert np.isnan(growth.standard_error).tolist() == [True] * 3


def test_growth_fit_against_a_textbook_regression():
    times = np.array([0.0, 1.0, 2.0, 3.0])
    logs = np.array([0.0, 1.0, 1.0, 3.0])
    # Slope 0.9, residuals (.1, .2, -.7, .4): s^2 = 0.7/2, sum of squared times about their mean 5.
    growth = signals.growth_fit(times, np.exp(logs))
    assert growth.rate == pytest.approx(0.9)
    assert growth.standard_error == pytest.approx(np.sqrt(0.35 / 5))


@pytest.mark.parametrize(
    ("call", "text"),
    [
        (lambda x: signals.band_amplitude(x, RATE, (1500.0, 100.0)), "band"),
        (lambda x: signals.band_amplitude(x, 2000.0, BAND), "1000 Hz"),
        (lambda x: signals.dominant_frequency(x, RATE, (-1.0, 100.0)), "band"),
        (lambda x: signals.band_amplitude(x[: SHORTEST_SEGMENT - 1], RATE, BAND), "31"),
        (lambda x: signals.window_amplitudes(x, RATE, BAND, 0.06), "1200 samples"),
        (lambda x: signals.amplitude_spectrum(x, 2000.0, BINS), "1505 Hz"),
        (lambda x: signals.amplitude_spectrum(x, RATE, BINS[::-1]), "ascending"),
        (lambda x: signals.amplitude_spectrum(x, RATE, [100.0]), "two or more"),
    ],
)
def test_what_cannot_be_measured_is_refused(call, text):
    with pytest.raises(ValueError, match=text):
        call(sine(600.0))
