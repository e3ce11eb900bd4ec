"""Model auto as a sweep: the same on two ranks as on one, CF conventions kept, drawn as any map."""

import numpy as np
from cf import cf_findings
from sweeps import call

from cvt_hpc.study import open_results

JOB = """name = "a"
model = "auto"
[axes]
friction_gradient = [-1.0, 0.0]
load = [60, 120]
disturbance = ["1 um", "0.3 mm"]
[scene]
thrust = "50 kN"
[run]
duration = "0.3 s"
"""


def test_two_ranks_and_their_audit(tmp_path):
    (tmp_path / "a.toml").write_text(JOB)
    printed, datasets = [], []
    for ranks in (0, 2):
        out = f"out{ranks}"
        ended = call("run", "a.toml", "--out", out, "--audit", "0.7", cwd=tmp_path, ranks=ranks)
        assert ended.returncode == 0, ended.stderr
        printed.append(ended.stdout.replace(out, "out"))
        assert cf_findings(tmp_path / out / "results.nc") == []
        with open_results(tmp_path / out) as dataset:
            datasets.append(dataset.load())
    assert printed[0] == printed[1]
    assert "audit: " in printed[0] and "passive: 0 of " in printed[0] and "coarse: 0 of " in printed[0]
    one, two = datasets
    for name in one.data_vars:
        if name != "core_seconds":
            assert np.array_equal(one[name], two[name], equal_nan=one[name].dtype.kind == "f"), name
    ended = call("map", "out2", cwd=tmp_path)
    assert ended.returncode == 0 and (tmp_path / "out2" / "map.png").stat().st_size > 0
    again = call("run", "a.toml", "--out", "out2", "--audit", "0.7", cwd=tmp_path)
    assert again.returncode == 0 and again.stdout.replace("out2", "out") == printed[1]
