"""Onsets along the load, and their pairs in two studies."""

import numpy as np
import pytest

from cvt_hpc.vibration.classes import Onset, onsets, paired_errors

NAN = np.nan
LOADS = np.array([10.0, 20.0, 30.0, 40.0, 50.0, 60.0])


@pytest.mark.parametrize(
    ("level", "expected"),
    [
        ([-1, -1, 1, 1, 1, -1], [Onset(25.0, True), Onset(55.0, False)]),
        # between the nearest places of which something is known
        ([-1, NAN, NAN, 1, 1, 1], [Onset(25.0, True)]),
        ([NAN, NAN, 1, 1, 1, NAN], []),
        ([1, 1, 1, 1, 1, 1], []),
        # rates: where the straight line is 0
        ([-300, -100, 25, 50, 50, 10], [Onset(28.0, True)]),
    ],
)
def test_onsets_lie_where_the_level_changes_its_sign(level, expected):
    level = np.array(level, float)
    assert onsets(LOADS, level) == expected
    assert onsets(LOADS[::-1], level[::-1]) == expected


def test_onsets_are_paired_by_direction_at_the_least_distance_in_all():
    known = (20.0, 200.0)
    true = [Onset(40.0, True), Onset(90.0, False), Onset(120.0, True), Onset(150.0, False)]
    found = [Onset(50.0, True), Onset(145.0, False)]
    errors, missed, additional = paired_errors(found, true, known)
    assert sorted(errors) == [5.0, 10.0] and (missed, additional) == (2, 0)
    assert paired_errors(true, found, known)[1:] == (0, 2)
    errors, missed, additional = paired_errors(
        [Onset(80.0, True), Onset(35.0, True)], [Onset(45.0, True)], known
    )
    assert (errors, missed, additional) == ([10.0], 0, 1)
    assert paired_errors([Onset(40.0, False)], [Onset(40.0, True)], known) == ([], 1, 1)


def test_an_onset_where_the_truth_is_not_known_is_not_additional():
    found, true = [Onset(85.0, True), Onset(185.0, False)], [Onset(80.0, True)]
    assert paired_errors(found, true, (20.0, 185.0)) == ([5.0], 0, 0)  # at the end it may lie beyond
    assert paired_errors(found, true, (20.0, 190.0)) == ([5.0], 0, 1)
    # but it is a partner, if there is one
    assert paired_errors([Onset(95.0, True)], true, (20.0, 90.0)) == ([15.0], 0, 0)
