"""What a job may set of recording and judging: whatever passes the checks can be recorded and judged."""

import numpy as np
import pytest
from hypothesis import assume, event, given
from hypothesis import strategies as st

from cvt_hpc import recording
from cvt_hpc.errors import InputError
from cvt_hpc.models import elastic_belt as belt
from cvt_hpc.models.elastic_belt.record import coordinates
from cvt_hpc.vibration import settings as vibration_settings
from cvt_hpc.vibration.assessment import assess
from cvt_hpc.vibration.signals import amplitude_spectrum
from support.marched import job

DEFAULTS = job().parameters


def problems(**values):
    """Keys that the checks of recording and judging complain about."""
    found = []
    for check in (recording.check, vibration_settings.check):
        found += [key for key, expected, text in check(DEFAULTS | values) if expected and text]
    return found


def test_defaults_are_fit():
    assert problems() == []
    assert belt.check(DEFAULTS) == []


def test_four_samples_per_period_of_the_highest_frequency():
    assert problems(sampling_rate=6000.0) == []
    assert problems(sampling_rate=5999.0) == ["sampling_rate"]
    with pytest.raises(
        InputError, match=r"\[record\] sampling_rate: expected 4 x band_high = 6000 Hz or more, found 5000 Hz"
    ):
        job(sampling_rate=5000.0)
    with pytest.raises(InputError, match="sampling_rate"):
        job(band_high=6000.0)


@pytest.mark.parametrize(
    ("values", "key"),
    [
        # a spectrum of one bin, or one that reaches beyond half the sampling rate
        (
            {"band_low": 50.0, "band_high": 100.0, "spectrum_step": 500.0, "window_length": 0.1},
            "spectrum_step",
        ),
        ({"band_low": 200.0, "band_high": 300.0, "spectrum_step": 500.0}, "spectrum_step"),
        # windows of 12 and 9 samples, where the estimator needs 32
        (
            {"band_low": 1400.0, "sampling_rate": 6000.0, "duration": 0.01, "rise_time": 0.002},
            "sampling_rate",
        ),
        ({"band_low": 1400.0, "sampling_rate": 6000.0, "window_length": 0.0015}, "sampling_rate"),
    ],
)
def test_what_cannot_be_judged_is_refused_before_it_is_computed(values, key):
    assert key in problems(**values)


@given(
    band_low=st.floats(10.0, 2000.0),
    band=st.floats(1.001, 10.0),
    oversampling=st.floats(4.0, 40.0),
    periods=st.floats(5.0, 40.0),
    judged_fraction=st.floats(0.05, 1.0),
    window_periods=st.floats(2.0, 20.0),
    spectrum_step=st.floats(0.1, 500.0),
)
def test_what_passes_can_be_judged(
    band_low, band, oversampling, periods, judged_fraction, window_periods, spectrum_step
):
    high = band_low * band
    values = {
        "band_low": band_low,
        "band_high": high,
        "sampling_rate": oversampling * high,
        "duration": periods / band_low / judged_fraction,
        "judged_fraction": judged_fraction,
        "window_length": window_periods / band_low,
        "spectrum_step": max(spectrum_step, high / 2000),
    }
    samples = max(round(values["duration"] * values["sampling_rate"]), 1)
    assume(samples < 20_000)
    fit = not problems(**values)
    event("fit" if fit else "refused")
    if fit:
        p = DEFAULTS | values
        w = np.random.default_rng(1).normal(size=(samples, 2))
        found = assess(w, p["sampling_rate"], ["t1", "t2"], p)
        assert np.all(np.isfinite(found.amplitude))
        judged = w[samples - round(judged_fraction * samples) :]
        bins = coordinates(p)["frequency_bin"].values
        assert np.all(np.isfinite(amplitude_spectrum(judged, p["sampling_rate"], bins)))


def test_a_run_is_not_judged_before_it_is_loaded():
    # a belt that never sees its load is quiet, and says nothing of the load that the job names
    with pytest.raises(InputError, match="rise_time"):
        job(rise_time=1.0, duration=0.3, load=120.0)
    job(rise_time=0.15, duration=0.3, load=120.0)
