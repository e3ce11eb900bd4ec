"""Where the band of a run begins, and what of its motion is judder: modes of the strands, jerks of the pulley."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from cvt_hpc.variables import Vibrates
from cvt_hpc.variator.band import LEAST_JERK, band, judder_frequency, strand_frequencies
from cvt_hpc.variator.judging import multiples, with_judder
from cvt_hpc.vibration.assessment import assess
from cvt_hpc.vibration.settings import ABOVE_MODES, BELOW_MODES, LOWEST, PARAMETERS, lower_edge

RATE = 20_000.0
DEFAULTS = {key: parameter.default for key, parameter in PARAMETERS["vibration"].items()}
# radii of 25 mm, shafts 0.15 m apart: strings of that length and 1 kg/m at 10 m/s
P = DEFAULTS | {
    "duration": 0.4,
    "sampling_rate": RATE,
    "ratio": 1.0,
    "driven_radius": 0.025,
    "centre_distance": 0.15,
    "driving_speed": 400.0,
    "element_mass": 0.8,
    "ring_mass": 0.2,
    "load_history": "constant",
}
SPEED, LENGTH = 10.0, 0.15


def first_mode(force):
    """(c^2 - v^2) / (2 c L) of a string of 1 kg/m under a tension [N]."""
    return (force - SPEED**2) / (2.0 * np.sqrt(force) * LENGTH)


def run(tension=(9e3, 8e3), push=(4e3, 0.0), judder=(), **parameters):
    """A run with constant forces; judder as frequency [Hz] and amplitude over the speed."""
    p = P | parameters
    time = np.arange(round(p["duration"] * RATE)) / RATE
    speed = 300.0 * (1.0 + sum(a * np.sin(2.0 * np.pi * f * time) for f, a in judder))
    means = {"ring_tension t1": tension[0], "ring_tension t2": tension[1]}
    means |= {"push_force t1": push[0], "push_force t2": push[1]}
    channels = {name: np.full(time.size, value) for name, value in means.items()}
    channels["driven_speed"] = np.broadcast_to(speed, time.shape)
    judged = slice(time.size - round(p["judged_fraction"] * time.size), time.size)
    return SimpleNamespace(
        parameters=p,
        judged=judged,
        channel=channels.__getitem__,
        mean_driving_speed=lambda samples: p["driving_speed"],
    )


def test_it_begins_below_the_lower_first_mode_of_both_strands():
    assert band(run()) == pytest.approx((BELOW_MODES * first_mode(5e3), 1500.0), rel=1e-4)
    assert band(run(push=(0.0, 4.5e3)))[0] == pytest.approx(BELOW_MODES * first_mode(3.5e3), rel=1e-4)
    # the strands of other scenes are slower, and so is all that they do
    for scale in (0.25, 1.0, 4.0):
        forces = np.array([[9e3, 8e3], [4e3, 0.0]]) * scale
        found = band(run(*forces, driving_speed=400.0 * np.sqrt(scale), band_high=3000.0))[0]
        assert found == pytest.approx(BELOW_MODES * first_mode(5e3) * np.sqrt(scale), rel=1e-4)


def test_of_a_run_that_judders_it_begins_above_both_first_modes():
    expected = ABOVE_MODES * first_mode(8e3)
    for frequency in (61.0, 90.0, 0.45 * first_mode(5e3)):
        assert band(run(judder=[(frequency, 1.3 * LEAST_JERK)]))[0] == pytest.approx(expected, rel=1e-4)
    # coarse runs are judged for a fifth of the time, and meet the same judder
    assert band(run(judder=[(61.0, 4.0 * LEAST_JERK)], duration=0.09))[0] == pytest.approx(expected, rel=1e-4)
    # a ripple is no judder, nor is a slow drift, nor what a vibration of the strands themselves does to the pulley
    undisturbed = band(run())[0]
    for motion in ((61.0, 0.8 * LEAST_JERK), (2.0, 1e-2), (0.6 * first_mode(5e3), 1e-2)):
        assert band(run(judder=[motion]))[0] == undisturbed, motion


def test_the_judged_part_and_the_windows_have_to_resolve_it():
    least = 5.0 / (0.5 * 0.08)
    assert BELOW_MODES * first_mode(5e3) > least > 100.0
    assert band(run((6e3, 6e3), (5e3, 5e3), duration=0.08))[0] == pytest.approx(least)
    assert band(run((6e3, 6e3), (5e3, 5e3), window_length=0.01))[0] == pytest.approx(200.0)
    assert band(run(band_high=305.0))[0] == pytest.approx(152.5)


def test_a_number_in_the_job_stays():
    assert band(run(band_low=123.0, judder=[(61.0, 3e-3)])) == (123.0, 1500.0)


def test_where_no_first_mode_is_known_it_is_constant():
    slack = run(push=(9e3, 0.0))
    without_belt = SimpleNamespace(parameters={k: v for k, v in P.items() if k != "ring_mass"})
    ramp = SimpleNamespace(parameters=P | {"load_history": "ramp"})
    assert {band(each) for each in (slack, without_belt, ramp)} == {(LOWEST, 1500.0)}
    assert lower_edge(P, np.nan, np.nan, True) == LOWEST


def test_it_has_the_eigenfrequencies_of_the_model_strand():
    found = strand_frequencies(P, (5e3, 8e3))[:, 0]
    assert found == pytest.approx([first_mode(5e3), first_mode(8e3)], rel=1e-4)


def judged(t1=(), t2=(), judder=((61.0, 4.0 * LEAST_JERK),), **parameters):
    """Verdict on a run of which the strands move by frequencies [Hz] and amplitudes [um], and that without judder."""
    found = run(judder=judder, **parameters)
    time = np.arange(round(found.parameters["duration"] * RATE)) / RATE
    moved = [
        sum(1e-6 * a * np.sin(2.0 * np.pi * f * time) for f, a in strand) + 0.0 * time for strand in (t1, t2)
    ]
    found.displacement = np.stack(moved, axis=1)
    in_band = found.parameters | {"band_low": band(found)[0]}
    plain = assess(found.displacement, RATE, ("t1", "t2"), in_band)
    return with_judder(found, plain), plain


def test_the_frequency_of_judder_is_that_of_the_pulley():
    assert judder_frequency(run(judder=[(61.0, 3e-3)])) == pytest.approx(61.0, abs=0.01)
    for quiet in (run(), run(judder=[(61.0, 0.8 * LEAST_JERK)]), run(judder=[(61.0, 3e-3)], band_low=123.0)):
        assert np.isnan(judder_frequency(quiet))


def test_jerks_whose_peak_a_short_part_does_not_show_have_no_known_frequency():
    short = {"judder": [(120.0, 0.03)], "duration": 0.06}
    assert judder_frequency(run(**short)) == 0.0
    found, plain = judged([(400.0, 9.0)], [], **short)
    assert plain.vibrates is Vibrates.YES
    assert found is plain


def test_strands_that_harmonics_of_judder_move_do_not_vibrate():
    # the harmonics in the band, from 310 Hz on, are the sixth and those above
    found, plain = judged(
        t1=[(244.0, 30.0), (305.0, 7.0), (366.0, 7.0), (427.0, 3.0)], t2=[(305.0, 4.0), (366.0, 6.0)]
    )
    assert plain.vibrates is Vibrates.YES
    assert found.vibrates is Vibrates.NO
    assert found.margin == 0.0
    t1, t2 = (
        f"{name} by {a * 1e6:.3g} um at its harmonic 6"
        for name, a in zip(("t1", "t2"), plain.amplitude, strict=True)
    )
    assert found.reason == f"the driven pulley judders at 61 Hz and moves {t1}, {t2}"
    assert np.array_equal(found.amplitude, plain.amplitude)


@pytest.mark.parametrize(("slow", "highest", "off"), [(61.3, 24, 1e-7), (13.0, 115, 1e-7), (1250.0, 8, 1e-4)])
def test_multiples_of_judder_are_fitted_as_by_all_waves_at_once(slow, highest, off):
    # the last case ends at half the sampling rate, where a sine is 0 at all samples
    moved, rate = np.random.default_rng(4).normal(size=(4000, 2)), 20_000.0
    phases = 2.0 * np.pi * np.outer(np.arange(4000), slow / rate * np.arange(1, highest + 1))
    waves = np.hstack([np.ones((4000, 1)), np.cos(phases), np.sin(phases)])
    parts = np.linalg.lstsq(waves, moved, rcond=1e-10)[0]
    found, fitted = multiples(moved, slow / rate, highest)
    np.testing.assert_allclose(np.abs(found[1:]), np.hypot(*np.split(parts[1:], 2)), rtol=0, atol=off)
    np.testing.assert_allclose(fitted, waves @ parts, rtol=0, atol=off)


def test_many_multiples_of_a_slow_judder_cost_little():
    # 750 of them in a second at 20 kHz: all waves at once take some 10 s and 240 MB
    moved, began = np.random.default_rng(5).normal(size=(20_000, 2)), time.process_time()
    multiples(moved, 1e-4, 750)
    assert time.process_time() - began < 3.0


@pytest.mark.parametrize(
    ("t1", "t2", "others"),
    [
        ([(305.0, 9.0), (366.0, 7.0)], [(411.0, 6.0)], {}),  # the other strand vibrates by itself
        ([(305.0, 9.0), (366.0, 9.0), (411.0, 6.0)], [], {}),  # so does the same one, by less
        ([(305.0, 9.0), (367.5, 7.0)], [], {}),  # off the harmonic by a third of the resolution
        ([(305.0, 2.0), (366.0, 9.0)], [], {}),  # rises out of the harmonics: the belt, locked to judder
        ([(305.0, 9.0), (366.0, 7.0)], [], {"judder": ()}),
        ([(305.0, 9.0), (366.0, 7.0)], [], {"band_low": 250.0}),  # the job decides on what counts
        ([(61.0, 9.0)], [], {"band_high": 120.0}),  # judder itself, in the band: no multiple comes before it
        ([(305.0, 4.7), (365.8, 4.9)], [], {"band_high": 365.9}),  # the multiple itself lies above the band
    ],
)
def test_a_vibration_beside_judder_stays_one(t1, t2, others):
    found, plain = judged(t1, t2, **others)
    assert plain.vibrates is Vibrates.YES
    assert found is plain
