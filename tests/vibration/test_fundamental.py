"""Fundamental and strongest line of motions whose lines are known, and the verdict, in its words and numbers, on them."""

import re

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from cvt_hpc.vibration.assessment import assess
from cvt_hpc.vibration.peaks import fundamental
from cvt_hpc.vibration.settings import PARAMETERS
from cvt_hpc.vibration.signals import amplitude_spectrum

RATE, LENGTH = 20_000.0, 0.2
BAND = (170.0, 1500.0)
RESOLUTION = 1.0 / LENGTH
TIME = np.arange(round(LENGTH * RATE)) / RATE
DEFAULTS = {key: parameter.default for key, parameter in PARAMETERS["vibration"].items()}


def motion(lines, time=TIME, seed=0):
    """Sines {frequency [Hz]: amplitude} with random phases."""
    phases = np.random.default_rng(seed).uniform(0.0, 2.0 * np.pi, len(lines))
    return sum(
        a * np.sin(2.0 * np.pi * f * time + phase)
        for (f, a), phase in zip(lines.items(), phases, strict=True)
    )


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ({612.0: 1.0}, (612.0, 612.0)),
        ({251.0: 1.0, 502.0: 0.3}, (251.0, 251.0)),
        ({251.0: 0.3, 502.0: 1.0, 753.0: 0.4}, (251.0, 502.0)),
        ({200.0: 0.15, 400.0: 0.3, 600.0: 0.5, 800.0: 1.0}, (200.0, 800.0)),
        # a fundamental at a node: three harmonics in a row tell their spacing, two do not
        ({500.0: 0.5, 750.0: 1.0, 1000.0: 0.4}, (250.0, 750.0)),
        ({500.0: 0.5, 750.0: 1.0}, (750.0, 750.0)),
        ({500.0: 0.5, 1000.0: 1.0}, (500.0, 1000.0)),
        # two modes, and a beat
        ({340.0: 0.8, 655.0: 1.0}, (655.0, 655.0)),
        ({500.0: 1.0, 510.0: 0.9}, (500.0, 500.0)),
        ({490.0: 0.4, 500.0: 1.0, 510.0: 0.4}, (500.0, 500.0)),
        # judder of 73 Hz below the band: its third harmonic is the lowest line in it
        ({73.0: 5.0, 146.0: 0.5, 219.0: 1.0, 292.0: 0.3, 365.0: 0.2}, (219.0, 219.0)),
        # a line that is too weak to count
        ({300.0: 0.05, 600.0: 1.0}, (600.0, 600.0)),
    ],
)
def test_known_lines(lines, expected):
    # lines nearer than 4/L to each other are one peak
    assert fundamental(motion(lines), RATE, BAND) == pytest.approx(expected, abs=0.1 * RESOLUTION)


@given(
    st.floats(175.0, 300.0),
    st.lists(st.floats(0.15, 1.0), min_size=3, max_size=5),
    st.floats(-3.0, 3.0),
    st.integers(0, 99),
)
@settings(deadline=None, max_examples=100)
def test_the_spacing_of_random_harmonics(first, sizes, growth, seed):
    sizes = np.array(sizes) / max(sizes) + 0.15  # of each a line that counts; it may grow or decay
    lines = {first * (k + 1): size for k, size in enumerate(sizes) if first * (k + 1) < 1400.0}
    found, strongest = fundamental(np.exp(growth * TIME) * motion(lines, seed=seed), RATE, BAND)
    assert found == pytest.approx(first, abs=0.05 * RESOLUTION)
    assert strongest / found == pytest.approx(round(strongest / found), abs=1e-9)


@given(st.floats(180.0, 700.0), st.floats(180.0, 1400.0), st.floats(0.2, 0.9), st.integers(0, 99))
@settings(deadline=None, max_examples=100)
def test_two_modes_are_no_harmonics_of_a_common_divisor(one, other, size, seed):
    found, strongest = fundamental(motion({one: 1.0, other: size}, seed=seed), RATE, BAND)
    assert strongest == pytest.approx(one, abs=0.5 * RESOLUTION) or abs(one - other) < 4.0 * RESOLUTION
    is_multiple = np.abs(one / np.arange(2, 9) - other).min() < 0.3 * RESOLUTION
    assert found == strongest or is_multiple


@pytest.mark.parametrize("seed", range(30))
def test_noise_has_no_harmonics(seed):
    noise = np.random.default_rng(seed).normal(size=TIME.size)
    found, strongest = fundamental(noise, RATE, BAND)
    assert found == strongest and BAND[0] <= found <= BAND[1]
    tone = noise + 4.0 * motion({600.0: 1.0})
    assert fundamental(tone, RATE, BAND)[0] == pytest.approx(600.0, abs=0.3)


@given(
    st.floats(180.0, 600.0),
    st.lists(st.floats(0.2, 1.0), min_size=1, max_size=3),
    st.floats(6e-6, 1e-4),
    st.floats(0.0, 100e-6),
    st.integers(0, 99),
)
@example(254.9420, [0.617, 0.313], 1.5e-5, 4e-5, 2)  # its nearest line lies in the next bin
@settings(deadline=None, max_examples=60)
def test_reason_amplitude_frequency_and_spectrum_are_of_one_motion(first, sizes, amplitude, judder, seed):
    time = np.arange(round(0.4 * RATE)) / RATE
    lines = {first * (k + 1): size for k, size in enumerate(sizes) if first * (k + 1) < 1450.0}
    size = amplitude / np.linalg.norm([*lines.values()])
    lines = {f: size * a for f, a in lines.items()}
    moved = motion({**lines, 61.0: judder}, time, seed)  # judder lies below the band, and has no part
    w = np.stack([0.5 * moved, moved, 0.01 * moved], 1)
    found = assess(w, RATE, ("t1", "t1", "t2"), DEFAULTS | {"band_low": 0.7 * first})
    assert found.vibrates.name == "YES" and found.lower_band_edge == 0.7 * first
    assert found.amplitude[0] == pytest.approx(amplitude, rel=0.01)
    assert found.strongest_probe[0] == 1
    told = re.match(r"t1 vibrates for the last 0\.2 s, (\S+) um, growth", found.reason)
    assert float(told[1]) == float(f"{1e6 * found.amplitude[0]:.3g}")
    bins = np.arange(0.0, 1505.0, 10.0)
    spectrum = amplitude_spectrum(moved[len(moved) // 2 :], RATE, bins)
    inside = bins >= found.lower_band_edge + 10.0
    strongest = bins[inside][np.argmax(spectrum[inside])]
    # of lines that are as strong either may be told, of a line between two bins that of the nearest of the lines
    # on which the spectrum is taken
    largest = np.array([f for f, a in lines.items() if a > 0.98 * max(lines.values())])
    in_bin = 5.0 + 0.5 * RATE / 2**15 + 0.01
    for told_frequency, off in ((strongest, in_bin), (found.strongest_frequency[0], 0.25)):
        assert np.abs(largest - told_frequency).min() <= off
    assert spectrum[inside].max() == pytest.approx(max(lines.values()), rel=0.02)
    assert found.frequency[0] == pytest.approx(first, abs=0.25)
