"""A transient run of the elastic belt by any general stepper: the belt as one system, sampled as ever."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt import flat
from cvt_hpc.models.elastic_belt.belt import (
    LAYER_WORK,
    N_ELEMENT,
    REGIONS,
    Belt,
    Mesh,
    State,
    W,
    belt_constants,
    initial_state,
    mesh,
    random_strands,
)
from cvt_hpc.models.elastic_belt.explicit import damper_power
from cvt_hpc.models.elastic_belt.imex import imex_work
from cvt_hpc.models.elastic_belt.lane_belt import lane_belt, lane_state
from cvt_hpc.models.elastic_belt.march import record_state
from cvt_hpc.models.elastic_belt.rhs import strains
from cvt_hpc.models.elastic_belt.sampling import CHANNELS, PROFILES, Outcome, probes, sensors
from cvt_hpc.models.elastic_belt.structure import SparseJacobian
from cvt_hpc.models.elastic_belt.transient import FAILURES, doubt
from cvt_hpc.steppers.facts import Result
from cvt_hpc.steppers.marching import Marching
from cvt_hpc.steppers.stiffness import STABLE, fastest_rate
from cvt_hpc.variables import Status

SAMPLES_TOGETHER = 20  # between two looks at what was sampled: a run that has left its path goes not far


class Form:
    """The belt as a system of equations, and the way between their unknowns and its state.

    Parameters
    ----------
    belt, grid
        Constants and mesh.
    parameters : dict
        Resolved parameters of the run [SI].

    Attributes
    ----------
    system : System
        The equations.
    """

    def __init__(self, belt: Belt, grid: Mesh, parameters: dict[str, Any]) -> None:
        self._flat = flat.flat_belt(belt)
        self.system = flat.system(self._flat)

    def pack(self, state: State) -> np.ndarray:
        """Unknowns of a state."""
        return flat.pack(self._flat, state)

    def state(self, time: float, y: np.ndarray) -> State:
        """State of unknowns; overwritten by the next call, and by the next evaluation of rates."""
        flat.unpack(self._flat, time, y)
        return self._flat.state

    def hints(self, stepper: str) -> dict[str, Any]:
        """What SciPy's integrators can use: the Jacobian, sparse where they take it so."""
        jacobian = SparseJacobian(self._flat)
        if stepper == "scipy_lsoda":
            return {"jac": lambda t, y: jacobian(t, y).toarray()}
        return {"jac": jacobian}


