"""The march of SciPy's integrators, for comparison: the same rates, the same samples, the same codes.

The integrator goes its own steps and its interpolant gives the samples; it is kept from call to call, and
started anew where state or time have been changed from outside. It is called from Python, which costs some
10 us an evaluation: for a few unknowns that is most of its time, for a belt it is little.
"""

import warnings
from typing import Any

import numpy as np
from scipy.integrate import OdeSolver

from cvt_hpc.steppers.facts import FACTORISATIONS, JACOBIANS, RATES, STEPS, Facts, Result
from cvt_hpc.steppers.settings import MOST_STEPS, TOLERANCE, Tolerance, tolerance
from cvt_hpc.steppers.system import System

# Common facts of the three; each states its own.
FACTS = Facts(order=5, adaptive=True, implicit=True, stability="", damping="below the tolerance")
PARAMETERS = {"numerics": {"tolerance": TOLERANCE, "most_steps": MOST_STEPS}}
control = tolerance


class Work:
    """An integrator with the data that it keeps.

    Attributes
    ----------
    options : dict
        Further facts on the system, such as `jac`; may be set before the first march.
    solver : OdeSolver or None
        None until it is started.
    time, state
        Where the last march ended [s], (n,).
    counted : (3,) int array
        Evaluations, Jacobians and factorisations counted so far.
    evaluations : int
        Of the rates, by this solver.
    known : bool
        Whether every rate of the present step had a value.
    """

    def __init__(self) -> None:
        self.options: dict[str, Any] = {}
        self.solver: Any = None
        self.time, self.state = 0.0, np.zeros(0)
        self.counted = np.zeros(3, dtype=np.int64)
        self.evaluations, self.known = 0, True

    def start(
        self, method: type[OdeSolver], system: System, control: Tolerance, time: float, y: np.ndarray
    ) -> None:
        """Start the integrator at a state."""

        def rates(t: float, state: np.ndarray) -> np.ndarray:
            out = np.zeros_like(state)
            self.evaluations += 1
            if not system.rates(system.constants, t, np.ascontiguousarray(state), out):
                self.known, out[:] = False, np.nan
            return out

        self.evaluations, self.known = 0, True
        self.counted[:] = 0
        allowed = {"rtol": control.tolerance, "atol": control.tolerance * system.scale}
        self.solver = method(rates, time, y.copy(), np.inf, **allowed, **self.options)

    def count(self, counts: np.ndarray) -> None:
        """Add the work since the last call to the counters."""
        now = np.array([self.evaluations, self.solver.njev, self.solver.nlu])
        counts[[RATES, JACOBIANS, FACTORISATIONS]] += now - self.counted
        self.counted = now


def work(system: System) -> Work:
    """Workspace in which the integrator is kept."""
    return Work()


def march_by(
    method: type[OdeSolver],
    system: System,
    control: Tolerance,
    interval: float,
    rows: np.ndarray,
    clock: np.ndarray,
    y: np.ndarray,
    work: Work,
    counts: np.ndarray,
) -> int:
    """March by an integrator of SciPy.

    Parameters
    ----------
    method : type
        LSODA, BDF or Radau of `scipy.integrate`.
    system, control, interval, rows, clock, y, work, counts
        As in every `march` of this package: see `cvt_hpc.steppers`.

    Returns
    -------
    int
        A `Result`.
    """
    # warnings of SciPy and its rates repeat the returned code
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        try:
            if work.solver is None or work.time != clock[0] or not np.array_equal(work.state, y):
                work.start(method, system, control, float(clock[0]), y)
            for k in range(rows.shape[0]):
                outcome = _sample(work, control, clock[0] + interval, y, counts)
                if outcome != Result.OK:
                    clock[0] = work.solver.t
                    return int(outcome)
                clock[0] += interval
                rows[k] = y
        except (ValueError, np.linalg.LinAlgError):  # matrices with entries that are not numbers
            return int(Result.NOT_FINITE if work.known else Result.NO_VALUE)
        finally:
            if work.solver is not None:
                work.count(counts)
            work.time, work.state = float(clock[0]), y.copy()
    return int(Result.OK)


def _sample(work: Work, control: Tolerance, end: float, y: np.ndarray, counts: np.ndarray) -> Result:
    """Step until `end` is passed, and interpolate there."""
    solver = work.solver
    for _ in range(control.most_steps):
        if solver.t >= end:
            y[:] = solver.dense_output()(end) if solver.t > end else solver.y
            return Result.OK
        solver.step()
        counts[STEPS] += 1
        finite = np.all(np.isfinite(solver.y))
        if solver.status == "failed" or not finite:
            y[:] = solver.y
            if not work.known:
                return Result.NO_VALUE
            return Result.STEP_TOO_SMALL if finite else Result.NOT_FINITE
        work.known = True  # it has found a way round where there was no value
    return Result.TOO_MANY_STEPS
