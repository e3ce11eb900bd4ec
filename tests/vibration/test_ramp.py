"""Ramps, by displacement histories that are known: verdict, onset, end, and amplitude over load."""

import numpy as np
import pytest

from cvt_hpc.variables import Vibrates
from cvt_hpc.vibration.ramp import BINS, SUSTAINED, VARIABLES, Passages, assess_ramp
from cvt_hpc.vibration.ramped import QUANTITIES
from cvt_hpc.vibration.settings import PARAMETERS

RATE = 20_000.0
DEFAULTS = {key: parameter.default for key, parameter in PARAMETERS["vibration"].items()}
TIME = np.arange(round(2.0 * RATE)) / RATE
LOADS = 20.0 + 90.0 * TIME  # [N m]: 20 to 200
STRANDS = ("t1", "t1", "t2")


def ramp(envelope, until=2.0, loads=LOADS, quantity="load", **changes):
    """Judgement of a ramp in which strand t1 moves at its second probe by `envelope` of the load [m]."""
    w = np.random.default_rng(0).normal(0.0, 1e-10, (len(TIME), 3))
    w += 1e-4 * TIME[:, np.newaxis]
    w[:, 1] += envelope(loads) * np.sin(2.0 * np.pi * 512.0 * TIME)
    kept = round(until * RATE)
    return assess_ramp(w[:kept], RATE, STRANDS, quantity, loads[:kept], len(TIME), DEFAULTS | changes)


def window(low, high, size=20e-6):
    """Vibration between two loads, with edges that rise by a decade within 5 N m."""

    def envelope(load):
        levels = np.minimum(load - low, high - load) / 5.0
        return np.minimum(5e-6 * 10.0**levels, size)

    return envelope


def test_a_window_of_vibration_is_found_wherever_it_lies():
    for low, high in ((60.0, 90.0), (100.0, 150.0), (150.0, 180.0)):
        found = ramp(window(low, high))
        assert found.vibrates is Vibrates.YES
        # the load changes by 3.6 N m within a window of amplitude
        assert found.onset == pytest.approx(low, abs=2.0)
        assert found.end == pytest.approx(high, abs=2.0)
        assert found.amplitude[0] == pytest.approx(20e-6, rel=0.05) and found.amplitude[1] < 1e-8
        assert found.frequency[0] == pytest.approx(512.0, abs=1.0)
        assert found.strongest_probe.tolist()[0] == 1 and found.strands == ("t1", "t2")
        assert found.reason.startswith(f"t1 vibrates from {found.onset:.4g} N m to")


def test_a_falling_ramp_vibrates_from_the_higher_load_to_the_lower():
    found = ramp(window(100.0, 150.0), loads=LOADS[::-1])
    assert (found.onset, found.end) == (
        pytest.approx(150.0, abs=2.0),
        pytest.approx(100.0, abs=2.0),
    )


def test_ends_that_lie_beyond_the_ramp_are_not_known():
    found = ramp(window(-100.0, 120.0))
    assert np.isnan(found.onset) and found.end == pytest.approx(120.0, abs=2.0)
    found = ramp(window(120.0, 500.0))
    assert found.onset == pytest.approx(120.0, abs=2.0) and np.isnan(found.end)
    assert "to its end" in found.reason


def test_the_amplitude_is_told_along_the_ramp():
    found = ramp(lambda load: 1e-7 * load)
    assert found.ramp_mean == pytest.approx(20.0 + 180.0 * (np.arange(BINS) + 0.5) / BINS, abs=1.5)
    # windows of a bin lie to either side of its middle
    assert found.ramp_amplitude[0] == pytest.approx(1e-7 * found.ramp_mean, rel=0.02)
    assert (found.ramp_amplitude[1] < 1e-8).all()


def test_only_a_ramp_below_the_threshold_all_along_is_quiet():
    found = ramp(lambda load: np.full(load.shape, 2e-6))
    assert found.vibrates is Vibrates.NO and found.margin == pytest.approx(np.log(2.5), rel=0.01)
    assert np.isnan(found.onset) and np.isnan(found.end)
    # a vibration of two windows
    brief = ramp(lambda load: np.where(np.abs(load - 100.0) < 2.0, 20e-6, 1e-6))
    assert brief.vibrates is Vibrates.UNDECIDED and brief.margin == 0.0
    assert "above the threshold in" in brief.reason


