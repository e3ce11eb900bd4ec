"""`cvt-hpc run JOB --check-step`: a sample of the runs again at half the step that each has taken."""

import csv
import sys

import numpy as np
import pytest
import xarray as xr

import cvt_hpc.job.schema as schema
from cvt_hpc.job import build_job
from cvt_hpc.simulation import estimate_cost
from cvt_hpc.study.repeats import step_check
from cvt_hpc.variables import Coordinate, Status, Variable, Vibrates

pytestmark = pytest.mark.usefixtures("unarranged")  # test_pictures.py looks at the places

STEP = 1e-6
GRID = """[scene]
thrust = "50 kN"
[axes]
load = { from = 1, to = 40, step = 1 }
"""
SENSITIVE = (5, 6)  # loads at which runs vibrate at long steps only
FAILING = 7  # load at which the run fails at steps below that of the job
STRAND = ("strand",)
VARIABLES = (
    Variable("status", "", "how the run ended", dtype="i1", flags=Status),
    Variable("vibrates", "", "whether the belt vibrates", dtype="i1", flags=Vibrates),
    Variable("reason", "", "why the run failed", dtype="S240"),
    Variable("amplitude", "m", "amplitude", dims=STRAND),
    Variable("frequency", "Hz", "frequency", dims=STRAND),
    Variable("time_step", "s", "time step"),
)


def run_points(job, points, interrupt, more=None):
    """Vibrate above 20 N m by 10 um, or more at long steps; what step a run takes depends on its load."""
    return [_record(point) for point in points]


def _record(point):
    load, step = point["load"], point["step"]
    vibrates = load > 20 or (load in SENSITIVE and step > 0.6 * STEP)
    fails = load == FAILING and step < 0.6 * STEP
    amplitude = 10e-6 * (1.0 + 1e5 * step) if vibrates else 1e-6
    return {
        "status": Status.FAILED_NUMERICS if fails else Status.DONE,
        "vibrates": Vibrates.YES if vibrates else Vibrates.NO,
        "reason": "step 3: too short" if fails else "",
        "amplitude": np.array([amplitude, 0.0]),
        "frequency": np.array([500.0, 1.0]) * (1.0 + 1e4 * step),
        "time_step": np.nan if load == 8 else step / (1 + (load == 9)),  # the run at 9 N m had to be refined
    }


@pytest.fixture
def checked(mechanics, write_job, call, monkeypatch):
    """Return a function that runs the job with a check of its step."""
    double = sys.modules["cvt_hpc.simulation"]  # the double of this room

    monkeypatch.setattr(double, "record_variables", lambda job: VARIABLES)
    strands = Coordinate(np.array(["t1", "t2"]), "", "strand")
    monkeypatch.setattr(double, "record_coordinates", lambda job: {"strand": strands})
    monkeypatch.setattr(double, "run_points", run_points)
    criterion = {"vibration": {"amplitude_threshold": schema.vibration_settings.PARAMETERS["vibration"]["amplitude_threshold"]}}  # fmt: skip
    monkeypatch.setattr(schema.SHARED[0], "PARAMETERS", schema.SHARED[0].PARAMETERS | criterion)
    write_job(GRID)
    return lambda fraction="1", *more: call("run", "x.toml", "--check-step", fraction, *more)


@pytest.fixture
def undrawn(monkeypatch):
    """Pictures take most of the time; those of a grid and of samples are drawn by tests without this."""
    drawing = "cvt_hpc.analysis.comparison_drawing.draw_comparison"
    monkeypatch.setattr(drawing, lambda found, path, sources: path)


def loads(path):
    """Loads at which a study has runs, and their time steps."""
    with xr.open_dataset(path, decode_times=False) as dataset:
        there = dataset["status"].values != Status.NOT_RUN
        return dataset["load"].values[there].astype(int).tolist(), dataset["time_step"].values[there]


