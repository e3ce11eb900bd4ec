"""The running steady state of the elastic belt, solved as a boundary value problem with complementarity.

It answers *what are the forces?*: ring tension and push force in each strand, contact forces and sliding over
both wraps, thrust ratio and loss of speed, at a load at which the belt runs quietly. It is the elastic belt
itself: same parameters, same right-hand side, none of its time. It cannot answer whether that state is
stable, and so whether the belt vibrates about it, or how far; the mean forces of a belt that vibrates.
Importing this package is cheap.
"""

from cvt_hpc.models import elastic_belt
from cvt_hpc.models.elastic_belt import shape_problems
from cvt_hpc.models.elastic_belt.pulley_checks import steady_pulley_problems
from cvt_hpc.parameters import Parameter, Parameters, Problem
from cvt_hpc.physics.friction_laws import friction_problems

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}

OF_THE_COURSE: Parameters = {
    "load_history": "constant",
    "load_start": 0.0,
    "speed_history": "constant",
    "speed_start": 1.0,
    "rise_time": 1.0,
    "start_damping": 1e4,
    "disturbance": 0.0,
    "seed": 1,
    **{key: parameter.default for key, parameter in elastic_belt.PARAMETERS["profiles"].items()},
}

# How soon pulleys come to rest, and where a controller begins: without effect on where they rest
OF_LAGS = ("tilt_lag", "ratio_gain")

PARAMETERS: dict[str, dict[str, Parameter]] = {
    section: {key: parameter for key, parameter in table.items() if key not in OF_THE_COURSE}
    for section, table in elastic_belt.PARAMETERS.items()
    if section not in ("profiles", "rings", "numerics", "record")  # of a transient
}


def check(parameters: Parameters) -> list[Problem]:
    """Problems that lie between parameters: as of `elastic_belt`."""
    return belt_problems(parameters) or steady_pulley_problems(parameters)


def belt_problems(parameters: Parameters) -> list[Problem]:
    """Problems of the belt, whatever its load. Result as of `check`."""
    return shape_problems(parameters) + friction_problems(parameters)


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect: see `elastic_belt.inert`."""
    found = elastic_belt.inert({**parameters, **OF_THE_COURSE}) | dict.fromkeys(OF_LAGS, "a steady state")
    return {key: setting for key, setting in found.items() if key not in OF_THE_COURSE}
