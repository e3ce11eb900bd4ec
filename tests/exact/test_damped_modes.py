"""Growth rates and frequencies of known sums of damped modes, without noise and with it."""

import numpy as np
import pytest

from cvt_hpc.vibration.damped_modes import damped_modes, thinned
from cvt_hpc.vibration.twins import found_modes

RATE = 20e3
HIGHEST = 1500.0


def motion(modes, seconds, random, sensors=8):
    """A sum of modes (growth [1/s], frequency [Hz], amplitude) over random shapes."""
    t = np.arange(round(seconds * RATE)) / RATE
    total = np.zeros((t.size, sensors))
    for growth, frequency, amplitude in modes:
        shape = random.normal(size=sensors) + 1j * random.normal(size=sensors)
        total += amplitude * (np.exp((growth + 2j * np.pi * frequency) * t)[:, None] * shape).real
    return total


@pytest.mark.parametrize("seed", range(5))
def test_modes_without_noise_are_exact(seed):
    random = np.random.default_rng(seed)
    frequency = 150.0 + 250.0 * np.arange(5) + random.uniform(0.0, 200.0, 5)
    growth = random.uniform(-150.0, 60.0, 5)
    signal, rate = thinned(
        motion(zip(growth, frequency, np.ones(5), strict=True), 0.04, random), RATE, HIGHEST
    )
    assert rate == RATE / 3
    (found,) = damped_modes(signal, rate, [12])
    order = np.argsort(found.frequency[:5])
    np.testing.assert_allclose(found.frequency[:5][order], frequency, rtol=1e-6)
    np.testing.assert_allclose(found.growth[:5][order], growth, atol=1e-3)
    assert found.share.sum() == pytest.approx(1.0) and np.all(np.diff(found.share) <= 0.0)


def test_a_record_that_is_too_short_is_refused():
    with pytest.raises(ValueError, match="24 are needed"):
        damped_modes(np.ones((23, 2)), RATE, [4])


def twins(modes, seconds, noise, random, base=0.0):
    """Motions of three runs with chatter of an rms of `noise`, kicked in their middle."""
    free = motion(modes, seconds, random)
    rest = base + np.zeros((2 * len(free), free.shape[1]))
    runs = np.array([rest, rest, rest])
    for run, size in zip(runs, (0.0, 0.5, 1.0), strict=True):
        run[len(free) :] += size * free + noise * random.normal(size=free.shape)
    return runs


def test_errors_hold_the_true_rates_under_noise():
    off, errors = [], []
    for seed in range(12):
        random = np.random.default_rng(seed)
        true = [(random.uniform(-120.0, 60.0), frequency, 1.0) for frequency in (310.0, 560.0)]
        found = found_modes(twins(true, 0.06, 0.03, random), RATE, HIGHEST, vibrates=False)
        # of white chatter in two runs, what passes the filter
        left = 0.03 * np.sqrt(2.0 * 1.2 * HIGHEST / (0.5 * RATE))
        assert found.reason == "" and found.floor == pytest.approx(left, rel=0.3)
        for growth, frequency, _ in true:
            near = np.flatnonzero(np.abs(found.modes.frequency - frequency) < 20.0)
            if near.size:  # one that grows hides one that decays
                off.append(abs(found.modes.growth[near[0]] - growth))
                errors.append(found.growth_error[near[0]])
    assert len(off) > 16
    assert np.mean(np.array(off) <= errors) > 0.9 and np.median(errors) < 15.0


def test_why_there_are_no_modes():
    random = np.random.default_rng(0)
    true = [(-100.0, 400.0, 1.0)]
    still = twins(true, 0.05, 0.0, random)
    assert found_modes(still[[0, 0, 0]], RATE, HIGHEST, vibrates=False).reason == "the kick moves nothing"
    short = found_modes(still[:, : len(still[0]) // 2 + 80], RATE, HIGHEST, vibrates=False)
    assert "too few for modes" in short.reason
    drowned = found_modes(twins(true, 0.05, 3.0, random), RATE, HIGHEST, vibrates=False)
    assert drowned.reason.startswith("not linear here: ") and drowned.floor > 1.0
    bent = still.copy()
    bent[2] += 0.5 * np.sign(bent[2]) * bent[2] ** 2
    assert found_modes(bent, RATE, HIGHEST, vibrates=False).reason.startswith("not linear here: ")
    restless = still + 10.0 * np.sin(2.0 * np.pi * 500.0 / RATE * np.arange(len(still[0])))[:, None]
    assert found_modes(restless, RATE, HIGHEST, vibrates=True).reason.startswith("not quiet here: ")


def test_a_state_that_still_settles_has_the_modes_of_its_difference():
    random = np.random.default_rng(1)
    true = [(-60.0, 400.0, 1.0)]
    runs = twins(true, 0.05, 0.0, random)
    t = np.arange(len(runs[0])) / RATE
    settling = runs + 30.0 * (np.exp(-120.0 * t) * np.sin(2.0 * np.pi * 180.0 * t))[:, None]
    found = found_modes(settling, RATE, HIGHEST, vibrates=False)
    assert found.unrest > 0.0 and found.modes.growth[0] == pytest.approx(-60.0, abs=0.1)