def test_contradictions_deviations_and_failures_are_reported(checked, tmp_path):
    status, out, err = checked()
    assert status == 1  # a run has failed
    assert [
        line for line in err if line.startswith("cvt-hpc: step check: run 6 (load = 7 N m): failed_numerics")
    ]
    # all but the run without steps; with 97.5 % of confidence each the ends are those of beta quantiles
    assert out[2:-1] == [
        "step check: 39 of 39 runs that took steps done again at half the step",
        "  2 of 38 contradict (quiet against vibrating; 5.26%, 95 % interval 0.64% to 17.75%), 2 of them beyond "
        "the threshold; 0 more of another class; 1 more failed at half the step",
        "  load = 5 N m: vibrating 11 um 505 Hz | quiet 1 um 502.5 Hz",
        "  load = 6 N m: vibrating 11 um 505 Hz | quiet 1 um 502.5 Hz",
        "  amplitude where both vibrate (20 cells): B deviates by 4.55% (median), 4.55% (95 %), 4.55% (largest)",
        "  frequency where both vibrate (20 cells): B deviates by 0.50% (median), 0.50% (95 %), 0.50% (largest)",
        "picture: out/x/check_step/compare.png",
        "table: out/x/check_step/compare.csv",
    ]
    rows = list(csv.DictReader((tmp_path / "out/x/check_step/compare.csv").open()))
    assert [row["load [N m]"] for row in rows if row["pair"] == "vibrates in A only"] == ["5.0", "6.0"]
    assert [row["load [N m]"] for row in rows if row["class_b"] == "not run"] == ["8.0"]


def test_each_run_is_done_at_half_of_the_step_that_it_took(checked, undrawn, tmp_path):
    checked()
    found, steps = loads(tmp_path / "out/x/check_step/results.nc")
    wanted = [
        0.125 * STEP if load == 9 else 0.5 * STEP for load in found
    ]  # 9 N m: a quarter, halved by itself
    assert np.allclose(steps, wanted, rtol=1e-12)


def test_a_dry_run_tells_what_the_check_will_cost(checked, tmp_path):
    status, out, _ = checked("0.1", "--dry-run")
    # the double's run takes 30 core-seconds, and twice that at half the step
    assert (status, out[-3:]) == (
        0,
        [
            "estimated cost: 30 core-seconds per run, 1.2e+03 core-seconds in all",
            "needed: 16 kB of memory for the plan; disk: 12.6 kB of records, at most 51.3 kB of results.nc",
            "step check: about 4 runs again at half the step, estimated cost: 60 core-seconds per run, 240 core-seconds in all",
        ],
    )
    assert not (tmp_path / "out").exists()


def test_a_check_by_the_explicit_step_is_priced_by_it(tmp_path):
    job = build_job({"name": "x", "model": "elastic_belt", "numerics": {"most_refinements": 2}}, "x.toml")
    check = step_check(job, tmp_path, 1.0, "explicit")
    # 0.1 us instead of 4.6 us, at half the cost of a step, eight lanes instead of 16
    assert check.core_seconds() == estimate_cost(check.job)
    assert check.core_seconds() > 20.0 * estimate_cost(job)


def test_at_least_one_run_is_done_again(checked, undrawn, tmp_path):
    _, out, _ = checked("1e-9")
    assert out[2] == "step check: 1 of 39 runs that took steps done again at half the step"
    (one,), _ = loads(tmp_path / "out/x/check_step/results.nc")
    checked("0.1")
    assert one in loads(tmp_path / "out/x/check_step/results.nc")[0]


def test_without_steps_nothing_is_drawn(checked, tmp_path):
    status, out, _ = checked("1", "--set", "load=8")
    assert status == 0
    assert out[2:-1] == ["step check: none of the runs has taken steps, none is done again"]


def test_a_study_that_is_right_has_no_contradiction(checked, undrawn):
    status, out, _ = checked("1", "--set", "load=30")
    assert status == 0
    assert out[3].startswith(
        "  0 of 1 contradict (quiet against vibrating; 0.00%, 95 % interval 0.00% to 97.50%)"
    )


def test_a_larger_share_goes_on_with_the_same_sample(checked, undrawn, tmp_path):
    place = tmp_path / "out/x/check_step"
    _, first, _ = checked("0.2")
    few, _ = loads(place / "results.nc")
    logs = sorted(path.name for path in (place / "records").iterdir())
    _, again, _ = checked("0.2")
    assert again == first and sorted(path.name for path in (place / "records").iterdir()) == logs
    checked("0.5")
    more, _ = loads(place / "results.nc")
    assert 0 < len(few) < len(more) < 39 and set(few) < set(more)
    # the smaller sample is reported as it was, whatever else has been done since
    assert checked("0.2")[1] == first


