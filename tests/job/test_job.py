import json
import math
import subprocess
import sys
import textwrap
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import cvt_hpc
from cvt_hpc import errors
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job, crosscheck, known_keys, load_job, rebuild_job, stored_job
from cvt_hpc.job.summary import summarize
from cvt_hpc.models import MODELS
from cvt_hpc.printing import point_lines

GRID = """
[scene]
thrust = "20 kN"
driving_speed = "3000 rpm"
[belt]
half_wedge_angle = "11 deg"
table = [["1 kN/m", 2], [3, 4]]
[mesh]
refined = true
[axes]
load = { from = "0 N m", to = "100 N m", step = "50 N m" }
load_history = ["ramp", "constant"]
sheave_stiffness = [1, inf]
"""


def test_values_are_si_and_defaults_are_resolved(write_job):
    job = load_job(write_job(GRID))
    assert (job.name, job.model, job.stepper, job.description, job.source) == (
        "x",
        "toy",
        "hop",
        "",
        "x.toml",
    )
    assert job.parameters["thrust"] == 20e3
    assert job.parameters["driving_speed"] == pytest.approx(100 * math.pi, rel=1e-15)
    assert job.parameters["table"] == ((1000.0, 2.0), (3.0, 4.0))
    assert job.parameters["refined"] is True
    assert (job.parameters["ratio"], job.parameters["stations"], job.parameters["step"]) == (2.5, 160, 1e-6)
    assert set(job.parameters) == set(known_keys("toy"))
    assert job.given == {"thrust", "driving_speed", "half_wedge_angle", "table", "refined"}


def test_runs_are_counted_in_c_order_over_the_axes_of_the_file(write_job):
    job = load_job(write_job(GRID))
    assert [axis.name for axis in job.axes] == ["load", "load_history", "sheave_stiffness"]
    assert (job.shape, job.size, len(job)) == ((3, 2, 2), 12, 12)
    found = [tuple(job.point(i)[axis.name] for axis in job.axes) for i in range(job.size)]
    assert found == [
        (load, history, stiffness)
        for load in (0.0, 50.0, 100.0)
        for history in ("ramp", "constant")
        for stiffness in (1.0, math.inf)
    ]
    assert job.point(7)["thrust"] == 20e3
    for beyond in (-1, 12):
        with pytest.raises(IndexError):
            job.point(beyond)


def test_a_job_without_axes_is_one_run(write_job):
    job = load_job(write_job())
    assert (job.axes, job.shape, job.size) == ((), (), 1)
    assert job.point(0) == job.parameters


def test_the_base_scene_has_an_axis_first_value_unless_its_table_gives_one(write_job):
    axes = "[axes]\nload = [30, 60]\nratio = [1, 2]\n"
    job = load_job(write_job("[scene]\nthrust = 2e4\nload = 45\n" + axes))
    assert (job.parameters["load"], job.parameters["ratio"]) == (45.0, 1.0)
    assert [job.point(i)["load"] for i in range(4)] == [30.0, 30.0, 60.0, 60.0]


def test_a_required_value_may_come_from_an_axis(write_job):
    assert load_job(write_job("[axes]\nthrust = [1e4, 2e4]\n")).point(1)["thrust"] == 2e4


@pytest.mark.parametrize(
    "overrides",
    [
        ["load=0.06 kN m", "scene.ratio = 2", "table=[[1], ['2 kN/m']]", "refined=false", "stations=200"],
        {"load": 60, "ratio": "2", "table": [[1], [2000]], "refined": False, "stations": 200.0},
    ],
)
def test_overrides_replace_values_and_axes(write_job, overrides):
    job = load_job(write_job(GRID), overrides)
    assert [axis.name for axis in job.axes] == ["load_history", "sheave_stiffness"]
    wanted = {"load": 60.0, "ratio": 2.0, "table": ((1.0,), (2000.0,)), "refined": False, "stations": 200}
    assert {key: job.parameters[key] for key in wanted} == wanted
    assert job.given >= wanted.keys()


