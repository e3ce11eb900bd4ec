import math
import subprocess
import sys
from decimal import Decimal

import pytest
from hypothesis import given
from hypothesis import strategies as st

from cvt_hpc.job import units
from cvt_hpc.job.units import UnitError, to_si


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("50 kN", "N", 50e3),
        ("3000 rpm", "rad/s", 100 * math.pi),
        ("50 turn/s", "rad/s", 100 * math.pi),
        ("11 deg", "rad", math.radians(11)),
        ("11°", "rad", math.radians(11)),
        ("2 us", "s", 2e-6),
        ("2 µs", "s", 2e-6),
        ("75 um", "m", 75e-6),
        ("75mm", "m", 0.075),
        ("120 N m", "N m", 120.0),
        ("120 Nm", "N m", 120.0),
        ("0.12 kNm", "N m", 120.0),
        ("120 N*m", "N m", 120.0),
        ("120 N·m", "N m", 120.0),
        ("20 %", "", 0.2),
        ("20%", "1", 0.2),
        ("-0.8 s/m", "s m-1", -0.8),
        ("1 kN s m-2", "N s/m^2", 1e3),
        ("1 N·s/m²", "N s/m**2", 1.0),
        ("2 N/(mm/s)", "N s/m", 2e3),
        ("4e5 N m/rad", "N m", 4e5),
        ("60 1/min", "1/s", 1.0),
        ("450 Hz", "1/s", 450.0),
        ("1.3 bar", "Pa", 1.3e5),
        ("1 eV", "J", 1.602176634e-19),
        ("20 degC", "K", 293.15),
        (" +.5e1 ", "N", 5.0),
        ("inf", "", math.inf),
        ("-inf kN", "N", -math.inf),
        ("1e400 kN", "N", math.inf),
        ("1e-400 kN", "N", 0.0),
    ],
)
def test_texts_with_units_become_si_numbers(text, unit, value):
    assert to_si(text, unit) == value


@pytest.mark.parametrize(
    ("text", "unit", "reason"),
    [
        ("50 kg", "N", "write kgf"),
        ("nan kg", "N", "write kgf"),
        ("50 kg", "s", ""),
        ("3000 U/min", "rad/s", "write rpm"),
        ("50 kX", "N", "kX is no known unit"),
        ("50 KN", "N", "KN is no known unit"),
        ("0NAN", "N", "NAN is no known unit"),
        ("1 kNp", "", "kNp is no known unit"),
        ("1 dBm", "W", "dBm is no plain multiple of W"),
        ("20 degC m", "K m", "degC m is no plain multiple of K m"),
        ("50 Hz", "rad/s", "Hz and rad/s differ by an angle; write turn/s if turns are meant"),
        ("3000 min-1", "rad/s", "min-1 and rad/s differ by an angle; write rpm"),
        ("3000 1/min", "rad/s", "1/min and rad/s differ by an angle; write rpm"),
        ("3000 min⁻¹", "rad/s", "min⁻¹ and rad/s differ by an angle; write rpm"),
        ("60 rpm", "Hz", "rpm and Hz differ by an angle"),
        ("20 deg", "", "deg and a plain number differ by an angle"),
        ("fifty", "N", ""),
        ("", "N", ""),
        ("kN", "N", ""),
        ("0,5 N", "N", ""),
        ("1 2 N", "N", ""),
        ("1 N/", "N", ""),
        ("1 (N", "N", ""),
        ("1 N)", "N", ""),
        ("1 N//m", "N/m", ""),
        ("1 N**9**9**9**9", "N", ""),
        ("1 N99", "N", ""),
        ("2*3 N", "N", ""),
        ("1 " + "m/m " * 20, "", ""),
        ("infinite", "", ""),
    ],
)
def test_other_texts_are_refused_with_the_reason_that_helps(text, unit, reason):
    with pytest.raises(UnitError) as caught:
        to_si(text, unit)
    assert str(caught.value) == reason


@given(st.decimals(-1000, 1000, places=4), st.sampled_from([("m", 1), ("mm", 1000), ("um", 1000000)]))
def test_a_unit_moves_the_point_and_nothing_else(number, scale):
    unit, factor = scale
    assert to_si(f"{number} {unit}", "m") == float(number / factor)


@given(
    st.text(st.characters(exclude_categories=["Cs"]), max_size=20)
    | st.from_regex(
        r"[0-9]{1,3} [kmNsrad/*()^ 12-]{0,12}", fullmatch=True, alphabet=st.characters(max_codepoint=127)
    )
)
def test_any_text_is_a_number_or_a_unit_error(text):
    try:
        value = to_si(text, "N m")
    except UnitError:
        return
    assert isinstance(value, float)


def run_program(program):
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    return done.stdout, done.stderr


def test_bare_numbers_and_texts_in_the_si_unit_or_with_a_prefix_do_without_pint():
    program = (
        "import sys; from cvt_hpc.job.units import from_si, to_si; "
        "print(to_si('20', 'N m'), to_si('20 N m', 'N m'), to_si('75 mm', 'm'), from_si(0.075, 'm', 'mm'), "
        "to_si('2 kN m', 'N m'), to_si('30 rpm', 'rad/s'), to_si('20 %', ''), 'pint' in sys.modules)"
    )
    assert run_program(program) == ("20.0 20.0 0.075 75.0 2000.0 3.141592653589793 0.2 False\n", "")


def test_prefixes_are_those_of_pint():
    for prefix, power in units._PREFIXES.items():
        for unit in ("m", "s", "N", "Hz", "N m", "m/s", "N s/m", "N/m^2"):
            known = units._registry().Quantity(Decimal(1), units._parse_unit(prefix + unit))
            assert known.to(units._parse_unit(unit)).magnitude == Decimal(10) ** power
            assert units._convert(Decimal(1), prefix + unit, unit) == Decimal(10) ** power


@given(st.decimals(min_value=-100_000, max_value=100_000, places=4))
def test_plain_factors_are_those_of_pint(number):
    for (given_unit, unit), factor in units._PLAIN.items():
        quantity = units._registry().Quantity(number, units._parse_unit(given_unit))
        assert float(factor(number)) == float(quantity.to(units._parse_unit(unit)).magnitude)


def test_conversion_is_silent():
    program = (
        "import logging; logging.basicConfig(level=logging.WARNING); "
        "from cvt_hpc.job.units import to_si; print(to_si('2 Nm', 'N m'))"
    )
    assert run_program(program) == ("2.0\n", "")
