"""When a run counts as vibrating: a table of window amplitudes, and displacement histories of known behaviour."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from cvt_hpc.variables import Vibrates
from cvt_hpc.vibration.assessment import assess, assess_runs, classify, is_certain, margin
from cvt_hpc.vibration.settings import PARAMETERS, check
from cvt_hpc.vibration.signals import growth_fit

RATE = 20_000.0
DEFAULTS = {key: parameter.default for key, parameter in PARAMETERS["vibration"].items()}
# a wide band and a round threshold, in which the cases below are told
SETTINGS = DEFAULTS | {"band_low": 100.0, "amplitude_threshold": 1e-6, "negligible_amplitude": 0.0}
NO, YES, UNDECIDED = Vibrates.NO, Vibrates.YES, Vibrates.UNDECIDED
STILL = [0.0] * 6

TABLE = {
    # amplitudes of one strand in six windows [um], over the last 0.15 s of 0.3 s
    "settled": ([10, 10, 10, 10, 10, 10], YES),
    "settled, scattering by 7 %": ([10, 9.3, 10.7, 9.4, 10.2, 9.8], YES),
    "still growing above the threshold": ([2, 3, 5, 7, 9, 11], YES),
    "just above": ([1.01, 1.01, 1.01, 1.01, 1.01, 1.01], YES),
    "creeping to its limit cycle": ([10.2, 10.15, 10.1, 10.08, 10.06, 10.05], YES),
    "decaying": ([12, 9, 7, 5, 4, 3], UNDECIDED),
    "decaying slowly but clearly": ([12, 11.8, 11.6, 11.4, 11.2, 11.0], UNDECIDED),
    "decaying and scattering": ([12, 8, 11, 6, 9, 5], UNDECIDED),
    "crossing upward": ([0.2, 0.4, 0.8, 1.6, 3.2, 6.4], UNDECIDED),
    "coming and going": ([3, 3, 0.2, 3, 3, 3], UNDECIDED),
    "a dip at the end": ([3, 3, 3, 3, 3, 0.9], UNDECIDED),
    "nothing": ([0, 0, 0, 0, 0, 0], NO),
    "stopped": ([3, 1, 0, 0, 0, 0], NO),
    "set in from nothing": ([0, 0, 0, 1e-6, 1e-5, 1e-4], UNDECIDED),
    "noise": ([1e-3, 1.1e-3, 0.9e-3, 1.05e-3, 0.95e-3, 1.1e-3], NO),
    "noise, larger": ([0.30, 0.36, 0.28, 0.34, 0.30, 0.35], NO),
    "decayed below the threshold": ([3, 2, 1.4, 0.9, 0.6, 0.4], NO),
    "decayed below it just now": ([3, 2.4, 1.9, 1.5, 1.2, 0.95], NO),
    "decayed far, fast, to its floor": ([40, 0.1, 0.02, 0.02, 0.021, 0.02], NO),
    "decayed to its floor": ([0.4, 0.1, 0.02, 0.02, 0.021, 0.02], NO),
    "growing, far below": ([1e-6, 2e-6, 4e-6, 8e-6, 16e-6, 32e-6], UNDECIDED),
    "growing slowly, far below": ([1e-3, 1.1e-3, 1.21e-3, 1.33e-3, 1.46e-3, 1.61e-3], UNDECIDED),
    "growing after a decay": ([1e-1, 1e-2, 1e-3, 1e-3, 2e-3, 4e-3], UNDECIDED),
    "irregular, low for a while by chance": ([0.1, 0.035, 0.1, 0.09, 0.035, 0.1], NO),
    "about to cross": ([0.70, 0.74, 0.78, 0.82, 0.86, 0.90], UNDECIDED),
}


def verdict(*strands, parameters=SETTINGS):
    windows = 1e-6 * np.array(strands, dtype=float).T
    growth = growth_fit(0.02 * np.arange(len(windows)), windows)
    names = ("t1", "t2")[: len(strands)]
    times = {"judged_time": 0.15, "record_time": 0.3}
    return classify(windows, *growth, **times, parameters=parameters, strands=names)


@pytest.mark.parametrize(("windows", "expected"), TABLE.values(), ids=TABLE.keys())
def test_one_strand(windows, expected):
    assert verdict(windows)[0] is expected
    assert verdict(STILL, windows)[0] is expected


def test_a_run_vibrates_if_a_strand_does_and_is_quiet_if_both_are():
    vibrating, decaying, quiet = (TABLE[name][0] for name in ("settled", "decaying", "noise"))
    assert verdict(vibrating, decaying)[0] is YES
    assert verdict(decaying, vibrating)[0] is YES
    assert verdict(quiet, decaying)[0] is UNDECIDED
    assert verdict(quiet, quiet)[0] is NO


def test_the_reason_names_strand_size_and_trend():
    assert verdict(STILL, TABLE["settled"][0])[1].startswith("t2 vibrates for the last 0.15 s, 10 um")
    reason = verdict(3 * np.exp(-14 * 0.02 * np.arange(-5, 1)), TABLE["noise"][0])[1]
    assert reason.startswith("t1 is above the threshold, 3 um in the last window, but decays at 14 1/s")
    assert "t2" not in reason
    assert verdict(STILL, STILL)[1] == "t1 is at rest; t2 is at rest"
    assert "growing" in verdict(TABLE["growing, far below"][0])[1]


def test_reasons_fit_into_a_record():
    for windows, _ in TABLE.values():
        reason = verdict(windows, windows)[1]
        assert reason.isascii() and 0 < len(reason) <= 240


def test_each_threshold_counts():
    def changed(name, **change):
        return verdict(TABLE[name][0], parameters=SETTINGS | change)[0]

    assert changed("settled", amplitude_threshold=20e-6) is NO
    assert changed("decaying and scattering", decay_tolerance=10.0) is YES
    assert changed("creeping to its limit cycle", decay_tolerance=0.0) is UNDECIDED
    assert changed("growing after a decay", growth_tolerance=3.0) is NO
    assert changed("growing after a decay", negligible_amplitude=3.9e-9) is UNDECIDED
    assert changed("growing after a decay", negligible_amplitude=4.1e-9) is NO


def test_too_few_windows_to_see_a_trend_are_undecided():
    for amplitude in (10.0, 0.1):
        assert verdict([amplitude] * 2)[0] is UNDECIDED


def test_a_failed_run_has_no_class():
    with pytest.raises(ValueError, match="finite"):
        verdict([10, 10, np.nan, 10, 10, 10])
    with pytest.raises(ValueError, match="one window"):
        classify(np.zeros((0, 2)), [0, 0], [0, 0], judged_time=1, record_time=1, parameters=SETTINGS)


# Displacement histories: strand t1 has its node at the first probe, t2 is quiet throughout.

STRANDS = ("t1", "t1", "t2")
DURATIONS = (0.1, 0.16, 0.3)


def history(envelope, duration, frequency=612.0, noise=1e-11, seed=0):
    t = np.arange(round(duration * RATE)) / RATE
    w = np.random.default_rng(seed).normal(0.0, noise, (len(t), 3))
    w += 1e-4 + 1e-4 * np.exp(-t / 0.1)[:, np.newaxis]
    w[:, 1] += envelope(t) * np.sin(2 * np.pi * frequency * t)
    return w


def assessed(*arguments, **keywords):
    return assess(history(*arguments, **keywords), RATE, STRANDS, SETTINGS)


@pytest.mark.parametrize("duration", DURATIONS)
def test_a_steady_vibration_is_found_with_its_size_and_frequency(duration):
    found = assessed(lambda t: 10e-6, duration)
    assert found.vibrates is YES
    assert found.strands == ("t1", "t2")
    assert found.strongest_probe[0] == 1
    assert found.amplitude[0] == pytest.approx(10e-6, rel=1e-3)
    assert found.frequency[0] == pytest.approx(612.0, abs=0.1)
    # 0.1 1/s is 0.5 % over the judged part of the shortest run.
    assert abs(found.growth_rate[0]) < 0.1
    assert found.amplitude[1] < 1e-8


@given(st.floats(0.0, 400.0), st.floats(-5.0, -3.0), st.sampled_from(DURATIONS), st.floats(250.0, 900.0))
@settings(deadline=None, max_examples=60)
def test_a_decaying_start_transient_never_vibrates(rate, exponent, duration, frequency):
    # A loss of 6 % over the judged part is told from scatter in a clean record; less may pass for steady.
    rate = max(rate, 0.06 / (SETTINGS["judged_fraction"] * duration))
    found = assessed(lambda t: 10**exponent * np.exp(-rate * t), duration, frequency=frequency)
    assert found.vibrates is not YES


@given(st.floats(0.0, 400.0), st.floats(-10.0, -7.0), st.sampled_from(DURATIONS), st.integers(0, 5))
@settings(deadline=None, max_examples=60)
def test_growth_out_of_the_noise_is_never_quiet(rate, exponent, duration, seed):
    # At least two e-folds over the run.
    rate = max(rate, 2.0 / duration)
    found = assessed(lambda t: 10**exponent * np.exp(rate * t), duration, seed=seed)
    assert found.vibrates is not NO


@pytest.mark.parametrize("duration", DURATIONS)
@pytest.mark.parametrize("noise", [1e-12, 3e-8])
def test_noise_and_settling_alone_are_quiet(noise, duration):
    found = [assessed(lambda t: 0.0, duration, noise=noise, seed=seed).vibrates for seed in range(100)]
    assert YES not in found
    # Four windows, all that the shortest run has, seem to grow by chance in 0.3 % of runs; two strands are looked at.
    assert found.count(UNDECIDED) <= (3 if duration == 0.1 else 0)


def test_only_the_last_part_of_a_run_is_judged():
    def settled_late(t):
        return np.where(t < 0.1, 100e-6, 5e-6)

    found = assessed(settled_late, 0.3)
    assert found.vibrates is YES
    assert found.amplitude[0] == pytest.approx(5e-6, rel=1e-3)
    whole = assess(history(settled_late, 0.3), RATE, STRANDS, SETTINGS | {"judged_fraction": 1.0})
    assert whole.vibrates is UNDECIDED


def test_a_vibration_that_has_died_out_is_quiet():
    found = assessed(lambda t: 1e-4 * np.exp(-t / 0.01), 0.3)
    assert found.vibrates is NO


def test_rest_is_quiet_and_has_no_frequency():
    found = assess(np.zeros((2000, 3)), RATE, STRANDS, SETTINGS)
    assert found.vibrates is NO
    assert not found.amplitude.any()
    assert np.isnan(found.frequency).all() and np.isnan(found.growth_rate).all()


def test_defaults_are_consistent_and_checks_name_the_key():
    assert check(DEFAULTS | {"duration": 0.1, "sampling_rate": RATE}) == []
    run = SETTINGS | {"duration": 0.1, "sampling_rate": RATE}
    assert check(run | {"duration": 0.05, "judged_fraction": 1.0}) == []
    assert [p[0] for p in check(run | {"band_high": 80.0})] == ["band_high"]
    assert [p[0] for p in check(run | {"window_length": 0.01})] == ["window_length"]
    ((key, expected, found),) = check(run | {"duration": 0.06})
    assert key == "duration" and "0.05 s" in expected and "0.03 s" in found


def test_each_default_lies_within_its_own_bounds():
    for name, parameter in PARAMETERS["vibration"].items():
        inside = parameter.minimum < parameter.default if parameter.exclusive else True
        assert inside and parameter.minimum <= parameter.default <= parameter.maximum, name
        assert parameter.unit in {"", "Hz", "m", "s"} and parameter.description


def test_what_moves_below_the_band_does_not_vibrate():
    # windows of 40 ms see 25 Hz and more beyond the band, the whole record 7 Hz
    settings = DEFAULTS | {"band_low": 300.0, "amplitude_threshold": 5e-6}
    time = np.arange(round(0.4 * RATE)) / RATE
    tones = {f: np.tile(12e-6 * np.sin(2 * np.pi * f * time)[:, np.newaxis], 3) for f in (288.0, 330.0)}
    assert assess(tones[330.0], RATE, STRANDS, settings).vibrates is YES
    found = assess(tones[288.0], RATE, STRANDS, settings)
    assert found.amplitude.max() < 5e-6 and found.vibrates is not YES


@pytest.mark.parametrize(
    ("windows", "expected"),
    [
        ([[2, 2, 3, 2], [9, 8, 8, 9]], np.log(8)),  # of the strand that keeps highest its lowest window
        ([[5, 1, 0.1, 0.01], [0.3, 0.25, 0.2, 0.15]], np.log(1 / 0.2)),  # the highest of the last half
        ([[5, 1, 0.2, 2], [0.3, 0.25, 0.2, 0.15]], 0.0),  # undecided
        ([[3, 1, 0, 0], [0, 0, 0, 0]], np.inf),
    ],
)
def test_the_margin_is_the_distance_from_the_threshold(windows, expected):
    vibrates, _ = verdict(*windows)
    assert margin(1e-6 * np.array(windows, float).T, vibrates, 1e-6) == pytest.approx(expected, abs=1e-12)


CERTAIN = {"amplitude_threshold": 5e-6, "judged_fraction": 0.5, "duration": 0.1, "band_low": 0.0}


@pytest.mark.parametrize(
    ("vibrates", "amplitude", "rate", "error", "scatter", "certain"),
    [
        (Vibrates.NO, (2.4e-6, 1e-7), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), True),
        (Vibrates.NO, (2.6e-6, 1e-7), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), False),  # within a factor of two
        (Vibrates.NO, (1e-7, 1e-7), (0.0, 10.9), (0.0, 0.0), (0.0, 0.0), False),  # will have grown too far
        (Vibrates.NO, (1e-7, 1e-7), (0.0, 10.5), (0.0, 0.0), (0.0, 0.0), True),
        (Vibrates.NO, (1e-7, 1e-7), (0.0, 0.0), (0.0, 6.0), (0.0, 0.0), False),  # or may have
        (Vibrates.NO, (1e-7, 0.0), (-50.0, np.nan), (0.1, np.nan), (0.0, np.nan), True),  # one is at rest
        (Vibrates.YES, (11e-6, 1e-7), (0.0, 300.0), (0.0, 0.0), (0.02, 0.5), True),
        (Vibrates.YES, (9e-6, 1e-7), (0.0, 0.0), (0.0, 0.0), (0.02, 0.5), False),
        (Vibrates.YES, (50e-6, 1e-7), (2.1, 0.0), (0.0, 0.0), (0.02, 0.0), False),  # its size is not settled
        (Vibrates.YES, (50e-6, 1e-7), (0.0, 0.0), (0.0, 0.0), (0.11, 0.0), False),
        (Vibrates.YES, (11e-6, 1e-7), (-1.0, 0.0), (0.0, 0.0), (0.02, 0.0), False),  # will have decayed
        (Vibrates.YES, (11e-6, 1e-7), (0.0, 0.0), (0.5, 0.0), (0.02, 0.0), False),
        (Vibrates.UNDECIDED, (50e-6, 50e-6), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), False),
        (Vibrates.IRREGULAR, (50e-6, 50e-6), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), False),
        (Vibrates.SLIPS, (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), (0.0, 0.0), False),
    ],
)
def test_when_more_of_a_run_would_not_change_its_verdict(vibrates, amplitude, rate, error, scatter, certain):
    values = amplitude, rate, error, scatter
    names = "amplitude", "growth_rate", "growth_error", "amplitude_scatter"
    record = {name: np.array(value) for name, value in zip(names, values, strict=True)}
    record |= {"vibrates": vibrates, "lower_band_edge": 150.0}
    assert is_certain(record, CERTAIN, left=0.3) is certain
    # five periods of the judged part: a longer run may be judged by a lower edge
    cut = {"lower_band_edge": 5.0 / (CERTAIN["judged_fraction"] * CERTAIN["duration"])}
    assert not is_certain(record | cut, CERTAIN, left=0.3)
    assert is_certain(record | cut, CERTAIN | {"band_low": cut["lower_band_edge"]}, left=0.3) is certain
    # a single body, whose values have no dimension, is judged as a single strand
    for strand in range(2):
        one, body = (record | {name: record[name][part] for name in names} for part in ([strand], strand))
        assert is_certain(body, CERTAIN, left=0.3) is is_certain(one, CERTAIN, left=0.3)


def test_a_record_without_growth_is_never_certain():
    assert not is_certain({"vibrates": Vibrates.NO, "amplitude": np.zeros(1)}, CERTAIN, left=0.3)


@settings(max_examples=30, deadline=None)
@given(runs=st.integers(1, 7), strands=st.sampled_from(["a", "ab", "aabbb"]), seed=st.integers(0, 2**32 - 1))
def test_runs_are_judged_together_as_each_alone(runs, strands, seed):
    """Tones with harmonics, growth and noise over decades, rest among them: equal to the bit."""
    rng, time = np.random.default_rng(seed), np.arange(2000) / RATE
    shape = runs, 1, len(strands)
    motion = rng.choice([0.0, 1e-9, 1e-6], (runs, 1, 1)) * rng.normal(size=(runs, time.size, len(strands)))
    for _ in range(3):
        size = rng.choice([0.0, 1e-8, 5e-6, 1e-4], shape) * np.exp(
            rng.normal(0.0, 20.0, shape) * time[:, np.newaxis]
        )
        wave = np.sin(2.0 * np.pi * rng.uniform(100.0, 1600.0, shape) * time[:, np.newaxis])
        motion += size * np.maximum(wave, rng.uniform(-1.0, 0.0, shape))
    together = assess_runs(motion, RATE, tuple(strands), DEFAULTS)
    assert len(together) == runs
    for found, alone in zip(together, motion, strict=True):
        expected = vars(assess(alone, RATE, tuple(strands), DEFAULTS))
        for name, value in vars(found).items():
            np.testing.assert_array_equal(value, expected[name], name)
