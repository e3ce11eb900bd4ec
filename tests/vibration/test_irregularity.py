"""What counts as irregular: amplitudes that come and go without a trend, and never growth nor decay."""

from functools import cache

import numpy as np
import pytest
from scipy.stats import linregress, t

from cvt_hpc.variables import Vibrates
from cvt_hpc.vibration.assessment import (
    assess,
    classify,
    is_irregular,
    is_stationary,
    margin,
    relative_scatter,
)
from cvt_hpc.vibration.settings import PARAMETERS
from cvt_hpc.vibration.signals import growth_fit

RATE = 20_000.0
DEFAULTS = {key: parameter.default for key, parameter in PARAMETERS["vibration"].items()}
NO, YES, UNDECIDED, IRREGULAR = Vibrates.NO, Vibrates.YES, Vibrates.UNDECIDED, Vibrates.IRREGULAR
STRANDS = ("t1", "t2")


@cache
def noise(alike):
    """Normal random numbers (2000, 200), of which neighbours in a row are alike by `alike`."""
    found = np.array([np.random.default_rng(seed).normal(size=200) for seed in range(2000)])
    for k in range(1, 200):
        found[:, k] = alike * found[:, k - 1] + np.sqrt(1.0 - alike**2) * found[:, k]
    return found


def scattered(seed, count, scatter=0.5, gain=0.0, alike=0.0):
    """Amplitudes of median 1 whose logarithm scatters and rises by `gain`; neighbours are alike by `alike`."""
    return np.exp(scatter * noise(alike)[seed, :count] + gain * np.linspace(-0.5, 0.5, count))


def share(count, trials=2000, **how):
    """Share of irregular records; a gain of 1 e-fold has to be ruled out."""
    records = scattered(slice(trials), count, **how)
    return np.mean([is_irregular(record, 1.0, 1.0) for record in records])


def test_what_scatters_about_the_threshold_is_irregular_once_there_are_windows_enough():
    assert share(9) == 0.0  # what a run of 0.4 s has
    assert share(12) < 0.3 < share(24)
    # the interval of the trend misses 0 in one of 20
    assert share(60) == pytest.approx(0.95, abs=0.02)


@pytest.mark.parametrize("count", [12, 24, 60, 200])
@pytest.mark.parametrize("gain", [1.0, -1.0])
def test_growth_and_decay_by_an_e_fold_are_irregular_in_one_of_40_records_at_most(count, gain):
    assert share(count, gain=gain) <= 0.025 + 3.0 * np.sqrt(0.025 / 2000)


@pytest.mark.parametrize("gain", [2.0, -2.0])
@pytest.mark.parametrize("alike", [0.0, 0.5, 0.8])
def test_growth_and_decay_by_two_never_are_however_long_the_bursts(gain, alike):
    assert all(share(count, 500, gain=gain, alike=alike) == 0.0 for count in (12, 24, 60))


def test_long_bursts_ask_for_more_windows():
    assert share(40, alike=0.6) < 0.6 * share(40)


