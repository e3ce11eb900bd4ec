import math
from itertools import pairwise

import numpy as np
import pandas as pd
import pint
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc import build_job
from cvt_hpc.errors import InputError
from cvt_hpc.job.axes import Axis, read_axis, thinned, without_rounding
from cvt_hpc.parameters import Parameter

LOAD = Parameter(0.0, "N m", "torque at the driving pulley")
STATIONS = Parameter(160, "", "cells")
STIFFNESS = Parameter(1.0, "", "stiffness", allow_infinite=True)
LAW = Parameter("coulomb", "", "friction law", choices=("coulomb", "stribeck"))


def values(raw, parameter=LOAD):
    return read_axis("load", parameter, raw, "x.toml: [axes] load").values


@pytest.mark.parametrize(
    ("raw", "expected"),
    [
        ([3, 1, 2.5], (3.0, 1.0, 2.5)),
        (["1 kN m", 5, "7 Nm"], (1000.0, 5.0, 7.0)),
        ({"from": 0, "to": 1, "count": 3}, (0.0, 0.5, 1.0)),
        ({"from": 0, "to": 0.3, "count": 4}, (0.0, 0.1, 0.2, 0.3)),
        ({"from": 1, "to": 0, "count": 2}, (1.0, 0.0)),
        ({"from": "0 N m", "to": "0.2 kN m", "step": "50 N m"}, (0.0, 50.0, 100.0, 150.0, 200.0)),
        ({"from": 0, "to": 0.3, "step": 0.1}, (0.0, 0.1, 0.2, 0.3)),
        ({"from": 1, "to": 0, "step": -0.5}, (1.0, 0.5, 0.0)),
        ({"from": -1, "to": 1, "step": 1}, (-1.0, 0.0, 1.0)),
        ({"from": 1, "to": 1000, "count": 4, "spacing": "log"}, (1.0, 10.0, 100.0, 1000.0)),
        ({"from": 0.01, "to": 1, "count": 3, "spacing": "log"}, (0.01, 0.1, 1.0)),
        ({"from": 0, "to": 2, "count": 3, "spacing": "linear"}, (0.0, 1.0, 2.0)),
    ],
)
def test_lists_and_ranges_give_their_values(raw, expected):
    assert values(raw) == expected


def test_an_axis_carries_what_the_parameter_declares():
    axis = read_axis("load", LOAD, [1], "x")
    assert (axis.name, axis.unit, axis.description) == ("load", "N m", "torque at the driving pulley")


def test_axes_keep_the_type_of_their_parameter():
    found = values({"from": 100, "to": 200, "step": 50}, STATIONS)
    assert found == (100, 150, 200)
    assert {type(value) for value in found} == {int}
    assert values(["stribeck", "coulomb"], LAW) == ("stribeck", "coulomb")
    assert values([1, math.inf], STIFFNESS) == (1.0, math.inf)


def test_minus_zero_is_zero():
    assert [math.copysign(1, value) for value in values([-0.0, -1.0])] == [1.0, -1.0]


