"""The page of terms: its keys are those of models, its effects those of stored tables."""

import re
import runpy
from pathlib import Path

import pytest

from cvt_hpc.job import known_keys
from cvt_hpc.models import MODELS
from cvt_hpc.vibration.classes import OccurrenceClass

ROOT = Path(__file__).parents[2]
PAGE = runpy.run_path(str(ROOT / "docs" / "terms_page.py"))
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


# Programs, file formats, signals, bodies of standards and words in place of others, which are no terms of the field
NO_TERMS = set("EXUDYN CSV TOML UTF HDF5 README EPYC UDUNITS MPICH A4 TERM HUP USR1 USR2 XCPU ISO".split())
NO_TERMS |= set("NAME SITE KIND WHAT AXIS VALUE TA P1".split())
# Terms of the field in a report; each stands in its texts
IN_A_REPORT = [
    *("amplitude", "disturbance", "hysteresis", "inferred", "load", "onset", "threshold"),
    *("ratio", "sample", "Sobol index", "strand t1, t2", "window"),
]
# Terms of the field on uncertain parameters and measurements; each stands on the page of sweeps or on that of verdicts
OF_UNCERTAINTY = [
    *("Akaike's criterion", "bootstrap", "Brier score", "distribution", "interval (95 %)", "likelihood"),
    *("mutual information", "quantile", "rank correlation", "specimen", "tribometer"),
]


def glossary_words():
    rows = re.findall(r"(?m)^\| `?(.*?)`? \| ", (ROOT / "docs" / "guide" / "glossary.md").read_text())
    return rows[1:]


def prose_of(path):
    """Text of a page of the guide, or of a page's template, without code and formulas."""
    code = r"```.*?```|`[^`]*`|\$[^$\n]*\$|<style>.*?</style>|\{[%{#].*?[%}#]\}|<[^>]+>|\]\([^)]*\)"
    return re.sub(code, "", path.read_text(), flags=re.DOTALL)


def test_the_glossary_has_the_classes_and_the_abbreviations():
    words = glossary_words()
    assert words == sorted(words, key=lambda word: word.split(",")[0].lower())
    assert {kind.label for kind in OccurrenceClass} | {"inferred"} <= {*words}
    pages = [*(ROOT / "docs" / "guide").glob("*.md"), ROOT / "cvt_hpc" / "report" / "page.html"]
    told = {word for page in pages for word in re.findall(r"\b[A-Z][A-Z0-9]*[A-Z0-9]\b", prose_of(page))}
    known = set(re.findall(r"\w+", (ROOT / "docs" / "guide" / "glossary.md").read_text()))
    assert sorted(told - known - NO_TERMS) == []
    assert NO_TERMS <= told


def test_the_glossary_has_the_terms_of_a_report():
    texts = "".join(path.read_text() for path in (ROOT / "cvt_hpc" / "report").glob("*.*"))
    for term in IN_A_REPORT:
        assert term in glossary_words() and re.split(r"[ ,]", term)[0] in texts, term


def test_the_glossary_has_the_terms_of_uncertain_parameters():
    texts = [(ROOT / "docs" / "guide" / f"{name}.md").read_text() for name in ("sweeps", "verdicts")]
    told = " ".join("".join(texts).split())
    for term in OF_UNCERTAINTY:
        assert term in glossary_words() and term.split(" (")[0] in told, term
