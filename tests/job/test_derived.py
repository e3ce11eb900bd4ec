"""Parameters that follow from others, in a job of the toy model: [derived] and [linked.AXIS]."""

import json
import pickle
import sys

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, crosscheck, load_job
from cvt_hpc.job.formula import Formula
from cvt_hpc.job.summary import summarize
from cvt_hpc.models import MODELS

JOB = """
[scene]
driving_speed = 100
[belt]
element_mass = 0.5
[derived]
load = "0.001 * thrust * ratio"
half_wedge_angle = "2 * element_mass / 10"
[axes]
ratio = [0.5, 1.0, 2.0]
sheave_stiffness = [1, inf]
[linked.ratio]
thrust = ["20 kN", "10 kN", "20 kN"]
load_history = ["ramp", "ramp", "constant"]
"""


def refusal(text, overrides=()):
    with pytest.raises(InputError) as caught:
        load_job(text, overrides)
    return str(caught.value).removeprefix("x.toml: ")


def test_a_job_with_what_follows_goes_to_other_processes(write_job):
    job = load_job(write_job(JOB))
    other = pickle.loads(pickle.dumps(job))
    assert other == job and [d.values for d in other.derived] == [d.values for d in job.derived]


@pytest.mark.parametrize("model", MODELS)
def test_a_job_of_each_model_goes_to_other_processes_with_its_declarations_read(model):
    job = build_job({"name": "x", "model": model})
    assert job.schema.parameters
    assert pickle.loads(pickle.dumps(job)) == job


def test_each_run_has_what_follows_from_its_values(write_job):
    job = load_job(write_job(JOB))
    assert job.shape == (3, 2)
    found = [
        [job.point(i)[key] for key in ("ratio", "thrust", "load", "load_history")] for i in range(0, 6, 2)
    ]
    assert found == [[0.5, 20e3, 10.0, "ramp"], [1.0, 10e3, 10.0, "ramp"], [2.0, 20e3, 40.0, "constant"]]
    assert all(job.point(i) == {**job.point(i + 1), "sheave_stiffness": 1.0} for i in range(0, 6, 2))
    assert job.point(0)["half_wedge_angle"] == 0.1
    assert job.point(0) == job.parameters
    assert list(job.parameters) == list(job.schema.parameters)


def test_what_is_linked_to_an_axis_follows_the_values_that_an_override_leaves(write_job):
    job = load_job(write_job(JOB), ["ratio=[2, 0.5]"])
    found = [[job.point(i)[key] for key in ("ratio", "thrust", "load_history")] for i in range(0, 4, 2)]
    assert found == [[2.0, 20e3, "constant"], [0.5, 20e3, "ramp"]]
    assert build_job(json.loads(json.dumps(job.resolved())), "x.toml") == job
    told = "[linked.ratio] thrust: expected a value of ratio that it is linked to (0.5, 1, 2), found 3"
    assert refusal("x.toml", ["ratio=[2, 3]"]) == told
    # an axis in the place of a formula
    assert "load" not in {rule.key for rule in load_job("x.toml", ["load=[1, 2]"]).rules}


def test_what_varies_is_told_along_its_axes_alone(write_job):
    job = load_job(write_job(JOB))
    told = {one.name: (one.axes, one.values, one.unit, one.words) for one in job.derived}
    assert told == {
        "thrust": (("ratio",), (20e3, 10e3, 20e3), "N", "linked to ratio"),
        "load_history": (("ratio",), ("ramp", "ramp", "constant"), "", "linked to ratio"),
        "load": (("ratio",), (10.0, 10.0, 40.0), "N m", "0.001 * thrust * ratio"),
    }


def test_what_follows_from_two_axes_varies_with_both_in_the_jobs_order(write_job):
    text = '[scene]\nthrust = 2e4\n[derived]\nload = "ratio + element_mass"\n[axes]\n'
    job = load_job(write_job(text + "ratio = [1, 2]\nload_history = ['ramp']\nelement_mass = [10, 20, 30]\n"))
    (derived,) = job.derived
    assert (derived.axes, derived.values) == (("ratio", "element_mass"), (11, 21, 31, 12, 22, 32))
    assert [job.point(i)["load"] for i in range(6)] == list(derived.values)