@pytest.mark.parametrize(
    ("raw", "parameter", "message"),
    [
        ([], LOAD, ": expected at least one value, found an empty list"),
        (
            5,
            LOAD,
            ": expected a list [v1, v2, ...] or a range {from=, to=, count=} or {from=, to=, step=}, found 5",
        ),
        (
            "40, 60",
            LOAD,
            ": expected a list [v1, v2, ...] or a range {from=, to=, count=} or {from=, to=, step=}, found "
            '"40, 60"; decimals have a point, as 2.4, thousands have no mark, and several values are a list, '
            "as [2, 4]",
        ),
        (
            [1, 2, "1 N m"],
            LOAD,
            ': expected distinct values, found "1 N m" as value 1 and value 3',
        ),
        ([1, math.nan], LOAD, ", value 2: expected a finite value in N m, found nan"),
        ([1, math.inf], LOAD, ", value 2: expected a finite value in N m, found inf"),
        (
            [True],
            LOAD,
            ', value 1: expected a value in N m (such as "1 N m" or a bare number in N m), found true',
        ),
        (
            ["coulomb", "stribek"],
            LAW,
            ', value 2: expected one of coulomb, stribeck, found "stribek"; did you mean stribeck?',
        ),
        (
            {"from": 0, "to": 1, "count": 2},
            LAW,
            ": expected a list of values, because the parameter is not a number, found a range",
        ),
        (
            [[1]],
            Parameter((), "", "table"),
            ": expected a parameter with a single value, found one that takes a list",
        ),
        ({"to": 1, "count": 2}, LOAD, ".from: expected the first value, found nothing"),
        ({"from": 1, "count": 2}, LOAD, ".to: expected the last value, found nothing"),
        ({"from": 0, "to": 1}, LOAD, ": expected a range with either count or step, found neither"),
        (
            {"from": 0, "to": 1, "count": 2, "step": 1},
            LOAD,
            ": expected a range with either count or step, found both",
        ),
        ({"from": 0, "to": 1, "cuont": 2}, LOAD, ".cuont: unknown key; did you mean count?"),
        ({"from": 0, "to": 1, "count": 1}, LOAD, ".count: expected >= 2 and <= 100000, found 1"),
        ({"from": 0, "to": 1, "count": 2.5}, LOAD, ".count: expected a whole number, found 2.5"),
        ({"from": 0, "to": 1, "count": True}, LOAD, ".count: expected a whole number, found true"),
        (
            {"from": 2, "to": 2, "count": 3},
            LOAD,
            ": expected a range with from and to apart, found 2 for both",
        ),
        (
            {"from": 0, "to": 1, "step": 0.3},
            LOAD,
            ".step: expected a step that leads from 0 to 1 in whole steps, found 0.3, which takes 3.33333 steps",
        ),
        (
            {"from": 0, "to": 1, "step": -0.5},
            LOAD,
            ".step: expected a step above 0, from 0 to 1, found -0.5",
        ),
        ({"from": 0, "to": 1, "step": 0}, LOAD, ".step: expected a step other than 0, found 0"),
        ({"from": 0, "to": 1, "step": 1e-9}, LOAD, ": expected at most 100000 values, found about 1e+9"),
        (list(range(100_001)), LOAD, ": expected at most 100000 values, found 100001"),
        (
            {"from": 0, "to": 1, "step": 1, "spacing": "log"},
            LOAD,
            ".spacing: expected to stand with count, found with step",
        ),
        (
            {"from": 0, "to": 1, "count": 3, "spacing": "lgo"},
            LOAD,
            '.spacing: expected one of linear, log, found "lgo"; did you mean log?',
        ),
        (
            {"from": 0, "to": 1, "count": 3, "spacing": "log"},
            LOAD,
            ": expected from > 0 and to > 0 for log spacing, found 0 and 1",
        ),
        (
            {"from": 1, "to": 0, "count": 3, "spacing": "log"},
            LOAD,
            ": expected from > 0 and to > 0 for log spacing, found 1 and 0",
        ),
        (
            {"from": "1 N", "to": 1, "count": 3},
            LOAD,
            '.from: expected a value in N m (such as "1 N m" or a bare number in N m), found "1 N"',
        ),
        (
            {"from": 1, "to": math.inf, "count": 3},
            STIFFNESS,
            ".to: expected a finite value, found inf",
        ),
        (
            {"from": 100, "to": 110, "count": 4},
            STATIONS,
            ", value 2: expected a whole number, found 103.33333333333333",
        ),
    ],
)
def test_what_is_wrong_with_an_axis_is_said(raw, parameter, message):
    with pytest.raises(InputError) as caught:
        values(raw, parameter)
    assert str(caught.value) == "x.toml: [axes] load" + message


finite = st.floats(-1e6, 1e6, allow_subnormal=False).map(lambda value: round(value, 6))


@given(finite, finite, st.integers(2, 200))
def test_a_counted_range_is_even_and_ends_where_it_says(start, stop, count):
    if abs(stop - start) < 1e-3:
        return
    found = values({"from": start, "to": stop, "count": count})
    assert (found[0], found[-1], len(found)) == (start, stop, count)
    gaps = [after - before for before, after in zip(found, found[1:], strict=False)]
    assert gaps == pytest.approx([(stop - start) / (count - 1)] * (count - 1), rel=1e-6, abs=1e-9)


@given(finite, st.integers(1, 300), st.decimals("0.001", 100, places=3), st.booleans())
def test_a_stepped_range_holds_the_values_as_one_would_write_them(start, count, step, down):
    stride = -step if down else step
    first = round(start, 3)
    written = [float(f"{first + float(stride) * i:.3f}") for i in range(count + 1)]
    assert values({"from": first, "to": written[-1], "step": float(stride)}) == tuple(written)


@given(st.floats(1e-6, 1e6), st.floats(1.1, 1e6), st.integers(2, 100))
def test_a_log_range_has_equal_ratios(start, factor, count):
    found = values({"from": start, "to": start * factor, "count": count, "spacing": "log"})
    assert (found[0], found[-1]) == (without_rounding(start), without_rounding(start * factor))
    ratios = [after / before for before, after in zip(found, found[1:], strict=False)]
    assert ratios == pytest.approx([factor ** (1 / (count - 1))] * (count - 1), rel=1e-9)


