"""Parameters of a method that a job may set: the entries that several methods share, once."""

from functools import partial
from typing import NamedTuple, TypeVar

from cvt_hpc.parameters import Parameter, Parameters, positive

STEP = positive(
    1e-5, "s", "largest time step; a whole number of steps makes a sampling interval", sensible=(1e-10, 0.5)
)
SPEED_TOLERANCE = Parameter(
    1e-3,
    "m/s",
    "largest correction of a speed with which the equations of a step count as solved",
    minimum=1e-12,
    maximum=1.0,
    sensible=(1e-12, 0.1),
)
MOST_ITERATIONS = Parameter(40, "", "iterations of a step", minimum=2, maximum=1000)
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


def own_step(default: float | None, least: float, longest: float) -> Parameter:
    """The step [s] of a model's own method, with its bounds."""
    bounds = least, longest
    return Parameter(default, "s", STEP.description, minimum=least, maximum=longest, sensible=bounds)


Kind = TypeVar("Kind", bound=NamedTuple)


def from_parameters(kind: type[Kind], parameters: Parameters) -> Kind:
    """Control whose fields are numbers named as the flat parameters [SI]."""
    return kind._make(float(parameters[key]) for key in kind._fields)


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


fixed_step = partial(from_parameters, FixedStep)
implicit_step = partial(from_parameters, ImplicitStep)


def tolerance(parameters: Parameters) -> Tolerance:
    """Control of an adaptive method, from flat parameters."""
    return Tolerance(float(parameters["tolerance"]), int(parameters["most_steps"]))
