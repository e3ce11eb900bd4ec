"""What a chart job says, and what is wrong with a bad one."""

import math
import sys
from pathlib import Path

import pytest

from cvt_hpc.errors import InputError
from cvt_hpc.experiments.chart import load
from cvt_hpc.experiments.chart.plan import Role
from cvt_hpc.models import MODELS


def test_a_chart_holds_every_run_that_it_needs(write_chart):
    chart = load(write_chart())
    assert (chart.job.name, chart.job.description, chart.repeats, chart.time_limit) == (
        "bells",
        "Two ways to ring",
        2,
        3600,
    )
    assert [point.name for point in chart.points] == [
        "ringing-exact",
        *(f"ringing-soft-{k}" for k in (1, 2, 3, 4)),
        *(f"ringing-clever-{k}" for k in (1, 2, 3)),
        "ringing-hard-1",
        "ringing-base",
        "ringing-choice-louder",
        "ringing-choice-fine",
        "ringing-choice-cracked",
    ]
    by_name = {point.name: point for point in chart.points}
    soft = by_name["ringing-soft-2"]
    assert soft.role is Role.METHOD and soft.timed
    assert (soft.label, soft.key, soft.setting) == ("soft hammer", "step", 1e-6)
    assert soft.setting_in_words == "1 µs"
    assert soft.job.parameters["loudness"] == 20e-6 and soft.job.stepper == "soft"
    assert by_name["ringing-clever-1"].setting_in_words == "0.01"
    assert math.isinf(soft.until)
    assert by_name["ringing-choice-louder"].job.parameters["step"] == 1e-5  # what the base sets
    assert [p.refines for p in chart.points_of("ringing", Role.CHOICE)] == [False, True, False]
    assert chart.budgeted == ("amplitude", "frequency", "occurrence")
    scene = chart.scene("ringing")
    assert [q.name for q in scene.quantities] == ["trajectory", "amplitude", "frequency", "occurrence"]
    assert [q.tolerance for q in scene.quantities] == [0.05, 0.01, 0.01, 0.0]


REFERENCE = ('reference = "exact"', 'reference = { stepper = "hard", step = "2 us" }')


@pytest.mark.parametrize(
    ("reference", "settings"),
    [
        ('{ stepper = "hard", step = "2 us" }', (2e-6, 4e-6)),
        ('{ stepper = "hard", step = "2 us", coarser = "3 us" }', (2e-6, 3e-6)),
        ('{ stepper = "hard", step = "2 us", coarser = { set = { loudness = "3 um" } } }', (2e-6, 4e-6)),
        ('{ stepper = "hard", step = "2 us", coarser = { step = "3 us" } }', (2e-6, 3e-6)),
        ('{ stepper = "clever", tolerance = 1e-6 }', (1e-6, 1e-5)),
    ],
)
def test_a_computed_reference_has_a_coarser_one_beside_it(write_chart, reference, settings):
    chart = load(write_chart((REFERENCE[0], f"reference = {reference}")))
    found = chart.points_of("ringing", Role.REFERENCE, Role.COARSER)
    assert [point.role for point in found] == [Role.REFERENCE, Role.COARSER]
    assert tuple(point.setting for point in found) == pytest.approx(settings, rel=1e-12)
    assert not any(point.timed for point in found)
    loud = [point.job.parameters["loudness"] for point in found]
    assert (loud[1] == 3e-6) == (loud[1] != loud[0]) == ("loudness" in reference)


@pytest.mark.parametrize(
    ("coarser", "complaint"),
    [
        (
            '{ step = "2.25 us", set = { stations = 640 } }',
            "coarser set stations: expected at most 480, the mesh of",
        ),
        (
            '{ set = { stations = 320, step = "1 us" } }',
            "coarser: expected step beside set, found step in it",
        ),
        (
            '{ step = "1 us", set = { stations = 320 } }',
            "coarser: expected more than step = 1.5e-06, found 1 us",
        ),
    ],
)
def test_a_coarser_reference_is_not_finer(tmp_path, coarser, complaint):
    text = (Path(__file__).parents[2] / "jobs/chart_ratios.toml").read_text()
    job = tmp_path / "c.toml"
    job.write_text(text.replace('{ step = "2.25 us", set = { stations = 320 } }', coarser, 1))
    with pytest.raises(InputError, match=complaint):
        load(job)


