"""The ladder of a small job, from the command line: its rungs, their runs, the files it leaves, and its errors."""

import csv
import json
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.cli import main
from cvt_hpc.experiments.ladder.loading import ladder, load
from cvt_hpc.experiments.sweeps import cost_left
from cvt_hpc.job import load_job
from cvt_hpc.models.elastic_belt.step_choice import transverse_limit
from cvt_hpc.tables import below_origin
from support.cf import cf_findings

JOB = """name = "small"
model = "elastic_belt"
[axes]
friction_gradient = [-1.0]
load = [100, 110]
[mesh]
stations = 48
[run]
duration = "0.1 s"
"""
# One cell of as small a belt as there is, by steps as long as it bears: what a ladder leaves is the same of many
TINY = """name = "tiny"
model = "elastic_belt"
[axes]
friction_gradient = [-1.0]
load = [110]
[mesh]
stations = 24
[numerics]
step = "12 us"
[run]
duration = "0.06 s"
longest_duration = "0.06 s"
"""


def test_the_ladder_of_the_repository_has_all_its_rungs():
    rungs, refusals = ladder(load_job(Path(__file__).parents[2] / "jobs" / "chart_ladder.toml"))
    assert refusals == {} and len(rungs) == 8
    reference = rungs[-1].job.point(0)
    # its step follows from its own mesh
    assert reference["step"] <= 0.75 * transverse_limit(reference) * 1.005


@pytest.fixture
def job(tmp_path):
    path = tmp_path / "job.toml"
    path.write_text(JOB)
    return path


def test_each_rung_does_the_same_runs_as_far_as_it_knows_them(job):
    rungs, refusals = ladder(load_job(job))
    jobs = {rung.name: rung.job for rung in rungs}
    assert refusals == {}
    assert list(jobs) == [
        "criterion", "strand", "steady_variator", "linear_stability", "coarse", "auto", "elastic_belt", "reference",
    ]  # fmt: skip
    axes = {name: [axis.name for axis in each.axes] for name, each in jobs.items()}
    assert axes.pop("criterion") == ["friction_gradient"] and axes.pop("strand") == ["load"]
    assert all(names == ["friction_gradient", "load"] for names in axes.values())
    assert [jobs[name].parameters["question"] for name in ("coarse", "auto")] == ["forces", "occurrence"]
    assert jobs["coarse"].parameters["least_margin"] == 0.0  # every answer as it is, near a threshold or not
    assert jobs["linear_stability"].parameters["stations"] == 48
    own, reference = jobs["elastic_belt"].parameters, jobs["reference"].parameters
    changed = {key: reference[key] / own[key] for key in own if reference[key] != own[key]}
    # a chosen step has three digits
    finer = {"step_error": 1 / 1.5, "step": 1 / 1.5}
    assert changed == pytest.approx({"stations": 1.5, **finer, "duration": 2.0}, rel=2e-3)


def test_a_dearer_model_stands_beside_the_rungs_if_it_is_asked_for(job, capsys):
    rungs, _ = load(job, ["ladder.beside=quasi_static_belt"])[1:]
    assert [rung.name for rung in rungs[-3:]] == ["quasi_static_belt", "elastic_belt", "reference"]
    beside = rungs[-3].job
    assert beside.stepper == "split" and beside.parameters["stations"] == 48 and beside.size == 2
    assert main(["ladder", str(job), "--set", "ladder.beside=quasi_static"]) == 2
    told = 'beside: expected one of none, quasi_static_belt, spatial_pushbelt, found "quasi_static"; did you mean quasi_static_belt?'
    assert told in capsys.readouterr().err


def test_a_rung_that_refuses_the_job_is_named(job):
    rungs, refusals = ladder(load_job(job, ["friction_memory=0"]))
    assert "linear_stability" not in [rung.name for rung in rungs]
    assert list(refusals) == ["linear_stability"] and "friction_memory" in refusals["linear_stability"]


def test_a_rung_has_the_keys_of_the_job_in_tables_of_its_own(job):
    rungs, refusals = ladder(load_job(job, ["vibration.band_high=1200"]))
    jobs = {rung.name: rung.job for rung in rungs}
    assert refusals == {} and jobs["linear_stability"].schema.section_of["band_high"] == "judgement"
    assert (
        jobs["linear_stability"].parameters["band_high"] == jobs["coarse"].parameters["band_high"] == 1200.0
    )


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["load=100"], "[axes]: expected load among the axes, for its onsets, found friction_gradient"),
        (["model=auto"], "model: expected elastic_belt, the top of the ladder, found auto"),
        (["stepper=explicit"], "stepper: expected imex, as all transients below have it, found explicit"),
        (
            ["load_history=ramp"],
            "[scene] load_history: expected constant, as the cheaper models have it, found ramp",
        ),
        (
            ["speed_history=ramp"],
            "[scene] speed_history: expected constant, as the cheaper models have it, found ramp",
        ),
        (
            ["profile_time=[0.01, 0.02]", "load_profile=[0.5, 1]"],
            "[profiles] profile_time: expected constant, as the cheaper models have it, found [0.01, 0.02]",
        ),
    ],
)
def test_jobs_without_a_ladder_are_refused(job, options, message, capsys):
    out = job.parent / "out"
    settings = [word for option in options for word in ("--set", option)]
    assert main(["ladder", str(job), "--out", str(out), *settings]) == 2
    assert capsys.readouterr().err == f"cvt-hpc: {job}: {message}\n"
    assert not out.exists()


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        (
            "[mesh]\nstations = 48",
            "stations = [48, 64]",
            "[axes] stations: expected one value, which the reference refines, found an axis",
        ),
        (
            "[mesh]\nstations = 48",
            "step_error = [0.01, 0.02]",
            "[axes] step_error: expected one value, which the reference refines, found an axis",
        ),
        (
            "load = [100, 110]",
            'load = { from = 100, to = 110, step = 1 }\n[design]\nkind = "trace"',
            "[design]: expected none: a ladder goes over the whole grid, found trace",
        ),
    ],
)
def test_what_a_ladder_cannot_go_over_is_refused(job, before, after, message, capsys):
    job.write_text(JOB.replace(before, after))
    assert main(["ladder", str(job), "--out", str(job.parent / "out")]) == 2
    assert capsys.readouterr().err == f"cvt-hpc: {job}: {message}\n"