@pytest.mark.parametrize(
    "windows",
    [
        np.linspace(0.5, 2.0, 40),
        np.exp(-np.linspace(-2.0, 2.0, 40)),
        np.where(np.arange(40) // 4 == 5, 3.0, 0.5),  # a burst
        1.0 + 0.05 * np.sin(np.arange(40)),  # steady, at the threshold
        1.0 + 0.8 * np.sin(2.0 * np.pi * np.arange(40) / 20),  # a beat of two periods
        np.tile([3.0, 0.0], 20),
    ],
)
def test_one_crossing_a_burst_a_steady_amplitude_and_slow_beats_are_not(windows):
    assert not is_irregular(windows, 1.0, 1.0)


def alternating(count, factor):
    """Amplitudes by turns above and below 1, by the same factor."""
    return factor ** (-1.0) ** np.arange(count)


def test_twelve_windows_suffice_if_they_are_independent():
    assert is_irregular(alternating(12, 1.3), 1.0, 1.0)
    assert not is_irregular(alternating(11, 1.3), 1.0, 1.0)


def test_it_takes_a_scatter_of_a_fifth():
    # a factor of 1 + s scatters by s
    assert is_irregular(alternating(40, 1.23), 1.0, 1.0)
    assert not is_irregular(alternating(40, 1.19), 1.0, 1.0)


def test_two_excursions_above_the_threshold_suffice():
    windows = 0.7 * alternating(40, 1.25)
    windows[9] = 1.1
    assert not is_irregular(windows, 1.0, 1.0)
    windows[30] = 1.1
    assert is_irregular(windows, 1.0, 1.0)


def test_the_gain_is_as_uncertain_as_that_of_a_fitted_line():
    windows = alternating(14, 1.3)
    line = linregress(np.linspace(-0.5, 0.5, 14), np.log(windows))
    largest = abs(line.slope) + t.ppf(0.975, 12) * line.stderr
    assert is_stationary(windows, 1.001 * largest)
    assert not is_stationary(windows, 0.999 * largest)


def test_scatter_is_relative():
    assert relative_scatter([[1.0, 2.0], [3.0, 2.0]]).tolist() == [0.5, 0.0]
    assert relative_scatter([1.0, 1.0, 4.0]) == pytest.approx(np.sqrt(2.0) / 2.0)
    assert np.isnan(relative_scatter(np.zeros((3, 1)))).all()


def verdict(*strands):
    windows = 5e-6 * np.array(strands).T
    growth = growth_fit(0.02 * np.arange(len(windows)), windows)
    found = classify(windows, *growth, judged_time=1.0, record_time=2.0, parameters=DEFAULTS, strands=STRANDS)
    return *found, margin(windows, found[0], 5e-6)


def test_a_run_is_irregular_only_where_no_strand_vibrates_or_may_yet():
    irregular, quiet, steady = scattered(0, 60), np.full(60, 0.01), np.full(60, 2.0)
    growing = np.exp(np.linspace(-4.0, 2.0, 60))
    found, reason, distance = verdict(irregular, quiet)
    assert (found, distance) == (IRREGULAR, 0.0)
    assert reason.startswith("t1 is irregular, ") and "in 60 windows without a trend" in reason
    assert verdict(quiet, irregular)[0] is IRREGULAR
    assert verdict(irregular, steady)[0] is YES
    assert verdict(irregular, growing)[0] is UNDECIDED
    # above the threshold once, and without a trend: a longer run would not tell more of it
    burst = np.where(np.arange(60) == 40, 1.2, 0.5 * scattered(2, 60, scatter=0.2))
    assert verdict(burst, burst)[0] is UNDECIDED
    assert verdict(irregular, burst)[0] is IRREGULAR
    assert verdict(quiet, quiet)[0] is NO


# Displacement histories of 2.4 s, judged over 1.2 s: 59 windows.

TIME = np.arange(round(2.4 * RATE)) / RATE


def assessed(envelope, seed=0):
    w = np.random.default_rng(seed).normal(0.0, 1e-9, (len(TIME), 2))
    w[:, 0] += envelope * np.sin(2.0 * np.pi * 612.0 * TIME)
    return assess(w, RATE, STRANDS, DEFAULTS)


def bursts(seed):
    """A strand that is jerked 60 times a second, each time to another height about the threshold."""
    random = np.random.default_rng(seed)
    envelope = np.full(len(TIME), 1e-7)
    for start in np.arange(0.0, TIME[-1], 1.0 / 60.0):
        since = TIME - start
        envelope += 7e-6 * random.lognormal(0.0, 0.7) * np.where(since > 0.0, np.exp(-since / 0.006), 0.0)
    return envelope


def test_bursts_are_irregular_and_their_size_is_told():
    found = [assessed(bursts(seed)) for seed in range(6)]
    assert {one.vibrates for one in found} <= {IRREGULAR, UNDECIDED}
    # a chance trend leaves some of them open
    irregular = [one for one in found if one.vibrates is IRREGULAR]
    assert len(irregular) >= 4
    for one in irregular:
        assert 2e-6 < one.amplitude[0] < 12e-6 and 0.2 < one.amplitude_scatter[0] < 1.0


@pytest.mark.parametrize("gain", [1.5, -1.5])
@pytest.mark.parametrize("seed", range(5))
def test_bursts_that_grow_or_decay_are_not(seed, gain):
    # over the judged half; about the threshold in its middle
    assert assessed(bursts(seed) * np.exp(gain * (TIME - 1.8) / 1.2)).vibrates is not IRREGULAR


@pytest.mark.parametrize(
    ("beat", "expected"),
    [
        (9.0, IRREGULAR),  # [Hz]: many beats, each longer than a window
        (1.0, UNDECIDED),  # hardly more than one in the judged part
        (200.0, YES),  # within a window they average out: 8 um
    ],
)
def test_beats(beat, expected):
    assert assessed(7.5e-6 * (1.0 + 0.6 * np.cos(2.0 * np.pi * beat * TIME))).vibrates is expected


@pytest.mark.parametrize("rate", [0.3, 1.0, 3.0, -0.3, -1.0, -3.0])
def test_slow_growth_and_slow_decay_through_the_threshold_are_undecided(rate):
    found = assessed(5e-6 * np.exp(rate * (TIME - 1.8)))
    assert found.vibrates in ((UNDECIDED,) if rate > 0 else (UNDECIDED, NO))


def test_a_start_that_decays_into_small_bursts_is_not_irregular():
    assert assessed(0.3 * bursts(1) + 1e-3 * np.exp(-TIME / 0.2)).vibrates is not IRREGULAR