class GeneralTransient:
    """One run, advanced sample by sample.

    Parameters
    ----------
    parameters : dict
        Resolved parameters of the run [SI], the stepper's among them.
    stepper : str
        Name of a general stepper that the model does not refuse.

    Attributes
    ----------
    probes : tuple of Probe
        Where displacement is recorded.
    samples : int
        Samples of the whole run.
    interval : float
        Sampling interval [s].
    done : int
        Samples recorded so far.
    """

    form = Form

    def __init__(self, parameters: dict[str, Any], stepper: str) -> None:
        p = self.parameters = parameters
        self.mesh = mesh(p)
        self.belt = belt_constants(p)
        self.interval = 1.0 / p["sampling_rate"]
        self.samples = max(int(round(p["duration"] * p["sampling_rate"])), 1)
        self.probes = probes(self.mesh, p["strand_probes"], p["arc_probes"])
        self._sensing = sensors(self.mesh, self.probes, self.interval, np.float64)
        self._rows = LaneArray(self.samples, self._sensing.matrix.shape[0] + len(CHANNELS), 1)
        self._kick = min(int(np.ceil(p["rise_time"] * p["sampling_rate"])), self.samples)
        self._first_judged = self.samples - round(p["judged_fraction"] * self.samples)
        self._disturbed = False
        n = self.mesh.cell.size
        self._profiles = [LaneArray(n, len(PROFILES), 1) for _ in range(2)]
        self._ended = LaneArray(1, 3, 1)
        self._form = self.form(self.belt, self.mesh, p)
        first = initial_state(p, self.belt)
        start = self._form.pack(first)
        # the same run as a single lane, which is what can be sampled
        lane = lane_state([self.belt], [first], np.float64)
        self._lane = (lane_belt([self.belt], np.float64), lane, imex_work(lane))
        self._marching = Marching(stepper, p, self._form.system, start, self.interval)
        self._stable = STABLE.get(stepper, np.inf)
        self._fastest = np.random.default_rng(0).normal(size=start.size)
        if stepper.startswith("scipy_"):
            self._marching.tell(**self._form.hints(stepper))
        self.done = 0

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self._marching.time

    @property
    def step(self) -> float:
        """Mean time step so far [s]."""
        return self._marching.step

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return self._marching.steps

    def counters(self) -> dict[str, int]:
        """Work done so far, by name."""
        return self._marching.counters()

    @property
    def state(self) -> State:
        """The present state; a copy."""
        return self._form.state(self.time, self._marching.y).copy()

    @property
    def contact_solves(self) -> int:
        """Solves of the contact problem so far: two wraps in every evaluation of the rates."""
        return 2 * self.counters()["rates"]

    @property
    def rows(self) -> np.ndarray:
        """The sensors' displacement [m], the strands' modes [m], and CHANNELS, (done, S + C)."""
        return self._rows.data[: self.done, :, 0]

    @property
    def displacement(self) -> np.ndarray:
        """Displacement at the probes, (done, probe) [m]."""
        return self.rows[:, : len(self.probes)]

    @property
    def modes(self) -> np.ndarray:
        """Sine amplitudes of both strands, (done, 2, MODES) [m]."""
        first, last = len(self.probes), self._sensing.matrix.shape[0]
        return self.rows[:, first:last].reshape(self.done, 2, -1)

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,)."""
        return self.rows[:, self._sensing.matrix.shape[0] + CHANNELS.index(name)]

    @property
    def judged(self) -> slice:
        """Samples of the judged part."""
        return slice(self._first_judged, self.samples)

    @property
    def profiles(self) -> dict[str, np.ndarray]:
        """PROFILES around the belt, (N,) each: mean over the judged part at the stations, nan before it."""
        count = self.done - self._first_judged
        sums = self._profiles[1].data[:, :, 0].T
        return dict(zip(PROFILES, sums / (count if count > 0 else np.nan), strict=True))

    @property
    def regions(self) -> np.ndarray:
        """Name of the region behind each station, (N,)."""
        return np.array(REGIONS)[self.mesh.region]

    def take_over(self, runs: Sequence[Any]) -> None:
        """Go on from where a run by another stepper stands, its history included but for the mean profiles.

        Parameters
        ----------
        runs : sequence of one Transient or GeneralTransient
            Of the same mesh, sampling and duration.
        """
        (run,) = runs
        self.done, self._disturbed = run.done, run.done > self._kick
        self._rows.data[: self.done, :, 0] = run.rows
        self._marching.begin(run.time, self._form.pack(run.state))

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
        found = self._march(0) if samples == 0 else None
        while found is None and self.done < last:
            if self.done == self._kick and not self._disturbed:
                self._disturb()
            stop = min(last, self.done + SAMPLES_TOGETHER)
            if self.done < self._kick:
                stop = min(stop, self._kick)
            found = self._march(stop - self.done)
        return found

    def _disturb(self) -> None:
        """Give the strands their random displacement, once the start-up's damping has gone."""
        p, state = self.parameters, self.state
        state.fields[W] += random_strands(self.mesh, p["disturbance"], p["seed"])
        self._marching.y[:] = self._form.pack(state)
        self._disturbed = True

    def _march(self, count: int) -> tuple[Status, str] | None:
        """March by `count` sampling intervals and record them."""
        rows = np.full((count, self._marching.y.size), np.nan)
        outcome = self._marching.advance(rows)
        for row in rows:
            if not np.all(np.isfinite(row)):
                break
            seen = self._sample(row)
            if seen != Outcome.OK:
                return FAILURES[Outcome(seen)]
        if outcome != Result.OK:
            return Status.FAILED_NUMERICS, self._marching.explain(outcome)
        return self._too_long() if np.isfinite(self._stable) else None

    def _too_long(self) -> tuple[Status, str] | None:
        """Whether an explicit step is beyond its limit, where friction only hums and nothing diverges."""
        rate = fastest_rate(self._form.system, self.time, self._marching.y, self._fastest)
        if self._marching.step * rate <= self._stable:
            return None
        step, limit = self._marching.step, self._stable / rate
        found = f"the step {step:.3g} s is beyond what is stable, {limit:.3g} s"
        return Status.FAILED_NUMERICS, f"{found}: some motion has a rate of {rate:.3g}/s"

    def _sample(self, y: np.ndarray) -> int:
        """Record one state."""
        state = self._form.state((self.done + 1) * self.interval, y)
        profiles = self._profiles[int(self.done >= self._first_judged)]
        # a general stepper knows nothing of dampers: their work is taken from the state, as over the interval
        eps = np.empty((2, self.mesh.cell.size))
        strains(self.belt, state.fields, eps)
        power = damper_power(self.belt, state.fields, eps, np.zeros((N_ELEMENT + 2, eps.shape[1])), 0.0)
        state.scalars[LAYER_WORK] = power * self.interval
        record_state(
            self.belt, state, *self._lane, self._sensing, self._rows, self.done, profiles, self._ended
        )
        outcome = int(self._ended.data[0, 0, 0])
        self.done += int(outcome == Outcome.OK)
        return outcome

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """Whether a run that reached its end is not to be trusted.

        Parameters
        ----------
        record : dict
            With `power_residual` and `least_strand_force`.

        Returns
        -------
        (Status, str) or None
            As `advance`.
        """
        return doubt(record, self.parameters["bending_stiffness"], self.mesh)
