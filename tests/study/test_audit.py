"""An audit finds what the lower rungs got wrong, and says how sure it is."""

import csv
import shutil
from contextlib import redirect_stdout
from io import StringIO

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError
from cvt_hpc.models.auto import record
from cvt_hpc.study.audit import FULL_MODEL
from cvt_hpc.variables import Status, Vibrates
from support.rungs import scene_tables

# the middle of a window of the map of the scene of the tests and cells outside
JOB = """name = "audited"
model = "auto"
[axes]
friction_gradient = [-1.0, -0.9]
load = [60, 120]
[scene]
thrust = "50 kN"
[mesh]
stations = 96
[run]
duration = "0.3 s"
[numerics]
step = "7.6 us"
""" + scene_tables("auto")


@pytest.fixture
def job(tmp_path):
    path = tmp_path / "job.toml"
    path.write_text(JOB)
    return path


def audited(job, capsys, fraction="1", *more):
    out = job.parent / "out"
    status = main(["run", str(job), "--out", str(out), "--audit", fraction, *more])
    return status, capsys.readouterr().out, out


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """What is printed of a study that is audited whole, and its folder."""
    folder = tmp_path_factory.mktemp("audited")
    (folder / "job.toml").write_text(JOB)
    with redirect_stdout(StringIO()) as printed:
        assert main(["run", str(folder / "job.toml"), "--out", str(folder / "out"), "--audit", "1"]) == 0
    return printed.getvalue(), folder / "out"


@pytest.fixture
def studied(job, whole):
    """The folder of that study beside the job, without its audit."""
    out = job.parent / "out"
    shutil.copytree(whole[1], out, ignore=shutil.ignore_patterns("audit"))
    return out


def test_rungs_that_are_right_are_found_right(whole):
    printed, out = whole
    assert "audit: 4 of 4 runs that cheaper models decided done again in full" in printed
    # none of four: with 97.5 % of confidence the rate is below 1 - 0.025^(1/4)
    assert "coarse: 0 of 4 runs of another class (0.00%, 95 % interval 0.00% to 60.24%)" in printed
    assert list(csv.DictReader((out / "audit" / "audit.csv").open())) == []
    with xr.open_dataset(out / "results.nc") as low, xr.open_dataset(out / "audit" / "results.nc") as full:
        assert full.attrs["job"].count(FULL_MODEL) and low["vibrates"].equals(full["vibrates"])
        assert (low["vibrates"] == Vibrates.YES).any() and (low["vibrates"] == Vibrates.NO).any()
        forces = np.hstack(
            [low["mean_push_force"] - full["mean_push_force"], low["axial_force"] - full["axial_force"]]
        )
        assert 0.0 < np.abs(forces).max()


def test_a_rung_that_errs_is_found_out(job, capsys, monkeypatch):
    monkeypatch.setattr(record, "is_passive", lambda parameters: parameters["load"] > 100.0)
    status, printed, out = audited(job, capsys)
    assert status == 0
    assert "passive: 2 of 2 runs of another class (100.00%, 95 % interval 15.81% to 100.00%)" in printed
    assert "2 of them quiet against vibrating\n" in printed  # no forces are compared where a rung knows none
    rows = list(csv.DictReader((out / "audit" / "audit.csv").open()))
    assert [(row["load [N m]"], row["rung"], row["class"], row["class in full"]) for row in rows] == [
        ("120.0", "passive", "quiet", "vibrating")
    ] * 2


def test_forces_are_compared(whole):
    printed, out = whole
    with xr.open_dataset(out / "results.nc") as low, xr.open_dataset(out / "audit" / "results.nc") as full:
        strands = ("mean_ring_tension", "mean_push_force")
        off = [
            max(
                max(abs(low[name] - full[name]).values[cell].max() for name in names)
                / max(abs(full[name]).values[cell].max() for name in names)
                for names in (strands, ("axial_force",))
            )
            for cell in np.ndindex(2, 2)
        ]
    assert f"mean forces within {np.quantile(off, 0.95):.2%} in 95 % of the runs" in printed


def test_the_smallest_sample_has_a_run(job, studied, capsys):
    status, printed, _ = audited(job, capsys, "1e-9")
    assert status == 0
    assert "audit: 1 of 4 runs that cheaper models decided done again in full" in printed