def test_vibration_counts_from_a_number_of_windows_in_a_row():
    hop = 0.02 * 90.0  # [N m] between windows
    lengths = hop * np.arange(1, 9)
    found = [ramp(lambda load, n=n: np.where(abs(load - 100.0) < n / 2, 20e-6, 1e-7)) for n in lengths]
    verdicts = [one.vibrates for one in found]
    first = verdicts.index(Vibrates.YES)
    # a window is above as soon as half of it is
    assert abs(first + 1 - SUSTAINED) <= 1
    assert set(verdicts[:first]) == {Vibrates.UNDECIDED} and set(verdicts[first:]) == {Vibrates.YES}


def passages(*levels):
    """Verdict and margin of one strand by its amplitudes in windows, over the threshold."""
    found = Passages(
        5e-6 * np.array(levels)[:, np.newaxis], 10.0 * np.arange(len(levels)), QUANTITIES["load"], DEFAULTS
    )
    vibrates, _ = found.classify(["t1"])
    return vibrates, found.margin(vibrates)


def test_four_windows_in_a_row_vibrate_and_three_do_not():
    below = [0.5] * 5
    assert passages(*below, *[1.2] * 4, *below) == (Vibrates.YES, pytest.approx(np.log(1.2)))
    assert passages(*below, *[1.2] * 3, *below, *[1.2] * 3) == (Vibrates.UNDECIDED, 0.0)


def test_the_margin_of_a_vibration_is_that_of_its_best_four_windows_in_a_row():
    found = passages(0.5, 1.1, 1.3, 3.0, 2.0, 2.5, 4.0, 1.2, 0.5, 9.0, 0.5)
    assert found == (Vibrates.YES, pytest.approx(np.log(2.0)))


@pytest.mark.parametrize(
    ("gains", "verdict"),
    [
        ([0.0, 0.4, 0.8, 1.05], Vibrates.UNDECIDED),  # e-folds over three windows: 1 is growth
        ([0.0, 0.4, 0.8, 0.95], Vibrates.NO),
        ([0.0, 0.6, 0.5, 1.2], Vibrates.NO),  # not at every window
    ],
)
def test_growth_at_the_end_is_a_gain_of_an_e_fold_over_three_windows(gains, verdict):
    assert passages(*[0.1] * 10, *(0.1 * np.exp(gains)))[0] is verdict


def test_growth_at_the_end_of_a_ramp_is_undecided():
    found = ramp(lambda load: 2e-6 * np.exp(load - 200.0))
    assert found.vibrates is Vibrates.UNDECIDED and "growing at the end" in found.reason
    assert ramp(lambda load: 5e-9 * np.exp(load - 200.0)).vibrates is Vibrates.NO  # negligible


def test_a_ramp_that_ended_early_tells_what_it_has_seen():
    found = ramp(window(60.0, 90.0), until=1.0)
    assert found.vibrates is Vibrates.YES and found.end == pytest.approx(90.0, abs=2.0)
    assert np.isfinite(found.ramp_mean[:10]).all() and np.isnan(found.ramp_mean[11:]).all()
    # five periods of 300 Hz are the least that is judged
    assert ramp(window(60.0, 90.0), until=5.0 / 300.0) is not None
    assert ramp(window(60.0, 90.0), until=0.96 * 5.0 / 300.0) is None


def test_the_record_has_what_is_declared():
    from cvt_hpc.vibration import assessment
    from cvt_hpc.vibration import ramp as room

    records = [ramp(window(60.0, 90.0), quantity=quantity).record() for quantity in room.QUANTITIES]
    sizes = {"strand": 2, "ramp_share": len(room.coordinate().values)}
    for variable in (*assessment.VARIABLES, *room.VARIABLES):
        found = [record[variable.name] for record in records if variable.name in record]
        assert len(found) == (1 if variable.name.endswith(tuple(room.QUANTITIES)) else len(records)), (
            variable.name
        )
        for value in found:
            assert np.shape(value) == tuple(sizes[dim] for dim in variable.dims), variable.name


def test_a_ramp_of_speed_is_told_in_its_units():
    found, quiet = (ramp(window(low, 150.0), quantity="speed") for low in (100.0, 1000.0))
    record = found.record()
    assert (record["onset_speed"], record["end_speed"]) == (found.onset, found.end)
    assert f"from {found.onset * 30 / np.pi:.4g} rpm to {found.end * 30 / np.pi:.4g} rpm" in found.reason
    assert quiet.reason.startswith("quiet between") and "rpm" in quiet.reason
    units = {variable.name: variable.units for variable in VARIABLES}
    assert {units[name] for name in ("onset_speed", "end_speed", "ramp_speed")} == {"rad s-1"}