def test_starts_differ_in_their_seeds(write_chart):
    chart = load(write_chart(('title = "Ringing"', "starts = 3")))
    point = chart.points[1]
    assert [point.parameters(k)["seed"] for k in range(3)] == [1, 2, 3]


def test_values_from_the_command_line_count_more_than_those_of_scenes(write_chart):
    chart = load(write_chart(), ["loudness=30 um", "duration=0.2 s"])
    by_name = {point.name: point.job.parameters for point in chart.points}
    assert by_name["ringing-soft-1"]["loudness"] == 30e-6 and by_name["ringing-exact"]["duration"] == 0.2
    assert by_name["ringing-choice-louder"]["loudness"] == 22e-6  # what is varied stays varied
    assert by_name["ringing-soft-1"]["step"] == 2e-3
    assert chart.fingerprint() != load(write_chart()).fingerprint()


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("loudnes=1", "--set loudnes: unknown key; did you mean loudness in [scene]?"),
        ("loudness=[1, 2]", "--set loudness: expected a value in m (such as \"1 m\" or a bare number in m), found a list; what a study varies stands in [axes]"),
        ("loudness=1 kg", '--set loudness: expected a value in m (such as "1 m" or a bare number in m), found "1 kg"'),
        ("scene.pitch=0", '--set scene.pitch: expected > 0 Hz, found "0"'),
        ("tolerance=-1", '--set tolerance: expected > 0, found "-1"'),  # of a stepper that is not the default
    ],
)  # fmt: skip
def test_what_is_wrong_on_the_command_line_is_not_blamed_on_a_scene(write_chart, override, message):
    with pytest.raises(InputError) as caught:
        load(write_chart(), [override])
    assert str(caught.value) == f"c.toml: {message}"


def test_names_do_not_make_another_chart(write_chart):
    plain = load(write_chart()).fingerprint()
    assert load(write_chart(("bells", "chimes"), ("Two ways", "Ways"))).fingerprint() == plain
    assert load(write_chart(("repeats = 2", "repeats = 3"))).fingerprint() != plain
    assert load(write_chart(('tolerance = "5 %"', 'tolerance = "6 %"'))).fingerprint() != plain


A_SCENE_OF_ITS_OWN = """
[chart.scenes.other]
model = "oscillator"
reference = "exact"
set = { stiffness = 1e7, normal_load = 3162.278 }
quantities = { frequency = {} }
"""


def test_a_scene_may_be_of_another_model(write_chart):
    job = write_chart(
        ("[chart.methods.soft]", f'{A_SCENE_OF_ITS_OWN}\n[chart.methods.soft]\nscenes = ["ringing"]'),
        ("[chart.methods.clever]", '[chart.methods.clever]\nscenes = ["ringing"]'),
        ("[chart.methods.hard]", '[chart.methods.hard]\nscenes = ["ringing"]'),
    )
    other = next(point for point in load(job).points if point.scene == "other")
    assert (other.job.model, other.job.name) == ("oscillator", "bells")
    assert (
        other.job.parameters["duration"] == 0.3
    )  # its own default: the job's tables are for the job's model


def test_a_scene_needs_a_transient(write_chart):
    scene = A_SCENE_OF_ITS_OWN.replace("oscillator", "strand").replace("set = {", "# set = {")
    with pytest.raises(InputError, match="model: expected one with a transient, found strand"):
        load(write_chart(("[chart.methods.soft]", f"{scene}\n[chart.methods.soft]")))


def test_methods_and_choices_may_be_of_another_model_and_choices_of_fewer_starts(write_chart, monkeypatch):
    monkeypatch.setitem(sys.modules, "gong", sys.modules["bell"])
    monkeypatch.setitem(MODELS, "gong", "gong")
    chart = load(write_chart(('title = "Ringing"', "starts = 3"),
                                   ('stepper = "hard"\n', 'stepper = "hard"\nmodel = "gong"\n'),
                                   ('set = { loudness = "22 um" }', 'model = "gong"\nstepper = "hard"\nstarts = 2')))  # fmt: skip
    models = {point.name: point.job.model for point in chart.points_of("ringing", Role.METHOD)}
    assert models["ringing-hard-1"] == "gong" and models["ringing-soft-1"] == "bell"
    choice = next(point for point in chart.points if point.name == "ringing-choice-louder")
    assert (choice.job.model, choice.job.stepper, choice.starts) == ("gong", "hard", 2)
    assert choice.job.parameters["loudness"] == 20e-6  # of the scene
    assert chart.points_of("ringing", Role.BASE)[0].starts == 3


