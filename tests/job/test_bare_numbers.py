"""Numbers far from usual without a unit draw a warning, in Python and in the commands."""

import tomllib
import warnings
from pathlib import Path

import numpy as np
import pytest

from cvt_hpc import models
from cvt_hpc.cli import main
from cvt_hpc.errors import JobWarning, NoEffectWarning, UnitWarning
from cvt_hpc.experiments.branch import load as load_diagram
from cvt_hpc.experiments.chart import load as load_chart
from cvt_hpc.experiments.fit import load as load_fit
from cvt_hpc.experiments.ladder import load as load_ladder
from cvt_hpc.job import build_job, load_job, rebuild_job
from cvt_hpc.job.values import warn_of_bare_numbers
from cvt_hpc.parameters import Parameter

SPEED = Parameter(300.0, "rad/s", "", sensible=(1.0, 800.0))
LENGTH = Parameter(0.1, "m", "", sensible=(1e-3, 1.0), allow_infinite=True)
FORCE = Parameter(1.0, "N", "")


JOBS = Path(models.__file__).parents[2] / "jobs"


def warned(call, *arguments, **more):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call(*arguments, **more)
    assert {one.category for one in caught} <= {JobWarning, NoEffectWarning, UnitWarning}
    return [str(one.message) for one in caught]


@pytest.mark.parametrize(
    ("parameter", "raw", "told"),
    [
        (SPEED, 3000, '3000 is read as 3000 rad/s, far from the usual 1 to 800 rad/s; write "3000 rpm" if that is meant, or "3000 rad/s"'),
        (SPEED, "3000", '3000 is read as 3000 rad/s, far from the usual 1 to 800 rad/s; write "3000 rpm" if that is meant, or "3000 rad/s"'),
        (SPEED, -1e6, '-1000000.0 is read as -1000000.0 rad/s, far from the usual 1 to 800 rad/s; if that is meant write "-1000000.0 rad/s"'),
        (LENGTH, 20, '20 is read as 20 m, far from the usual 0.001 to 1 m; write "20 mm" if that is meant, or "20 m"'),
        (LENGTH, 1e3, '1000.0 is read as 1000.0 m, far from the usual 0.001 to 1 m; write "1000.0 mm" or "1000.0 um" if that is meant, or "1000.0 m"'),
        (SPEED, [1.5, [2, 900.0], 5000], '900.0 is read as 900.0 rad/s, far from the usual 1 to 800 rad/s; write "900.0 rpm" if that is meant, or "900.0 rad/s"'),
        (SPEED, {"from": 10, "to": "900", "step": 1e4}, '900 is read as 900 rad/s, far from the usual 1 to 800 rad/s; write "900 rpm" if that is meant, or "900 rad/s"'),
        (SPEED, np.array([1, 900]), '900 is read as 900 rad/s, far from the usual 1 to 800 rad/s; write "900 rpm" if that is meant, or "900 rad/s"'),
    ],
)  # fmt: skip
def test_what_is_meant_is_guessed_by_the_units_that_would_be_usual(parameter, raw, told):
    assert warned(warn_of_bare_numbers, parameter, raw, "x") == [f"x: {told}"]


@pytest.mark.parametrize(
    ("parameter", "raw"),
    [
        (SPEED, 800.0),
        (SPEED, 0),
        (SPEED, -300),
        (SPEED, "9000 rad/s"),
        (SPEED, ["9000 rpm", 1]),
        (SPEED, {"from": 1, "to": 2, "step": 0.01}),
        (LENGTH, float("inf")),
        (SPEED, True),
        (SPEED, "much"),
        (FORCE, 1e99),
    ],
)
def test_what_is_usual_or_has_its_unit_draws_none(parameter, raw):
    assert warned(warn_of_bare_numbers, parameter, raw, "x") == []


def test_every_place_of_a_job_is_looked_at_and_what_counts_most_is_told(write_job):
    tables = "[scene]\nthrust = 2e4\ndriving_speed = 3000\n"
    meant = 'read as 3000 rad/s, far from the usual 1 to 800 rad/s; write "3000 rpm" if that is meant, or "3000 rad/s"'
    assert warned(load_job, write_job(tables)) == [f"x.toml: [scene] driving_speed: 3000 is {meant}"]
    assert warned(load_job, "x.toml", ["driving_speed=3000 rpm"]) == []
    assert warned(load_job, "x.toml", ["driving_speed=[3000, 2]"]) == [
        f"x.toml: --set driving_speed: 3000 is {meant}"
    ]
    axis = {"driving_speed": [3000]}
    document = {"name": "x", "model": "toy", "scene": {"thrust": 2e4}, "axes": axis}
    assert warned(build_job, document) == [f"build_job: [axes] driving_speed: 3000 is {meant}"]
    linked = {"linked": {"ratio": {"driving_speed": [3000]}}, "axes": {"ratio": [1]}}
    assert warned(build_job, document | linked) == [
        f"build_job: [linked.ratio] driving_speed: 3000 is {meant}"
    ]
    # a number that is an SI value of another job is what it is
    assert warned(rebuild_job, document, "x", {}) == []


def test_commands_say_it_once_on_stderr(write_job, capsys):
    write_job("[scene]\nthrust = 2e4\ndriving_speed = [3000]\n".replace("driving", "[axes]\ndriving"))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a warning that Python would not show is none that a command hides
        main(["check", "x.toml"])
    told = [line for line in capsys.readouterr().err.splitlines() if "warning" in line]
    assert len(told) == 1
    assert told[0].startswith("cvt-hpc: warning: x.toml: [axes] driving_speed: 3000 is read as 3000 rad/s")


def test_jobs_of_other_commands_that_are_shipped_draw_none():
    """Those of runs are checked by tests/sweep/test_jobs.py."""
    loads = {"chart": load_chart, "branch": load_diagram, "ladder": load_ladder, "fit": load_fit}
    loaded = set()
    for path in sorted(JOBS.glob("*.toml")):
        for table in loads.keys() & tomllib.loads(path.read_text()).keys():
            assert warned(loads[table], path) == []
            loaded.add(table)
    assert loaded == loads.keys()


def test_values_without_effect_draw_one_line_and_defaults_none():
    """Files and lists without effect are an error: see `test_friction_files`."""
    friction = {"friction_gradient": "0 s/m", "stribeck_velocity": "0.2 m/s", "kinetic_friction": 0.1}
    document = {
        "name": "x",
        "model": "elastic_belt",
        "friction": friction,
        "scene": {"seed": 7, "disturbance": 0},
    }
    (told,) = warned(build_job, document, "x.toml")
    assert told == (
        "x.toml: without effect on all runs: seed (with disturbance 0), stribeck_velocity (with friction_gradient 0)"
    )
    assert not warned(
        build_job, document | {"axes": {"friction_gradient": [-1.0, 0.0], "disturbance": ["0 m", "1 nm"]}}
    )
    friction["stribeck_velocity"], document["scene"]["seed"] = "0.05 m/s", 1
    assert not warned(build_job, document)
    assert not warned(rebuild_job, build_job(document).resolved(), "x", {}, {"seed": 7})
