"""The folder of a diagram: whose it is, what an interruption leaves, and how failed runs are told of. Branches are made up."""

import multiprocessing
import os
import shutil
import signal

import pytest
import xarray as xr

from cvt_hpc.cli import main
from cvt_hpc.experiments.branch import diagram
from cvt_hpc.experiments.branch.attractors import Attractor, Followed, Stability, states_of
from cvt_hpc.models.linear_stability.branch import Branch
from cvt_hpc.storage.locks import locked
from cvt_hpc.vibration.classes import OccurrenceClass

JOB = """
name = "x"
model = "linear_stability"
[axes]
friction_gradient = ["-1.0 s/m", "-0.8 s/m"]
load = ["90 N m", "105 N m"]
"""


@pytest.fixture
def branch(tmp_path, monkeypatch):
    """The command, on branches without any steady state, whose runs end as `classes` says.

    `end` is called where the second one is to be followed; `branch.followed` lists those that were. Pictures take most of the time: they are files without content unless `drawn`.
    """
    (tmp_path / "x.toml").write_text(JOB)
    followed = []

    def command(*options, classes=(OccurrenceClass.QUIET,) * 2, end=None, drawn=False):
        left = iter(classes)

        def follow(diagram, asked):
            kind = next(left)
            run = Attractor(90.0, 1, kind, 0.0, 0.0, "slips")
            if end is not None and asked is not diagram.branches[0]:
                end()
            followed.append(diagram.branches.index(asked))
            none = Branch([], dict.fromkeys(diagram.loads, "none"))
            return Followed(asked, states_of(none, None, diagram.loads), [], [], [run], [])

        with monkeypatch.context() as patch:
            patch.setattr(diagram, "_follow", follow)
            if not drawn:
                patch.setattr(diagram, "draw", lambda figure, out: out.touch())
            return main(["branch", str(tmp_path / "x.toml"), "--out", str(tmp_path / "out"), *options])

    command.followed = followed
    return command


def interrupt():
    raise KeyboardInterrupt


def names(folder):
    return sorted(path.name for path in folder.iterdir() if path.name != ".branch.lock")


def stability(folder):
    with xr.open_dataset(folder / "branch.nc") as dataset:
        return dataset["stability"].values.tolist()


def test_another_job_is_refused_and_fresh_leaves_none_of_its_pictures(branch, tmp_path, capsys):
    out = tmp_path / "out"
    assert branch() == 0
    (out / "branch_notes.png").write_text("mine")
    assert names(out) == [
        "branch.json", "branch.nc", "branch_1.png", "branch_2.png", "branch_notes.png", "branches",
    ]  # fmt: skip
    assert names(out / "branches") == ["branch_1.npz", "branch_2.npz"]
    before = (out / "branch.nc").read_bytes()
    assert branch("--set", "friction_gradient=-0.6") == 2
    error = capsys.readouterr().err
    assert (
        "expected the folder of this job, found that of another (" in error
        and "friction_gradient is" in error
        and "--fresh" in error
    )
    assert (out / "branch.nc").read_bytes() == before
    assert branch("--set", "friction_gradient=-0.6", "--fresh") == 0
    assert names(out) == ["branch.json", "branch.nc", "branch.png", "branch_notes.png", "branches"]
    assert names(out / "branches") == ["branch_1.npz"]
    (tmp_path / "x.toml").write_text(JOB + "[branch]\nresolution = 2\n")
    assert branch("--set", "friction_gradient=-0.6") == 2
    assert "branch.resolution is 1.0 there, 2.0 here" in capsys.readouterr().err
    (tmp_path / "x.toml").write_text(JOB.replace('"x"', '"y"'))
    assert branch("--set", "friction_gradient=-0.6") == 0  # the name is without effect on any number


def test_a_diagram_goes_on_where_it_was_killed_between_two_branches(branch, tmp_path, capfd):
    process = multiprocessing.get_context("fork").Process(
        target=branch, kwargs={"end": lambda: os.kill(os.getpid(), signal.SIGKILL)}
    )
    process.start()
    process.join()
    assert process.exitcode == -signal.SIGKILL
    assert stability(tmp_path / "out") == [[Stability.NOT_FOUND] * 2, [Stability.NOT_COMPUTED] * 2]
    assert branch() == 0
    assert branch.followed == [1]
    assert "cvt-hpc: 2/2 branches: 0 Hopf points" in capfd.readouterr().err
    assert stability(tmp_path / "out") == [[Stability.NOT_FOUND] * 2] * 2
    with xr.open_dataset(tmp_path / "out" / "branch.nc") as dataset:
        assert dataset["run_branch"].values.tolist() == [0, 1]
    assert branch() == 0
    assert branch.followed == [1]
    assert branch("--fresh", end=interrupt) == 130
    assert branch.followed == [1, 0]
    assert stability(tmp_path / "out") == [[Stability.NOT_FOUND] * 2, [Stability.NOT_COMPUTED] * 2]


