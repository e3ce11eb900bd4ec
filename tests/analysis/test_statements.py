"""Statements of papers: how parts make a verdict, and the page that is made of the tables."""

import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from cvt_hpc.analysis.statements.figures import FIGURES
from cvt_hpc.analysis.statements.verdicts import Measured, Statement, Verdict, judged
from cvt_hpc.errors import InputError

ROOT = Path(__file__).parents[2]


@pytest.mark.parametrize(
    ("holds", "verdict", "why"),
    [
        ([True, True], "reproduced", ""),
        ([True, False], "partly", "for a reason"),
        ([False], "not", "for a reason"),
    ],
)
def test_a_verdict_is_of_all_parts(holds, verdict, why):
    found = judged(Statement("it does", lambda kept: Measured(holds, "3 N"), "for a reason"), None)
    assert (found.verdict.value, found.why, found.numbers) == (verdict, why, "3 N")


def test_a_run_that_failed_measures_nothing():
    def measure(kept):
        raise InputError("expected a run that is done")

    assert judged(Statement("it does", measure), None).verdict is Verdict.UNKNOWN


def test_each_figure_has_a_job_and_a_table():
    for folder, suffix in (("figures", "toml"), ("results/figures", "csv")):
        assert {path.stem for path in (ROOT / "jobs" / folder).glob(f"*.{suffix}")} == set(FIGURES)


def test_the_page_has_a_row_for_all_that_the_papers_state():
    rows = tomllib.loads((ROOT / "docs/coverage.toml").read_text())["row"]
    assert [row["id"] for row in rows] == [f"L{k}" for k in range(1, 41)] + [f"B{k}" for k in range(1, 37)]
    assert all("measured" in row or row["verdict"] == "reproduced" or row["why"] for row in rows)


def test_the_page_is_made_of_the_tables(tmp_path):
    subprocess.run([sys.executable, ROOT / "jobs/paper_coverage.py", tmp_path / "page.md"], check=True)
    page = ROOT / "docs/coverage.md"
    assert (tmp_path / "page.md").read_text() == page.read_text()
