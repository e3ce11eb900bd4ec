"""The page of terms: its keys are those of models, its effects those of stored tables."""

import runpy
from pathlib import Path

import pytest

from cvt_hpc.job import known_keys
from cvt_hpc.models import MODELS

PAGE = runpy.run_path(str(Path(__file__).parents[2] / "docs" / "terms_page.py"))
TERMS = PAGE["terms"]()


@pytest.mark.parametrize("term", TERMS, ids=[term["name"] for term in TERMS])
def test_models_of_a_key_are_those_that_take_it(term):
    for key in term["keys"]:
        models = [name for names in PAGE["defaults"](key).values() for name in names]
        assert models and sorted(models) == sorted(name for name in MODELS if key in known_keys(name)), key


def test_no_key_belongs_to_two_terms():
    keys = [key for term in TERMS for key in term["keys"]]
    assert len(keys) == len(set(keys))


def test_what_is_switched_has_been_measured():
    measured, switches = PAGE["effects"](), {term["switch"] for term in TERMS if "switch" in term}
    assert measured.keys() == switches | {"none"}
    page = PAGE["table"]()
    rows = [line.split(" | ") for line in page.splitlines()]
    assert {len(row) for row in rows} == {len(PAGE["HEAD"])}
    assert all(f"| {term['name']} |" in page for term in TERMS)
    (tilt,) = [row for row in rows if row[0] == "| tilt of the elements"]
    assert tilt[4] == "auto, elastic_belt, linear_stability, slip_limit, steady_variator"
    assert float(tilt[6].split()[0]) == round(measured["none"]["frequency"])