def test_a_resolved_job_has_its_rules_and_builds_the_same_job(write_job):
    job = load_job(write_job(JOB))
    resolved = json.loads(json.dumps(job.resolved(), allow_nan=False))
    assert resolved["derived"] == {
        "load": "0.001 * thrust * ratio",
        "half_wedge_angle": "2 * element_mass / 10",
    }
    assert resolved["linked"] == {
        "ratio": {"thrust": [20e3, 10e3, 20e3], "load_history": ["ramp", "ramp", "constant"]}
    }
    assert not {"load", "thrust", "load_history"} & resolved["scene"].keys()
    again = build_job(resolved, "x.toml")
    assert again == job
    assert again.fingerprint() == job.fingerprint()


@pytest.mark.parametrize(
    ("old", "new"),
    [("0.001 * thrust", "0.002 * thrust"), ('"10 kN"', '"11 kN"'), ("element_mass / 10", "0.1")],
)
def test_rules_are_part_of_what_determines_the_numbers(write_job, old, new):
    assert old in JOB
    before = load_job(write_job(JOB)).fingerprint()
    assert load_job(write_job(JOB.replace(old, new))).fingerprint() != before


def test_a_job_without_rules_is_resolved_as_ever(write_job):
    job = load_job(write_job())
    assert (job.rules, job.derived) == ((), ())
    assert not {"derived", "linked"} & job.resolved().keys()


def test_an_override_counts_more_than_a_rule(write_job):
    job = load_job(write_job(JOB), ["load=3", "thrust=9000"])
    assert {job.point(i)["load"] for i in range(6)} == {3.0}
    assert [rule.key for rule in job.rules] == ["load_history", "half_wedge_angle"]
    assert job.given >= {"load", "thrust"}


def test_an_axis_that_is_replaced_leaves_what_is_linked_to_its_value(write_job):
    job = load_job(write_job(JOB), ["ratio=2"])
    assert [axis.name for axis in job.axes] == ["sheave_stiffness"]
    assert (job.point(0)["thrust"], job.point(0)["load"], job.point(0)["load_history"]) == (
        20e3,
        40.0,
        "constant",
    )
    assert "linked" not in job.resolved()
    assert build_job(job.resolved(), "x.toml").fingerprint() == job.fingerprint()
    assert refusal("x.toml", ["ratio=1.5"]) == (
        "[linked.ratio] thrust: expected a value of ratio that it is linked to (0.5, 1, 2), found 1.5"
    )


def test_a_run_at_chosen_values_has_what_follows_from_them(write_job):
    job = load_job(write_job(JOB))
    assert job.point_at({"ratio": 2, "sheave_stiffness": "inf"}) == job.point(5)
    assert job.point_at({"ratio": 2, "thrust": "30 kN"})["load"] == 60.0
    off = job.point_at({"ratio": 1.5, "thrust": 1e4, "load_history": "ramp", "load": 7})
    assert (off["load"], off["half_wedge_angle"]) == (7.0, 0.1)
    for index in range(job.size):  # a whole run, as its history names it
        assert job.point_at(job.point(index)) == job.point(index)
    with pytest.raises(InputError) as caught:
        job.point_at(["ratio=1.5"], "--at")
    assert str(caught.value) == (
        "x.toml: [linked.ratio] thrust: expected a value of ratio that it is linked to (0.5, 1, 2), found 1.5 "
        "(at ratio = 1.5)"
    )


def test_samples_have_what_follows_from_them(write_job):
    text = """
[scene]
thrust = "20 kN"
[design]
kind = "sobol"
runs = 8
[axes]
ratio = { from = 1, to = 2 }
[derived]
load = "10 * ratio"
"""
    job = load_job(write_job(text))
    (derived,) = job.derived
    assert derived.values == tuple(10.0 * ratio for ratio in job.axes[0].values)
    assert [job.point(i)["load"] for i in range(8)] == list(derived.values)
    assert build_job(job.resolved(), "x.toml") == job
    message = refusal(write_job(text + "[linked.ratio]\ndriving_speed = [1, 2]\n"))
    assert message.startswith(
        "[linked]: expected a grid, since samples have no values to be linked to; a formula"
    )


