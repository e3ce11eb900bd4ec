"""What models, steppers and all runs declare is something that a job file can set."""

import re
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pint
import pytest

from cvt_hpc import recording, steppers
from cvt_hpc.analysis.figures import LONGEST_NAME
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.summary import summarize
from cvt_hpc.job.units import to_si
from cvt_hpc.job.values import read_value
from cvt_hpc.models import MODELS
from cvt_hpc.models.contract import load_model
from cvt_hpc.simulation import estimate_cost, record_coordinates, record_variables, simulate
from cvt_hpc.steppers import STEPPERS
from cvt_hpc.steppers.facts import Facts
from cvt_hpc.study import run
from cvt_hpc.vibration import settings as vibration_settings

TAKEN = {model: load_model(model).steppers for model in MODELS}
PAIRS = [(model, stepper) for model in MODELS for stepper in TAKEN[model]]
DIRECT = [model for model in MODELS if not TAKEN[model]]
OWN = {name: place for taken in TAKEN.values() for name, place in taken.items() if name not in STEPPERS}
both = pytest.mark.parametrize(("model", "stepper"), PAIRS + [(model, None) for model in DIRECT])


def test_the_type_checker_reads_each_model_beside_its_contract():
    text = (Path(__file__).parents[1] / "typing" / "models_by_contract.py").read_text()
    for kind, module in (("declared", ""), ("recorded", "_record"), ("marched", "_transient")):
        offering = [name for name in MODELS if find_spec(f"{MODELS[name]}{module.replace('_', '.', 1)}")]
        assert re.findall(rf"^{kind} = (\w+)$", text, re.MULTILINE) == [
            f"{name}{module}" for name in sorted(offering)
        ]


@both
def test_keys_are_unique_over_all_tables(model, stepper):
    """But for those of all transients, of which a model may declare the same quantity with its own default."""
    modules, shared = [import_module(MODELS[model])], {}
    if stepper is not None:
        modules.append(import_module(TAKEN[model][stepper]))
        shared = {
            (section, key): parameter
            for module in (recording, vibration_settings)
            for section, table in module.PARAMETERS.items()
            for key, parameter in table.items()
        }
    own = [
        ((section, key), parameter)
        for module in modules
        for section, table in module.PARAMETERS.items()
        for key, parameter in table.items()
    ]
    for place, parameter in own:
        if place in shared:
            assert replace(parameter, default=shared[place].default) == shared[place]
    places = shared | dict(own)
    keys = [key for _, key in places]
    assert len({place for place, _ in own}) == len(own) and len(set(keys)) == len(keys)
    schema = load_schema(model, stepper, "x")
    assert {key: schema.parameters[key].default for key in keys} == {
        key: parameter.default for (_, key), parameter in places.items()
    }
    assert set(keys) == set(schema.parameters)


@pytest.fixture(scope="module")
def registry():
    return pint.UnitRegistry()


@both
def test_units_are_si_and_what_a_job_file_may_write(registry, model, stepper):
    for unit in {parameter.unit for parameter in load_schema(model, stepper, "x").parameters.values()} - {""}:
        assert registry.Quantity(1.0, unit).to_base_units().magnitude == 1.0
        assert to_si(f"3 ({unit})", unit) == 3.0


@both
def test_defaults_are_legal(model, stepper):
    for key, parameter in load_schema(model, stepper, "x").parameters.items():
        if parameter.default is not None:
            assert read_value(parameter, parameter.default, key) == parameter.default
        assert parameter.description


@both
def test_what_has_a_unit_has_a_sensible_range_around_its_default(model, stepper):
    for key, parameter in load_schema(model, stepper, "x").parameters.items():
        assert (parameter.sensible is None) == (not parameter.unit), f"{key}: unit {parameter.unit!r}"
        if parameter.sensible is not None:
            low, high = parameter.sensible
            assert 0.0 < low < high, key
            sizes = np.abs(np.ravel(parameter.default or ()))
            assert ((low <= sizes) & (sizes <= high) | (sizes == 0.0)).all(), key


