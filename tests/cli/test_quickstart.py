"""The first command of the README, in an environment that is installed already, with some of its runs, an eighth as long."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from cvt_hpc import open_results
from support.sweeps import environment, mpirun

ROOT = Path(__file__).parents[2]


@pytest.mark.slow
def test_quickstart_leaves_results_and_a_map(tmp_path):
    launcher, _, ranks = mpirun(2)
    for name in ("pyproject.toml", "tests/constraints.txt", "jobs/environment.sh", "jobs/quickstart.sh"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        shutil.copy(ROOT / name, tmp_path / name)
    job = (ROOT / "jobs" / "quickstart.toml").read_text()
    for text, shorter in (
        ('thrust = "50 kN"', 'thrust = "50 kN"\nrise_time = "10 ms"'),
        ('duration = "0.3 s"', 'duration = "0.04 s"\nlongest_duration = "0.04 s"\n[mesh]\nstations = 64'),
        ('step = "20 N m"', 'step = "80 N m"'),  # 30 runs of 90: each rank has a batch
    ):
        assert text in job
        job = job.replace(text, shorter)
    (tmp_path / "jobs" / "quickstart.toml").write_text(job)
    # what the script would install: its stamp says that nothing has changed since
    programs = tmp_path / ".venv" / "bin"
    programs.mkdir(parents=True)
    for name, line in (
        ("python", f'"{sys.executable}" "$@"'),
        ("cvt-hpc", f'"{sys.executable}" -m cvt_hpc "$@"'),
        ("mpirun", f'"{launcher}" "$@"'),
    ):
        (programs / name).write_text(f"#!/bin/sh\nexec {line}\n")
        (programs / name).chmod(0o755)
    stamp = "cat pyproject.toml tests/constraints.txt | cksum > .venv/installed-mpich"
    subprocess.run(stamp, shell=True, cwd=tmp_path, check=True)
    path = os.pathsep.join([str(ROOT), os.environ.get("PYTHONPATH", "")])
    done = subprocess.run(
        ["bash", "jobs/quickstart.sh"],
        cwd=tmp_path,
        env=environment(CVT_HPC_RANKS=ranks, PYTHONPATH=path),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert "Installing" not in done.stdout and "on 2 rank(s)" in done.stdout
    assert open_results(tmp_path / "out" / "quickstart").status.size == 30
    assert (tmp_path / "out" / "quickstart" / "map.png").read_bytes().startswith(b"\x89PNG")