def test_a_trace_has_what_follows_from_its_axes(write_job):
    text = '[scene]\nthrust = 2e4\n[design]\nkind = "trace"\n[derived]\nload = "10 * ratio"\n[axes]\n'
    job = load_job(write_job(text + "ratio = { from = 1, to = 9, step = 1 }\n"))
    assert job.design["first_spacing"] == {"ratio": 4}
    assert [job.point(i)["load"] for i in (0, 8)] == [10.0, 90.0]


def test_a_check_shows_what_follows_from_what(write_job):
    told = [" ".join(line.split()) for line in summarize(load_job(write_job(JOB)), 2.0).splitlines()]
    assert "load see [derived] derived torque at the driving pulley" in told
    table = told[told.index("[derived]") + 1 :][:4]
    assert [" ".join(line.split()) for line in sorted(table)] == [
        "half_wedge_angle 0.1 rad 2 * element_mass / 10 the same in all runs",
        "load 10 to 40 N m 0.001 * thrust * ratio varies with ratio",
        "load_history ramp, constant linked to ratio varies with ratio",
        "thrust 10 to 20 kN linked to ratio varies with ratio",
    ]


def test_values_that_follow_are_checked_at_each_place(write_job, monkeypatch):
    message = refusal(write_job(JOB.replace("2 * element_mass / 10", "ratio - 0.6")))
    assert (
        message
        == "[derived] half_wedge_angle: expected >= 0 and <= 1 rad, found -0.09999999999999998 (at ratio = 0.5)"
    )
    # what lies between the extremes of a huge grid, too: of three values along the axis with which it varies
    monkeypatch.setattr(crosscheck, "MOST_CHECKED_POINTS", 1)
    monkeypatch.setattr(crosscheck, "MOST_CHECKED_VALUES", 3)
    message = refusal(
        write_job(JOB.replace("2 * element_mass / 10", "abs(ratio - 1) + 0.01 * log(abs(ratio - 1))"))
    )
    assert message == (
        '[derived] half_wedge_angle: expected a finite value, found "abs(ratio - 1) + 0.01 * log(abs(ratio - 1))" '
        "(math domain error) (at ratio = 1)"
    )
    monkeypatch.undo()


HUGE = """
[scene]
thrust = "20 kN"
[derived]
half_wedge_angle = "{}"
[axes]
ratio = {{ from = 1, to = 2, count = 400 }}
driving_speed = {{ from = 1, to = 250, count = 250 }}
friction_gradient = {{ from = -1, to = 0, count = 100 }}
"""


def test_of_a_huge_grid_few_values_are_evaluated_before_its_runs(write_job, monkeypatch):
    evaluated = []
    value = Formula.value
    monkeypatch.setattr(Formula, "value", lambda *given: evaluated.append(1) or value(*given))
    formula = "0.3 + 1e-4 * ratio * driving_speed * friction_gradient"
    job = load_job(write_job(HUGE.format(formula)))
    told = summarize(job, 2.0)
    assert job.size == 10_000_000
    # some 10 us each: a tenth of a second
    assert 0 < len(evaluated) < 10_000
    assert "half_wedge_angle  0.25 to 0.3 rad" in told
    assert "varies with ratio, driving_speed, friction_gradient" in told
    # a single value, in the middle of all axes: told of when the runs begin, with its place
    hidden = "0.1 + 2 * max(0, 1 - 1e3 * abs(ratio - 1.5) - abs(driving_speed - 126) - abs(friction_gradient + 0.5))"
    few = HUGE.replace("count = 100", "count = 3").replace("count = 400", "count = 41")
    job = load_job(write_job(few.format(hidden)))
    assert job.size == 41 * 250 * 3
    with pytest.raises(
        InputError, match=r"half_wedge_angle: expected >= 0 and <= 1 rad, found .* \(at ratio = 1.5,"
    ):
        _ = job.derived[0].values