@pytest.mark.parametrize("model", sorted(set(MODELS) - {"moving_string"}))
def test_what_is_recorded_has_a_name_that_fits_an_axis_label(model):
    job = build_job({"name": "x", "model": model}, "x.toml")
    variables = record_variables(job)
    coordinates = record_coordinates(job).items()
    words = {v.name: v.long_name for v in variables} | {name: c.long_name for name, c in coordinates}
    for name, long_name in words.items():
        # a clause is a sentence, and belongs into the comment
        assert 0 < len(long_name) <= LONGEST_NAME and not set(long_name) & set(",;:()"), name
    for variable in variables:
        assert variable.comment and variable.comment != variable.long_name, variable.name


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (
            {"vibration": {"band_low": 90, "band_high": 80}},
            "[vibration] band_high: expected a frequency above",
        ),
        (
            {"run": {"longest_duration": 0.29}},
            "[run] longest_duration: expected duration = 0.3 s or more, or 0 for 4 times the duration, found 0.29 s",
        ),
        ({"run": {"longest_duration": "3 N"}}, "[run] longest_duration: expected a value in s "),
        ({"run": {"longest_duration": -1}}, "[run] longest_duration: expected >= 0 s, found -1"),
        (
            {"numerics": {"most_refinements": -1}},
            "[numerics] most_refinements: expected >= 0 and <= 10, found -1",
        ),
        (
            {"run": {"duration": 0.14}, "vibration": {"judged_fraction": 0.1}},
            "[run] duration: expected a judged part of five periods",
        ),
    ],
)
def test_every_transient_is_checked_for_what_all_runs_share(tables, message):
    for model, stepper in PAIRS:
        with pytest.raises(InputError) as caught:
            build_job({"name": "x", "model": model, "stepper": stepper} | tables, "x.toml")
        assert str(caught.value).startswith(f"x.toml: {message}"), (model, stepper)


def test_all_of_a_run_is_judged_only_where_nothing_rises():
    for model, stepper in PAIRS:
        run = {"duration": 0.8, "shortest_duration": 0.4}
        document = {
            "name": "x",
            "model": model,
            "stepper": stepper,
            "vibration": {"judged_fraction": 1.0},
            "run": run,
        }
        if "rise_time" in load_schema(model, stepper, "x.toml").parameters:
            with pytest.raises(InputError, match=r"\[(scene|run)\] (rise_time|shortest_duration): expected "):
                build_job(document, "x.toml")
        else:
            assert build_job(document, "x.toml").parameters["shortest_duration"] == 0.4


@pytest.mark.parametrize("model", [model for model in MODELS if model not in DIRECT])
def test_every_stepper_is_taken_or_refused_with_a_reason(model):
    asked = load_model(model)
    assert not asked.refused.keys() & asked.steppers.keys()
    assert asked.default_stepper in asked.steppers
    for stepper in (STEPPERS | OWN).keys() - asked.steppers.keys():
        own = {"newton": "pushbelt", "proximal": "beam_pushbelt", "cyclic_alpha": "belt_drive"}
        own |= {"split": "quasi_static_belt"}
        owner = own.get(stepper, "elastic_belt")
        reason = asked.refused.get(stepper, f"it is {owner}'s own step")
        assert len(reason.split()) > 3, stepper
        assert stepper in OWN or stepper in asked.refused
        with pytest.raises(InputError) as caught:
            build_job({"name": "x", "model": model, "stepper": stepper}, "x.toml")
        assert str(caught.value).startswith(f"x.toml: stepper: expected one that {model} takes (")
        assert str(caught.value).endswith(f'found "{stepper}": {reason}')


