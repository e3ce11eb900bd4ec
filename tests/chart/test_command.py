"""`cvt-hpc chart` within this process."""

import re

import pytest

from cvt_hpc.cli import main
from support.bells import JOB


@pytest.fixture
def call(capsys, monkeypatch):
    """Return a function that runs a command line: exit status, lines on stdout, lines on stderr."""
    monkeypatch.setattr("cvt_hpc.experiments.chart.making.draw", lambda figure, out: out)

    def run(*arguments, command="chart"):
        status = main([command, *map(str, arguments)])
        out, err = capsys.readouterr()
        return status, out.splitlines(), err.splitlines()

    return run


def test_a_chart_prints_its_tables_and_where_it_left_its_files(write_chart, call, tmp_path):
    status, out, err = call(write_chart())
    assert status == 0
    assert out[0] == "Ringing"
    assert "  chosen: clever at 0.01, 0.0022 core-s/s" in out
    assert out[-4:] == [
        "table: out/bells/chart.csv",
        "dataset: out/bells/chart.nc",
        "picture: out/bells/ringing.png",
        "picture: out/bells/budget.png",
    ]
    assert (
        re.fullmatch(r"cvt-hpc: 1/13 ringing-exact: 0 core-s, \d:\d\d:\d\d to go", err[0]) and len(err) == 13
    )
    assert " to go" in err[-2] and " to go" not in err[-1]
    assert call("c.toml") == (0, out, [])  # nothing is measured twice
    assert {path.name for path in (tmp_path / "out/bells").iterdir()} == {
        "chart.csv", "chart.nc", "chart.json", "points", ".chart.lock",
    }  # fmt: skip


def test_check_tells_what_a_chart_measures_and_computes_nothing(write_chart, call, tmp_path):
    status, out, err = call(write_chart(), command="check")
    assert (status, err) == (0, [])
    assert out[0] == "chart bells (c.toml): 1 scenes, 13 points"
    (row,) = [line.split() for line in out if line.startswith("  ringing")]
    assert row[:3] == ["ringing", "13", "13"] and row[-1] == "hard"
    # a bell has no cost model, and its exact solution costs nothing
    assert out[-1].startswith("estimated cost: 0 core-seconds") and "not known of 12 points" in out[-1]
    assert [path.name for path in tmp_path.iterdir()] == ["c.toml"]
    assert call("c.toml", "--ranks", "2", command="check")[0] == 2
    assert call("c.toml", "--for", "run", command="check")[0] == 2
    # what the command refuses is refused
    assert call(write_chart(("occurrence = {}", "push_force = {}")), command="check")[0] == 2


def test_values_are_set_and_another_job_needs_a_folder_or_fresh(write_chart, call, tmp_path):
    assert call(write_chart(), "--out", "here")[0] == 0
    before = (tmp_path / "here/chart.csv").read_bytes()
    status, out, err = call("c.toml", "--out", "here", "--set", "loudness=30 um")
    assert (status, out, len(err)) == (2, [], 1)
    assert (tmp_path / "here/chart.csv").read_bytes() == before
    assert call("c.toml", "--out", "here", "--set", "loudness=30 um", "--fresh")[0] == 0
    assert (tmp_path / "here/chart.csv").read_bytes() != before


def test_bad_input_is_one_line_and_nothing_is_written(write_chart, call, tmp_path):
    assert call(write_chart(), "--set", "loudnes=1") == (
        2,
        [],
        ["cvt-hpc: c.toml: --set loudnes: unknown key; did you mean loudness in [scene]?"],
    )
    assert call(write_chart(("occurrence = {}", "push_force = {}")))[0] == 2
    assert call(write_chart(text=JOB.partition("[chart")[0])) == (
        2,
        [],
        [
            "cvt-hpc: c.toml: chart: expected a table [chart], found nothing; `cvt-hpc examples "
            "chart_oscillator` copies a job that has one",
        ],
    )
    assert [path.name for path in tmp_path.iterdir()] == ["c.toml"]


def test_times_are_measured_by_one_process(write_chart, call, monkeypatch):
    monkeypatch.setenv("PMI_SIZE", "2")
    monkeypatch.setenv("PMI_RANK", "0")
    assert call(write_chart()) == (
        2,
        [],
        ["cvt-hpc: chart: expected one process, because it measures times, found 2 started"],
    )
