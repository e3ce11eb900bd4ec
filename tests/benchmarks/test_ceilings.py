"""What a step needs, as the benchmark counts it: every operation of the step's source is met, and counted once."""

import pytest
from ceilings import STATIONS, STEP, Counted, count


def test_operations_are_counted_once():
    Counted.tally.clear()
    assert ((Counted(2.0) + 1.0) * 3.0 / Counted(4.0)).value == pytest.approx(2.25)
    assert Counted.tally == {"sums and products": 2, "quotients and roots": 1}


def test_a_step_needs_what_the_docs_say():
    needs = count(STEP, "single")
    flops = needs["sums and products"] + 2 * needs["fused"] + needs["quotients and roots"]
    # 107 kflop, 669 for each station, implicit bending included; a front that moves by a cell or two changes little
    assert flops / STATIONS == pytest.approx(669, rel=0.05)
    assert needs["quotients and roots"] / STATIONS == pytest.approx(11.5, rel=0.1)
    assert (needs["array read"] + needs["array written"]) / STATIONS == pytest.approx(212, rel=0.05)


def test_precision_changes_the_length_of_the_exponential_series_alone():
    single, double = count(STEP, "single"), count(STEP, "double")
    assert {kind for kind in double if double[kind] != single[kind]} == {"fused"}
    assert double["fused"] > single["fused"]