def axis(name, values):
    return Axis(name, tuple(values), "", "")


@pytest.mark.parametrize(
    ("sizes", "most", "left"),
    [
        ((3, 4), 12, (3, 4)),
        ((1000, 1000), 100, (10, 10)),
        ((2, 1000, 1000), 200, (2, 10, 10)),
        ((100_000,), 2000, (2000,)),
        ((9, 9, 9), 2, (2, 2, 2)),
        ((), 5, ()),
    ],
)
def test_a_thinned_grid_keeps_short_axes_and_all_ends(sizes, most, left):
    axes = tuple(axis(f"a{k}", range(size)) for k, size in enumerate(sizes))
    found = thinned(axes, most)
    assert tuple(len(one.values) for one in found) == left
    for one, other in zip(found, axes, strict=True):
        assert (one.values[0], one.values[-1]) == (other.values[0], other.values[-1])
        # evenly, but for rounding
        steps = {b - a for a, b in pairwise(one.values)}
        assert max(steps, default=0) - min(steps, default=0) <= 1


def test_a_thinned_grid_keeps_texts_and_samples_stay_together():
    kinds = axis("kind", "abcdefg")
    found = thinned((kinds, axis("a", range(100))), 14)
    assert (found[0], found[1].values) == (kinds, (0, 99))
    pair = thinned((axis("a", range(100)), axis("b", range(100, 0, -1))), 10, sampled=True)
    assert [len(one.values) for one in pair] == [10, 10]
    assert all(a + b == 100 for a, b in zip(pair[0].values, pair[1].values, strict=True))


UNITS = pint.UnitRegistry()


@pytest.mark.parametrize(
    "array",
    [
        np.array([20.0, 60.0]),
        pd.Series([20, 60], index=["a", "b"]),
        pd.Index([20.0, 60.0]),
        pd.Series(["20 N m", "0.06 kN m"]),
        xr.DataArray([20.0, 60.0], dims="load", attrs={"units": "N m"}),
        xr.DataArray([0.02, 0.06], dims="load", attrs={"units": "kN m"}),
        xr.DataArray(np.array([0.02, 0.06]) * UNITS("kN*m"), dims="load"),
        np.array([0.02, 0.06]) * UNITS("kN*m"),
        [20 * UNITS("newton * meter"), 6e4 * UNITS("N mm")],
        {"from": 20 * UNITS("N m"), "to": 0.06 * UNITS("kN m"), "count": 2},
    ],
    ids=lambda array: type(array).__name__,
)
def test_arrays_of_other_libraries_are_axes(array):
    document = {"name": "x", "model": "elastic_belt"}
    for job in (
        build_job({**document, "axes": {"load": array}}),
        build_job(document, overrides={"load": array}),
    ):
        assert job.axes[0].values == (20.0, 60.0)
        assert job.fingerprint() == build_job({**document, "axes": {"load": [20, 60]}}).fingerprint()


def test_a_quantity_is_a_value_and_its_unit_is_checked():
    document = {"name": "x", "model": "elastic_belt", "scene": {"load": 0.06 * UNITS("kN m")}}
    job = build_job(document)
    assert (job.parameters["load"], job.units["load"]) == (60.0, "kN*m")
    assert job.point_at({"load": xr.DataArray(0.02, attrs={"units": "kN m"})})["load"] == 20.0
    with pytest.raises(
        InputError, match=r"\[axes\] load, value 1: expected a value in N m .*, found \"2.0 kg\""
    ):
        build_job({**document, "axes": {"load": np.array([2.0]) * UNITS.kg}})


def test_what_rounding_has_left_is_no_value_of_its_own():
    assert values([0.1, 0.1 + 0.2, 0.7 + 0.1, 1 / 3, 1.1 * 1.1]) == (0.1, 0.3, 0.8, 1 / 3, 1.21)
    assert values(np.arange(0.1, 0.5, 0.1)) == values(np.linspace(0.1, 0.4, 4)) == (0.1, 0.2, 0.3, 0.4)
    for number in (100 * math.pi, 0.1234567891, 2.0 / 7.0, 1e99, 5e-324, math.inf):
        assert values([number], STIFFNESS) == (number,)
    with pytest.raises(
        InputError, match="expected distinct values, found 0.30000000000000004 as value 1 and"
    ):
        values([0.3, 0.1 + 0.2])
