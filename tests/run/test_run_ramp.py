"""Ramps of load: what is recorded of them, beside runs at constant loads."""

import numpy as np
import pytest

from cvt_hpc.analysis.histories import draw_history
from cvt_hpc.simulation import simulate
from cvt_hpc.variables import Status, Vibrates
from support.marched import alone, record

BELT = {"stations": 96, "step": 7.6e-6, "friction_gradient": -1.0, "precision": "single"}
RAMP = BELT | {"load_history": "ramp", "load_start": 20.0, "load": 200.0, "duration": 0.8}
BELOW, BEYOND = {"load_start": 50.0, "load": 60.0}, {"load": 500.0}


def test_a_ramp_through_a_window_vibrates_between_its_onset_and_its_end():
    found = record(**RAMP)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.YES)
    onset, end = found["onset_load"], found["end_load"]
    assert 30.0 < onset < end < 195.0
    # beside and within the window, far from where it takes long to grow; a ramp of 234 N m/s shows it late
    beside = [record(**BELT, load=load, duration=0.4)["vibrates"] for load in (60.0, 120.0, 190.0)]
    assert beside == [Vibrates.NO, Vibrates.YES, Vibrates.NO]
    assert found["reason"].endswith("um") and f"from {onset:.4g} N m to {end:.4g} N m" in found["reason"]
    load, amplitude = found["ramp_load"], found["ramp_amplitude"]
    assert (np.diff(load) > 0.0).all() and 20.0 < load[0] < load[-1] < 200.0
    inside = (load > onset + 5.0) & (load < end - 5.0)
    assert (amplitude[:, inside].max(axis=0) > 5e-6).all()
    assert amplitude[:, -1].max() < 5e-6 < found["amplitude"].max() < 1e-3
    assert np.isnan(found["growth_rate"]).all() and np.isfinite(found["frequency"]).all()


def test_below_the_window_a_ramp_is_quiet():
    found = record(**RAMP | BELOW)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.NO)
    assert np.isnan(found["onset_load"]) and np.isnan(found["end_load"])
    assert (found["ramp_amplitude"] < 5e-6).all()


def test_a_ramp_beyond_what_friction_carries_slips_and_tells_what_was_before():
    found = record(**RAMP | BEYOND)
    assert (found["status"], found["vibrates"]) == (Status.DONE, Vibrates.SLIPS)
    assert "slips through" in found["reason"] and "before: " in found["reason"]
    assert found["simulated_seconds"] < 0.8 and found["slip_margin"] > -0.1
    known = np.isfinite(found["ramp_load"])
    assert 5 < known.sum() < 20 and (np.diff(known.astype(int)) <= 0).all()
    assert found["ramp_load"][known][-1] < 400.0


def test_its_history_is_drawn(tmp_path):
    for name, load in (("ramp", 200.0), ("slips", 500.0)):
        dataset = simulate(alone(**RAMP | {"load": load, "duration": 0.3}))
        assert "ramp_amplitude" in dataset and dataset["ramp_amplitude"].dims == ("strand", "ramp_share")
        picture = draw_history(dataset, tmp_path / f"{name}.png")
        assert picture.stat().st_size > 10_000
        if name == "slips":
            assert dataset["time"].values[-1] == pytest.approx(float(dataset["simulated_seconds"]), abs=1e-4)
