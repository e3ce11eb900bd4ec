"""A transient run of a model that offers its rates: any stepper marches it, and each sample is kept.

Such a run has no lanes: it is alone in its batch.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, NamedTuple, Self

import numpy as np

from cvt_hpc.recording import sample_count
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.system import SetValuedSystem, System
from cvt_hpc.variables import Status


class Probe(NamedTuple):
    """A place where displacement is recorded: label, and position [m]."""

    label: str
    position: float


class Marched:
    """State of a run's march: its progress, and its work.

    Attributes
    ----------
    marching : Marching
        The stepper at work on the model's equations.
    failure : (Status, str) or None
        Why the run cannot continue.
    """

    marching: Marching
    failure: tuple[Status, str] | None = None

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.marching.time

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return self.marching.steps

    @property
    def step(self) -> float:
        """Mean time step so far [s]."""
        return self.marching.step

    @property
    def contact_solves(self) -> int:
        """Solves of a contact problem so far."""
        return 0

    def counters(self) -> dict[str, int]:
        """Work done so far: steps, rejected, rates, jacobians, factorisations, solves."""
        return self.marching.counters()

    def paused(self) -> Self:
        """The state from which a batch of the same point over a longer time continues: the run itself."""
        return self

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """Why a run that reached its end fails the checks: its march has checked everything."""
        return None


class MarchedRun(Marched):
    """One run, advanced sample by sample.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI], the stepper's among them.
    stepper : str
        Name of a general stepper.
    system : System or SetValuedSystem
        The model's equations, as the stepper needs them.
    state : (n,) array
        Initial state.
    probes : sequence of Probe
        Where displacement is recorded.
    displacements : sequence of int
        The unknown that is the displacement [m] at each probe.
    frequency : float
        The model's fastest undamped vibration [rad/s], which an explicit step must resolve.

    Attributes
    ----------
    parameters, probes
        As given.
    samples : int
        Samples of the whole run.
    interval : float
        Sampling interval [s].
    rows : (samples, n) array
        The state at each sample; filled up to `done`.
    done : int
        Samples recorded so far.
    """

    def __init__(
        self,
        parameters: Mapping[str, Any],
        stepper: str,
        system: System | SetValuedSystem,
        state: np.ndarray,
        probes: Sequence[Probe],
        displacements: Sequence[int],
        frequency: float,
    ) -> None:
        self.probes = tuple(probes)
        self.interval = 1.0 / parameters["sampling_rate"]
        self.rows = np.empty((0, state.size))
        self.prolong(parameters)
        self.done = 0
        self.marching = Marching(stepper, parameters, system, state, self.interval)
        self._displacements = list(displacements)
        self._longest = self.marching.facts.vibration_limit / frequency

    def prolong(self, parameters: Mapping[str, Any]) -> None:
        """Make room for the samples of a longer duration.

        Parameters
        ----------
        parameters : mapping
            Parameters of the run but for `duration` and `judged_fraction`.
        """
        self.parameters = parameters
        self.samples = sample_count(parameters)
        new = np.full((self.samples - len(self.rows), self.rows.shape[1]), np.nan)
        self.rows = np.concatenate([self.rows, new])

    @property
    def times(self) -> np.ndarray:
        """Instants of the samples recorded so far, (done,) [s]."""
        return self.interval * np.arange(1, self.done + 1)

    @property
    def displacement(self) -> np.ndarray:
        """Displacement at the probes, (done, probe) [m]."""
        return self.rows[: self.done, self._displacements]

    def advance(self, samples: int) -> tuple[Status, str] | None:
        """March on.

        Parameters
        ----------
        samples : int
            How many samples at most; 0 compiles only.

        Returns
        -------
        (Status, str) or None
            The failure, where the run cannot continue.
        """
        first, last = self.done, min(self.done + samples, self.samples)
        outcome = self.marching.advance(self.rows[first:last])
        wrong = self._too_long()
        if outcome == Result.OK:
            self.done = last
            wrong = wrong or self._doubt(first)
        else:
            wrong = wrong or self.marching.explain(outcome)
        self.failure = (Status.FAILED_NUMERICS, wrong) if wrong else None
        return self.failure

    def _too_long(self) -> str | None:
        """Whether the fastest vibration grows from step to step, which shows late in a linear model."""
        if not self.step > self._longest:
            return None
        return f"the step is beyond {self._longest:.3g} s, from where the fastest vibration grows by itself"

    def _doubt(self, first: int) -> str | None:
        """Why the samples from `first` on are none of the model's motion, by the model's own laws."""
        return None


class BatchOfOne:
    """A batch of one run.

    Parameters
    ----------
    run : object
        Which has `samples`, `done`, `interval`, `failure`, and `advance(samples)`.

    Attributes
    ----------
    runs : tuple
        The run.
    samples : int
        Samples of the whole run.
    interval : float
        Sampling interval [s].
    """

    def __init__(self, run: Any) -> None:
        self.runs = (run,)
        self.samples, self.interval = run.samples, run.interval

    @property
    def done(self) -> int:
        """Samples recorded so far."""
        return self.runs[0].done

    @property
    def running(self) -> bool:
        """Whether it has not ended."""
        (run,) = self.runs
        return run.failure is None and run.done < self.samples

    def advance(self, samples: int) -> None:
        """March on.

        Parameters
        ----------
        samples : int
            How many samples at most.
        """
        self.runs[0].advance(samples)

    def take_over(self, runs: Sequence[Any]) -> None:
        """Continue a run by another stepper; for models with TAKES_OVER.

        Parameters
        ----------
        runs : sequence of one run
            Of the same point.
        """
        self.runs[0].take_over(runs)


def batches_of_one(run: Callable[[Mapping[str, Any], str], Any]) -> Callable[..., BatchOfOne]:
    """The function `batch` of a model without lanes.

    Parameters
    ----------
    run : type
        Makes a run from its parameters and the name of a stepper.
    """
    return partial(_batch_of_one, run)


def _batch_of_one(
    run: Callable[[Mapping[str, Any], str], Any],
    points: Sequence[Mapping[str, Any]],
    stepper: str,
    paused: Sequence[Any] = (),
) -> BatchOfOne:
    (parameters,) = points
    if not paused:
        return BatchOfOne(run(parameters, stepper))
    (shorter,) = paused
    shorter.prolong(parameters)
    return BatchOfOne(shorter)
