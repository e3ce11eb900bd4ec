"""What the models and steppers declare is something that a job file can set."""

from importlib import import_module

import pint
import pytest

from cvt_hpc.job.schema import load_schema
from cvt_hpc.job.units import to_si
from cvt_hpc.job.values import read_value
from cvt_hpc.models import MODELS
from cvt_hpc.steppers import STEPPERS

pytestmark = [pytest.mark.parametrize("model", MODELS), pytest.mark.parametrize("stepper", STEPPERS)]


def test_keys_are_unique_over_all_tables(model, stepper):
    modules = [import_module(MODELS[model]), import_module(STEPPERS[stepper])]
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