def test_checks_between_parameters_see_what_follows(write_job):
    message = refusal(write_job(JOB.replace("0.001", "0.02")))
    assert message == (
        "[scene] load: expected at most 100 N m at this thrust, found 200 N m (at ratio = 1, sheave_stiffness = 1)"
    )


def test_an_axis_is_of_effect_as_far_as_what_follows_from_it(write_job, monkeypatch):
    inert = {"label": "always", "ratio": "always", "driving_speed": "always"}
    monkeypatch.setattr(sys.modules["toy_model"], "inert", lambda parameters: inert, raising=False)
    text = '[scene]\nthrust = 2e4\n[axes]\nratio = [1, 2]\n[derived]\n{} = "10 * ratio"\n'
    assert load_job(write_job(text.format("load"))).size == 2
    for idle in ('driving_speed = "10 * ratio"', 'driving_speed = "3"'):
        message = refusal(write_job(text.replace('{} = "10 * ratio"', idle)))
        assert (
            message == "[axes] ratio: expected one value, since it has no effect with always, found 2 values"
        )


def test_a_rule_of_a_whole_number_has_to_give_one(write_job):
    text = '[scene]\nthrust = 2e4\n[derived]\nstations = "round(100.3 * ratio)"\n'
    assert load_job(write_job(text)).parameters["stations"] == 251
    message = refusal(write_job(text.replace("round(100.3 * ratio)", "100.3 * ratio")))
    assert message == "[derived] stations: expected a whole number, found 250.75"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("load = ", "laod = ", "[derived] laod: unknown key; did you mean load in [scene]?"),
        ("load = ", "label = ", "[derived] label: expected a parameter that is a number, found label"),
        ("* thrust *", "* thrsut *", '[derived] load: unknown name "thrsut"; did you mean thrust?'),
        ("element_mass / 10", "load", "[derived] half_wedge_angle: expected >= 0 and <= 1 rad, found 20.0 (at ratio = 0.5)"),
        ("thrust * ratio", "load", "[derived] load: expected formulas without a circle, found load -> load"),
        ("thrust * ratio", "half_wedge_angle\"\ndriving_speed = \"load", "[derived] driving_speed: expected one source of its values, found a second one of driving_speed"),
        ("element_mass / 10", "load\"\ntable = \"2", "[derived] table: expected a parameter that is a number, found table"),
        ("ratio = [0.5,", "load = [1, 2]\nratio = [0.5,", "[derived] load: expected one source of its values, found a second one of load"),
        ("[linked.ratio]", "[linked.raito]", "[linked.raito]: unknown axis; did you mean ratio?"),
        ("[linked.ratio]", "[linked.element_mass]", "[linked.element_mass]: unknown axis; known: ratio, sheave_stiffness"),
        ("[linked.ratio]\nthrust", "[linked]\nthrust", "[linked] thrust: expected a table [linked.thrust], found a list"),
        (', "20 kN"]', "]", "[linked.ratio] thrust: expected 3 values, one for each of ratio, found 2"),
        ('"10 kN"', '"10 kg"', '[linked.ratio] thrust, value 2: expected a value in N (such as "1 N" or a bare number in N), found "10 kg" (write kgf)'),
        ("thrust = [", "load = [", None),
        ("thrust = [", "thurst = [", "[linked.ratio] thurst: unknown key; did you mean thrust in [scene]?"),
        ("[derived]", "[derive]", "[derive]: unknown table; did you mean derived?"),
        ("[scene]\ndriving_speed = 100", "derived = 3", "derived: expected a table [derived], found 3"),
    ],
)  # fmt: skip
def test_what_is_wrong_with_rules_is_said_in_one_line(write_job, old, new, message):
    assert old in JOB
    text = JOB.replace(old, new, 1)
    if new == "derived = 3":
        text = text.replace("[derived]\n", "").replace('load = "0.001 * thrust * ratio"\n', "")
        text = text.replace('half_wedge_angle = "2 * element_mass / 10"\n', "")
    message = message or "[linked.ratio] load: expected one source of its values, found a second one of load"
    if 'load = ["20' in text:
        text = text.replace("kN", "N m")
    assert refusal(write_job(text)) == message
