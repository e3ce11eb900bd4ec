"""A sweep with uncertain parameters: killed, grown and shared by ranks it has the numbers of an undisturbed one."""

import shutil
import signal
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from cvt_hpc import open_results
from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, load_job
from cvt_hpc.study import run
from cvt_hpc.variables import Status
from support.cf import cf_findings
from support.recorded import assert_same_numbers, frames_written, records
from support.sweeps import PATIENCE, call, environment

JOB = Path(__file__).parents[2] / "jobs" / "uncertain_criterion.toml"
FEW = ("--set", "friction_gradient=-0.5", "--set", "radial_speed=[0.05, 0.09, 0.15]")
RUNS = 3 * 32
# The command line, killed as it begins to write its second batch of records.
KILLED = """
import os, signal, sys
from cvt_hpc.cli import main
from cvt_hpc.study.record.log import RecordLog
write, batches = RecordLog.append, []
def append(self, records):
    batches.append(len(records))
    if len(batches) == 2:
        os.kill(os.getpid(), signal.SIGKILL)
    write(self, records)
RecordLog.append = append
main(sys.argv[1:])
"""


def load_results(out):
    with open_results(out) as dataset:
        return dataset.load()


@pytest.mark.slow
def test_a_sweep_that_is_killed_and_grows_has_the_numbers_of_an_undisturbed_one(
    tmp_path, monkeypatch, capsys, unarranged
):
    monkeypatch.chdir(tmp_path)
    sweep = subprocess.run(
        [sys.executable, "-c", KILLED, "run", str(JOB), *FEW, "--out", "killed"],
        env=environment(),
        capture_output=True,
        timeout=PATIENCE,
    )
    assert sweep.returncode == -signal.SIGKILL, sweep.stderr
    before = records(tmp_path / "killed")
    assert 0 < before < RUNS
    assert main(["run", str(JOB), *FEW, "--out", "killed"]) == 0
    assert frames_written(tmp_path / "killed") == RUNS  # none was repeated
    half = load_results(tmp_path / "killed")

    larger = (*FEW, "--set", "uncertain.samples=64")
    grown = call("run", JOB, *larger, "--out", "killed", cwd=tmp_path, ranks=2)
    assert grown.returncode == 0, grown.stderr
    assert "the study grows from 96 to 192 runs" in grown.stderr
    assert main(["run", str(JOB), *larger, "--out", "whole"]) == 0
    found, whole = load_results(tmp_path / "killed"), load_results(tmp_path / "whole")
    assert_same_numbers(found, whole)
    assert_same_numbers(found.isel(sample=slice(32)), half)
    assert cf_findings(tmp_path / "whole" / "results.nc") == []

    assert main(["map", "whole", "--show", "slip_probability"]) == 0
    assert main(["report", "whole"]) == 0
    capsys.readouterr()
    assert main(["plot", "onset_bands", "whole"]) == 2
    assert "results over samples, radial_speed with numbers, and a further axis" in capsys.readouterr().err


def test_each_run_has_the_values_that_the_dataset_states(tmp_path):
    document = tomllib.loads((JOB.parent / "bistable_oscillator.toml").read_text())
    document["axes"] = {"normal_load": [0.5, 1.0, 1.5]}
    del document["oscillator"]["damping"], document["scene"]["normal_load"]
    document["uncertain"] = {
        "samples": 8,
        "damping": {"distribution": "normal", "mean": "5.9 N s/m", "standard_deviation": "0.6 N s/m"},
    }
    job = build_job(document, "x.toml", {"belt_speed": 0.2, "duration": 2.0, "step": 2e-4})
    results = load_results(run(job, tmp_path, progress=False).results.parent)
    assert results["damping"].dims == ("sample",)
    assert results["damping"].attrs["derived"] == "normal, mean 5.9 N s/m, standard deviation 0.6 N s/m"
    # m s^2 + (c + N mu') s + k = 0 with mu' = -40 s/m exp(-v / 0.1 m/s)
    growth = (40.0 * np.exp(-2.0) * results["normal_load"] - results["damping"]) / (2 * 0.538)
    assert results["linear_growth_rate"].values == pytest.approx(growth.values, rel=1e-9)


ADAPTIVE = (
    "uncertain.samples=128",
    "design.kind=adaptive",
    "design.first_samples=16",
    "design.widest_interval=0.3",
)


def test_samples_go_to_cells_that_are_not_yet_known_and_a_cut_record_goes_on_to_the_same(tmp_path):
    job = load_job(
        JOB,
        {"friction_gradient": -0.5, "radial_speed": [0.05, 0.09, 0.12, 0.2]}
        | dict(entry.split("=") for entry in ADAPTIVE),
    )
    report = run(job, tmp_path / "whole", progress=False)
    whole = load_results(tmp_path / "whole")
    told = whole.cvt.probability()
    width = told["vibration_probability_high"] - told["vibration_probability_low"]
    samples = told["samples"].values.ravel()
    assert samples.min() == 16 and samples.max() > 32
    assert ((width.values.ravel() <= 0.3) | (samples == 128)).all()
    assert report.total == samples.sum() == (whole["status"] == Status.DONE).sum()
    assert report.unneeded == 4 * 128 - samples.sum()

    log = min((tmp_path / "whole" / "records").glob("*.log"))
    (tmp_path / "cut" / "records").mkdir(parents=True)
    shutil.copy(tmp_path / "whole" / "job.json", tmp_path / "cut")
    whole_log = log.read_bytes()
    (tmp_path / "cut" / "records" / log.name).write_bytes(whole_log[: len(whole_log) // 2])
    run(job, tmp_path / "cut", progress=False)
    assert_same_numbers(load_results(tmp_path / "cut"), whole)
    assert frames_written(tmp_path / "cut") - samples.sum() in (0, 1)  # that which the cut has torn
    with pytest.raises(InputError, match="expected a whole study, since it chooses by the runs of all parts"):
        run(job, tmp_path / "part", part="1/2", progress=False)
