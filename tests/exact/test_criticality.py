"""Super- and subcritical Hopf points: masses on a belt whose bifurcations are known, and made-up classes."""

import numpy as np
import pytest

from cvt_hpc.experiments.branch.attractors import Attractor, Start, attractors, close_values
from cvt_hpc.models.oscillator.motion import oscillator, steady_sliding
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Kind, criticality
from support.rungs import rung_job, rung_record
from support.small_systems import VERASZTO_STEPAN

QUIET, VIBRATING, UNDECIDED, FAILED, NOT_RUN, SLIPPING, IRREGULAR = OccurrenceClass
BOTH_STARTS = (Start({"start": "sliding"}), Start({"start": "sticking"}))
OF_RUNS = {
    "initial_displacement": 1e-4,
    "step": 1e-4,
    "duration": 8.0,
    "sampling_rate": 2e3,
    "band_low": 5.0,
    "band_high": 100.0,
    "window_length": 0.4,
    "amplitude_threshold": 5e-5,
}
EXPONENTIAL = OF_RUNS | VERASZTO_STEPAN | {"step": 2e-4}
# 16 Hz; steady sliding loses stability where N mu'(v) = -c: v^2 = v_s^2 (1 - c / (N |g|))
CUBIC = OF_RUNS | {
    "friction_law": "cubic",
    "friction_gradient": -0.4,
    "stribeck_velocity": 0.21,
    "normal_load": 10.0,
    "kinetic_friction": 0.2,
    "mass": 0.1,
    "stiffness": 1e3,
    "damping": 0.8,
    "duration": 4.0,
}
HOPF_OF_CUBIC = 0.21 * np.sqrt(1.0 - 0.8 / (10.0 * 0.4))


def of_mass(settings, hopf, values, resolution, agreement):
    """Criticality of a mass that slides stably at belt speeds above its Hopf point."""
    runs = attractors(
        rung_job("oscillator", **settings), "belt_speed", BOTH_STARTS, values, [hopf], resolution
    )
    speeds = [run.value for run in runs if run.start == 0]
    small, large = ([run.occurrence for run in runs if run.start == start] for start in (0, 1))
    return criticality(hopf, True, speeds, small, large, agreement=agreement)


def test_exponential_friction_is_subcritical_with_the_published_hysteresis():
    hopf = np.log(10.0 * 4.0 / 5.946) / 10.0  # ln[c_v (C0 - C) / (b0 + b_s)] / c_v
    assert hopf == pytest.approx(0.190616, abs=1e-6)
    values, resolution = np.arange(0.17, 0.30, 0.02), 5e-3
    found = of_mass(EXPONENTIAL, hopf, values, resolution, agreement=resolution)
    assert found.kind is Kind.SUBCRITICAL
    # stick-slip survives to 0.2718 m/s
    assert found.width == pytest.approx(0.2718 - hopf, abs=found.error)
    assert found.error <= 0.51 * resolution  # of the runs' spacing, half


def test_cubic_friction_is_supercritical_with_the_amplitude_of_averaging():
    hopf = HOPF_OF_CUBIC
    for speed, sign in ((hopf - 1e-4, 1.0), (hopf + 1e-4, -1.0)):
        parameters = rung_job("oscillator", **CUBIC | {"belt_speed": speed}).point(0)
        assert sign * steady_sliding(oscillator(parameters)).eigenvalue.real > 0.0
    found = of_mass(CUBIC, hopf, np.arange(0.17, 0.22, 0.01), 2.5e-3, agreement=5e-3)
    assert found.kind is Kind.SUPERCRITICAL, found.reason
    # a spacing at either end: next to the Hopf point runs settle too slowly to be told within 4 s
    assert abs(found.width) <= found.error < 2.01 * 2.5e-3
    # sliding one way, a^2 = 4 (v_H^2 - v^2) of the mass' speed; of second order in N |g| / (m w) = 0.4 beside
    record = rung_record("oscillator", **CUBIC, belt_speed=0.18, start="sliding")
    assert record["half_stroke"] * 100.0 == pytest.approx(2.0 * np.sqrt(hopf**2 - 0.18**2), rel=0.02)


LOADS = np.arange(1.0, 11.0)
V, Q, U, F = VIBRATING, QUIET, UNDECIDED, FAILED


def judged(small, large, hopf=5.3, stable_above=True, **changes):
    classes = ([{"V": V, "q": Q, "?": U, "!": F}[letter] for letter in letters] for letters in (small, large))
    return criticality(hopf, stable_above, LOADS, *classes, **({"agreement": 2.0, "bracket": 0.1} | changes))


