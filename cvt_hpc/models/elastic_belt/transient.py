"""Transient runs of the elastic belt: state, stepper and recording in one object, for one run or a batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.alone import Alone
from cvt_hpc.models.elastic_belt import OWN_STEPPERS
from cvt_hpc.models.elastic_belt.belt import (
    FIELDS,
    REGIONS,
    Mesh,
    State,
    W,
    belt_constants,
    initial_state,
    mesh,
    random_strands,
)
from cvt_hpc.models.elastic_belt.doubts import slack_doubt
from cvt_hpc.models.elastic_belt.imex import derive, imex_work
from cvt_hpc.models.elastic_belt.lane_belt import lane_belt, lane_state, take_lane
from cvt_hpc.models.elastic_belt.march import march_explicit, march_imex
from cvt_hpc.models.elastic_belt.record import lanes
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
        "the search for the closed stations of belt and sheaves did not end",
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


PRECISIONS = {"double": np.float64, "single": np.float32}


def batch(points: Sequence[dict[str, Any]], stepper: str) -> Any:
    """Runs that advance together by any stepper that the belt takes.

    Parameters
    ----------
    points : sequence of dict
        Resolved parameters of the runs [SI], all of one `lane_key`; one for steppers without lanes.
    stepper : str
        One of STEPPER_NAMES.

    Returns
    -------
    Batch or Alone
        They have `runs`, `samples`, `done`, `running`, `interval` and `advance` in common.
    """
    if stepper in OWN_STEPPERS:
        return Batch(points, stepper)
    from cvt_hpc.models.elastic_belt.general import GeneralTransient

    (parameters,) = points
    return Alone(GeneralTransient(parameters, stepper))


def doubt(record: dict[str, Any], bending_stiffness: float, grid: Mesh) -> tuple[Status, str] | None:
    """Whether a run that reached its end is not to be trusted.

    Parameters
    ----------
    record : dict
        With `power_residual` and `least_strand_force`.
    bending_stiffness : float
        EI [N m^2].
    grid : Mesh
        The belt's mesh.

    Returns
    -------
    (Status, str) or None
        What is wrong.
    """
    residual = abs(record["power_residual"])
    if not residual <= LARGEST_POWER_RESIDUAL:
        why = f"the power balance is open by {residual:.3g} of the power that flows"
        return Status.FAILED_NUMERICS, why
    return slack_doubt(bending_stiffness, float(grid.cell[grid.starts[1]]), record["least_strand_force"])


class Batch:
    """Runs that advance together, sample by sample, each in a lane of its own.

    Parameters
    ----------
    points : sequence of dict
        Resolved parameters of the runs [SI], all of one `lane_key`.
    stepper : str
        "imex" or "explicit"; the latter takes one run.

    Attributes
    ----------
    runs : tuple of Transient
        The runs.
    samples : int
        Samples of a whole run.
    done : int
        Samples taken so far.
    begun : float
        When it took over from another stepper [s]; 0 where it did not.
    interval, step : float
        Sampling interval and time step [s].
    """

    def __init__(self, points: Sequence[dict[str, Any]], stepper: str) -> None:
        p = points[0]
        most = lanes(p, stepper)
        if not 0 < len(points) <= most:
            raise ValueError(f"a batch of {stepper} takes 1 to {most} runs, not {len(points)}")
        self.points = tuple(points)
        self.mesh = mesh(p)
        # one lane, or all of them: a register costs the same however many of its lanes are of use
        width = 1 if len(points) == 1 else most
        padded = [*points, *[points[-1]] * (width - len(points))]
        self.belts = [belt_constants(point) for point in padded]
        self.dtype = PRECISIONS[p["precision"]] if stepper == "imex" else np.float64
        starts = [initial_state(point, belt) for point, belt in zip(padded, self.belts, strict=True)]
        self._sweeps = p["contact_sweeps"] if stepper == "imex" else 0
        self.state = lane_state(self.belts, starts, self.dtype, self._sweeps)
        self._belt = lane_belt(self.belts, self.dtype)
        self._work = imex_work(self.state)
        derive(self._belt, self.state, self._work.stations)
        self.interval = 1.0 / p["sampling_rate"]
        self.steps_per_sample = max(int(np.ceil(self.interval / p["step"] - 1e-9)), 1)
        self.step = self.interval / self.steps_per_sample
        self.samples = max(int(round(p["duration"] * p["sampling_rate"])), 1)
        self.probes = probes(self.mesh, p["strand_probes"], p["arc_probes"])
        self.sensing = sensors(self.mesh, self.probes, self.interval, self.dtype)
        self.rows = LaneArray(self.samples, self.sensing.matrix.shape[0] + len(CHANNELS), width)
        self._ordered: np.ndarray | None = None
        self.done, self.begun = 0, 0.0
        n = self.mesh.cell.size
        self.profiles = [LaneArray(n, len(PROFILES), width) for _ in range(2)]
        self.ended = LaneArray(1, 3, width)
        self._kick = min(int(np.ceil(p["rise_time"] * p["sampling_rate"])), self.samples)
        self.first_judged = self.samples - round(p["judged_fraction"] * self.samples)
        self._disturbed = False
        self._explicit = None
        if stepper == "explicit":
            wraps = (self.belts[0].driving, self.belts[0].driven)
            contacts = tuple(contact_state(wrap.weight.size) for wrap in wraps)
            self._explicit = (self.belts[0], starts[0], contacts, np.zeros((3 + len(FIELDS), n)))
            self._solves = 0
        self.runs = tuple(Transient(point, stepper, self, k) for k, point in enumerate(points))

    @property
    def running(self) -> bool:
        """Whether any run has not ended."""
        return self.done < self.samples and any(run.failure is None for run in self.runs)

    def advance(self, samples: int) -> None:
        """March on, at most to the next border of the judged part.

        Parameters
        ----------
        samples : int
            How many samples at most.
        """
        first = self.done
        if first == self._kick and not self._disturbed:
            # start-up damping has gone by now: from here on a disturbance grows or decays by the belt's own
            # nature
            for lane, point in enumerate(self.points):
                self._displace(lane, random_strands(self.mesh, point["disturbance"], point["seed"]))
            derive(self._belt, self.state, self._work.stations)
            self._disturbed = True
        borders = [border for border in (self._kick, self.first_judged, self.samples) if border > first]
        last = min(first + samples, *borders)
        profiles = self.profiles[int(first >= self.first_judged)]
        pace = (self.step, self.steps_per_sample, self.sensing, self.rows, first, last, profiles, self.ended)
        if self._explicit is None:
            march_imex(self._belt, self.state, self._work, *pace)
        else:
            lane = (self._belt, self.state, self._work)
            self._solves += march_explicit(*self._explicit, *lane, *pace)
        self.done = last

    def take_over(self, runs: Sequence[Any]) -> None:
        """Go on from where runs by another stepper stand, their history included but for the mean profiles.

        Parameters
        ----------
        runs : sequence of Transient or GeneralTransient
            One for each run, of the same mesh, sampling and duration, all at the same time.
        """
        self.done, self._disturbed = runs[0].done, runs[0].done > self._kick
        states = [run.state for run in runs]
        states += [states[-1].copy() for _ in self.belts[len(runs) :]]
        self.state = lane_state(self.belts, states, self.dtype, self._sweeps)
        self._work = imex_work(self.state)
        derive(self._belt, self.state, self._work.stations)
        self.begun = self.ended.data[0, 1] = runs[0].time
        for lane, run in enumerate(runs):
            self.rows.data[: self.done, :, lane] = run.rows
        if self._explicit is not None:
            self._explicit = (self.belts[0], states[0], *self._explicit[2:])

    def state_of(self, lane: int) -> State:
        """Return the present state of a run; a copy."""
        if self._explicit is not None:
            return self._explicit[1].copy()
        return take_lane(self.state, lane, self.belts[lane])

    def _displace(self, lane: int, shape: np.ndarray) -> None:
        if self._explicit is None:
            self.state.fields.data[:, W, lane] += shape
        else:
            self._explicit[1].fields[W] += shape

    def history(self, lane: int) -> np.ndarray:
        """Rows of a run, (samples, S + C); put in order of lanes and channels once all are there.

        As they are written, values of a channel lie far apart: reading them costs more than the copy.
        """
        if self.done < self.samples:
            return self.rows.data[:, :, lane]
        if self._ordered is None:
            self._ordered = np.ascontiguousarray(self.rows.data.transpose(2, 1, 0))
        return self._ordered[lane].T

    def solves(self, lane: int) -> int:
        """Linear solves of the contact problem in a run so far."""
        if self._explicit is not None:
            return self._solves
        return int(self.ended.data[0, 2, lane])


class Transient:
    """One run, alone or of a batch.

    Parameters
    ----------
    parameters : dict
        Resolved parameters of the run [SI].
    stepper : str
        "imex" or "explicit".
    batch : Batch, optional
        Which it belongs to; by default one of its own.
    lane : int
        Its lane there.

    Attributes
    ----------
    probes : tuple of Probe
        Where displacement is recorded.
    samples : int
        Samples of the whole run.
    interval, step : float
        Sampling interval and time step [s].
    """

    def __init__(
        self, parameters: dict[str, Any], stepper: str, batch: Batch | None = None, lane: int = 0
    ) -> None:
        self.parameters = parameters
        self.batch = batch or Batch([parameters], stepper)
        self._lane = lane
        self.mesh, self.probes = self.batch.mesh, self.batch.probes
        self.samples, self.interval, self.step = self.batch.samples, self.batch.interval, self.batch.step
        self._sensors = self.batch.sensing.matrix.shape[0]

    @property
    def failure(self) -> tuple[Status, str] | None:
        """What has gone wrong, where the run cannot go on."""
        outcome = int(self.batch.ended.data[0, 0, self._lane])
        return FAILURES[Outcome(outcome)] if outcome else None

    def counters(self) -> dict[str, int]:
        """Work done so far, by its name."""
        return {"steps": self.steps, "contact_solves": self.contact_solves}

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self.batch.ended.data[0, 1, self._lane])

    @property
    def state(self) -> State:
        """The present state; a copy."""
        return self.batch.state_of(self._lane)

    @property
    def done(self) -> int:
        """Samples recorded so far, up to the one at which the run failed."""
        taken = round(self.time / self.interval)
        return taken if self.failure is None else taken - 1

    @property
    def steps(self) -> int:
        """Steps taken so far."""
        return round((self.time - self.batch.begun) / self.step)

    @property
    def contact_solves(self) -> int:
        """Linear solves of the contact problem so far."""
        return self.batch.solves(self._lane)

    @property
    def rows(self) -> np.ndarray:
        """The sensors' displacement [m], the strands' modes [m], and CHANNELS, (done, S + C)."""
        return self.batch.history(self._lane)[: self.done]

    @property
    def displacement(self) -> np.ndarray:
        """Displacement at the probes, (done, probe) [m]."""
        return self.rows[:, : len(self.probes)]

    @property
    def modes(self) -> np.ndarray:
        """Sine amplitudes of both strands, (done, 2, MODES) [m]."""
        return self.rows[:, len(self.probes) : self._sensors].reshape(self.done, 2, -1)

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,)."""
        return self.rows[:, self._sensors + CHANNELS.index(name)]

    @property
    def judged(self) -> slice:
        """Samples of the judged part."""
        return slice(self.batch.first_judged, self.samples)

    @property
    def profiles(self) -> dict[str, np.ndarray]:
        """PROFILES around the belt, (N,) each: mean over the judged part at the stations.

        Not a number before that part, and where the run has failed.
        """
        count = self.done - self.batch.first_judged if self.failure is None else 0
        sums = self.batch.profiles[1].data[:, :, self._lane].T
        return dict(zip(PROFILES, sums / (count if count > 0 else np.nan), strict=True))

    @property
    def regions(self) -> np.ndarray:
        """Name of the region behind each station, (N,)."""
        return np.array(REGIONS)[self.mesh.region]

    def advance(self, samples: int) -> tuple[Status, str] | None:
        """March on, and the rest of the batch with it.

        Parameters
        ----------
        samples : int
            How many samples at most.

        Returns
        -------
        (Status, str) or None
            What has gone wrong, where the run cannot go on.
        """
        self.batch.advance(samples)
        return self.failure

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
