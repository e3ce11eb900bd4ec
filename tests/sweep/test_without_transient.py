"""Rungs without a transient as citizens of the job, the sweep, the map and the command line."""

import numpy as np
import pytest

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.job.summary import summarize
from cvt_hpc.simulation import Interrupted, estimate_cost, record_variables, run_point, simulate
from cvt_hpc.study import open_results, run
from cvt_hpc.variables import Status, Vibrates
from support.cf import cf_findings
from support.rungs import rung_job

AXES = {"tangential_speed": [0.0, 0.05, 0.2], "friction_gradient": [-1.6, 0.0]}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    report = run(rung_job("criterion", AXES), tmp_path_factory.mktemp("criterion"), progress=False)
    assert (report.done, report.exit_status) == (6, 0)
    assert cf_findings(report.results) == []
    with open_results(report.results) as dataset:
        yield dataset.load()


def test_a_sweep_records_each_point(results):
    assert results["vibrates"].dims == ("tangential_speed", "friction_gradient")
    assert np.all(results["status"] == Status.DONE)
    assert results["vibrates"].values[0].tolist() == [Vibrates.YES, Vibrates.NO]
    assert results["vibrates"].values[2].tolist() == [Vibrates.NO, Vibrates.NO]
    assert np.all(results["core_seconds"] > 0.0)
    assert "steps" not in results and "simulated_seconds" not in results
    one = simulate(rung_job("criterion", AXES), {"tangential_speed": 0.05, "friction_gradient": -1.6})
    for name in ("growth_rate", "energy_per_cycle", "frequency"):
        assert np.array_equal(results[name].sel(tangential_speed=0.05, friction_gradient=-1.6), one[name]), (
            name
        )


def test_the_verdict_comes_first_and_the_cost_last():
    names = [variable.name for variable in record_variables(rung_job("criterion"))]
    assert names[:3] == ["status", "vibrates", "reason"] and names[-1] == "core_seconds"


def test_no_stepper_is_taken():
    with pytest.raises(
        InputError, match='stepper: expected none, since criterion has no transient, found "imex"'
    ):
        rung_job("criterion", stepper="imex")
    job = rung_job("criterion")
    assert job.stepper is None
    assert build_job(job.resolved(), "again").fingerprint() == job.fingerprint()
    assert "model criterion, no transient" in summarize(job, estimate_cost(job)).splitlines()[0]


def test_there_is_no_run_to_set_or_to_keep():
    for table, key in (("run", "duration"), ("record", "history")):
        with pytest.raises(InputError, match=rf"\[{table}\]: unknown table"):
            build_job({"name": "x", "model": "criterion", table: {key: 1}}, "x.toml")


def test_it_can_be_interrupted():
    job = rung_job("criterion")
    with pytest.raises(Interrupted, match="^SIGTERM$"):
        run_point(job, job.point(0), lambda: "SIGTERM")


def test_the_command_line(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "x.toml").write_text(
        'name = "x"\nmodel = "criterion"\n[axes]\ntangential_speed = [0, 0.1]\nradial_speed = [0.05, 0.1]\n'
    )
    assert main(["check", "x.toml", "--ranks", "2", "--pilots", "2"]) == 0
    assert "forecast of all 4 runs by 1 pilot batch of 100% of the simulated time" in capsys.readouterr().out
    assert main(["run", "x.toml"]) == 0
    assert main(["map", "out/x"]) == 0
    assert (tmp_path / "out/x/map.png").stat().st_size > 0
    capsys.readouterr()
    assert main(["simulate", "x.toml", "--at", "radial_speed=0.1", "--out", "x.nc", "--plot", "x.png"]) == 0
    printed = capsys.readouterr().out
    assert "growth rate " in printed and "picture: none, the run has no history" in printed
    assert (tmp_path / "x.nc").exists()