LEAD = 'lead = { stepper = "hard", until = "40 ms", set = { step = "1 us" } }'
PART = ('trajectory = { until = "10 ms"', 'trajectory = { since = "40 ms", until = "60 ms"')
OTHERS = 'amplitude = { tolerance = "1 %" }\nfrequency = { tolerance = "1 %" }\noccurrence = {}\n'


def test_where_methods_take_over_all_runs_end_with_what_is_judged(write_chart):
    chart = load(write_chart((REFERENCE[0], f"{REFERENCE[1]}\n{LEAD}"), PART, (OTHERS, "")))
    (scene,) = chart.scenes
    assert scene.lead.until == 0.04 and scene.lead.job.stepper == "hard"
    assert scene.lead.job.parameters["step"] == 1e-6 and scene.lead.job.parameters["loudness"] == 20e-6
    measured = [p for p in chart.points if p.role in (Role.REFERENCE, Role.COARSER, Role.METHOD)]
    assert {point.until for point in measured} == {0.06}
    later = load(
        write_chart((REFERENCE[0], f"{REFERENCE[1]}\n{LEAD.replace('1 us', '2 us')}"), PART, (OTHERS, ""))
    )
    assert later.fingerprint() != chart.fingerprint()


@pytest.mark.parametrize(
    ("replacements", "message"),
    [
        (((REFERENCE[0], f"{REFERENCE[0]}\n{LEAD}"), PART, (OTHERS, "")),
         'reference: expected a stepper, because methods take over, found "exact"'),
        (((REFERENCE[0], f"{REFERENCE[1]}\n{LEAD}"), PART),
         "quantities.amplitude: expected the trajectory alone, because methods take over, found amplitude"),
        (((REFERENCE[0], f"{REFERENCE[1]}\n{LEAD}"), (OTHERS, "")),
         "quantities.trajectory.since: expected 0.04 s or more, when methods take over, found 0 s"),
        (((REFERENCE[0], f"{REFERENCE[1]}\n{LEAD.replace('until', 'til')}"), PART, (OTHERS, "")),
         "lead til: unknown key; did you mean until?"),
        ((('title = "Ringing"', 'time_limit = "0 s"'),), 'time_limit: expected > 0 s, found "0 s"'),
    ],
)  # fmt: skip
def test_a_bad_lead_is_one_clear_error(write_chart, replacements, message):
    with pytest.raises(InputError) as caught:
        load(write_chart(*replacements))
    assert str(caught.value) == f"{WHERE}] {message}"