def test_a_check_that_was_stopped_goes_on(checked, undrawn, tmp_path, monkeypatch):
    double = sys.modules["cvt_hpc.simulation"]  # the double of this room

    whole = checked("0.5")[1]
    whole_loads, steps = loads(tmp_path / "out/x/check_step/results.nc")
    done = []

    def stopping(job, points, interrupt, more):
        if points[0]["step"] < STEP:
            done.append(points[0]["load"])
            if len(done) == 4:
                raise double.Interrupted("no more")
        return run_points(job, points, interrupt)

    monkeypatch.setattr(double, "run_points", stopping)
    status, out, err = checked("0.5", "--out", "cut")
    assert status == 99 or len(done) >= 4
    monkeypatch.setattr(double, "run_points", run_points)
    _, out, _ = checked("0.5", "--out", "cut")
    found, found_steps = loads(tmp_path / "cut/check_step/results.nc")
    assert (found, found_steps.tolist()) == (whole_loads, steps.tolist())
    assert [line.replace("cut", "out/x") for line in out] == whole


def test_samples_are_checked(checked, tmp_path, write_job):
    write_job(GRID.replace(", step = 1", "") + '[design]\nkind = "sobol"\nruns = 16\n')
    status, out, _ = checked("1")
    assert status == 0
    assert out[2] == "step check: 16 of 16 runs that took steps done again at half the step"
    assert out[3].startswith("  0 of 16 contradict")
    with xr.open_dataset(tmp_path / "out/x/check_step/results.nc", decode_times=False) as dataset:
        assert np.allclose(dataset["time_step"].values, 0.5 * STEP, rtol=1e-12)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (("--check-step", "0"), "--check-step: expected a fraction above 0, at most 1, found 0"),
        (("--check-step", "1", "--part", "1/2"), "--check-step: expected a run of the whole study"),
        (
            ("--check-step-by", "half"),
            "--check-step-by: expected --check-step FRACTION beside it, found none",
        ),
        (("--check-step", "1", "--check-step-by", "explicit"), "stepper: expected one that toy takes (hop)"),
    ],
)
def test_checks_that_make_no_sense_are_refused_before_any_run(checked, call, tmp_path, options, message):
    status, out, err = call("run", "x.toml", *options)
    assert (status, out, len(err)) == (2, [], 1)
    assert message in err[0]
    assert not (tmp_path / "out").exists()


def test_a_study_over_steps_is_not_checked(checked, call, write_job):
    write_job(GRID + "step = [1e-6, 2e-6]\n")
    status, _, err = checked()
    assert (status, err) == (
        2,
        ["cvt-hpc: --check-step: expected a job with one value of step, found an axis"],
    )


def test_another_job_in_the_folder_of_the_check_is_refused(checked, undrawn, call):
    checked()
    call("run", "x.toml", "--set", "step=3e-6", "--fresh")
    status, out, err = checked("1", "--set", "step=3e-6")
    assert status == 2 and out == []
    assert "out/x/check_step: expected the folder of this job, found that of another" in err[-1]
    assert checked("1", "--set", "step=3e-6", "--fresh")[0] == 0


def test_failed_runs_are_done_again_at_a_shorter_step_from_the_command_line(
    checked, call, tmp_path, write_job
):
    write_job(GRID + "[numerics]\nstep = 3e-7\n")
    assert call("run", "x.toml")[0] == 1  # 7 N m fails at 0.3 us, and all the more at shorter steps
    status, out, _ = call("run", "x.toml", "--retry", "failed_numerics", "--refine", "3")
    assert status == 1
    _, steps = loads(tmp_path / "out/x/results.nc")
    assert np.isclose(steps[6], 1e-7, rtol=1e-12) and np.isclose(steps[5], 3e-7, rtol=1e-12)
    assert call("run", "x.toml", "--refine", "2") == (
        2,
        [],
        ["cvt-hpc: --refine: expected --retry failed_numerics beside it, and no other, found no --retry"],
    )
    status, _, err = call("run", "x.toml", "--refine", "0.5", "--retry", "failed_numerics")
    assert (status, err) == (
        2,
        ["cvt-hpc: --refine: expected a factor of 1 or more, at most 1000, found 0.5"],
    )
