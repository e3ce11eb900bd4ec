"""A ladder whose reference is a pushbelt of rigid elements: its rungs, their cost, and what is refused."""

from pathlib import Path

import numpy as np
import pytest

from cvt_hpc.cli import main
from cvt_hpc.errors import InputError, UnitWarning
from cvt_hpc.experiments.ladder.loading import QUESTIONS, ladder, load, pushbelt_jobs
from cvt_hpc.job import build_job
from cvt_hpc.models.elastic_belt import inert
from cvt_hpc.models.pushbelt import inert as idle_in_pushbelt
from cvt_hpc.models.pushbelt.continuous import FOLLOWS
from cvt_hpc.models.pushbelt.parameters import local_compliance

JOBS = Path(__file__).parents[2] / "jobs"
DOCUMENT = {
    "name": "x",
    "model": "elastic_belt",
    "axes": {"sheave_stiffness": [1.0, 2.0, "inf"], "load": ["100 N m", "120 N m"]},
    "linked": {"sheave_stiffness": {"thrust": ["50 kN", "45 kN", "40 kN"]}},
    "derived": {"rise_time": "duration / 10"},
    "sheaves": {"stiffness_of": "sheave"},
    "friction": {"kinetic_friction": 0.11},
    "numerics": {"step": "4 us"},
    "run": {"duration": "0.2 s"},
    "vibration": {"band_high": "1200 Hz"},
}


def test_the_reference_is_the_same_scene_on_a_refined_pushbelt():
    rungs, _ = ladder(build_job(DOCUMENT, "x.toml"), {"elements": 208, "head_height": "5 mm"})
    assert [rung.name for rung in rungs[-3:]] == ["elastic_belt", "pushbelt", "reference"]
    belt, coarser, reference = (rung.job for rung in rungs[-3:])
    assert rungs[-2].answers == QUESTIONS and rungs[-1].answers == ()
    assert [job.model for job in (belt, coarser, reference)] == ["elastic_belt", "pushbelt", "pushbelt"]
    assert reference.axes == coarser.axes and [axis.name for axis in belt.axes] == [
        axis.name for axis in reference.axes
    ]
    for index in range(belt.size):
        points = [job.point(index) for job in (belt, coarser, reference)]
        for key in ("thrust", "load", "sheave_stiffness", "driven_radius", "rise_time", "kinetic_friction",
                    "element_mass", "friction_gradient", "duration", "band_high"):  # fmt: skip
            assert len({point[key] for point in points}) == 1, key
        changed = {key for key in points[1] if points[1][key] != points[2][key]}
        assert changed == {"elements", "step"}
    assert [points[k][key] for k in (1, 2) for key in ("elements", "step", "head_height")] == [
        208, 1e-5, 5e-3, 416, 5e-6, 5e-3,
    ]  # fmt: skip
    # local bending, of which rigid sheaves have none
    bending = np.array([local_compliance(reference.point(index)) for index in range(0, 6, 2)])
    assert bending / bending[0] == pytest.approx([1.0, 0.5, 0.0])


def test_the_spatial_pushbelt_beside_it_is_that_belt_with_both_sheaves_alike():
    asked = load(JOBS / "ladder_spatial.toml")
    assert [rung.name for rung in asked.rungs[-3:]] == ["spatial_pushbelt", "pushbelt", "reference"]
    spatial, planar = (rung.job for rung in asked.rungs[-3:-1])
    assert asked.rungs[-3].answers == QUESTIONS and spatial.axes == planar.axes
    for index in range(planar.size):
        here, there = spatial.point(index), planar.point(index)
        assert {key: here[key] for key in there} == there
        assert here["misalignment"] == 0.0
        assert here["driving_loose_side"] == here["driven_loose_side"] == "both"


def test_keys_without_effect_in_the_continuous_belt_are_not_handed_over():
    """Its driving thrust, which a held sheave does not feel, would let that of the pushbelt go."""
    job = build_job(DOCUMENT, "x.toml")
    pushbelt, _ = pushbelt_jobs(job, {})
    for index in range(job.size):
        here, there = job.point(index), pushbelt.point(index)
        idle = {*inert(here)} & there.keys()
        assert "driving_thrust" in idle
        assert idle <= {*FOLLOWS, *idle_in_pushbelt(there)}
    assert there["driving_thrust"] == 0.0