@pytest.mark.parametrize(
    "overrides",
    [
        ["load=[40, '0.06 kN m']", "thrust={from='20 kN', to=30e3, step='10 kN'}"],
        {"load": [40, "0.06 kN m"], "thrust": {"from": "20 kN", "to": 30e3, "step": "10 kN"}},
        {"load": np.array([40, 60]), "thrust": np.array([2e4, 3e4], np.float32)},
    ],
)
def test_overrides_make_axes_and_replace_them_in_their_place(write_job, overrides):
    job = load_job(write_job(GRID), overrides)
    assert {axis.name: axis.values for axis in job.axes} == {
        "load": (40.0, 60.0),
        "load_history": ("ramp", "constant"),
        "sheave_stiffness": (1.0, math.inf),
        "thrust": (2e4, 3e4),
    }
    # those of the file come first
    assert [axis.name for axis in job.axes] == ["load", "load_history", "sheave_stiffness", "thrust"]
    assert "thrust" not in job.given
    assert build_job(json.loads(json.dumps(job.resolved(), allow_nan=False))) == replace(
        job, source="build_job"
    )


def test_a_job_of_a_dict_takes_arrays_as_axes_and_tables(toy):
    document = {
        "name": "x",
        "model": "toy",
        "scene": {"thrust": "20 kN"},
        "belt": {"table": np.array([[1, 2], [3, 4]])},
        "axes": {"load": np.linspace(20, 60, 3), "stations": np.array([32, 64], np.uint16)},
    }
    job = cvt_hpc.build_job(document)
    assert [axis.values for axis in job.axes] == [(20.0, 40.0, 60.0), (32, 64)]
    assert {type(value) for value in job.axes[1].values} == {int}
    assert job.parameters["table"] == ((1.0, 2.0), (3.0, 4.0))
    document["axes"] = {"laod": [1]}
    with pytest.raises(InputError, match=r"^build_job: \[axes\] laod: unknown key; did you mean load"):
        cvt_hpc.build_job(document)


def test_overrides_reach_the_head_and_the_last_of_two_counts(write_job):
    job = load_job(write_job(), ["name=y", "load=1", "load=2"])
    assert (job.name, job.parameters["load"]) == ("y", 2.0)
    assert load_job("x.toml", "load=3").parameters["load"] == 3.0


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        (["load"], '--set: expected KEY=VALUE, found "load"'),
        (["=3"], '--set: expected KEY=VALUE, found "=3"'),
        (["laod=3"], "--set laod: unknown key; did you mean load in [scene]?"),
        (["runs=3"], "--set runs: unknown key; did you mean design.runs?"),
        (["first_samples=8"], "--set first_samples: unknown key; did you mean design.first_samples?"),
        (["indices=true"], "--set indices: unknown key; did you mean uncertain.indices?"),
        (["belt.load=3"], "--set belt.load: belongs in [scene], found in [belt]"),
        (
            ["load=3 kg"],
            '--set load: expected a value in N m (such as "1 N m" or a bare number in N m), found "3 kg"',
        ),
        (["table=3"], '--set table: expected a list of numbers in N/m, found "3"'),
        (["load=[1, 2"], '--set load: expected a value in N m (such as "1 N m" or a bare number in N m), found "[1, 2"; decimals have a point, as 2.4, thousands have no mark, and several values are a list, as [2, 4]'),
        (["load=[1, 1]"], "--set load: expected distinct values, found 1 as value 1 and value 2"),
        (["load={from=1, too=2, step=1}"], "--set load.too: unknown key; did you mean to?"),
        ({"load": np.ones((2, 2))}, "override load: expected a 1-D array of numbers, found an array of shape (2, 2) of float64"),
        ({"load": np.array([True])}, "override load: expected a 1-D array of numbers, found an array of shape (1,) of bool"),
        ({"load": np.array([1.0, np.nan])}, "override load, value 2: expected a finite value in N m, found nan"),
        ({"table": np.ones((1, 1, 1))}, "override table: expected a 1-D or 2-D array of numbers, found an array of shape (1, 1, 1) of float64"),
        (["table=[x"], '--set table: expected a list of numbers in N/m, found "[x"'),
        (["refined=yes"], '--set refined: expected true or false, found "yes"'),
        (["model=toi"], f'model: expected one of {", ".join(MODELS)}, toy, found "toi"; did you mean toy?'),
        (
            {"load": None},
            'override load: expected a value in N m (such as "1 N m" or a bare number in N m), found nothing',
        ),
    ],
)  # fmt: skip
def test_what_is_wrong_with_an_override_is_said(write_job, overrides, message):
    with pytest.raises(InputError) as caught:
        load_job(write_job(), overrides)
    assert str(caught.value) == "x.toml: " + message


