"""What a job may set of the steady belt: the elastic belt's parameters, but for those of a run's course."""

from __future__ import annotations

from typing import Any

from cvt_hpc.models import elastic_belt
from cvt_hpc.models.elastic_belt.parameters import shape_problems
from cvt_hpc.parameters import Parameter
from cvt_hpc.physics.friction_laws import friction_problems

OF_THE_COURSE = {
    "load_history": "constant",
    "load_start": 0.0,
    "speed_history": "constant",
    "speed_start": 1.0,
    "rise_time": 1.0,
    "disturbance": 0.0,
    "seed": 1,
}

PARAMETERS: dict[str, dict[str, Parameter]] = {
    section: {key: parameter for key, parameter in table.items() if key not in OF_THE_COURSE}
    for section, table in elastic_belt.PARAMETERS.items()
    # of a transient: a steady pulley is turned by a given speed, pressed by a given thrust
    if section not in ("pulleys", "rings", "record")
}


def check(parameters: dict[str, Any]) -> list[tuple[str, str, str]]:
    """Problems that lie between parameters: as of `elastic_belt`."""
    return shape_problems(parameters) + friction_problems(parameters)


def inert(parameters: dict[str, Any]) -> dict[str, str]:
    """Parameters without effect: see `elastic_belt.inert`."""
    found = elastic_belt.inert(parameters | OF_THE_COURSE)
    return {key: setting for key, setting in found.items() if key not in OF_THE_COURSE}