@pytest.mark.parametrize(
    ("changes", "settings", "message"),
    [
        ({"axes": {"disturbance": [1e-6, 1e-5], "load": [50]}, "linked": {}}, {},
         r"\[axes\] disturbance: expected a key of pushbelt"),
        ({"axes": {"ratio": [1.0, 2.0], "load": [50]}, "linked": {}}, {},
         r"\[axes\] ratio: expected one value, since driving_modal_stiffness of the pushbelt follows"),
        ({"axes": {"flank_stiffness": [1e10, 2e10], "load": [50]}, "linked": {}}, {},
         r"\[axes\] flank_stiffness: expected one value"),
        ({"sheaves": {"driving_position": "1 mm"}}, {},
         "driving_position: expected 0, since the pushbelt knows no other, found 0.001"),
        ({"friction": {"friction_law": "table", "table_force": [1e5, 2e5], "table_speed": [0.0, 1.0],
                       "table_mu": [[0.1, 0.1], [0.1, 0.1]]}}, {}, r"\[friction\] friction_law: expected one of"),
        ({"sheaves": {}}, {}, 'stiffness_of: expected "sheave", since sheave_stiffness scales all modes .*found disc'),
        ({"vibration": {"band_high": "1500 Hz"}}, {}, r"\[vibration\] band_high: expected at most 1393 Hz"),
        ({}, {"load": 30}, r"\[ladder\] set load: expected a key that the elastic belt does not know"),
        ({}, {"element": 104}, r"\[ladder\] set element: unknown key; did you mean elements"),
        ({}, {"elements": [208, 216]}, r"\[ladder\] set: expected one value for each key, found an axis"),
        ({}, {"elements": 10}, r"\[ladder\]: set elements: expected >= 32"),
    ],
)  # fmt: skip
def test_what_has_no_counterpart_is_refused_in_a_line(changes, settings, message):
    with pytest.raises(InputError, match=message) as error:
        ladder(build_job(DOCUMENT | changes, "x.toml"), settings)
    assert str(error.value).startswith("x.toml: ")


def test_a_setting_without_a_unit_that_is_far_from_usual_draws_a_warning():
    with pytest.warns(UnitWarning, match="head_height"):
        ladder(build_job(DOCUMENT, "x.toml"), {"head_height": 4})


@pytest.fixture
def job(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "job.toml"
    path.write_text((JOBS / "ladder_pushbelt.toml").read_text())
    return path


def test_its_cost_is_told_before_it_is_asked_for(job, capsys):
    assert main(["check", str(job)]) == 0  # by its table it is a job for `ladder`
    asked = capsys.readouterr().out.splitlines()
    rows = {line.split()[0]: line.split() for line in asked if line.startswith("  ")}
    assert rows["pushbelt"][1:4] == rows["reference"][1:4] == ["pushbelt", "36", "36"]
    # twice the elements at half the step, samples apart
    assert float(rows["reference"][4]) == pytest.approx(4.0 * float(rows["pushbelt"][4]), rel=0.2)
    assert "ladder.reference" not in asked[-1]
    assert main(["check", str(job), "--set", "ladder.reference=elastic_belt"]) == 0
    *plan, last = capsys.readouterr().out.splitlines()
    assert not any("pushbelt" in line.split()[:2] for line in plan)
    assert last.startswith("with --set ladder.reference=pushbelt: ") and "core-" in last and "more" in last
    assert (
        main(["check", str(job), "--set", "ladder.reference=elastic_belt", "--set", "band_high=1500 Hz"]) == 0
    )
    assert "refused, " in capsys.readouterr().out.splitlines()[-1]
    assert main(["run", str(job)]) == 2
    assert capsys.readouterr().err.endswith("expected a job of runs, found one for `cvt-hpc ladder`\n")


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            "[ladder]\nreference = 'strand'",
            "[ladder] reference: expected one of elastic_belt, pushbelt, found",
        ),
        ("[ladder]\nrefrence = 'pushbelt'", "[ladder] refrence: unknown key; did you mean reference?"),
        (
            "[ladder]\nset = { elements = 104 }",
            '[ladder] set: expected reference = "pushbelt", for which it is',
        ),
        (
            "[ladder]\nbeside = 'spatial_pushbelt'",
            '[ladder] beside: expected reference = "pushbelt", for which it is, found',
        ),
        ("[ladder]\nreference = 'pushbelt'\nset = 3", "[ladder] set: expected a table, found 3"),
    ],
)
def test_a_bad_table_is_told_in_a_line(job, table, message, capsys):
    job.write_text(job.read_text().split("[ladder]")[0] + table)
    assert main(["ladder", str(job)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"cvt-hpc: {job}: {message}") and error.count("\n") == 1
    assert not (job.parent / "out").exists()


def test_settings_of_the_command_line_replace_those_of_the_table(job):
    assert load(job).rungs[-1].job.parameters["elements"] == 432
    asked = load(job, ["ladder.set={elements = 108}", "load=[100, 120]", "band_high=600 Hz"])
    assert asked.rungs[-1].job.parameters["elements"] == 216
    assert asked.job.size == asked.rungs[-1].job.size == 6
