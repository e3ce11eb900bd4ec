"""Properties of a method of time integration, and the ways in which a march with it can end."""

from dataclasses import dataclass
from enum import IntEnum
from math import inf

from cvt_hpc.parameters import Parameter


class Result(IntEnum):
    """Outcome of a march, as kernels return it."""

    OK = 0
    NOT_FINITE = 1
    NO_VALUE = 2
    STEP_TOO_SMALL = 3
    NO_CONVERGENCE = 4
    SINGULAR = 5
    TOO_MANY_STEPS = 6
    NOT_UNIQUE = 7


# the same as plain numbers, for kernels
OK, NOT_FINITE, NO_VALUE, STEP_TOO_SMALL, NO_CONVERGENCE, SINGULAR, TOO_MANY_STEPS, NOT_UNIQUE = map(
    int, Result
)
MESSAGES: dict[Result, str] = {
    Result.NOT_FINITE: "the state is not a number",
    Result.NO_VALUE: "the right-hand side has no value",
    Result.STEP_TOO_SMALL: "no step is short enough for the tolerance",
    Result.NO_CONVERGENCE: "the equations of an implicit step were not solved",
    Result.SINGULAR: "the matrix of an implicit step is singular",
    Result.TOO_MANY_STEPS: "more steps in a sampling interval than are allowed",
    Result.NOT_UNIQUE: (
        "friction falls too steeply for an implicit step of this length, which has more than one solution or "
        "turns growth into decay"
    ),
}

# Work counters, in the order of the array that every march adds to.
COUNTERS = ("steps", "rejected", "rates", "jacobians", "factorisations", "solves")
STEPS, REJECTED, RATES, JACOBIANS, FACTORISATIONS, SOLVES = range(len(COUNTERS))


# Of steps that are written for the processor's registers.
LANES = Parameter(
    "runs",
    "",
    "content of the lanes of a register: runs side by side, or stations of one run, which then ends sooner",
    choices=("runs", "stations"),
)


@dataclass(frozen=True)
class Facts:
    """Properties by which a method is chosen.

    Attributes
    ----------
    order : int
        Order of the error in the step, or of the error per step's control, where the motion is smooth.
    order_at_events : float or None
        Order that is left where friction turns from slip to stick and back, as measured
        (tests/order/test_events.py); None for an adaptive method, whose step follows the event.
    adaptive : bool
        Takes a tolerance instead of a step.
    needs : frozenset of str
        Needs of the method: "rates"; "partition" (which unknowns are velocities, and of which positions);
        "friction" (set-valued forces by their bounds).
    implicit : bool
        Solves linear systems with the Jacobian.
    l_stable : bool
        Motions much faster than the step are gone after it.
    stability : str
        The limit of the step, in a sentence.
    damping : str
        Effect of the method on a vibration, in a sentence.
    rest_limit : float
        Largest step times the rate at which smoothed friction stops sliding, N mu / (m v_reg), with which
        sliding comes to rest [1].
    width_limit : float
        Of an adaptive method: largest error that the tolerance allows in a speed, against the width v_reg of
        smoothed friction, with which sliding comes to rest and stays there, as measured [1].
    vibration_limit : float
        Largest step times the frequency of a vibration that does not grow by itself [1].
    """

    order: int
    stability: str
    damping: str
    order_at_events: float | None = None
    adaptive: bool = False
    needs: frozenset[str] = frozenset({"rates"})
    implicit: bool = False
    l_stable: bool = False
    rest_limit: float = inf
    width_limit: float = inf
    vibration_limit: float = inf
