"""The jobs of this repository: each can be run as it lies there."""

import tomllib
from pathlib import Path

import pytest

from cvt_hpc import simulation
from cvt_hpc.cli import main
from cvt_hpc.experiment_kinds import with_table
from cvt_hpc.job import build_job, load_job
from cvt_hpc.study.description import describe

FOLDER = Path(__file__).parents[2] / "jobs"
JOBS = [
    path
    for path in sorted(FOLDER.glob("*.toml"))
    if not set(with_table()) & tomllib.loads(path.read_text()).keys()
]


def test_there_are_jobs():
    assert "quickstart" in [path.stem for path in JOBS]


@pytest.mark.parametrize("path", JOBS, ids=lambda path: path.stem)
def test_a_job_is_fit_to_be_run(path, capsys, monkeypatch):
    loaded = []  # once, as that of a large grid takes a while
    monkeypatch.setattr("cvt_hpc.job.load_job", lambda *given: loaded.append(load_job(*given)) or loaded[-1])
    assert main(["check", str(path)]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    (job,) = loaded
    most = "at most " if "first_spacing" in job.design else ""
    assert f"runs: {most}{job.size}" in printed.out
    assert any(line.startswith("estimated cost: ") and "core-" in line for line in printed.out.splitlines())
    # results go where the file's name says
    assert job.name == path.stem
    # the rules declare all that their values follow from
    point = job.point(0)
    assert all(rule.read(point) <= {*rule.needs} for rule in job.rules)
    # the sweep takes it, too: its dataset can hold axes and recorded quantities under their names
    study = describe(job, simulation)
    assert study.size == job.size
    assert study.description


def test_the_scene_of_reference_is_that_of_the_defaults():
    job, plain = load_job(FOLDER / "lebrecht_2004.toml"), build_job({"name": "x", "model": "elastic_belt"})
    own = {
        "load",
        "friction_gradient",
        "duration",
        "shortest_duration",
    }  # axes at their first values, and the run
    assert {key for key, value in job.parameters.items() if value != plain.parameters[key]} == own