def test_a_resolved_job_is_json_and_builds_the_same_job(write_job):
    job = load_job(write_job(GRID))
    resolved = json.loads(json.dumps(job.resolved(), allow_nan=False))
    again = build_job(resolved, "x.toml")
    assert again == job
    assert again.fingerprint() == job.fingerprint()
    assert resolved["axes"]["sheave_stiffness"] == [1.0, "inf"]
    assert "load" not in resolved["scene"]


def changed(text, old, new):
    assert old in text
    return text.replace(old, new)


@pytest.mark.parametrize(
    ("old", "new", "same"),
    [
        ('"20 kN"', "20000", True),
        ('"20 kN"', '"20 kN"\nload = 7', True),
        ('"11 deg"', '"11 deg"\nelement_mass = 1', True),
        ('"11 deg"', '"11 deg"\nelement_mass = 1.5', False),
        ('"20 kN"', "20001", False),
        ("[1, inf]", "[1, 2]", False),
        ("[1, inf]", "[inf, 1]", False),
        ('load_history = ["ramp", "constant"]\nsheave_stiffness = [1, inf]',
         'sheave_stiffness = [1, inf]\nload_history = ["ramp", "constant"]', False),
    ],
)  # fmt: skip
def test_the_fingerprint_tells_what_changes_the_numbers(write_job, old, new, same):
    before = load_job(write_job(GRID)).fingerprint()
    after = load_job(write_job(changed(GRID, old, new))).fingerprint()
    assert (after == before) is same


def test_name_and_description_do_not_count_for_the_fingerprint(write_job):
    before = load_job(write_job(GRID))
    after = load_job("x.toml", {"name": "y", "description": "another"})
    assert after.fingerprint() == before.fingerprint()
    assert after.resolved() != before.resolved()


def test_the_order_of_declaration_does_not_count_for_the_fingerprint(write_job, monkeypatch):
    before = load_job(write_job(GRID))
    model = sys.modules["toy_model"]
    shuffled = {section: dict(reversed(table.items())) for section, table in model.PARAMETERS.items()}
    monkeypatch.setattr(model, "PARAMETERS", dict(reversed(shuffled.items())))
    assert load_job("x.toml").fingerprint() == before.fingerprint()


def test_checks_between_parameters_name_the_run(write_job):
    with pytest.raises(InputError) as caught:
        load_job(write_job(GRID + 'thrust = ["20 kN", "9 kN"]\n'))
    assert str(caught.value) == (
        "x.toml: [scene] load: expected at most 90 N m at this thrust, found 100 N m "
        "(at load = 100 N m, load_history = ramp, sheave_stiffness = 1, thrust = 9 kN)"
    )
    with pytest.raises(InputError) as caught:
        load_job(write_job("[scene]\nthrust = 100\nload = 5\n"))
    assert str(caught.value) == "x.toml: [scene] load: expected at most 1 N m at this thrust, found 5 N m"


IN_UNITS = """
[scene]
thrust = "20 kN"
[belt]
half_wedge_angle = "11 deg"
table = ["1 kN/m", 2000]
[axes]
driving_speed = ["1000 rpm", "3000 rpm"]
load = { from = "0.02 kN m", to = 40, step = 10 }
[linked.driving_speed]
element_mass = ["900 g/m", 1.0]
"""


def test_people_read_values_in_the_units_of_the_job(write_job):
    job = load_job(write_job(IN_UNITS))
    assert job.units == {
        "thrust": "kN", "half_wedge_angle": "deg", "table": "kN/m", "driving_speed": "rpm", "load": "kN m", "element_mass": "g/m",
    }  # fmt: skip
    told = [" ".join(line.split()) for line in summarize(job, 1.0).splitlines()]
    assert "half_wedge_angle 11 deg given half wedge angle" in told
    assert "table [1, 2] kN/m given rows of line forces" in told
    assert "driving_speed 1000, 3000 rpm 2 values" in told
    assert "load 0.02, 0.03, 0.04 kN m 3 values" in told
    assert "element_mass 900 to 1000 g/m linked to driving_speed varies with driving_speed" in told
    assert list(point_lines(job, {"driving_speed": 100 * math.pi})) == [
        "at      driving speed 3000 rpm, load 0.02 kN m, element mass 1000 g/m"
    ]
    # what counts more has the unit
    assert "driving_speed" not in load_job("x.toml", ["driving_speed=[100, 200]", "element_mass=1"]).units
    assert job.resolved()["axes"]["load"] == [20.0, 30.0, 40.0]
    assert build_job(job.resolved(), "x.toml").units == {}
    assert rebuild_job(job.resolved(), "x.toml", job.units).units == job.units