def test_check_tells_the_runs_of_each_rung_and_what_is_left_of_them(job, capsys, monkeypatch):
    monkeypatch.chdir(job.parent)
    assert main(["check", str(job), "--for", "ladder", "--set", "friction_memory=0"]) == 0
    first, *lines = capsys.readouterr().out.splitlines()
    assert first == f"ladder small ({job}): 2 runs with 7 models"
    rows = {line.split()[0]: line.split() for line in lines if line.startswith("  ")}
    assert rows["criterion"][2:4] == ["1", "1"] and rows["coarse"][1:4] == ["auto", "2", "2"]
    # twice the duration at 1.5 times the stations and steps: 4.5 times the cost, in two digits
    assert float(rows["reference"][4]) == pytest.approx(4.5 * float(rows["elastic_belt"][4]), rel=0.1)
    assert any(line.startswith("linear_stability left out: ") for line in lines)
    assert not (job.parent / "out").exists()


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A ladder: its job, its folder, and what it has printed."""
    folder = tmp_path_factory.mktemp("ladder")
    path, out = folder / "tiny.toml", folder / "out"
    path.write_text(TINY)
    printed, told = StringIO(), StringIO()
    with redirect_stdout(printed), redirect_stderr(told):
        status = main(["ladder", str(path), "--out", str(out)])
    assert status == 0, told.getvalue()
    return path, out, printed.getvalue(), told.getvalue()


@pytest.mark.slow
def test_what_is_done_costs_nothing_more(made):
    path, out, *_ = made
    rungs = ladder(load_job(path))[0]
    assert len(rungs) == 8
    for rung in rungs:
        assert cost_left(rung, out) == (0, 0.0) and cost_left(rung, None)[0] == 1


@pytest.mark.slow
def test_a_ladder_leaves_its_studies_and_what_they_say(made):
    _, out, printed, told = made
    announced = [line for line in told.splitlines() if " to go in all" in line]
    assert [line.split()[1:4] for line in announced[:2]] == [
        ["model", "1/8", "criterion:"],
        ["model", "2/8", "strand:"],
    ]
    assert len(announced) == 8
    assert printed.splitlines()[-3:] == [
        f"table: {out / 'ladder.csv'}",
        f"dataset: {out / 'ladder.nc'}",
        f"picture: {out / 'ladder.png'}",
    ]
    rows = list(csv.DictReader(below_origin((out / "ladder.csv").open())))
    answers = {(row["question"], row["rung"]): row for row in rows}
    assert len(answers) == len(rows) == 6 + 5 + 5 + 3 + 5
    assert {rung for question, rung in answers if question == "amplitude"} == {
        "coarse", "elastic_belt", "reference",
    }  # fmt: skip
    forces = [answers["forces", rung]["error_median"] for rung in ("steady_variator", "linear_stability")]
    assert forces[0] == forces[1] != ""  # of one steady state
    assert cf_findings(out / "ladder.nc") == []
    assert (out / "ladder.png").stat().st_size > 10_000
    with xr.open_dataset(out / "ladder.nc", decode_times=False) as dataset:
        cost = dataset["core_seconds"].sel(question="forces", rung="coarse").item()
        assert cost == pytest.approx(float(answers["forces", "coarse"]["core_seconds"]), rel=5e-3)  # 3 digits
        assert np.isnan(dataset["cells"].sel(question="amplitude", rung="strand"))
        assert json.loads(dataset.attrs["rungs"])["reference"]["mesh"]["stations"] == 36
    with xr.open_dataset(out / "coarse" / "results.nc", decode_times=False) as dataset:
        assert cost == dataset["core_seconds"].mean()
    with xr.open_dataset(out / "strand" / "results.nc", decode_times=False) as dataset:
        assert dataset["status"].dims == ("load",)


@pytest.mark.slow
def test_an_ended_ladder_is_only_read_again(made, capsys, monkeypatch):
    job, out, printed, _ = made
    monkeypatch.setattr("cvt_hpc.experiments.ladder.making.draw", lambda *_: None)  # it is drawn
    records = sum(path.stat().st_size for path in out.glob("*/records/*"))
    assert main(["ladder", str(job), "--out", str(out)]) == 0  # nothing is done twice
    again = capsys.readouterr()
    assert again.out == printed and "to go in all" not in again.err
    assert sum(path.stat().st_size for path in out.glob("*/records/*")) == records
    assert main(["ladder", str(job), "--out", str(out), "--set", "thrust=45 kN"]) == 2
    assert "expected the folder of this job" in capsys.readouterr().err
