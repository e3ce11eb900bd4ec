"""Which runs of a branch a Hopf point is judged by: made-up runs about one at 20.3 N m, below which it is stable."""

import numpy as np
import pytest

from cvt_hpc.experiments.branch.attractors import Attractor
from cvt_hpc.experiments.branch.table import AGREEMENT, judged
from cvt_hpc.models.linear_stability.branch import CLOSE, Onset
from cvt_hpc.vibration.classes import OccurrenceClass
from cvt_hpc.vibration.criticality import Kind

LOADS = range(10, 31)
CLASSES = {"q": OccurrenceClass.QUIET, "V": OccurrenceClass.VIBRATING}


def hopf(load, frequency=500.0, rising=True, others=0):
    return Onset(load, frequency, 0, 1, rising, others)


def runs(start, first, without=()):
    """Runs that vibrate from the load `first` on."""
    return [
        Attractor(float(load), start, CLASSES["V" if load >= first else "q"], 0.0, 0.0, "")
        for load in LOADS
        if load not in without
    ]


def verdict(small=21, large=17, onset=None, others=(), hidden=(), without=()):
    onset = onset or hopf(20.3)
    found = [*runs(0, small, without), *runs(1, large)]
    return judged(onset, sorted([onset, *others]), list(hidden), found, lambda load: 200.0, "{:g} N m".format)


def test_the_width_is_from_the_hopf_point_with_its_bracket_in_the_error():
    found = verdict()
    assert found.kind is Kind.SUBCRITICAL and found.reason == "both attractors from 17 N m to 20 N m"
    assert (found.width, found.error) == pytest.approx((20.3 - 16.5, 0.5 + 0.5 * CLOSE))


def test_runs_from_the_steady_state_may_turn_quiet_so_far_from_the_hopf_point_alone():
    assert verdict(small=24, large=24).kind is Kind.SUPERCRITICAL
    far = int(20.3 + AGREEMENT + 2.0)
    assert far in LOADS
    assert verdict(small=far, large=far).reason.startswith(
        "runs from the small start turn quiet at 26.5 N m,"
    )


def test_slow_modes_and_states_that_stay_unstable_are_not_judged():
    assert verdict(onset=hopf(20.3, 199.0)).reason == "its mode lies below the band of runs"
    assert verdict(onset=hopf(20.3, 201.0)).kind is Kind.SUBCRITICAL
    assert verdict(onset=hopf(20.3, others=1)).reason == "the steady state is unstable on both sides"


def test_a_mode_is_compared_with_the_band_under_its_own_load():
    onset, slow = hopf(20.3), hopf(22.0, 150.0, rising=False)
    found = [*runs(0, 24), *runs(1, 17)]
    kinds = [
        judged(
            onset, [onset, slow], [], found, lambda load, edge=edge: edge if load > 21.0 else 200.0, str
        ).kind
        for edge in (140.0, 160.0)
    ]
    assert kinds == [Kind.UNDECIDED, Kind.SUBCRITICAL]


def test_a_slow_mode_ends_the_stable_side_and_not_the_other():
    slow = {"frequency": 150.0, "rising": False}
    assert (
        verdict(others=[hopf(19.5, **slow)]).reason
        == "both attractors at 20 N m alone, closer runs would tell"
    )
    assert verdict(small=24, others=[hopf(22.0, **slow)]).kind is Kind.SUBCRITICAL
    assert verdict(small=24, others=[hopf(22.0, rising=False)]).kind is Kind.UNDECIDED
    assert verdict(hidden=[(12.0, 19.5)]).reason == "both attractors at 20 N m alone, closer runs would tell"


def test_where_no_run_began_in_the_steady_state_nothing_is_concluded():
    assert verdict(without=(17, 18, 19)).reason == "both attractors at 20 N m alone, closer runs would tell"


def test_without_runs_nothing_is_decided():
    found = judged(hopf(20.3), [hopf(20.3)], [], [], lambda load: 200.0, str)
    assert (found.kind, found.reason) == (Kind.UNDECIDED, "no runs were asked for")
    assert np.isnan(found.width)
