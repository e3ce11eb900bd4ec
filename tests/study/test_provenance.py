"""Where numbers come from: the revision of this source, and of no other."""

import shutil
import subprocess
from pathlib import Path

import pytest

from cvt_hpc import provenance
from cvt_hpc.provenance import merge_versions, revision_of


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


def test_versions_of_several_sessions_stand_side_by_side():
    found = [{"numpy": "2.0", "python": "3.11"}, {"numpy": "2.1", "python": "3.11"}, {"mpi4py": "4"}]
    assert merge_versions(found) == {"numpy": "2.0, 2.1", "python": "3.11", "mpi4py": "4"}


def test_command_has_no_folder_of_the_program(monkeypatch):
    monkeypatch.setattr("sys.argv", ["/home/me/.venv/bin/cvt-hpc", "run", "a job.toml"])
    assert provenance.command() == "cvt-hpc run 'a job.toml'"
