"""A march under way: a method, a system and a state, advanced sample by sample."""

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np

from cvt_hpc.steppers import STEPPERS
from cvt_hpc.steppers.facts import COUNTERS, MESSAGES, REJECTED, STEPS, Facts, Result
from cvt_hpc.steppers.system import SetValuedSystem, System


class Marching:
    """A method at work on a system.

    Parameters
    ----------
    stepper : str
        A name in `STEPPERS`, of a stepper that marches by itself.
    parameters : mapping
        Flat parameters of a run [SI], the method's among them.
    system : System or SetValuedSystem
        The equations; set-valued ones for a method that needs "friction".
    state : (n,) array
        Initial state.
    interval : float
        Sampling interval [s].

    Attributes
    ----------
    facts : Facts
        Of the method.
    y : (n,) array
        The present state; may be changed between two calls.
    """

    def __init__(
        self,
        stepper: str,
        parameters: Mapping[str, Any],
        system: System | SetValuedSystem,
        state: np.ndarray,
        interval: float,
    ) -> None:
        self._method = import_module(STEPPERS[stepper])
        self.facts: Facts = self._method.FACTS
        self.y = state.copy()
        self.interval = interval
        self._system = system
        self._control = self._method.control(parameters)
        self._work = self._method.work(system)
        self._clock, self._begun = np.zeros(1), 0.0
        self._counts = np.zeros(len(COUNTERS), dtype=np.int64)

    def tell(self, **options: Any) -> None:
        """Give an integrator of SciPy further facts on the system, such as its Jacobian by `jac`."""
        self._work.options |= options

    def begin(self, time: float, state: np.ndarray) -> None:
        """Start from a later state.

        Parameters
        ----------
        time : float
            Simulated time [s].
        state : (n,) array
            The unknowns there.
        """
        self._begun = self._clock[0] = time
        self.y[:] = state

    def advance(self, rows: np.ndarray) -> Result:
        """March on.

        Parameters
        ----------
        rows : (samples, n) array
            Result: the state at the end of each sampling interval. None of them: compiles only.
        """
        outcome = self._method.march(
            self._system, self._control, self.interval, rows, self._clock, self.y, self._work, self._counts
        )
        return Result(outcome)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._clock[0])

    @property
    def steps(self) -> int:
        """Steps taken, refused ones excluded."""
        return int(self._counts[STEPS])

    @property
    def step(self) -> float:
        """Mean time step so far [s]; before the first one the requested step, nan if there was none."""
        if not self.steps:
            return float(getattr(self._control, "step", np.nan))
        return (self.time - self._begun) / self.steps

    def counters(self) -> dict[str, int]:
        """Work done so far, by the names of COUNTERS."""
        return dict(zip(COUNTERS, map(int, self._counts), strict=True))

    def explain(self, outcome: Result) -> str:
        """Describe in words how a march has ended, and the attempted steps.

        Parameters
        ----------
        outcome : Result
            Not OK.
        """
        tried = f"{self.steps} steps of {self.step:.3g} s on average"
        rejected = int(self._counts[REJECTED])
        return f"{MESSAGES[outcome]} ({tried}{f', {rejected} repeated' if rejected else ''})"
