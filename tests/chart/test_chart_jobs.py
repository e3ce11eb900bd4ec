"""The charts of this repository: each can be made as it lies there."""

import tomllib
from pathlib import Path

import pytest

from cvt_hpc.cli import main
from cvt_hpc.experiments.chart import load
from cvt_hpc.experiments.chart.measuring import check_prospects
from cvt_hpc.experiments.chart.plan import Role

FOLDER = Path(__file__).parents[2] / "jobs"
CHARTS = [path for path in sorted(FOLDER.glob("*.toml")) if "chart" in tomllib.loads(path.read_text())]


def test_there_are_charts():
    assert [path.stem for path in CHARTS] == [
        "chart_beam_pushbelt",
        "chart_belt",
        "chart_belt_drive",
        "chart_oscillator",
        "chart_pushbelt",
        "chart_ratios",
        "chart_spatial_pushbelt",
    ]


@pytest.mark.parametrize("path", CHARTS, ids=lambda path: path.stem)
def test_a_chart_is_fit_to_be_made(path):
    chart = load(path)
    assert chart.job.name == path.stem and chart.job.description
    check_prospects(chart)
    for scene in chart.scenes:
        assert any(quantity.tolerance < 1.0 for quantity in scene.quantities)
        # a method that is also the reference would be judged by itself
        reference = chart.points_of(scene.name, Role.REFERENCE)[0]
        alike = [p for p in chart.points_of(scene.name, Role.METHOD)
                 if not scene.exact and p.job.stepper == reference.job.stepper]  # fmt: skip
        assert all(p.setting >= reference.setting for p in alike)
        assert all(p.job.parameters != reference.job.parameters for p in alike)


@pytest.mark.parametrize("command", ["run", "simulate"])
def test_a_chart_is_no_job_of_runs(command, capsys):
    assert main([command, str(CHARTS[0])]) == 2
    error = capsys.readouterr().err
    assert error == f"cvt-hpc: {CHARTS[0]}: [chart]: expected a job of runs, found one for `cvt-hpc chart`\n"
