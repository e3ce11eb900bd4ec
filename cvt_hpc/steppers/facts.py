"""What a method of time integration says of itself, and of how a march with it has ended."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum


class Result(IntEnum):
    """How a march ended, as kernels return it."""

    OK = 0
    NOT_FINITE = 1
    NO_VALUE = 2
    STEP_TOO_SMALL = 3
    NO_CONVERGENCE = 4
    SINGULAR = 5
    TOO_MANY_STEPS = 6
    NOT_UNIQUE = 7


MESSAGES: dict[Result, str] = {
    Result.NOT_FINITE: "the state is not a number",
    Result.NO_VALUE: "the right-hand side has no value",
    Result.STEP_TOO_SMALL: "no step is short enough for the tolerance",
    Result.NO_CONVERGENCE: "the equations of an implicit step were not solved",
    Result.SINGULAR: "the matrix of an implicit step is singular",
    Result.TOO_MANY_STEPS: "more steps in a sampling interval than are allowed",
    Result.NOT_UNIQUE: (
        "friction falls so steeply that an implicit step of this length has more than one solution"
    ),
}

# Work counters, in the order of the array that every march adds to.
COUNTERS = ("steps", "rejected", "rates", "jacobians", "factorisations", "solves")
STEPS, REJECTED, RATES, JACOBIANS, FACTORISATIONS, SOLVES = range(len(COUNTERS))


@dataclass(frozen=True)
class Facts:
    """What a chooser has to know of a method.

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
        What a system must offer: "rates"; "partition" (which unknowns are velocities, and of what);
        "friction" (set-valued forces by their bounds).
    implicit : bool
        Solves linear systems with the Jacobian.
    l_stable : bool
        Motions much faster than the step are gone after it.
    damping_limit : float
        Largest step times the rate of a decay (friction: N mu / (m v_reg)) that stays a decay [1].
    stability : str
        The limit of the step, in a sentence.
    damping : str
        What the method does to a vibration, in a sentence.
    """

    order: int
    order_at_events: float | None
    adaptive: bool
    needs: frozenset[str]
    implicit: bool
    l_stable: bool
    damping_limit: float
    stability: str
    damping: str
