"""The elastic belt checked by its explicit step, and compared with itself at a coarse one."""

import numpy as np
import pytest

from cvt_hpc.cli import main
from cvt_hpc.study import open_results
from cvt_hpc.variables import Status

JOB = """name = "b"
model = "elastic_belt"
[axes]
load = [120]
[scene]
thrust = "50 kN"
rise_time = "4 ms"
[friction]
friction_gradient = -1.0
[mesh]
stations = 24
[run]
duration = "11 ms"
[vibration]
band_low = "1 kHz"
"""
EXPLICITLY = ("--check-step", "1", "--check-step-by", "explicit")


@pytest.mark.slow
def test_a_study_is_checked_by_the_explicit_step_and_compared_with_it(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "b.toml").write_text(JOB)
    assert main(["run", "b.toml", *EXPLICITLY]) == 0
    printed = capsys.readouterr().out
    assert "step check: 1 of 1 runs that took steps done again by the explicit step" in printed
    assert "  0 of 1 contradict" in printed
    with open_results("out/b/check_explicit") as dataset:
        assert np.allclose(dataset["time_step"], 4e-8, rtol=1e-9)
        assert dataset["status"].values.tolist() == [Status.DONE]
    assert main(["compare", "out/b", "out/b/check_explicit"]) == 0
    assert 'differs: stepper: "imex" in A, "explicit" in B' in capsys.readouterr().out
    assert main(["run", "b.toml", "--set", "stepper=explicit", *EXPLICITLY]) == 2
    found = "--check-step-by explicit: expected a job of another stepper, found stepper explicit"
    assert found in capsys.readouterr().err
