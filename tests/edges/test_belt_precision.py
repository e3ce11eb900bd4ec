"""Single precision on the belt: the fast step's round-off shakes strands that nothing else moves, and how much."""

from functools import cache

import pytest

from cvt_hpc.vibration.signals import band_amplitude
from support.belts import point
from support.lone import Transient

THRESHOLD, NEGLIGIBLE = 5e-6, 1e-8  # [m]: defaults of what vibrates, and of what is at rest


@cache
def hum(precision, step):
    """Amplitude [m] in the band of a belt without load, disturbance or vibration."""
    values = {"stations": 64, "load": 0.0, "disturbance": 0.0, "duration": 0.1, "rise_time": 0.03}
    run = Transient(point("imex", **values, precision=precision, step=step), "imex")
    while run.batch.running:
        assert run.advance(run.samples) is None
    strands = [k for k, probe in enumerate(run.probes) if probe.label.startswith("t")]
    return band_amplitude(run.displacement[run.judged][:, strands], 1.0 / run.interval, (300.0, 1500.0)).max()


def test_round_off_is_what_moves_the_strands():
    # 0.8 nm: some twenty-five times what the start-up leaves in double precision, and at rest for the verdict
    assert 10.0 * hum("double", 4.6e-6) < hum("single", 4.6e-6) < NEGLIGIBLE


def test_shorter_steps_round_more_often_and_stay_far_below_a_vibration():
    # Bending, implicit, damps the more the longer the step is, and at first makes up for fewer roundings:
    # 0.8, 0.5, 0.6 nm at 4.6, 2.3, 1.15 us; from there on 2.6 nm at half.
    step = 4.6e-6 / 8
    short = hum("single", step)
    assert short > 2.0 * hum("single", 4.6e-6)
    assert short < THRESHOLD / 100.0
    assert hum("double", step) == pytest.approx(hum("double", 4.6e-6), rel=0.05)