WHERE = "c.toml: [chart.scenes.ringing"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[chart]\nrepeats", "[chart]\nrepeat", "c.toml: [chart] repeat: unknown key; did you mean repeats?"),
        ("repeats = 2", "repeats = 0", "c.toml: [chart] repeats: expected >= 1, found 0"),
        ("repeats = 2", 'repeats = "2 s"', 'c.toml: [chart] repeats: expected a whole number, found "2 s"'),
        ('time_limit = "1 h"', 'time_limit = "1 m"',
         'c.toml: [chart] time_limit: expected a value in s (such as "1 s" or a bare number in s), found "1 m"'),
        ("[chart.scenes.ringing]\ntitle", "[chart.scenes.ringing]\ntitel",
         f"{WHERE}] titel: unknown key; did you mean title?"),
        ("chart.scenes.ringing", 'chart.scenes."ring/ing"',
         "c.toml: [chart.scenes.ring/ing]: expected a name of letters, digits and '_' (it names files), "
         'found "ring/ing"'),
        ('loudness = "20 um"', 'loudnes = "20 um"',
         f"{WHERE}] reference: set loudnes: unknown key; did you mean loudness in [scene]?"),
        ('loudness = "20 um"', "loudness = [1, 2]", f"{WHERE}] reference: set loudness: expected one value in a chart, found an axis"),
        ('loudness = "20 um"', 'model = "bell"', f"{WHERE}] set model: expected a parameter, found the job's model"),
        ('reference = "exact"', 'reference = "exakt"',
         f'{WHERE}] reference: expected "exact", or a table with a stepper and its step or tolerance, found "exakt"'),
        ('reference = "exact"', 'reference = { stepper = "hard" }',
         f"{WHERE}] reference: expected one of step and tolerance, found neither"),
        ('reference = "exact"', 'reference = { stepper = "hard", step = "2 us", coarser = "1 us" }',
         f"{WHERE}] reference coarser: expected more than step = 2e-06, found 1 us"),
        ('reference = "exact"', 'reference = { stepper = "hard", step = "2 us", coarser = { steps = "4 us" } }',
         f"{WHERE}] reference coarser steps: unknown key; did you mean step?"),
        ('reference = "exact"', 'reference = { stepper = "hard", step = "2 kg" }',
         f'{WHERE}] reference step: expected a value in s (such as "1 s" or a bare number in s), found "2 kg"'),
        ('reference = "exact"', 'reference = { stepper = "hard", step = "2 us", coarser = "x" }',
         f'{WHERE}] reference coarser: expected a value in s (such as "1 s" or a bare number in s), found "x"'),
        ('reference = "exact"', 'reference = { stepper = "hart", step = "2 us" }',
         f'{WHERE}] reference: stepper: expected one of soft, hard, clever, found "hart"; did you mean hard?'),
        ("amplitude =", "amplitde =", f"{WHERE}.quantities] amplitde: unknown quantity; did you mean amplitude?"),
        ('until = "10 ms", tol', "tol",
         f'{WHERE}.quantities] trajectory until: expected a value in s (such as "1 s" or a bare number in s), '
         "found nothing"),
        ('until = "10 ms"', 'since = "10 ms", until = "10 ms"',
         f"{WHERE}.quantities] trajectory until: expected a time after since = 0.01 s, found 0.01 s"),
        ('until = "10 ms"', 'until = "0.2 s"',
         f"{WHERE}] quantities.trajectory.until: expected a time within the run of 0.1 s, found 0.2 s"),
        ('step = ["2 ms", "1 us", "10 us", "0.2 ms"]', "",
         "c.toml: [chart.methods.soft]: expected one of step and tolerance, found neither"),
        ('step = ["2 ms", "1 us", "10 us", "0.2 ms"]', 'step = "1 us"',
         'c.toml: [chart.methods.soft] step: expected a list of values, found "1 us"'),
        ('"1 us", "10 us"', '"1 kg", "10 us"',
         'c.toml: [chart.methods.soft] step, value 2: expected a value in s (such as "1 s" or a bare number in s), '
         'found "1 kg"'),
        ('stepper = "clever"', 'stepper = "clever"\nscenes = ["rining"]',
         'c.toml: [chart.methods.clever] scenes: unknown scene "rining"; did you mean ringing?'),
        ('stepper = "hard"', 'stepper = "hard"\nuntil = "20 ms"',
         "c.toml: [chart.methods.hard] until: unknown key; known: label, stepper, model, lanes, set, scenes, step, tolerance"),
        ('stepper = "hard"', 'stepper = "clever"',
         "c.toml: [chart.methods.hard] step: unknown key of stepper clever; known: tolerance"),
        ('stepper = "soft"', 'stepper = "explicit"', None),
        ('scene = "ringing"', 'scene = "rining"',
         'c.toml: [chart.budget] scenes: unknown scene "rining"; did you mean ringing?'),
        ("refines = true", "refine = true",
         "c.toml: [chart.budget.choices.fine] refine: unknown key; did you mean refines?"),
        ('set = { loudness = "22 um" }', "set = { loudness = inf }",
         "c.toml: [chart.budget.choices.louder]: set loudness: expected a finite value in m, found inf"),
        ('label = "the default"', 'quantities = ["onset"]',
         'c.toml: [chart.budget] quantities: unknown quantity "onset" of scene ringing; '
         "known: trajectory, amplitude, frequency, occurrence"),
        ("[run]", "[axes]\nseed = [1, 2]\n[run]", "c.toml: [axes]: expected no axes in a chart job, found some"),
    ],
)  # fmt: skip
def test_bad_input_is_one_clear_error(write_chart, old, new, message):
    with pytest.raises(InputError) as caught:
        load(write_chart((old, new)))
    if message is not None:
        assert str(caught.value) == message
    assert "\n" not in str(caught.value)


def test_a_job_without_a_chart_is_refused(write_chart):
    with pytest.raises(InputError, match=r"c.toml: chart: expected a table \[chart\]"):
        load(write_chart(text='name = "x"\nmodel = "bell"\n'))
    with pytest.raises(
        InputError, match="--set stepper: expected a parameter of the scenes, found the job's"
    ):
        load(write_chart(), ["stepper=hard"])
