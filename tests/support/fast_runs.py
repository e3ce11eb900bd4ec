"""The belt's own steps for tests: runs with a state of their own choice, each in a lane of its own."""

from __future__ import annotations

from cvt_hpc.models.elastic_belt.belt import Belt, State
from cvt_hpc.models.elastic_belt.sampling import Outcome
from cvt_hpc.models.elastic_belt.transient import StateMarch as FastRuns

__all__ = ["FastRuns", "march", "march_fast"]


def march(stepper: str, belt: Belt, state: State, step: float, steps: int) -> State:
    """State of one run after some steps, alone in its lane, with the dampers' work in them."""
    run = FastRuns([belt], [state], stepper=stepper)
    run.advance(steps, step)
    assert run.outcome() is Outcome.OK, run.outcome()
    return run.state()


def march_fast(belt: Belt, state: State, step: float, steps: int) -> State:
    """As `march`, by the fast step."""
    return march("imex", belt, state, step, steps)
