"""Records of the rungs of the ladder for tests, through the job and the simulation as any user has them."""

from collections.abc import Mapping
from numbers import Real
from typing import Any

from cvt_hpc.job import Job, build_job
from cvt_hpc.job.schema import load_schema
from cvt_hpc.simulation import run_point


def rung_job(model: str, axes: dict | None = None, stepper: str | None = None, **values) -> Job:
    """A job of a model with defaults but for `values` and those of the axes [SI]."""
    head = {"name": "test", "model": model} | ({"stepper": stepper} if stepper else {})
    axes = with_units(model, stepper, axes or {})
    return build_job(head | {"axes": axes}, "test.toml", with_units(model, stepper, values))


def with_units(model: str, stepper: str | None, values: Mapping[str, Any]) -> dict[str, Any]:
    """Values [SI] as a job file gives them with their units, so that unusual ones draw no warning."""
    parameters = load_schema(model, stepper, "test.toml").parameters
    units = {key: parameters[key].unit for key in values if key in parameters}
    return {key: _written(value, units.get(key)) for key, value in values.items()}


def _written(value: Any, unit: str | None) -> Any:
    if isinstance(value, (list, tuple)):
        return [_written(each, unit) for each in value]
    return f"{float(value)!r} {unit}" if unit and isinstance(value, Real) else value


def rung_record(model: str, stepper: str | None = None, **values) -> dict:
    """The record of one run."""
    asked = rung_job(model, stepper=stepper, **values)
    return run_point(asked, asked.point(0), lambda: None)
