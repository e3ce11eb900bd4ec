"""Where numbers come from: the revision of this source, and of no other."""

import json
import platform
import runpy
import shutil
import subprocess
from pathlib import Path

import pytest

from cvt_hpc import read_table
from cvt_hpc.storage import provenance
from cvt_hpc.storage.provenance import machine, merge_versions, origin_lines, revision_of
from support.studies import study

ROOT = Path(__file__).parents[2]
TOLD = ("revision", "job", "command", "versions", "date", "machine")


def git(folder, *arguments):
    identity = ["-c", "user.name=a", "-c", "user.email=a@b"]
    done = subprocess.run(
        ["git", *identity, *arguments], cwd=folder, check=True, capture_output=True, text=True
    )
    return done.stdout.strip()


def test_revision_is_that_of_the_source(tmp_path):
    if shutil.which("git") is None:
        pytest.skip("git is not installed")
    source = tmp_path / "provenance.py"
    assert revision_of(source) == ""
    git(tmp_path, "init", "-q")
    source.write_text("first")
    git(tmp_path, "commit", "-q", "--allow-empty", "-m", "another program")
    assert revision_of(source) == ""  # only installed below another program's checkout
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "-q", "-m", "this program")
    git(tmp_path, "tag", "-m", "x", "v1")
    assert revision_of(source) == git(tmp_path, "rev-parse", "HEAD")
    source.write_text("second")
    assert revision_of(source) == git(tmp_path, "rev-parse", "HEAD") + "-dirty"


def test_no_revision_without_git(monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert revision_of(Path(provenance.__file__)) == ""


@pytest.mark.parametrize(("written", "told"), [("abc\n", "abc"), ("$Format:%H$\n", ""), (None, "")])
def test_the_revision_of_what_is_installed_is_the_one_that_was_written(written, told, tmp_path, monkeypatch):
    monkeypatch.setattr(provenance, "__file__", str(tmp_path / "provenance.py"))
    monkeypatch.setattr(provenance, "_PACKAGE", tmp_path)
    if written:
        (tmp_path / "revision.txt").write_text(written)
    assert provenance.git_revision.__wrapped__() == told


def test_versions_of_several_sessions_stand_side_by_side():
    found = [{"numpy": "2.0", "python": "3.11"}, {"numpy": "2.1", "python": "3.11"}, {"mpi4py": "4"}]
    assert merge_versions(found) == {"numpy": "2.0, 2.1", "python": "3.11", "mpi4py": "4"}


def test_command_has_no_folder_of_the_program(monkeypatch):
    monkeypatch.setattr("sys.argv", ["/home/me/.venv/bin/cvt-hpc", "run", "a job.toml"])
    assert provenance.command() == "cvt-hpc run 'a job.toml'"


def test_a_stored_table_is_read_as_a_dataset():
    dataset = read_table(ROOT / "jobs/results/lebrecht_2004.csv")
    assert dataset["status"].shape == (7, 4, 19)
    assert dataset["tilt_factor"].dims == ("sheave_stiffness",)  # linked to it
    assert dataset["amplitude"].attrs["units"] == "m" and dataset["core_seconds"].attrs["units"] == "s"
    assert dataset.cvt.strongest("amplitude").max() > 1e-5


def test_a_table_tells_the_origin_of_its_dataset_in_one_line_each():
    made = {
        "git_revision": "abc-dirty",
        "job_name": "x",
        "job_fingerprint": 64 * "f",
        "command": "cvt-hpc run x.toml --set 'a=[1,\n2]'",
        "versions": json.dumps({"numpy": "2.0, 2.1"}),
        "history": "2026-01-30T01:00:00Z: began\n2026-01-31T01:00:00Z: ended",
        "host": platform.node(),
    }
    *lines, of_machine = origin_lines(made)
    assert lines == [
        "# revision: abc-dirty\n",
        "# job: x, fingerprint ffffffffffffffff\n",
        "# command: cvt-hpc run x.toml --set 'a=[1, 2]'\n",
        "# versions: numpy 2.0, 2.1\n",
        "# date: 2026-01-31\n",
    ]
    assert f"{machine()['cores']} cores, 2e6 turns of s += i * i take " in of_machine


def test_the_speed_of_this_machine_is_not_told_of_another():
    other = {"processor": "Abacus", "cores": 3}
    assert list(origin_lines({"host": "other"}))[-1] == "# machine: not recorded\n"
    for machines in (other, [other]):
        made = {"host": platform.node(), "machine": json.dumps(machines)}
        assert list(origin_lines(made))[-1] == "# machine: Abacus, 3 cores\n"
    assert [line.split(":")[0] for line in origin_lines()] == [f"# {name}" for name in TOLD]


def test_the_table_of_a_study_is_read_with_its_origin(tmp_path, monkeypatch):
    made = study().assign_attrs(git_revision="abc", job_name="x")
    made["core_seconds"] = made["status"].astype(float)
    made.to_netcdf(tmp_path / "results.nc")
    table = tmp_path / "table.csv"
    monkeypatch.setattr("sys.argv", ["tabulate.py", str(tmp_path / "results.nc"), str(table), "amplitude"])
    runpy.run_path(str(ROOT / "jobs" / "tabulate.py"), run_name="__main__")
    assert table.read_text().startswith("# revision: abc\n# job: x\n")
    assert read_table(table)["status"].equals(made["status"])
