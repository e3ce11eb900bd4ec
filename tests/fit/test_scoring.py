"""Scores of targets by hand: what counts as met, what never does, and where a score ends."""

import numpy as np
import pytest

from cvt_hpc.experiments.fit.job import Course, Target, areas, score, total, verdict
from cvt_hpc.vibration.classes import OccurrenceClass as Kind

LETTERS = {
    "q": Kind.QUIET,
    "V": Kind.VIBRATING,
    "?": Kind.UNDECIDED,
    "x": Kind.FAILED,
    "s": Kind.SLIPPING,
    "i": Kind.IRREGULAR,
    "n": Kind.VIBRATING,  # near gross slip
}


def course(letters, frequency=600.0, amplitude=1e-5):
    """Runs at 10, 20, ... N m, by one letter for each; n is a vibration that does not count."""
    values = 10.0 * np.arange(1, len(letters) + 1)
    quantities = {
        "frequency": np.broadcast_to(np.float64(frequency), values.shape),
        "amplitude": np.broadcast_to(np.float64(amplitude), values.shape),
    }
    counted = np.array([letter not in "sn" for letter in letters])
    return Course(values, np.array([LETTERS[letter] for letter in letters]), counted, quantities)


def scored(measure, letters, low=0.0, high=1000.0, other="V", **keys):
    target = Target("x", "", "own", measure, low, high, **keys)
    of_case = course(letters) if isinstance(letters, str) else letters
    of_other = course(other) if isinstance(other, str) else other
    return score(target, {"own": of_case, "other": of_other})


@pytest.mark.parametrize(
    ("letters", "vibrating", "quiet"),
    [
        ("VVVV", 1.0, 0.0),
        ("qqqq", 0.0, 1.0),
        ("VqVq", 0.5, 0.5),
        ("????", 0.0, 0.0),  # undecided is neither
        ("xxxx", 0.0, 0.0),  # failed is failed
        ("iiii", 0.0, 0.0),
        ("VVss", 0.5, 0.0),  # a belt that slips does not vibrate there
        ("qqss", 0.0, 1.0),  # and need not be quiet
        ("VVnn", 0.5, 0.0),  # so near gross slip: no vibration
        ("qqnn", 0.0, 1.0),
        ("ssss", 0.0, 0.0),  # silence of nothing is none
    ],
)
def test_shares_of_runs(letters, vibrating, quiet):
    assert scored("vibrating", letters) == vibrating
    assert scored("quiet", letters) == quiet


def test_only_the_values_asked_count_both_ends_included():
    assert scored("vibrating", "qVVVq", 20.0, 40.0) == 1.0
    assert scored("vibrating", "qVVVq", 20.0, 50.0) == 0.75
    assert scored("quiet", "qVVVq", 50.0, 50.0) == 1.0
    assert scored("quiet", "qVVVq", -np.inf, 10.0) == 1.0
    assert scored("vibrating", "qVVVq", 20.0, np.inf) == 0.75


@pytest.mark.parametrize(
    ("frequency", "expected"),
    [(500.0, 1.0), (700.0, 1.0), (450.0, 0.5), (725.0, 0.75), (300.0, 0.0), (900.0, 0.0)],
)
def test_a_quantity_within_bounds(frequency, expected):
    keys = {"quantity": "frequency", "bounds": (500.0, 700.0), "fading": 100.0}
    assert scored("within", course("qVV", frequency), **keys) == pytest.approx(expected)
    assert (
        scored("within", course("qq?xn", 600.0), **keys) == 0.0
    )  # nothing vibrates, so nothing is in the band


def test_quiet_runs_have_no_say_in_a_quantity():
    mixed = course("VqV", np.array([600.0, 0.0, 750.0]))
    keys = {"quantity": "frequency", "bounds": (500.0, 700.0), "fading": 100.0}
    assert scored("within", mixed, **keys) == pytest.approx(0.75)


def test_the_least_value_is_that_of_the_worst_run_whether_it_vibrates_or_not():
    keys = {"quantity": "frequency", "fading": 100.0}
    assert scored("least", course("qVq", np.array([10.0, -300.0, 50.0])), **keys) == 0.25
    assert scored("least", course("qVq", np.array([10.0, -300.0, 50.0])), 25.0, **keys) == pytest.approx(
        2 / 3
    )
    assert scored("least", course("q", 0.0), **keys) == 1.0
    assert scored("least", course("qx", np.array([10.0, np.nan])), **keys) == 0.0  # failed is failed


@pytest.mark.parametrize(
    ("letters", "found"),
    [
        ("qVVqqVq", [(20.0, 30.0), (60.0, 60.0)]),
        ("VV?VV", [(10.0, 50.0)]),  # what is undecided parts no areas
        ("VVxsVV", [(10.0, 60.0)]),
        ("VqVqn", [(10.0, 10.0), (30.0, 30.0)]),  # motion near gross slip is no area
        ("qqq", []),
    ],
)
def test_areas_are_parted_by_silence_alone(letters, found):
    assert areas(course(letters)) == found
    expected = {0: 0.0, 1: 0.5, 2: 1.0}[len(found)]
    assert scored("areas", letters, count=2) == expected


def test_areas_too_many_cost_as_well():
    assert scored("areas", "VqVqV", count=2) == 0.5
    assert scored("areas", "VqVqVqVqV", count=2) == 0.0


def test_the_onset_is_the_first_run_that_vibrates():
    keys = {"bounds": (40.0, 50.0), "fading": 20.0}
    assert scored("onset", "qqqVV", **keys) == 1.0
    assert scored("onset", "qqVVV", **keys) == pytest.approx(0.5)
    assert scored("onset", "Vqqqq", **keys) == 0.0
    assert scored("onset", "qq??q", **keys) == 0.0


def test_larger_is_by_the_largest_amplitudes_of_both():
    small, large = course("qV", amplitude=1e-5), course("qV", amplitude=1.21e-5)
    keys = {"than": "other", "by": 1.21}
    assert scored("larger", large, other=small, **keys) == pytest.approx(1.0)
    assert scored("larger", course("V", amplitude=1.1e-5), other=small, **keys) == pytest.approx(0.5)
    assert scored("larger", small, other=large, **keys) == 0.0
    # a large motion that is quiet by its verdict, failed, or near gross slip is none
    assert scored("larger", course("qxn", amplitude=1.0), other=small, **keys) == 0.0
    assert scored("larger", large, other=course("q", amplitude=0.0), **keys) == 0.0


def test_the_total_is_the_weighted_mean():
    targets = [Target("a", "", "own", "quiet", 0, 1, weight=3.0), Target("b", "", "own", "quiet", 0, 1)]
    assert total(targets, np.array([[1.0, 0.0], [0.0, 1.0]])).tolist() == [0.75, 0.25]
    assert [verdict(value) for value in (1.0, 0.5, 0.0)] == ["reproduced", "partly", "not reproduced"]
