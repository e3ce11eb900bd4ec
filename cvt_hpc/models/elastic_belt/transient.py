"""A transient run of the elastic belt: state, stepper and recording in one object."""

from __future__ import annotations

from typing import Any

import numpy as np

from cvt_hpc.models.elastic_belt.belt import (
    FIELDS,
    REGIONS,
    W,
    belt_constants,
    initial_state,
    mesh,
    random_strands,
)
from cvt_hpc.models.elastic_belt.imex import imex_work
from cvt_hpc.models.elastic_belt.march import march_explicit, march_imex
from cvt_hpc.models.elastic_belt.sampling import (
    CHANNELS,
    LARGEST_DISPLACEMENT,
    LARGEST_ELEMENT_STRAIN,
    LARGEST_STRAIN,
    LEAST_SPEED,
    PROFILES,
    Outcome,
    probes,
    sensors,
)
from cvt_hpc.physics.compliance import contact_state
from cvt_hpc.variables import Status

LARGEST_POWER_RESIDUAL = 0.02

FAILURES = {
    Outcome.NO_CONTACT_SOLUTION: (
        Status.FAILED_NUMERICS,
        "the contact of belt and sheaves has no solution, since the state is not a number",
    ),
    Outcome.NOT_FINITE: (Status.FAILED_NUMERICS, "the state is not a number"),
    Outcome.LEFT_THE_GROOVES: (
        Status.FAILED_NUMERICS,
        f"the belt is more than {LARGEST_DISPLACEMENT * 1e3:g} mm off its path",
    ),
    Outcome.OVERSTRAINED: (
        Status.FAILED_NUMERICS,
        f"strain is beyond {LARGEST_STRAIN:.0%} in the rings or {LARGEST_ELEMENT_STRAIN:.0%} in the elements",
    ),
    # physics, no fault of the numerics: the torque is more than friction carries
    Outcome.SLIPPED_THROUGH: (
        Status.FAILED_ERROR,
        f"the belt slips through: the driven pulley has lost {1 - LEAST_SPEED:.0%} of its speed",
    ),
}


class Transient:
    """One run, advanced sample by sample.

    Parameters
    ----------
    parameters : dict
        Resolved parameters of the run [SI].
    stepper : str
        "imex" or "explicit".

    Attributes
    ----------
    probes : tuple of Probe
        Where displacement is recorded.
    samples : int
        Samples of the whole run.
    interval, step : float
        Sampling interval and time step [s].
    rows : (samples, S + C) array
        The sensors' displacement [m], the strands' modes [m], and CHANNELS; filled up to `done`.
    """

    def __init__(self, parameters: dict[str, Any], stepper: str) -> None:
        p = parameters
        self.parameters = p
        self.mesh = mesh(p)
        self.belt = belt_constants(p)
        self.state = initial_state(p, self.belt)
        self.contacts = (
            contact_state(self.belt.driving.weight.size),
            contact_state(self.belt.driven.weight.size),
        )
        self.interval = 1.0 / p["sampling_rate"]
        self.steps_per_sample = max(int(np.ceil(self.interval / p["step"] - 1e-9)), 1)
        self.step = self.interval / self.steps_per_sample
        self.samples = max(int(round(p["duration"] * p["sampling_rate"])), 1)
        self.probes = probes(self.mesh, p["strand_probes"], p["arc_probes"])
        self._sensing = sensors(self.mesh, self.probes)
        self.rows = np.full((self.samples, self._sensing.matrix.shape[0] + len(CHANNELS)), np.nan)
        self._kick = min(int(np.ceil(p["rise_time"] * p["sampling_rate"])), self.samples)
        self._first_judged = self.samples - round(p["judged_fraction"] * self.samples)
        self._disturbed = False
        n = self.mesh.cell.size
        self._profiles = np.zeros((2, len(PROFILES), n))
        self._scratch = np.zeros((3, n))
        self._counts = np.zeros(3, dtype=np.int64)
        if stepper == "explicit":
            self._march, self._work = march_explicit, np.zeros((3 + len(FIELDS), n))
        else:
            self._march, self._work = march_imex, imex_work(self.state)

    @property
    def done(self) -> int:
        """Samples recorded so far."""
        return int(self._counts[0])

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return int(self._counts[1])

    @property
    def contact_solves(self) -> int:
        """Linear solves of the contact problem so far."""
        return int(self._counts[2])

    def counters(self) -> dict[str, int]:
        """Work done so far, by its name."""
        return {"steps": self.steps, "contact_solves": self.contact_solves}

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.state.scalars[0])

    @property
    def displacement(self) -> np.ndarray:
        """Displacement at the probes, (done, probe) [m]."""
        return self.rows[: self.done, : len(self.probes)]

    @property
    def modes(self) -> np.ndarray:
        """Sine amplitudes of both strands, (done, 2, MODES) [m]."""
        first, last = len(self.probes), self._sensing.matrix.shape[0]
        return self.rows[: self.done, first:last].reshape(self.done, 2, -1)

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,)."""
        return self.rows[: self.done, self._sensing.matrix.shape[0] + CHANNELS.index(name)]

    @property
    def judged(self) -> slice:
        """Samples of the judged part."""
        return slice(self._first_judged, self.samples)

    @property
    def profiles(self) -> dict[str, np.ndarray]:
        """PROFILES around the belt, (N,) each: mean over the judged part at the stations, nan before it."""
        count = self.done - self._first_judged
        return dict(zip(PROFILES, self._profiles[1] / (count if count > 0 else np.nan), strict=True))

    @property
    def regions(self) -> np.ndarray:
        """Name of the region behind each station, (N,)."""
        return np.array(REGIONS)[self.mesh.region]

    def advance(self, samples: int) -> tuple[Status, str] | None:
        """March on.

        Parameters
        ----------
        samples : int
            How many samples at most.

        Returns
        -------
        (Status, str) or None
            What has gone wrong, where the run cannot go on.
        """
        first = self.done
        if first == self._kick and not self._disturbed:
            # start-up damping has gone by now: from here on a disturbance grows or decays by the belt's own
            # nature
            p = self.parameters
            self.state.fields[W] += random_strands(self.mesh, p["disturbance"], p["seed"])
            self._disturbed = True
        borders = [border for border in (self._kick, self._first_judged, self.samples) if border > first]
        last = min(first + samples, *borders)
        outcome = self._march(
            self.belt,
            self.state,
            self.contacts,
            self._work,
            self.step,
            self.steps_per_sample,
            self._sensing,
            self.rows[first:last],
            self._profiles[int(first >= self._first_judged)],
            self._scratch,
            self._counts,
        )
        return None if outcome == Outcome.OK else FAILURES[Outcome(outcome)]

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """Whether a run that reached its end is not to be trusted.

        Parameters
        ----------
        record : dict
            With `power_residual`.

        Returns
        -------
        (Status, str) or None
            As `advance`.
        """
        residual = abs(record["power_residual"])
        if residual <= LARGEST_POWER_RESIDUAL:
            return None
        return Status.FAILED_NUMERICS, f"the power balance is open by {residual:.3g} of the power that flows"
