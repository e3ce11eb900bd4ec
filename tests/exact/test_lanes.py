"""Numbers of several lanes, and plain ones: each operation is numpy's, lane by lane, whatever is in the others.

Nearly all operations are in one kernel, so that the compiler is waited for once for each type.
"""

from fractions import Fraction

import numpy as np
import pytest
from numba.core.errors import TypingError

from cvt_hpc.kernels import kernel
from cvt_hpc.lanes import (
    ALIGNMENT,
    LaneArray,
    absolute,
    anywhere,
    decay,
    fma,
    halving,
    like,
    maximum,
    minimum,
    nearest_integer,
    reciprocals,
    select,
    sqrt,
    with_sign_of,
)

# rows of the results
NAMES = (
    *("sum", "difference", "product", "quotient", "negative", "sum with a number", "number less", "halved"),
    *("in place", "less", "at most", "more", "at least", "both", "either", "not"),
    *(
        "root",
        "size",
        "whole",
        "signed",
        "fused",
        "least",
        "largest",
        "decay",
        "number",
        "chosen number",
        "reciprocal",
        "other reciprocal",
        "halving",
    ),
)
PLAIN = 0  # instead of a number of lanes
LANES = [(np.float64, 1), (np.float64, 8), (np.float32, 16)]
TYPES = [(np.float64, PLAIN), *LANES]
SPECIAL = (0.0, -0.0, 1.0, -1.0, 0.5, 2.5, -3.5, 1e-30, -1e30, np.inf, -np.inf, np.nan)
NUMBER = 0.7


@kernel
def operate(rows: int, a: LaneArray, b: LaneArray, out: LaneArray, number: float) -> None:
    """Every operation on a[j, 0] and b[j, 0], into row j, in the order of NAMES."""
    for j in range(rows):
        x, y = a[j, 0], b[j, 0]
        out[j, 0], out[j, 1], out[j, 2], out[j, 3] = x + y, x - y, x * y, x / y
        out[j, 4], out[j, 5], out[j, 6], out[j, 7] = -x, x + number, number - x, x * 0.5
        z = x
        z += y
        z *= y
        z -= number
        out[j, 8] = z
        one, none = like(1.0, x), like(0.0, x)
        out[j, 9], out[j, 10] = select(x < y, one, none), select(x <= y, one, none)
        out[j, 11], out[j, 12] = select(x > y, one, 0.0), select(x >= y, one, 0.0)
        out[j, 13], out[j, 14] = (
            select((x < y) & (y > 0.0), one, none),
            select((x < y) | (y > 0.0), one, none),
        )
        out[j, 15] = select(~(x < y), one, none)
        out[j, 16], out[j, 17], out[j, 18], out[j, 19] = (
            sqrt(x),
            absolute(x),
            nearest_integer(x),
            with_sign_of(x, y),
        )
        out[j, 20], out[j, 21], out[j, 22], out[j, 23] = (
            fma(x, y, number),
            minimum(x, y),
            maximum(x, y),
            decay(x),
        )
        out[j, 24] = number
        out[j, 25] = select(x < y, x, number)
        out[j, 26], out[j, 27] = reciprocals(x, y)
        out[j, 28] = halving(x)


@kernel
def converse(rows: int, single: LaneArray, double: LaneArray) -> None:
    """Between precisions: by a store, and by `like`."""
    for j in range(rows):
        double[j, 1] = single[j, 0]
        single[j, 1] = double[j, 0]
        double[j, 2] = like(single[j, 0], double[j, 0]) + double[j, 0]


@kernel
def found_anywhere(rows: int, a: LaneArray, threshold: float, found: np.ndarray) -> None:
    for j in range(rows):
        found[j] = anywhere(a[j, 0] > threshold)


@kernel
def mixed(a: LaneArray, b: LaneArray, out: LaneArray) -> None:
    out[0, 0] = a[0, 0] + b[0, 0]


