"""A transient run of a model that offers its rates: any stepper marches it, and each sample is kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.variables import Status


class Probe(NamedTuple):
    """A place where displacement is recorded: label, and position [m]."""

    label: str
    position: float


class MarchedRun:
    """One run, advanced sample by sample.

    Parameters
    ----------
    parameters : mapping
        Resolved parameters of the run [SI].
    march : Marching
        The stepper with the model's equations and initial state.
    probes : sequence of Probe
        Where displacement is recorded.
    displacements : sequence of int
        The unknown that is the displacement [m] at each probe.

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
        march: Marching,
        probes: Sequence[Probe],
        displacements: Sequence[int],
    ) -> None:
        self.parameters = parameters
        self.probes = tuple(probes)
        self.interval = march.interval
        self.samples = max(int(round(parameters["duration"] * parameters["sampling_rate"])), 1)
        self.rows = np.full((self.samples, march.y.size), np.nan)
        self.done = 0
        self._march = march
        self._displacements = list(displacements)

    @property
    def times(self) -> np.ndarray:
        """Instants of the samples recorded so far, (done,) [s]."""
        return self.interval * np.arange(1, self.done + 1)

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._march.time

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return self._march.steps

    @property
    def step(self) -> float:
        """Mean time step so far [s]."""
        return self._march.step

    def counters(self) -> dict[str, int]:
        """Work done so far: steps, rejected, rates, jacobians, factorisations, solves."""
        return self._march.counters()

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
            What has gone wrong, where the run cannot go on.
        """
        last = min(self.done + samples, self.samples)
        outcome = self._march.advance(self.rows[self.done : last])
        if outcome != Result.OK:
            return Status.FAILED_NUMERICS, self._march.explain(outcome)
        self.done = last
        return None