@pytest.mark.parametrize("stepper", STEPPERS | OWN)
def test_every_stepper_says_what_a_chooser_has_to_know(stepper):
    module = import_module((STEPPERS | OWN)[stepper])
    facts = module.FACTS
    assert isinstance(facts, Facts)
    assert isinstance(facts.order, int) and facts.order >= 1
    assert all(type(flag) is bool for flag in (facts.adaptive, facts.implicit, facts.l_stable))
    # a step or a tolerance is what a job sets; a method that chooses its step follows the events
    table = module.PARAMETERS["numerics"]
    assert ("tolerance" in table, "step" in table) == (facts.adaptive, not facts.adaptive)
    assert (facts.order_at_events is None) == facts.adaptive
    assert facts.adaptive or 0.0 < facts.order_at_events <= facts.order
    assert facts.rest_limit > 0.0
    assert len(facts.stability.split()) > 1 and facts.damping.strip()
    if stepper in OWN:
        assert facts.needs == frozenset()
    else:
        assert "rates" in facts.needs and facts.needs <= {"rates", "partition", "friction"}
        assert all(callable(getattr(module, name)) for name in ("control", "work", "march"))


def test_every_stepper_stands_in_the_table_of_methods():
    table = (
        Path(steppers.__file__)
        .with_name("README.md")
        .read_text()
        .split("## The methods")[1]
        .split("\n## ")[0]
    )
    for stepper in STEPPERS:
        assert re.search(rf"^\|[^|]*`{stepper}`", table, re.MULTILINE), stepper


@pytest.mark.parametrize("model", ["moving_string"])
def test_a_model_without_records_is_no_model_of_a_study(model, tmp_path):
    job = build_job({"name": "x", "model": model}, "x.toml")
    with pytest.raises(InputError, match=f"x.toml: model: expected one whose runs .*found {model}"):
        run(job, tmp_path / "out", progress=False)
    assert not (tmp_path / "out").exists()
    with pytest.raises(InputError, match=f"found {model}"):
        simulate(job)
    assert "estimated cost: not known for this model" in summarize(job, estimate_cost(job))


DURATIONS = {"shortest_duration", "longest_duration", "decay_tolerance"}
FILE = {"table_force": [1, 2], "table_speed": [1, 2], "table_mu": [[1, 1], [1, 1]]}


@pytest.mark.parametrize(
    ("model", "stepper", "overrides", "setting", "keys"),
    [
        ("elastic_belt", "imex", {}, "friction_law stribeck", {"table_file", "table_force", "table_speed", "table_mu"}),
        ("elastic_belt", "imex", {"friction_law": "coulomb", "friction_gradient": 0}, "friction_law coulomb",
         {"table_file", "table_force", "table_speed", "table_mu"}),
        ("elastic_belt", "imex", {"friction_law": "table", **FILE}, "friction_law table",
         {"friction_gradient", "kinetic_friction", "stribeck_velocity"}),
        ("elastic_belt", "imex", {"load_history": "ramp"}, "load_history ramp", DURATIONS),
        ("quasi_static_belt", "split", {"speed_history": "ramp"}, "speed_history ramp", DURATIONS),
        ("elastic_belt", "theta", {}, "a stepper that chooses its step", set()),
        ("elastic_belt", "scipy_bdf", {}, "a stepper that chooses its step", {"most_refinements"}),
        ("moving_string", None, {}, "shape mode", {"pulse_width"}),
        ("moving_string", None, {"shape": "pulse"}, "shape pulse", {"mode"}),
        # of effect on some runs
        ("moving_string", None, {"shape": ["mode", "pulse"]}, "shape mode", set()),
        ("strand", None, {}, "strand_forces formulas", {"ring_tension_t1", "push_force_t1", "ring_tension_t2", "push_force_t2"}),
    ],
)  # fmt: skip
def test_what_has_no_effect_is_named_in_a_check(model, stepper, overrides, setting, keys):
    document = {"name": "x", "model": model} | ({"stepper": stepper} if stepper else {})
    lines = summarize(build_job(document, "x", overrides), 1.0).splitlines()
    assert {line.split()[0] for line in lines if f"  without effect with {setting}: " in line} == keys


def test_an_axis_without_effect_under_the_law_is_refused():
    document = {"name": "x", "model": "elastic_belt", "friction": {"friction_law": "table", **FILE}}
    with pytest.raises(
        InputError, match="expected one value, since it has no effect with friction_law table, found 2"
    ):
        build_job(document, "x", {"kinetic_friction": [0.1, 0.2]})