@pytest.mark.parametrize(
    ("small", "large", "kind", "width", "error"),
    [  # the Hopf point lies 0.3 beyond the fifth run, and is known to 0.1
        ("VVVVVqqqqq", "VVVVVqqqqq", Kind.SUPERCRITICAL, 0.2, 0.6),
        ("VVVVVqqqqq", "VVVVVVVVqq", Kind.SUBCRITICAL, 3.2, 0.6),
        ("VVVVVqqqqq", "VVVVVVV?qq", Kind.SUBCRITICAL, 2.7, 1.1),
        ("VVVV?qqqqq", "VVVVVqqqqq", Kind.SUPERCRITICAL, 0.2, 0.6),
        ("VVVVVqqqqq", "VVVVV?qqqq", Kind.SUPERCRITICAL, 0.7, 1.1),
        ("VVVVVqqqqq", "VVVVVVVVVV", Kind.SUBCRITICAL, 4.6, np.inf),
        ("VVVVVqqqqq", "VVVVVVVV??", Kind.SUBCRITICAL, 2.6, np.inf),
        ("VVVqqqqqqq", "VVVVVqqqqq", Kind.UNDECIDED, np.nan, np.nan),
        ("VVVqqqqqqq", "VVVVVVqqqq", Kind.UNDECIDED, np.nan, np.nan),
        ("VVVqqqqqqq", "VVVVVVVqqq", Kind.SUBCRITICAL, 2.2, 0.6),
        ("VVVqqqqqqq", "VVVqqqqqqq", Kind.SUPERCRITICAL, -1.8, 0.6),
        ("VVVVVqqqqq", "VVVVV??qqq", Kind.UNDECIDED, np.nan, np.nan),
        ("VVVVVqqqqq", "VVVVVVqqqq", Kind.UNDECIDED, np.nan, np.nan),
        ("VVVVVqqqqq", "VVVVV?????", Kind.UNDECIDED, np.nan, np.nan),
        ("VVVVVqqqqq", "VVVV??qqqq", Kind.SUPERCRITICAL, 0.2, 1.6),
        ("VVVVVqqqqq", "VVVVqqqqqq", Kind.UNDECIDED, np.nan, np.nan),
        ("VVVVVqqqqq", "VVVVqqqVVq", Kind.UNDECIDED, np.nan, np.nan),
        ("VVVVVVVVqq", "VVVVVVVVqq", Kind.UNDECIDED, np.nan, np.nan),
        ("qqqqqqqqqq", "VVVVVVVVqq", Kind.UNDECIDED, np.nan, np.nan),
    ],
)
def test_verdict_on_made_up_classes_either_way_round(small, large, kind, width, error):
    found = judged(small, large)
    assert (found.kind, found.reason != "") == (kind, True)
    assert (found.width, found.error) == pytest.approx((width, error), nan_ok=True)
    mirrored = judged(small[::-1], large[::-1], hopf=5.7, stable_above=False)
    assert mirrored.kind == kind
    assert (mirrored.width, mirrored.error) == pytest.approx((width, error), nan_ok=True)


def test_both_attractors_count_where_the_steady_state_is_stable_alone():
    found = judged("VVVqqqqqqq", "VVVVVqqqqq")
    assert found.reason == "both attractors from 4 to 5, not where the steady state is stable"
    # a run as far from the Hopf point as that is known may lie on either side of it
    assert judged("VVVVVqqqqq", "VVVVVVVqqq", hopf=5.95).reason.endswith("closer runs would tell")
    assert judged("VVVVVqqqqq", "VVVVVVVqqq", hopf=5.85).kind is Kind.SUBCRITICAL


def test_the_run_that_says_nothing_is_named_by_its_class():
    assert judged("VVVVVqqqqq", "VVVVV!?qqq").reason == "the run from the large start at 7 is undecided"
    assert judged("VVVVVqqqqq", "VVVVV?!qqq").reason == "the run from the large start at 7 is failed"


def test_runs_beyond_the_next_hopf_point_do_not_count():
    small, large = "VVVVVqqqVV", "VVVVVVVVVV"
    found = judged(small, large, limits=(0.0, 8.5))
    assert (found.kind, found.width, found.error) == (Kind.SUBCRITICAL, pytest.approx(2.6), np.inf)


def test_values_are_close_where_a_start_turns_and_at_bifurcations():
    found = [
        Attractor(v, 0, Q if v > 3 else U if v == 3 else V, 0.0, 0.0, "") for v in (1.0, 2.0, 3.0, 4.0, 5.0)
    ]
    values = [1.0, 2.0, 3.0, 4.0, 5.0]
    assert close_values(values, found, [], 0.5) == [2.5, 3.5]
    assert close_values(values, found, [4.1], 0.4) == pytest.approx(
        [7 / 3, 8 / 3, 10 / 3, 11 / 3, 13 / 3, 14 / 3]
    )
