"""docs/coverage.toml: what it names is there, and how its rows and tables make the page."""

import re
import runpy
import tomllib

import pytest

from cvt_hpc.cli import _parser
from cvt_hpc.errors import InputError
from cvt_hpc.job.schema import load_schema
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.papers.figures import FIGURES
from support.pages import ROOT, shell_calls

JOBS = ROOT / "jobs"
PAGE = runpy.run_path(str(JOBS / "paper_coverage.py"))
MEASURED, SETTLED = PAGE["measured"], PAGE["settled"]
ROWS = tomllib.loads((ROOT / "docs" / "coverage.toml").read_text())["row"]
IDS = [
    f"{letter}{k}"
    for letter, last in zip("LBGCS", (40, 36, 35, 34, 37), strict=True)
    for k in range(1, last + 1)
]
NAMES = sorted(
    {
        name
        for row in ROWS
        for key in ("command", "gives", "why")
        for name in re.findall("`([^`]+)`", row.get(key, ""))
    }
)
SCHEMAS = [load_schema(model, None, "coverage") for model in MODELS]
SECTIONS = {(section, key) for schema in SCHEMAS for key, section in schema.section_of.items()}
WORDS = {
    *(key for _, key in SECTIONS),
    *FIGURES,
    *MODELS,
    *(path.stem for path in JOBS.glob("*.toml")),
    *(
        variable.name
        for model in map(load_model, MODELS)
        if model.is_recorded
        for variable in model.variables
    ),
    "ring_slip",  # of histories
}


def is_there(name):
    """Whether a command, file, test, key, variable, model or job exists under a name; not so a folder of tests."""
    words = shell_calls(name)[0]
    if words[0] == "cvt-hpc":
        try:
            _parser().parse_args(words[1:])
        except InputError:
            return False
        return all((ROOT / word).exists() for word in words if word.startswith("jobs/"))
    places = [word.partition("::") for word in words if "/" in word]
    if places:
        return all(
            (ROOT / path).is_file() and (not test or f"def {test}(" in (ROOT / path).read_text())
            for path, _, test in places
        )
    section, key = re.fullmatch(r"(?:\[(\w+)\] ?)?(\w*)(?: = .+)?", name).groups()
    if section is None:
        return key in WORDS
    return (section, key) in SECTIONS or (not key and section in {section for section, _ in SECTIONS})


def test_the_page_has_a_row_for_all_that_the_papers_state():
    assert [row["id"] for row in ROWS] == IDS


@pytest.mark.parametrize("name", NAMES)
def test_what_a_row_names_is_there(name):
    assert is_there(name)


@pytest.mark.parametrize(
    "name",
    [
        "cvt-hpc walk jobs/belt_drive.toml",
        "cvt-hpc run jobs/none.toml",
        "bash jobs/none.sh",
        "[belt] load",
        "[none]",
    ]
    + ["pytest tests/run/test_pushbelt.py::test_none", "tests/none.py", "pytest tests/exact", "none"],
)
def test_what_is_not_there_is_seen(name):
    assert not is_there(name)


@pytest.mark.parametrize("row", ROWS, ids=IDS)
def test_a_row_has_a_verdict_and_a_reason_where_it_is_not_reproduced(row):
    assert row.keys() >= {"states", "at", "command"} and not {"measured", "measures", "verdict"}.isdisjoint(
        row
    )
    gives, verdict, why = SETTLED(row)
    assert gives and (verdict == "reproduced") == (not why)
    assert "|" not in "".join(map(str, SETTLED(row)))


@pytest.fixture
def table(tmp_path, monkeypatch):
    (tmp_path / "kept.csv").write_text(
        "# job: kept\n# older than the code: so\nload,push [N]\n0,2\n10,4\n20,5\n"
    )
    monkeypatch.setitem(MEASURED.__globals__, "RESULTS", tmp_path)
    MEASURED.__globals__["stored"].cache_clear()
    yield {"table": "kept", "tell": "push [N]"}
    MEASURED.__globals__["stored"].cache_clear()


@pytest.mark.parametrize(
    ("part", "holds", "told"),
    [
        ({"value": "push", "least": 2}, True, "2, 4, 5"),
        ({"value": "push", "least": 3}, False, "2, 4, 5"),
        ({"value": "push / load", "rows": "load > 0", "most": 0.4}, True, "0.4, 0.25"),
        ({"value": "push", "rows": "load == 20", "beside": "load == 0", "least": 2, "most": 3}, True, "2.5"),
        ({"value": "push", "course": "rises"}, True, "2 to 5"),
        ({"value": "push", "course": "falls"}, False, "2 to 5"),
    ],
)
def test_a_part_of_a_row_is_measured_in_a_table(table, part, holds, told):
    assert MEASURED(table | part) == (holds, f"push [N]: {told} (older)")


def test_a_part_without_numbers_is_an_error(table):
    with pytest.raises(ValueError, match="expected rows with numbers"):
        MEASURED(table | {"value": "push", "rows": "load == 30", "least": 2})


def test_parts_and_the_verdict_beside_them_make_that_of_the_row(table):
    holds, fails = ({**table, "value": "push", "least": least} for least in (0, 9))
    for parts, beside, verdict in (
        ([holds], {}, "reproduced"),
        ([holds, fails], {}, "partly"),
        ([fails], {}, "not"),
        ([fails], {"verdict": "reproduced"}, "partly"),
        ([holds], {"verdict": "partly"}, "partly"),
        ([holds], {"verdict": "not"}, "not"),
        ([], {"verdict": "missing"}, "missing"),
        ([holds], {"verdict": "missing"}, "missing"),
    ):
        assert SETTLED({"measures": parts, "why": "so", **beside})[1] == verdict


def test_the_page_is_made_of_the_tables():
    page = (ROOT / "docs" / "coverage.md").read_text()
    assert "\n".join(PAGE["lines"]()) == page
    for letter, paper in PAGE["PAPERS"].items():
        found = [verdict for row in ROWS if row["id"][0] == letter for _, verdict, _ in [SETTLED(row)]]
        counts = [found.count(verdict) for verdict in ("reproduced", "partly", "not", "missing")]
        assert f"| {paper} | {len(found)} | {' | '.join(map(str, counts))} |" in page
