"""What a job may set of a method: the entries that several methods share, once."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from cvt_hpc.parameters import Parameter

STEP = Parameter(
    1e-5,
    "s",
    "largest time step; a whole number of steps makes a sampling interval",
    minimum=0.0,
    exclusive=True,
)
TOLERANCE = Parameter(
    1e-6,
    "",
    "error allowed in a step, relative to each unknown or its typical size, the larger",
    minimum=1e-13,
    maximum=0.1,
)
MOST_STEPS = Parameter(
    1_000_000, "", "steps in a sampling interval beyond which the run is given up", minimum=1
)
SOLVER_TOLERANCE = Parameter(
    1e-10,
    "",
    "error allowed in the solution of an implicit step, relative to each unknown's typical size",
    minimum=1e-14,
    maximum=1e-2,
)


class FixedStep(NamedTuple):
    """Control of a method with a fixed step."""

    step: float


class ImplicitStep(NamedTuple):
    """Control of a method that solves equations in every step."""

    step: float
    solver_tolerance: float


class Tolerance(NamedTuple):
    """Control of a method that chooses its steps."""

    tolerance: float
    most_steps: int


def fixed_step(parameters: Mapping[str, Any]) -> FixedStep:
    """Control of a method with a fixed step, from flat parameters [SI]."""
    return FixedStep(float(parameters["step"]))


def implicit_step(parameters: Mapping[str, Any]) -> ImplicitStep:
    """Control of an implicit method, from flat parameters [SI]."""
    return ImplicitStep(float(parameters["step"]), float(parameters["solver_tolerance"]))


def tolerance(parameters: Mapping[str, Any]) -> Tolerance:
    """Control of an adaptive method, from flat parameters."""
    return Tolerance(float(parameters["tolerance"]), int(parameters["most_steps"]))
