"""The command `branch` on a coarse belt: what it prints, keeps and draws, and what it refuses."""

import shutil

import numpy as np
import pytest
import xarray as xr

from cvt_hpc.cli import main
from cvt_hpc.experiments.branch.attractors import Attractor, Stability, Start, attractors
from cvt_hpc.experiments.branch.diagram import DiagramFolder, Direction
from cvt_hpc.experiments.branch.job import load
from cvt_hpc.job import build_job
from cvt_hpc.models.steady_variator.walking import SteadyBelt
from cvt_hpc.vibration.classes import OccurrenceClass
from support.cf import cf_findings
from support.rungs import scene_tables

JOB = """
name = "x"
model = "linear_stability"
[axes]
load = ["90 N m", "105 N m", "120 N m"]
[mesh]
stations = 96
end_refinement = 1
""" + scene_tables("linear_stability")
RUNS = """
[branch]
resolution = "5 N m"
set = { duration = "0.15 s", step = "7.6 us" }
"""


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Exit status, printed lines and folder of one diagram."""
    folder = tmp_path_factory.mktemp("branch")
    (folder / "x.toml").write_text(JOB + RUNS)
    with pytest.MonkeyPatch.context() as patch:
        printed = []
        patch.setattr("builtins.print", lambda *words, **_: printed.extend(map(str, words)))
        status = main(["branch", str(folder / "x.toml"), "--out", str(folder / "out")])
    return status, printed, folder / "out"


def test_it_finds_the_hopf_point_and_says_so(made):
    status, printed, folder = made
    assert status == 0
    assert "cvt-hpc: 1/1 branches: 1 Hopf points" in printed
    (line,) = [line for line in printed if line.startswith("Hopf point")]
    assert "stability lost" in line and "critical" in line
    with xr.open_dataset(folder / "branch.nc") as dataset:
        expected = [Stability.STABLE, Stability.UNSTABLE, Stability.UNSTABLE]
        assert dataset["stability"].values.tolist() == expected
        load = dataset["onset_load"].item()
        assert f"at {load:.1f} N m, {dataset['onset_frequency'].item():.0f} Hz" in line
        assert 90.0 < load < 105.0
        assert dataset["onset_direction"].item() == Direction.GROWS_ABOVE
        first = dataset["growth_rate"].max("mode").values
        assert first[0] < 0.0 < first[1]


def test_the_dataset_keeps_the_conventions(made):
    assert cf_findings(made[2] / "branch.nc") == []


def test_runs_lie_closely_beside_the_hopf_point_and_agree_with_it(made):
    with xr.open_dataset(made[2] / "branch.nc") as dataset:
        small = dataset.isel(run=dataset["run_start"].values == 0)
        assert small["run_load"].values.tolist() == [90.0, 95.0, 100.0, 105.0, 120.0]
        above = small["run_load"] > dataset["onset_load"].item() + 5.0
        assert (small["run_occurrence"].values == OccurrenceClass.VIBRATING)[above.values].all()
        # begun in the steady state with 1 um: below the Hopf point nothing is left of it
        below = small["run_load"] < dataset["onset_load"].item() - 3.0
        assert small["run_amplitude"].values[below.values].max() < 1e-7
        # the large start belongs to runs of their own: another vibration at the same load
        pairs = dataset["run_amplitude"].values.reshape(-1, 2)
        assert (pairs[:, 0] != pairs[:, 1]).all()


def test_the_picture_is_there(made):
    assert (made[2] / "branch.png").read_bytes().startswith(b"\x89PNG")


def test_a_branch_that_is_kept_is_the_same_to_the_last_bit(made, tmp_path, monkeypatch, capsys):
    shutil.copytree(made[2], tmp_path / "out")
    (tmp_path / "x.toml").write_text(JOB + RUNS)
    monkeypatch.setattr("cvt_hpc.experiments.branch.diagram._follow", None)
    assert main(["branch", str(tmp_path / "x.toml"), "--out", str(tmp_path / "out")]) == 0
    lines = capsys.readouterr().out.splitlines()
    hopf = [line for line in lines if line.startswith("Hopf point")]
    assert hopf == [line for line in made[1] if line.startswith("Hopf point")] != []
    with xr.open_dataset(made[2] / "branch.nc") as one, xr.open_dataset(tmp_path / "out/branch.nc") as other:
        assert one.equals(other)
    assert (tmp_path / "out/branch.png").read_bytes() == (made[2] / "branch.png").read_bytes()


def test_a_kept_branch_is_told_of_in_the_unit_of_the_job_that_asks(made, tmp_path):
    (tmp_path / "x.toml").write_text(JOB + RUNS)
    diagram = load(tmp_path / "x.toml")
    whole = DiagramFolder(made[2], diagram).load_branch(0)
    first = {
        0: 94.0,
        1: 90.0,
    }  # load [N m] from which runs vibrate, by start; the Hopf point lies between 92 and 94
    runs = [
        Attractor(load, start, OccurrenceClass(load >= first[start]), 1e-6, 400.0, "")
        for load in (88.0, 90.0, 92.0, 94.0, 96.0)
        for start in first
    ]
    folder = DiagramFolder(tmp_path, diagram)
    folder.parts.folder.mkdir()
    folder.save_branch(0, whole._replace(runs=runs))
    (kind,) = folder.load_branch(0).kinds
    assert kind.reason == "both attractors from 90 N m to 92 N m"
    in_mm = (JOB + RUNS).replace("90 N m", "90000 N mm")
    (tmp_path / "x.toml").write_text(
        in_mm.replace("105 N m", "105000 N mm").replace("120 N m", "120000 N mm")
    )
    (again,) = DiagramFolder(tmp_path, load(tmp_path / "x.toml")).load_branch(0).kinds
    assert again == kind._replace(reason="both attractors from 90000 N mm to 92000 N mm")


def test_another_file_in_its_place_is_left_alone(tmp_path, capsys):
    (tmp_path / "x.toml").write_text(JOB)
    xr.Dataset({"mine": 1.0}).to_netcdf(tmp_path / "branch.nc")
    before = (tmp_path / "branch.nc").read_bytes()
    assert main(["branch", str(tmp_path / "x.toml"), "--out", str(tmp_path)]) == 2
    assert "found branch.nc without a branch.json" in capsys.readouterr().err
    assert (tmp_path / "branch.nc").read_bytes() == before


def test_a_run_begins_in_the_steady_state(tmp_path):
    (tmp_path / "x.toml").write_text(JOB)
    (asked,) = load(tmp_path / "x.toml").branches
    job = build_job(asked.runs.resolved(), "x", {"duration": 0.1, "precision": "double", "lanes": "stations"})
    state = SteadyBelt(asked.parameters).at(90.0).state
    push = {"disturbance": 1e-9}
    at_rest, started = attractors(
        job, "load", (Start(push, lambda load: state), Start(push)), [90.0], [], 1.0
    )
    assert attractors(job, "load", (Start(push, lambda load: None),), [90.0], [], 1.0) == []
    # a push of 1 nm fades; a load that has risen within 30 ms leaves more
    assert at_rest.amplitude < 1e-11 < 1e-7 < started.amplitude


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ('"linear_stability"', '"steady_variator"', "model: expected linear_stability, found steady_variator"),
        ('["90 N m", "105 N m", "120 N m"]', '["90 N m"]', "[axes] load: expected two values or more"),
        ("[mesh]", "[branch]\nresolutoin = 1\n[mesh]", "did you mean resolution?"),
        ("[mesh]", '[branch]\ndisturbance = ["1 mm", "1 um"]\n[mesh]', "[branch] disturbance: expected a small"),
        ("[mesh]", "[branch]\nset = { durration = 1 }\n[mesh]", "did you mean duration"),
        ("[mesh]", "[branch]\nset = { seed = [1, 2] }\n[mesh]", "[branch] set seed: expected one value, found an axis"),
        (
            '["90 N m", "105 N m", "120 N m"]',
            '{ from = 10, to = 90, step = 10 }\n[design]\nkind = "trace"',
            "[design]: expected the full grid of the axes, found trace",
        ),
    ],
)  # fmt: skip
def test_bad_jobs_are_refused(old, new, told, tmp_path, capsys):
    (tmp_path / "x.toml").write_text(JOB.replace(old, new))
    assert main(["branch", str(tmp_path / "x.toml"), "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert told in error and "x.toml" in error
    assert not (tmp_path / "out").exists()


def test_a_job_with_its_table_is_for_no_other_command(tmp_path, capsys):
    (tmp_path / "x.toml").write_text(JOB + RUNS)
    assert main(["run", str(tmp_path / "x.toml")]) == 2
    assert "found one for `cvt-hpc branch`" in capsys.readouterr().err


def test_check_tells_branches_runs_and_cost(tmp_path, capsys):
    (tmp_path / "x.toml").write_text(JOB + RUNS)
    assert main(["check", str(tmp_path / "x.toml"), "--set", "sheave_stiffness=1.5"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == f"diagram x ({tmp_path / 'x.toml'}): 1 branches of 3 loads"
    assert any(line.startswith("  load") and line.endswith(" N m  3 values") for line in lines)
    assert lines[-3].startswith("steady states: 3, ")
    # two starts at three loads, and two between each pair of the two in which vibration begins or ends
    assert lines[-2].startswith("runs: about 14, ")
    (tmp_path / "x.toml").write_text(JOB + "[branch]\ndisturbance = []\n")
    assert main(["check", str(tmp_path / "x.toml")]) == 0
    assert "runs: none" in capsys.readouterr().out
    (tmp_path / "x.toml").write_text(JOB)
    assert main(["check", str(tmp_path / "x.toml"), "--for", "branch"]) == 0
    assert capsys.readouterr().out.startswith("diagram x")


def test_runs_have_the_scene_of_their_branch(tmp_path):
    text = (
        JOB.replace("[mesh]", "sheave_stiffness = [1.0, inf]\n[mesh]")
        + '[judgement]\nband_low = "250 Hz"\n[branch]\nset = { seed = 7 }\n'
    )
    (tmp_path / "x.toml").write_text(text)
    diagram = load(tmp_path / "x.toml", ["friction_gradient=-1.0"])
    assert [branch.place for branch in diagram.branches] == [
        {"sheave_stiffness": 1.0},
        {"sheave_stiffness": np.inf},
    ]
    for branch in diagram.branches:
        runs = branch.runs.parameters
        assert (
            runs["sheave_stiffness"]
            == branch.parameters["sheave_stiffness"]
            == branch.place["sheave_stiffness"]
        )
        assert (runs["stations"], runs["friction_gradient"]) == (96, -1.0)
        assert (runs["band_low"], runs["seed"]) == (250.0, 7)


def test_the_job_of_this_repository_is_fit(request):
    diagram = load(request.config.rootpath / "jobs" / "branch.toml")
    assert diagram.job.name == "branch" and len(diagram.branches) == 9
