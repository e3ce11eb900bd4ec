"""Limit of slip of a belt: the largest torque under a thrust, or the least thrust for a torque.

Two methods answer: Bullinger et al. 2005, eq. 2, in a microsecond, and steady states of the elastic belt as
its driven pulley is slowed down, in seconds. The latter also give the working point that is safe by a factor:
thrusts of both pulleys, efficiency and losses by their part. It cannot answer whether the belt vibrates
there. A belt whose gaps wander may carry some per cent more than its steady states do. Importing this package
is cheap.

Parameters of the limit of slip that a job may set: the steady belt's parameters, and the question.
"""

from cvt_hpc.models import steady_variator
from cvt_hpc.models.elastic_belt.pulley_checks import slipping_pulley_problems
from cvt_hpc.parameters import Parameter, Parameters, Problem

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "question": {
        "sought": Parameter(
            "torque",
            "",
            "the largest torque under the thrust, or the least thrust for the load",
            choices=("torque", "thrust"),
        ),
        "method": Parameter(
            "steady_state",
            "",
            "steady states of the elastic belt, or the formula of Bullinger et al. 2005, eq. 2",
            choices=("steady_state", "formula"),
        ),
        # 1.3 is a common choice for clamping forces, and an assumption
        "safety": Parameter(1.3, "", "limit over working point, of torque or thrust", minimum=1.0),
    },
    **steady_variator.PARAMETERS,
}

DEFAULT_STEPPER = None
STEPPERS: dict[str, str] = {}


def check(parameters: Parameters) -> list[Problem]:
    """Problems that lie between parameters: those of the belt, or a thrust sought for no load."""
    problems = steady_variator.belt_problems(parameters) + slipping_pulley_problems(parameters)
    if parameters["sought"] == "thrust" and parameters["load"] == 0.0:
        problems.append(("load", 'other than 0 where sought = "thrust"', "0 N m"))
    return problems


def inert(parameters: Parameters) -> dict[str, str]:
    """Parameters without effect; of a load whose limit is sought the sign counts, the direction of power."""
    found = dict(steady_variator.inert(parameters))
    if parameters["sought"] == "thrust":
        found["thrust"] = "sought thrust"
    return found
