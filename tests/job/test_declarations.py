"""What models, steppers and all runs declare is something that a job file can set."""

from importlib import import_module

import pint
import pytest

from cvt_hpc import recording
from cvt_hpc.errors import InputError
from cvt_hpc.job import build_job
from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.units import to_si
from cvt_hpc.job.values import read_value
from cvt_hpc.models import MODELS
from cvt_hpc.steppers import STEPPERS
from cvt_hpc.vibration import criterion

pytestmark = [pytest.mark.parametrize("model", MODELS), pytest.mark.parametrize("stepper", STEPPERS)]


def test_keys_are_unique_over_all_tables(model, stepper):
    modules = [import_module(MODELS[model]), import_module(STEPPERS[stepper]), recording, criterion]
    keys = [key for module in modules for table in module.PARAMETERS.values() for key in table]
    assert sorted(keys) == sorted(set(keys))
    assert set(keys) == set(load_schema(model, stepper, "x").parameters)


def test_units_are_si_and_what_a_job_file_may_write(model, stepper):
    registry = pint.UnitRegistry()
    for unit in {parameter.unit for parameter in load_schema(model, stepper, "x").parameters.values()} - {""}:
        assert registry.Quantity(1.0, unit).to_base_units().magnitude == 1.0
        assert to_si(f"3 ({unit})", unit) == 3.0


def test_defaults_are_legal(model, stepper):
    for key, parameter in load_schema(model, stepper, "x").parameters.items():
        if parameter.default is not None:
            assert read_value(parameter, parameter.default, key) == parameter.default
        assert parameter.description


@pytest.mark.parametrize(
    ("tables", "message"),
    [
        (
            {"vibration": {"band_low": 900, "band_high": 800}},
            "[vibration] band_high: expected a frequency above",
        ),
        (
            {"run": {"duration": 0.02}, "scene": {"rise_time": 0.005}},
            "[run] duration: expected a judged part of five periods",
        ),
    ],
)
def test_every_job_is_checked_for_what_all_runs_share(model, stepper, tables, message):
    with pytest.raises(InputError) as caught:
        build_job({"name": "x", "model": model, "stepper": stepper} | tables, "x.toml")
    assert str(caught.value).startswith(f"x.toml: {message}")
