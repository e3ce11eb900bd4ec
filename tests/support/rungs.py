"""Records of the rungs of the ladder for tests, through the job and the simulation as any user has them."""

from collections.abc import Collection, Mapping
from numbers import Real
from typing import Any

from cvt_hpc.job import Job, build_job
from cvt_hpc.job.schema import load_schema
from cvt_hpc.simulation import run_point
from support.scene import OF_BELTS, SCENE


def rung_job(model: str, axes: dict | None = None, stepper: str | None = None, **values) -> Job:
    """A job of a model on the scene of the tests but for `values` and those of the axes [SI]."""
    head = {"name": "test", "model": model} | ({"stepper": stepper} if stepper else {})
    values = scene_of(model, {*values, *(axes or {})}) | values
    axes = with_units(model, stepper, axes or {})
    return build_job(head | {"axes": axes}, "test.toml", with_units(model, stepper, values))


def scene_of(model: str, given: Collection[str] = ()) -> dict[str, float]:
    """Values [SI] of the scene of the tests that a model has, but for given keys."""
    has = load_schema(model, None, "test.toml").parameters
    scene = SCENE if "tilt_stiffness" in has else OF_BELTS if "tilt_lag" in has else {}
    return {key: value for key, value in scene.items() if key in has and key not in given}


def scene_tables(model: str) -> str:
    """That scene as the tables of a job file."""
    schema = load_schema(model, None, "test.toml")
    tables: dict[str, list[str]] = {}
    for key, value in scene_of(model).items():
        written = f'{key} = "{value!r} {schema.parameters[key].unit}"\n'
        tables.setdefault(schema.section_of[key], []).append(written)
    return "".join(f"[{table}]\n{''.join(lines)}" for table, lines in tables.items())


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
