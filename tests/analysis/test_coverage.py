"""docs/coverage.toml: what it names is there, and how its rows and tables make the page."""

import ast
import re
import runpy
import tomllib
from types import SimpleNamespace

import numpy as np
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
OF_TESTS = runpy.run_path(str(JOBS / "paper_tests.py"))
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
    assert row.keys() >= {"states", "at", "command"}
    assert PAGE["is_measured"](row)
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
    (tmp_path / "paper_tests.csv").write_text("quantity,value,error\nsag [m],3,0.01\nsag [m],2,0.02\n")
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


@pytest.mark.usefixtures("table")
def test_a_part_of_a_row_is_measured_by_tests():
    for error, holds in ((0.02, True), (0.019, False)):
        told = MEASURED({"quantity": "sag [m]", "error": error})
        assert told == (holds, "sag, relative error: 0.01, 0.02")
    assert MEASURED({"quantity": "sag [m]", "least": 2, "most": 2.9}) == (False, "sag [m]: 3, 2")


def test_all_that_tests_tell_is_kept_and_measures_rows_that_name_them():
    table = PAGE["stored"]("paper_tests")
    telling = {
        f"{path.relative_to(ROOT)}::{node.name}"
        for path in (ROOT / "tests").rglob("test_*.py")
        if "tell" in (text := path.read_text())
        for node in ast.parse(text).body
        if isinstance(node, ast.FunctionDef)
        and node.name.startswith("test_")
        and "tell" in [arg.arg for arg in node.args.args]
    }
    assert {*table["test"]} == telling
    parts = [(row["command"], part) for row in ROWS for part in row.get("measures", []) if "quantity" in part]
    assert {*table["quantity"]} == {part["quantity"] for _, part in parts}
    for command, part in parts:
        for test in table["test"][table["quantity"] == part["quantity"]]:
            assert {f"`pytest {test}`", f"`pytest {test.partition('::')[0]}`"} & {
                *re.findall("`[^`]+`", command)
            }


def test_the_worst_that_a_test_tells_is_kept_if_none_fails(tmp_path, monkeypatch):
    told = [
        ("sag [m]", ([1.0, 2.0], [1.0, 4.0])),
        ("sag [m]", ([3.0], [4.0])),
        ("share", ([-1.0, 0.5], [np.nan])),
    ]
    report = SimpleNamespace(when="call", nodeid="a.py::test_a[case]", user_properties=told)
    status = 1

    def main(_, plugins):
        plugins[0].pytest_runtest_logreport(report)
        return status

    monkeypatch.setattr(pytest, "main", main)
    file = tmp_path / "table.csv"
    assert OF_TESTS["main"](file, "a.py") == 1 and not file.exists()
    status = 0
    assert OF_TESTS["main"](file, "a.py") == 0
    head, *rows = [line for line in file.read_text().splitlines() if line[0] != "#"]
    assert head == "test,case,quantity,value,reference,error"
    assert rows == ["a.py::test_a,case,sag [m],2,4,0.5", "a.py::test_a,case,share,-1,nan,nan"]


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
