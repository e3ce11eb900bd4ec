"""Model auto as a sweep: the same on two ranks as on one, CF conventions kept, drawn as any map, and checked."""

import numpy as np
import pytest

from cvt_hpc.cli import main
from cvt_hpc.study import open_results
from cvt_hpc.variables import Status
from support.cf import cf_findings
from support.rungs import scene_tables
from support.sweeps import call

JOB = """name = "a"
model = "auto"
[axes]
friction_gradient = [-1.0, 0.0]
load = [60, 120]
disturbance = ["1 um", "0.3 mm"]
[scene]
thrust = "50 kN"
[mesh]
stations = 96
[run]
duration = "0.3 s"
[numerics]
step = "7.6 us"
""" + scene_tables("auto")


CHECKED = ("--audit", "0.7", "--check-step", "0.9")


@pytest.mark.slow
def test_two_ranks_their_audit_and_the_check_of_their_step(tmp_path, monkeypatch, capsys, unarranged):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a.toml").write_text(JOB)
    assert main(["run", "a.toml", "--out", "out1", *CHECKED]) == 0
    printed, datasets = [capsys.readouterr().out.replace("out1", "out")], []
    ended = call("run", "a.toml", "--out", "out2", *CHECKED, cwd=tmp_path, ranks=2)
    assert ended.returncode == 0, ended.stderr
    printed.append(ended.stdout.replace("out2", "out"))
    for out in ("out1", "out2"):
        assert cf_findings(tmp_path / out / "results.nc") == []
        with open_results(tmp_path / out) as dataset:
            datasets.append(dataset.load())
    assert printed[0] == printed[1]
    assert "audit: " in printed[0] and "passive: 0 of " in printed[0] and "coarse: 0 of " in printed[0]
    assert (
        "\nstep check: " in printed[0]
        and " of 4 runs that took steps done again at half the step" in printed[0]
    )
    with open_results(tmp_path / "out2" / "check_step") as dataset:
        assert dataset.attrs["source"].endswith("model auto")
        halved, done = dataset["time_step"].load(), dataset["status"].load() == Status.DONE
    assert done.any() and np.allclose((datasets[0]["time_step"] / halved).where(done, 2.0), 2.0, rtol=1e-12)
    one, two = datasets
    for name in one.data_vars:
        if name != "core_seconds":
            assert np.array_equal(one[name], two[name], equal_nan=one[name].dtype.kind == "f"), name
    assert main(["map", "out2"]) == 0 and (tmp_path / "out2" / "map.png").stat().st_size > 0
    capsys.readouterr()
    assert main(["run", "a.toml", "--out", "out2", *CHECKED]) == 0
    assert capsys.readouterr().out.replace("out2", "out") == printed[1]