def test_a_damaged_branch_is_named_and_followed_again(branch, tmp_path, caplog):
    assert branch() == 0
    kept = tmp_path / "out" / "branches"
    whole = {name: (kept / name).read_bytes() for name in names(kept)}
    for damaged in (whole["branch_1.npz"][:-1], b"", b"mine"):
        (kept / "branch_1.npz").write_bytes(damaged)
        branch.followed.clear()
        assert branch() == 0
        assert branch.followed == [0] and "branch_1.npz: damaged (" in caplog.text
        assert {name: (kept / name).read_bytes() for name in names(kept)} == whole
        caplog.clear()
    # of as many runs, but along other loads
    (tmp_path / "x.toml").write_text(JOB.replace("105", "104"))
    assert branch("--out", str(tmp_path / "other")) == 0
    shutil.copy(tmp_path / "other" / "branches" / "branch_1.npz", kept)
    (tmp_path / "x.toml").write_text(JOB)
    branch.followed.clear()
    assert branch() == 0
    assert branch.followed == [0] and "branch_1.npz: damaged (of another job)" in caplog.text


def test_without_its_other_files_a_diagram_is_known_by_its_branches(branch, tmp_path, capsys):
    assert branch() == 0
    for name in ("branch.json", "branch.nc"):
        (tmp_path / "out" / name).unlink()
    assert branch("--set", "friction_gradient=-0.6") == 2
    assert "found branches without a branch.json" in capsys.readouterr().err
    branch.followed.clear()
    assert branch() == 0
    assert branch.followed == [] and stability(tmp_path / "out") == [[Stability.NOT_FOUND] * 2] * 2


def test_failed_runs_are_named_and_make_the_exit_status(branch, tmp_path, capsys):
    assert branch(classes=(OccurrenceClass.QUIET, OccurrenceClass.FAILED), drawn=True) == 1
    told = capsys.readouterr()
    place = "friction gradient -0.8 s/m, sheave stiffness 1"
    assert f"{place}: the run from the large start at 90 N m failed: slips" in told.err
    assert "friction gradient -1 s/m: the run" not in told.err
    assert "branch_2.png" in told.out
    with xr.open_dataset(tmp_path / "out" / "branch.nc") as dataset:
        assert dataset["run_reason"].values.tolist() == ["slips", "slips"]
        assert dataset["run_occurrence"].values.tolist() == [OccurrenceClass.QUIET, OccurrenceClass.FAILED]


@pytest.mark.parametrize("key", ["disturbance", "resolution", "branch.resolution", "set"])
def test_keys_of_the_table_branch_are_not_set_on_the_command_line(key, branch, tmp_path, capsys):
    assert branch("--set", f"{key}=-1") == 2
    told = f"--set {key}: expected a parameter or an axis, found a key of [branch]"
    assert told in capsys.readouterr().err and not (tmp_path / "out").exists()


def test_one_process_at_a_time_and_no_lock_through_a_link(branch, tmp_path, capsys):
    out = tmp_path / "out"
    assert branch() == 0
    with locked(out / ".branch.lock"):
        assert branch() == 2
    assert "expected a folder that no run is at work in, found process" in capsys.readouterr().err
    (tmp_path / "mine").write_text("mine")
    (out / ".branch.lock").unlink()
    (out / ".branch.lock").symlink_to(tmp_path / "mine")
    assert branch() == 2
    assert ".branch.lock: expected a file, found a link; remove it" in capsys.readouterr().err
    assert branch("--fresh") == 0
    assert (tmp_path / "mine").read_text() == "mine"


def test_a_changed_job_file_is_mended_by_its_own_job_alone(branch, tmp_path, capsys):
    assert branch() == 0
    path = tmp_path / "out" / "branch.json"
    whole = path.read_text()
    path.write_text(whole.replace("105.0", "104.0"))
    assert path.read_text() != whole
    assert branch("--set", "friction_gradient=-0.6") == 2
    assert "does not fit its checksum" in capsys.readouterr().err
    assert branch() == 0
    assert path.read_text() == whole


def test_a_damaged_dataset_is_written_again(branch, tmp_path):
    assert branch() == 0
    (tmp_path / "out" / "branch.nc").write_text("damaged")
    assert branch() == 0
    assert stability(tmp_path / "out") == [[Stability.NOT_FOUND] * 2] * 2


@pytest.mark.parametrize("name", ["branch.nc", "branch_2.png"])
def test_files_of_somebody_else_are_left_alone(branch, tmp_path, capsys, name):
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / name).write_text("mine")
    for options in ([], ["--fresh"]):
        assert branch(*options) == 2
        assert f"found {name} without a branch.json; choose another --out" in capsys.readouterr().err
    assert [(path.name, path.read_text()) for path in (tmp_path / "out").iterdir()] == [(name, "mine")]