def in_lanes(values, lanes, dtype):
    """A LaneArray, or a plain array, of one field that holds the values in order."""
    if lanes == PLAIN:
        return np.array(values, dtype)[:, np.newaxis]
    array = LaneArray(len(values) // lanes, 1, lanes, dtype)
    array.data[:, 0] = np.reshape(values, (-1, lanes))
    return array


def operands(dtype):
    """Pairs of all special values, and of ordinary ones of every size and sign."""
    random = np.random.default_rng(2)
    ones, others = (x.ravel() for x in np.meshgrid(SPECIAL, SPECIAL))
    sizes = random.choice([1e-3, 1.0, 80.0, 1e6], (2, 2000))
    a = np.concatenate([ones, sizes[0] * random.normal(size=2000)]).astype(dtype)
    b = np.concatenate([others, sizes[1] * random.normal(size=2000)]).astype(dtype)
    return a[: a.size // 16 * 16], b[: b.size // 16 * 16]


def results(dtype, lanes):
    """Values by name of all operations on the operands."""
    return results_of(*operands(dtype), lanes)


def results_of(a, b, lanes):
    """Values by name of all operations on numbers of one size."""
    dtype = a.dtype.type
    rows = a.size // max(lanes, 1)
    out = np.zeros((rows, len(NAMES))) if lanes == PLAIN else LaneArray(rows, len(NAMES), lanes, dtype)
    operate(rows, in_lanes(a, lanes, dtype), in_lanes(b, lanes, dtype), out, NUMBER)
    data = out if lanes == PLAIN else out.data
    return {name: data[:, k].ravel() for k, name in enumerate(NAMES)}


def same_bits(one, other):
    """Whether all numbers are the same, signs of zeros included; what is no number has many forms."""
    nan = np.isnan(one) & np.isnan(other)
    return np.array_equal(one[~nan], other[~nan]) and np.array_equal(
        np.signbit(one[~nan]), np.signbit(other[~nan])
    )


@pytest.mark.parametrize(("dtype", "lanes"), TYPES)
@np.errstate(all="ignore")
def test_operations_are_numpys(dtype, lanes):
    a, b = operands(dtype)
    found, n = results(dtype, lanes), dtype(NUMBER)
    expected = {
        "sum": a + b,
        "difference": a - b,
        "product": a * b,
        "quotient": a / b,
        "negative": -a,
        "sum with a number": a + n,
        "number less": n - a,
        "halved": a * dtype(0.5),
        "in place": (a + b) * b - n,
        "less": a < b,
        "at most": a <= b,
        "more": a > b,
        "at least": a >= b,
        "both": (a < b) & (b > 0),
        "either": (a < b) | (b > 0),
        "not": ~(a < b),
        "root": np.sqrt(a),
        "size": np.abs(a),
        "whole": np.rint(a),
        "signed": np.copysign(a, b),
        # the second one wherever the first is not the lesser or the greater: where one is not a number, too
        "least": np.where(a < b, a, b),
        "largest": np.where(a > b, a, b),
        "number": np.full_like(a, n),
        "chosen number": np.where(a < b, a, n),
    }
    assert set(NAMES) - set(expected) == {"fused", "decay", "halving", "reciprocal", "other reciprocal"}
    for name, values in expected.items():
        assert same_bits(found[name], values.astype(dtype)), name


@pytest.mark.parametrize(("dtype", "lanes"), TYPES)
def test_products_are_fused_with_sums_rounded_once(dtype, lanes):
    a, b = operands(dtype)
    finite = np.isfinite(a) & np.isfinite(b) & (np.abs(a) < 1e9) & (np.abs(b) < 1e9)
    found = results(dtype, lanes)["fused"]
    other = 0
    for x, y, value in zip(a[finite], b[finite], found[finite], strict=True):
        exact = Fraction(float(x)) * Fraction(float(y)) + Fraction(float(dtype(NUMBER)))
        error = abs(Fraction(float(value)) - exact)
        neighbours = np.nextafter(value, dtype(-np.inf)), np.nextafter(value, dtype(np.inf))
        assert all(error <= abs(Fraction(float(neighbour)) - exact) for neighbour in neighbours)
        other += value != x * y + dtype(NUMBER)
    # in two roundings some would be others
    assert other > 100


@pytest.mark.parametrize(("dtype", "lanes"), TYPES)
@np.errstate(all="ignore")
def test_two_reciprocals_by_one_division(dtype, lanes):
    a, b = operands(dtype)
    found = results(dtype, lanes)
    fit = np.isfinite(a * b) & (np.abs(a * b) > 1e-30) & (np.abs(a * b) < 1e30)
    assert np.sum(fit) > 1000
    # three roundings
    for name, x in (("reciprocal", a), ("other reciprocal", b)):
        exact = 1 / x[fit].astype(np.longdouble)
        assert np.max(np.abs(found[name][fit] / exact - 1)) < 2 * np.finfo(dtype).eps


@pytest.mark.parametrize(("dtype", "lanes"), TYPES)
def test_powers_of_one_half_to_two_roundings(dtype, lanes):
    largest = 125 if dtype is np.float32 else 1021
    x = np.concatenate([np.linspace(0, largest, 15000), np.linspace(0, 3, 1000)]).astype(dtype)
    found = results_of(x, x, lanes)["halving"]
    assert np.max(np.abs(found / np.exp2(-x.astype(np.longdouble)) - 1)) < 2 * np.finfo(dtype).eps
    assert found[0] == 1
    if lanes == PLAIN:
        return
    a, outside = operands(dtype)[0], results(dtype, lanes)["halving"]
    assert np.all(outside[(a > 1e4) | np.isnan(a)] == found[14999]) and np.sum(a == np.inf) > 0


@pytest.mark.parametrize(("dtype", "lanes"), TYPES)
def test_exponential_to_two_units_in_the_last_place(dtype, lanes):
    largest = dtype(87 if dtype is np.float32 else 708)
    x = np.concatenate([np.linspace(0, largest, 15000), np.linspace(0, 1, 1000)]).astype(dtype)
    found = results_of(x, x, lanes)["decay"]
    exact = np.exp(-x.astype(np.longdouble))
    assert np.finfo(np.longdouble).nmant > 60
    assert np.max(np.abs(found - exact) / np.spacing(found)) < 2
    assert found[0] == 1 and 0 < found[14999] < 1e-37
    if lanes == PLAIN:
        return
    # held within the range: beyond it nothing overflows, and what is not a number counts as most
    a, outside = operands(dtype)[0], results(dtype, lanes)["decay"]
    assert np.all(outside[a > 1e4] == found[14999]) and np.sum(a == np.inf) > 0
    assert np.all(outside[np.isnan(a)] == found[14999]) and np.isnan(a).any()


def test_results_do_not_depend_on_the_number_of_lanes():
    alone, together = (results(np.float64, lanes) for lanes in (1, 8))
    for name in NAMES:
        assert same_bits(alone[name], together[name]), name


@pytest.mark.parametrize("lanes", [1, 8])
def test_a_mask_that_holds_anywhere(lanes):
    values = np.zeros(64)
    values[[5, 40, 41]] = 2.0, 3.0, np.nan
    found = np.zeros(64 // lanes, dtype=bool)
    found_anywhere(64 // lanes, in_lanes(values, lanes, np.float64), 1.0, found)
    assert np.array_equal(found, (values > 1.0).reshape(-1, lanes).any(axis=1))


@np.errstate(over="ignore")
def test_conversions_between_precisions():
    a, b = operands(np.float32)[0], operands(np.float64)[1]
    rows = a.size // 8
    single, double = LaneArray(rows, 2, 8, np.float32), LaneArray(rows, 3, 8)
    single.data[:, 0], double.data[:, 0] = a.reshape(-1, 8), b.reshape(-1, 8)
    converse(rows, single, double)
    assert same_bits(double.data[:, 1].ravel(), a.astype(np.float64))
    assert same_bits(single.data[:, 1].ravel(), b.astype(np.float32))
    with np.errstate(invalid="ignore"):
        assert same_bits(double.data[:, 2].ravel(), a.astype(np.float64) + b)
    # what was there stays
    assert same_bits(single.data[:, 0].ravel(), a) and same_bits(double.data[:, 0].ravel(), b)


def test_precisions_are_not_mixed_unawares():
    with pytest.raises(TypingError):
        mixed(LaneArray(1, 1, 8, np.float32), LaneArray(1, 1, 8), LaneArray(1, 1, 8))


def test_arrays_begin_where_a_register_can_be_loaded():
    for dtype, lanes in LANES:
        for _ in range(20):  # wherever the memory begins
            array = LaneArray(3, 5, lanes, dtype)
            assert array.data.ctypes.data % ALIGNMENT == 0
            assert array.data.shape == (3, 5, lanes) and array.data.dtype == dtype
            assert array.data.flags.c_contiguous and not array.data.any()
