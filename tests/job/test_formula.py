"""Formulas of a job file: their values, and what is refused."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc.errors import InputError
from cvt_hpc.job.formula import DEEPEST, LONGEST, read_formula
from cvt_hpc.parameters import Parameter

KNOWN = {
    "load": Parameter(0.0, "N m", "torque"),
    "ratio": Parameter(2.5, "", "speed ratio"),
    "stations": Parameter(160, "", "cells"),
    "law": Parameter("coulomb", "", "friction law"),
    "refined": Parameter(False, "", "finer"),
    "table": Parameter((), "", "rows"),
}
VALUES = {"load": 30.0, "ratio": 2.0, "stations": 160, "law": "coulomb", "refined": True, "table": ()}
FORMULA = (
    'expected a formula of parameters and numbers in SI units, such as "0.6 * thrust * driven_radius / ratio"'
)


def read(text):
    return read_formula(text, KNOWN, "x")


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1", 1.0),
        ("-load + 2 * ratio", -26.0),
        ("+(load - 5) / ratio", 12.5),
        ("2 ** -ratio ** 2", 2.0**-4.0),
        ("1.5e-3 * stations", 0.24),
        ("sqrt(load + 6) * sin(pi / ratio)", 6.0),
        ("atan(tan(0.3)) + asin(sin(0.2)) + log(exp(ratio)) + cos(0)", 3.5),
        ("min(load, ratio, 3) + max(load, ratio) + abs(-ratio) + round(2.6)", 37.0),
        (" ( load ) ", 30.0),
    ],
)
def test_formulas_have_their_values(text, value):
    assert read(text).value(VALUES) == pytest.approx(value, rel=1e-15)


def test_brackets_alone_are_no_operations():
    assert read("(" * 199 + "1" + ")" * 199).value(VALUES) == 1.0


def test_names_are_told_once_in_their_order():
    assert read("load * ratio + sqrt(load) * pi").names == ("load", "ratio")


@given(st.floats(1e-3, 1e3), st.floats(1e-3, 1e3), st.integers(-9, 9))
def test_arithmetic_is_that_of_floats(a, b, n):
    # the powers are Python's own where these are real
    values = {"load": a, "ratio": b}
    assert read(f"(load - ratio) * load / ratio + load ** {n}").value(values) == (a - b) * a / b + a**n


@pytest.mark.parametrize(
    ("raw", "message"),
    [
        (5, f"{FORMULA}, found 5"),
        ("", f'{FORMULA}, found ""'),
        ("5 mm", f'{FORMULA}, found "5 mm" (a value with a unit belongs in a table of the job)'),
        ("load * 0.5 kN", f'{FORMULA}, found "load * 0.5 kN" (a value with a unit belongs in a table of the job)'),
        ("load *", f'{FORMULA}, found "load *"'),
        ("load; ratio", f'{FORMULA}, found "load; ratio"'),
        ("2 * load^2", f'{FORMULA}, found "2 * load^2" (a power is written **)'),
        ("load % 2", f'{FORMULA}, found "load % 2"'),
        ("1 + load.real", f'{FORMULA}, found "load.real"'),
        ("[load][0]", f'{FORMULA}, found "[load][0]"'),
        ("load if ratio else 1", f'{FORMULA}, found "load if ratio else 1"'),
        ("(x := 2)", f'{FORMULA}, found "x := 2"'),
        ("True", f'{FORMULA}, found "True"'),
        ("1j", f'{FORMULA}, found "1j"'),
        ("'a'", f"""{FORMULA}, found "'a'\""""),
        ("load < 1", f'{FORMULA}, found "load < 1"'),
        ("min(*load, 1)", f'{FORMULA}, found "*load"'),
        ("round(load, ndigits=2)", f'{FORMULA}, found "round(load, ndigits=2)"'),
        ("(lambda: 1)()", f'{FORMULA}, found "(lambda: 1)()"'),
        ("lod", 'unknown name "lod"; did you mean load?'),
        ("sine(1)", 'unknown function "sine"; did you mean sin?'),
        ("__import__('os')", 'unknown function "__import__"; known: sqrt, sin, cos, tan, asin, atan, exp, log, abs, round, min, max'),
        ("law + 1", "expected parameters that are numbers in a formula, found law"),
        ("refined", "expected parameters that are numbers in a formula, found refined"),
        ("table", "expected parameters that are numbers in a formula, found table"),
        ("qqq", 'unknown name "qqq"; known: load, ratio, stations, pi'),
        ("sin(1, 2)", "expected one argument of sin, found 2"),
        ("max(1)", "expected two arguments of max or more, found 1"),
        ("1e999", "expected finite numbers in a formula, found one that is too large"),
        ("9" * 350, "expected finite numbers in a formula, found one that is too large"),
        ("1" * (LONGEST + 1), f"expected a formula of at most {LONGEST} characters, found {LONGEST + 1}"),
        ("-" * DEEPEST + "1", f"expected a formula of at most {DEEPEST} operations within each other, found a deeper one"),
        ("(" * 201 + "1" + ")", f'{FORMULA}, found "{"(" * 57}..."'),
    ],
)  # fmt: skip
def test_what_is_no_formula_is_refused(raw, message):
    with pytest.raises(InputError) as caught:
        read(raw)
    assert str(caught.value) == f"x: {message}"


@pytest.mark.parametrize(
    "text", ["1 / (load - 30)", "sqrt(-load)", "(-load) ** 0.5", "10 ** 10 ** 10", "exp(load * load)", "asin(load)",
             "log(0)", "0 ** -1", "round(1e308 * 10)"]
)  # fmt: skip
def test_a_formula_without_a_value_says_so(text):
    with pytest.raises(ValueError):
        read(text).value(VALUES)


def test_what_overflows_in_a_product_is_infinite_and_no_error_of_the_formula():
    assert read("1e300 * 1e300").value(VALUES) == math.inf


@given(st.text(alphabet="load ratio()+-*/.,0123456789e^[]{}:=_'\"#\\\n", max_size=60))
def test_any_text_is_a_formula_or_an_input_error(text):
    try:
        formula = read(text)
    except InputError as error:
        assert str(error).startswith("x: ")
    else:
        try:
            assert isinstance(formula.value(VALUES), float)
        except ValueError:
            pass  # no value at this place
