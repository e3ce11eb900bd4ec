"""Classes of made-up studies, value by value."""

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.analysis.classes import OccurrenceClass, at_strongest_strand, occurrence_classes
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.vibration.classes import StartClass
from support.studies import study, two_flags

QUIET, VIBRATING, UNDECIDED, FAILED, NOT_RUN, SLIPPING, IRREGULAR = OccurrenceClass


CLASS_TABLE = [
    (Status.NOT_RUN, {v: NOT_RUN for v in Vibrates}),
    (
        Status.DONE,
        {
            Vibrates.NO: QUIET,
            Vibrates.YES: VIBRATING,
            Vibrates.UNDECIDED: UNDECIDED,
            Vibrates.SLIPS: SLIPPING,
            Vibrates.IRREGULAR: IRREGULAR,
            7: UNDECIDED,
        },
    ),
    (Status.FAILED_NUMERICS, {v: FAILED for v in Vibrates}),
    (Status.FAILED_ERROR, {v: FAILED for v in Vibrates}),
    (Status.TIMED_OUT, {v: FAILED for v in Vibrates}),
    (9, {v: FAILED for v in Vibrates}),
    (-1, {v: FAILED for v in Vibrates}),
    (np.nan, {v: NOT_RUN for v in Vibrates}),
]


@pytest.mark.parametrize(("status", "expected"), CLASS_TABLE)
def test_class_of_every_pair_of_flags(status, expected):
    found = occurrence_classes(two_flags([status] * len(expected), [int(v) for v in expected]))
    assert found.dims == ("load",)
    assert [OccurrenceClass(c) for c in found.values] == list(expected.values())


def test_every_status_and_verdict_is_in_the_table():
    told = {status: set(expected) for status, expected in CLASS_TABLE}
    assert all(set(Vibrates) <= told[status] for status in Status)


def test_no_flag_is_ever_renumbered():
    assert [(v.name, int(v)) for v in Vibrates] == [
        ("NO", 0), ("YES", 1), ("UNDECIDED", 2), ("SLIPS", 3), ("IRREGULAR", 4)]  # fmt: skip
    kinds = {c.name: int(c) for c in StartClass}
    assert kinds == {"QUIET": 0, "VIBRATING": 1, "UNDECIDED": 2, "FAILED": 3, "NOT_RUN": 4,
                     "LARGE_START_ONLY": 5, "SLIPPING": 6, "IRREGULAR": 7}  # fmt: skip
    assert all(int(c) == kinds[c.name] for c in OccurrenceClass)


def test_classes_of_a_study_follow_its_flags_in_any_order_of_dimensions():
    dataset = study()
    classes = occurrence_classes(dataset)
    assert classes.sel(friction_gradient=-2.4, sheave_stiffness=1.0, load=200) == FAILED
    assert classes.sel(friction_gradient=-0.8, sheave_stiffness=1.0, load=40) == FAILED
    assert classes.sel(friction_gradient=-0.8, sheave_stiffness=np.inf, load=200) == NOT_RUN
    assert classes.sel(friction_gradient=-2.4, sheave_stiffness=1.0, load=120) == VIBRATING
    assert classes.sel(friction_gradient=-2.4, sheave_stiffness=np.inf, load=120) == QUIET
    turned = dataset.assign(vibrates=dataset["vibrates"].transpose("load", ...))
    xr.testing.assert_identical(occurrence_classes(turned), classes)


def test_the_strongest_strand_is_shown_and_a_missing_one_does_not_count():
    dims = ("load", "strand")
    dataset = two_flags([1, 1, 1], [1, 1, 1])
    dataset["amplitude"] = dims, [[2.0, 1.0], [1.0, 3.0], [np.nan, 1.0]]
    dataset["frequency"] = dims, [[500.0, 600.0], [501.0, 601.0], [502.0, 602.0]]
    assert at_strongest_strand(dataset, "amplitude").values.tolist() == [2.0, 3.0, 1.0]
    assert at_strongest_strand(dataset, "frequency").values.tolist() == [500.0, 601.0, 602.0]
    assert np.isnan(at_strongest_strand(dataset, "growth_rate").values).all()
