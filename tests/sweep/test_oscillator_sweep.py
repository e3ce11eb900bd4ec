"""The oscillator as a swept model: two starts over the belt's speed, in a dataset, a map, a table and a history."""

import csv
import runpy
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cvt_hpc.analysis.figures import draw
from cvt_hpc.analysis.histories import draw_history
from cvt_hpc.analysis.maps import map_figure
from cvt_hpc.job import build_job
from cvt_hpc.simulation import record_variables, run_point, run_points, simulate
from cvt_hpc.study import open_results, run
from cvt_hpc.variables import Status, Vibrates
from support.cf import cf_findings

JOBS = Path(__file__).parents[2] / "jobs"
SPEEDS = [0.15, 0.23, 0.28]


def few():
    """The published case with three speeds in the place of 25, and shorter."""
    document = tomllib.loads((JOBS / "bistable_oscillator.toml").read_text())
    document["axes"]["belt_speed"] = SPEEDS
    return build_job(document, "few.toml", {"duration": 3.0, "step": 1e-4})


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    report = run(few(), tmp_path_factory.mktemp("oscillator"), progress=False)
    assert report.exit_status == 0
    assert cf_findings(report.results) == []
    with open_results(report.results) as dataset:
        yield dataset.load()


def test_both_starts_are_swept(results):
    assert results["vibrates"].dims == ("start", "belt_speed")
    assert results["start"].values.tolist() == ["sliding", "sticking"]
    assert np.all(results["status"] == Status.DONE)
    found = dict(zip(results["start"].values, results["vibrates"].values.tolist(), strict=True))
    assert found["sliding"] == [Vibrates.YES, Vibrates.NO, Vibrates.NO]
    assert found["sticking"] == [Vibrates.YES, Vibrates.YES, Vibrates.NO]
    assert results["sticks"].attrs["flag_meanings"] == "no yes"
    assert np.all(results["linear_growth_rate"].sel(belt_speed=0.15) > 0.0)
    assert np.all(results["linear_growth_rate"].sel(belt_speed=SPEEDS[1:]) < 0.0)


def test_a_record_does_not_depend_on_the_runs_beside_it():
    """Decided early, at their end and prolonged, in one batch: each as alone, to the bit."""
    job = few()
    points = [job.point(index) | {"duration": 2.0, "shortest_duration": 0.5} for index in range(len(job))]
    together = run_points(job, points, lambda: None)
    assert {1.0, 2.0} <= {round(record["simulated_seconds"], 9) for record in together}
    for point, found in zip(points, together, strict=True):
        alone = run_point(job, point, lambda: None)
        for name in (variable.name for variable in record_variables(job) if not variable.volatile):
            assert np.asarray(found[name]).tobytes() == np.asarray(alone[name]).tobytes(), name


def test_it_has_a_map(results, tmp_path):
    assert draw(lambda: map_figure(results), tmp_path / "map.png").stat().st_size > 0


def test_it_has_a_table(results):
    rows = runpy.run_path(str(JOBS / "tabulate.py"))["rows"]
    table = list(csv.DictReader(rows(results, ["half_stroke", "sticks", "linear_growth_rate"])))
    assert [row["start"] for row in table] == ["sliding"] * 3 + ["sticking"] * 3
    assert [row["sticks"] for row in table] == ["yes", "no", "no", "yes", "yes", "no"]
    row, one = table[4], results.isel(start=1, belt_speed=1)
    assert float(row["half_stroke [um]"]) == pytest.approx(one["half_stroke"].item() * 1e6, abs=0.005)
    assert float(row["linear_growth_rate [s-1]"]) == pytest.approx(one["linear_growth_rate"].item(), rel=1e-5)


def test_a_run_has_its_history(results, tmp_path):
    history = simulate(few(), {"start": "sticking", "belt_speed": 0.23})
    assert history["half_stroke"] == results["half_stroke"].sel(start="sticking", belt_speed=0.23)
    # friction holds the mass until it has pulled as hard as it can, 6 N; the spring pulls 0.16 N more each step
    assert history["friction_force"].values.max() == pytest.approx(6.0, abs=0.16)
    assert np.ptp(history["displacement"].values[-200:]) / 2 == pytest.approx(
        history["half_stroke"].item(), rel=0.01
    )
    assert draw_history(history, tmp_path / "run.png").stat().st_size > 0