def test_errors_are_in_the_units_of_the_job(write_job):
    def refusal(*overrides):
        with pytest.raises(InputError) as caught:
            load_job("x.toml", overrides)
        return str(caught.value).removeprefix("x.toml: ")

    job = load_job(write_job(IN_UNITS))
    place = "(at driving_speed = 1000 rpm, load = 0.03 kN m)"
    told = "[scene] load: expected at most 25 N m at this thrust, found 30 N m (0.03 kN m)"
    assert refusal("thrust=2.5 kN") == f"{told} {place}"
    told = "[linked.driving_speed] element_mass: expected a value of driving_speed that it is linked to"
    assert refusal("driving_speed=2000 rpm") == f"{told} (1000 rpm, 3000 rpm), found 2000 rpm"
    assert refusal("half_wedge_angle=80 deg") == (
        '--set half_wedge_angle: expected >= 0 and <= 57.2958 deg, found "80 deg"'
    )
    with pytest.raises(
        InputError, match=r"found 30 N m \(0.03 kN m\) \(at load = 0.03 kN m, thrust = 2.5 kN\)"
    ):
        job.point_at(["load=30", "thrust=2.5 kN"])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[run]\nduration = 0.1\n[numerics]\nstep = 0.2\n", "[numerics] step: expected at most duration = 0.1 s, found 0.2 s"),
        ("[run]\nduration = '2 h'\n", "[run] duration: expected at most an hour, found 7200 s (2 h)"),
    ],
)  # fmt: skip
def test_stepper_and_shared_tables_have_their_checks(write_job, text, message):
    with pytest.raises(InputError) as caught:
        load_job(write_job("[scene]\nthrust = 2e4\n" + text))
    assert str(caught.value) == f"x.toml: {message}"


def test_a_stepper_is_not_asked_about_a_scene_that_the_model_refuses(write_job, monkeypatch):
    monkeypatch.setattr(sys.modules["toy_stepper"], "check", lambda parameters: 1 / 0)
    with pytest.raises(InputError, match="at most 1 N m at this thrust"):
        load_job(write_job("[scene]\nthrust = 100\nload = 5\n"))


def test_a_stepper_may_have_no_check(write_job, monkeypatch):
    monkeypatch.delattr(sys.modules["toy_stepper"], "check")
    assert load_job(write_job("[scene]\nthrust = 2e4\n[numerics]\nstep = 9\n")).parameters["step"] == 9.0


IDLE = '[scene]\nthrust = "20 kN"\n[axes]\nlabel = ["steel", "brass"]\n'


def test_an_axis_that_changes_no_run_is_refused(write_job, monkeypatch):
    def inert(parameters):
        return {"label": "refined false", "ratio": "always"} if not parameters["refined"] else {}

    assert load_job(write_job(IDLE)).size == 2  # the model says nothing of what is inert
    monkeypatch.setattr(sys.modules["toy_model"], "inert", inert, raising=False)
    with pytest.raises(InputError) as caught:
        load_job("x.toml")
    assert (
        str(caught.value)
        == "x.toml: [axes] label: expected one value, since it has no effect with refined false, found 2 values"
    )
    assert load_job("x.toml", {"refined": True}).size == 2
    assert load_job("x.toml", {"label": "brass"}).size == 1
    # of effect in half of the runs is of effect, and one value costs nothing
    for order in ("true, false", "false, true"):
        assert load_job(write_job(f"{IDLE}refined = [{order}]\n")).size == 4
    assert load_job(write_job(changed(IDLE, '"steel", ', ""))).size == 1