def test_a_fresh_study_has_a_fresh_audit(job, whole, capsys):
    shutil.copytree(whole[1], job.parent / "out")
    job.write_text(JOB.replace("120]", "130]"))
    status, printed, _ = audited(job, capsys, "1", "--fresh")
    assert status == 0 and "audit: 4 of 4 runs" in printed
    job.write_text(JOB)
    out = job.parent / "out"
    assert main(["run", str(job), "--out", str(out), "--audit", "1"]) == 2  # before anything is computed
    assert "expected the folder of this job" in capsys.readouterr().err


def test_what_fails_in_full_is_no_error_of_the_rung(job, studied, capsys):
    status, printed, _ = audited(job, capsys, "1", "--run-limit", "1us")
    assert status == 1
    assert "coarse: 0 of 0 runs of another class (95 % interval 0.00% to 100.00%)" in printed
    assert "; 4 more failed in full" in printed
    rows = list(csv.DictReader((studied / "audit" / "audit.csv").open()))
    assert [row["class in full"] for row in rows] == ["failed"] * 4
    status, printed, _ = audited(job, capsys, "1", "--retry", "timed_out")
    assert status == 0
    assert "coarse: 0 of 4 runs of another class" in printed and "failed in full" not in printed


def test_audits_end_with_the_time(job, capsys, monkeypatch):
    asked = {}

    def stopped(repeat, **options):
        asked.update(options)
        raise InputError("stopped")

    monkeypatch.setattr("cvt_hpc.study.repeats.Repeat.run", stopped)
    out = str(job.parent / "out")
    arguments = [
        "run",
        str(job),
        "--out",
        out,
        "--audit",
        "1",
        "--time-limit",
        "600s",
        "--retry",
        "timed_out",
    ]
    assert main(arguments) == 2
    assert 0.0 < asked["time_limit"] < 600.0
    assert asked["retry"] == [Status.TIMED_OUT] and asked["fresh"] is False


def test_a_larger_share_goes_on_with_the_same_sample(job, capsys):
    passive = ("--set", "friction_gradient=0", "--set", "run.duration=0.1", "--set", "stations=48")
    job.write_text(JOB.replace("[60, 120]", "{ from = 1, to = 40, step = 1 }"))
    _, first, out = audited(job, capsys, "0.2", *passive)
    records = sum(path.stat().st_size for path in (out / "audit" / "records").iterdir())
    _, again, _ = audited(job, capsys, "0.2", *passive)
    assert again == first
    assert sum(path.stat().st_size for path in (out / "audit" / "records").iterdir()) == records
    with xr.open_dataset(out / "audit" / "results.nc") as dataset:
        few = dataset["status"].values != 0
    audited(job, capsys, "0.4", *passive)
    with xr.open_dataset(out / "audit" / "results.nc") as dataset:
        more = dataset["status"].values != 0
    assert 0 < few.sum() < more.sum() < 40
    assert not (few & ~more).any()


def test_a_trace_is_audited_where_it_ran(job, capsys):
    job.write_text(JOB.replace("[60, 120]", "{ from = 10, to = 18, step = 1 }"))
    trace = ("--set", "design.kind=trace", "--set", "friction_gradient=0", "--set", "run.duration=0.1")
    status, printed, _ = audited(job, capsys, "1", *trace)
    assert status == 0
    assert "audit: 3 of 3 runs" in printed  # all of one class: the corners of the first boxes


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--audit", "0"), "--audit: expected a fraction above 0, at most 1, found 0"),
        (("--audit", "1.5"), "--audit: expected a fraction above 0, at most 1, found 1.5"),
        (("--audit", "0.1", "--part", "1/2"), "--audit: expected a run of the whole study"),
        (("--audit", "0.1", "--set", "model=elastic_belt", "--dry-run"), "unknown table"),
    ],
)
def test_audits_that_make_no_sense_are_refused_before_any_run(job, capsys, options, message):
    out = job.parent / "out"
    job.write_text(JOB + '[auto]\nquestion = "occurrence"\n')
    assert main(["run", str(job), "--out", str(out), *options]) == 2
    assert message in capsys.readouterr().err
    assert not out.exists()


def test_only_what_has_lower_rungs_can_be_audited(job, capsys):
    job.write_text(JOB.replace('"auto"', '"elastic_belt"'))
    assert main(["run", str(job), "--audit", "0.1"]) == 2
    assert "--audit: expected a job of model auto" in capsys.readouterr().err