def test_a_huge_grid_is_checked_at_its_extremes(write_job, monkeypatch):
    monkeypatch.setattr(crosscheck, "MOST_CHECKED_POINTS", 5)
    loads = "[axes]\nload_history = ['ramp', 'constant']\nload = [0, {}, 10]\n"
    with pytest.raises(InputError, match=r"\(at load_history = ramp, load = -300 N m\)"):
        load_job(write_job("[scene]\nthrust = 2e4\n" + loads.format(-300)))
    monkeypatch.setattr(crosscheck, "MOST_CHECKED_POINTS", 6)
    thrusts = "[axes]\nload_history = ['ramp', 'constant']\nthrust = [2e4, 1e3, 3e4]\n"
    with pytest.raises(InputError, match="thrust = 1000 N"):
        load_job(write_job("[scene]\nload = 20\n" + thrusts))


def test_point_at_takes_values_on_and_off_the_axes(write_job):
    job = load_job(write_job(GRID))
    assert job.point_at({}) == job.parameters
    assert job.point_at(["load=50 N m", "load_history=ramp", "sheave_stiffness=inf"]) == job.point(5)
    assert job.point_at({"load": 12.5})["load"] == 12.5
    with pytest.raises(InputError) as caught:
        job.point_at(["load=0.5 kN m", "ratio=1"], "--at")
    assert str(caught.value) == (
        "x.toml: [scene] load: expected at most 200 N m at this thrust, found 500 N m (at load = 500 N m, ratio = 1)"
    )
    with pytest.raises(InputError) as caught:
        job.point_at({"laod": 1})
    assert str(caught.value) == "x.toml: at laod: unknown key; did you mean load in [scene]?"


def test_a_job_of_bare_numbers_does_without_pint_and_kernels(tmp_path):
    (tmp_path / "x.toml").write_text('name = "x"\nmodel = "elastic_belt"\n[axes]\nload = [0, 5]\n')
    program = """
        import sys
        from cvt_hpc.job import load_job
        print(load_job("x.toml").size, {"pint", "numba", "xarray", "mpi4py"} & sys.modules.keys())
    """
    command = [sys.executable, "-c", textwrap.dedent(program)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert (done.stdout, done.stderr) == ("2 set()\n", "")


json_values = st.recursive(
    st.none()
    | st.booleans()
    | st.integers()
    | st.floats()
    | st.text(st.characters(exclude_categories=["Cs"]), max_size=5),
    lambda inner: st.lists(inner, max_size=2) | st.dictionaries(st.sampled_from(["from", "to", "a"]), inner),
    max_leaves=4,
)
names = st.sampled_from(
    ["name", "model", "scene", "belt", "axes", "thrust", "load", "table", "refined", "label", "zz"]
)


@pytest.mark.usefixtures("toy")
class TestAnyDocument:
    @given(st.dictionaries(names, json_values | st.dictionaries(names, json_values, max_size=3), max_size=5))
    def test_is_a_job_or_an_input_error(self, document):
        try:
            job = build_job({"name": "x", "model": "toy", "scene": {"thrust": 1e4}} | document, "x.toml")
        except InputError as error:
            assert str(error).startswith("x.toml: ")
        else:
            assert build_job(job.resolved(), "x.toml") == job


@pytest.mark.parametrize(
    ("value", "words"),
    [
        (None, "nothing"), (True, "true"), (False, "false"), ({}, "a table"), ([], "an empty list"), ([1], "a list"),
        (1.5, "1.5"), ("a", '"a"'), ("x" * 61, '"' + "x" * 57 + '..."'),
    ],
)  # fmt: skip
def test_found_values_are_shown_in_the_words_of_a_job_file(value, words):
    assert errors.show(value) == words


def test_numbers_that_python_refuses_to_print_are_named():
    assert errors.show(10**5000) == "a number of too many digits"


def test_a_key_of_an_earlier_version_is_named_in_a_job_and_left_out_of_a_dataset(tmp_path):
    document = {"name": "x", "model": "elastic_belt", "numerics": {"contact_sweeps": 0}}
    with pytest.raises(InputError, match="contact_sweeps: no key of this version; contact is solved exactly"):
        build_job(document, "x.toml")
    assert (
        stored_job(document, "x.nc").fingerprint()
        == build_job({"name": "x", "model": "elastic_belt"}).fingerprint()
    )
