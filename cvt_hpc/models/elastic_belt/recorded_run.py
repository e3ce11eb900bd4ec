"""Recording of every run of the elastic belt, with any stepper: its plan, its arrays and their reading."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.lanes import LaneArray
from cvt_hpc.models.elastic_belt import lane_fields as lf
from cvt_hpc.models.elastic_belt import lane_rings, sampling
from cvt_hpc.models.elastic_belt.along_belt import Momentary
from cvt_hpc.models.elastic_belt.belt import REGIONS, Belt, State, mesh
from cvt_hpc.models.elastic_belt.belt_settings import layer_count
from cvt_hpc.models.elastic_belt.fields import LOSSES, POWERS
from cvt_hpc.models.elastic_belt.fluctuation import Fluctuation, fluctuation
from cvt_hpc.models.elastic_belt.lane_belt import lane_belt, lane_state
from cvt_hpc.models.elastic_belt.pulley_settings import are_free
from cvt_hpc.models.elastic_belt.rings import ring_constants, without_saddle_friction
from cvt_hpc.models.elastic_belt.validity import doubt, reach_doubt
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.geometry import Variator
from cvt_hpc.recording import sample_count, start_up_samples
from cvt_hpc.variables import Failure, Values
from cvt_hpc.vibration.ramped import ramped


class Records:
    """Plan and arrays of the recording of runs that advance together, each in a lane.

    Their `points`, resolved parameters [SI], are alike in mesh, sampling and duration; `width` is the number
    of lanes, at least one for each run, `dtype` np.float64 or np.float32, that of the lanes.

    Attributes
    ----------
    mesh : Mesh
        Cells around the belt.
    probes : tuple of Probe
        Where displacement is recorded; `sensing` is the same for kernels.
    interval : float
        Of sampling [s].
    samples : int
        Of the whole run.
    kick : int
        Samples before the strands are disturbed; the start-up's damping has gone by then: from there on a
        disturbance grows or decays by the belt's own nature.
    first_judged : int
        Samples before the judged part.
    channels : int
        Values in a row of a sample.
    profiles : (N, 23) LaneArray of doubles
        PROFILES, summed over the judged part's samples.
    momentary : Momentary
        Profiles of the last samples.
    ended : (1, 4) LaneArray of doubles
        ENDED.
    """

    def __init__(self, points: Sequence[Parameters], width: int, dtype: type) -> None:
        p = points[0]
        self.mesh, self.interval, self.samples = mesh(p), 1.0 / p["sampling_rate"], sample_count(p)
        self.probes = sampling.probes(self.mesh, p["strand_probes"], p["arc_probes"])
        self.sensing = sampling.sensors(self.mesh, self.probes, self.interval, dtype)
        self.kick = start_up_samples(p)
        self.first_judged = self.samples - round(p["judged_fraction"] * self.samples)
        self.channels = self.sensing.matrix.shape[0] + len(sampling.CHANNELS)
        stations = self.mesh.cell.size
        self.profiles = LaneArray(stations, len(sampling.PROFILES), width)
        self._none = LaneArray(0, len(sampling.PROFILES), width)
        self.momentary = Momentary(points, stations)
        self.ended = LaneArray(1, len(sampling.ENDED), width)

    @contextmanager
    def profiles_of(self, sample: int) -> Iterator[LaneArray]:
        """Yield the array to which PROFILES of samples from a certain one on are to be added.

        Of the part that is not judged nothing is summed up. A sample of which profiles are kept comes alone.
        """
        is_judged = sample >= self.first_judged
        if sample < self.momentary.first:
            yield self.profiles if is_judged else self._none
            return
        alone = LaneArray(*self.profiles.data.shape)
        yield alone
        self.momentary.note(sample, alone)
        if is_judged:
            self.profiles.data[:] += alone.data

    def without_means(self) -> None:
        """Forget means that another stepper has begun, whose sums are not known."""
        self.profiles.data[:] = np.nan


class RecordedRun:
    """One run, as it is judged and recorded, by its resolved parameters [SI], in a lane of `records`.

    `mesh`, `probes`, `interval`, `samples` and `risen` are those of the records. The marching class sets
    `time`, simulated [s]; `rows`, the sensors' displacement [m], the strands' modes [m], and CHANNELS, (done,
    S + C); `done`, the samples recorded so far, up to the one at which the run failed; and `failure`, why the
    run cannot continue: a failure, or a result, with the status done.
    """

    if TYPE_CHECKING:  # set by the marching class

        @property
        def rows(self) -> np.ndarray:
            """Sensors, modes and CHANNELS."""

        @property
        def done(self) -> int:
            """Samples."""

        @property
        def failure(self) -> Failure | None:
            """Why the run cannot continue."""

        @property
        def time(self) -> float:
            """Simulated time [s]."""

        @property
        def layer_sums(self) -> np.ndarray | None:
            """`lane_rings.SUMS` of ring layers over the judged part, (n + 1, 6); None where rings are one."""

    def __init__(self, parameters: Parameters, records: Records, lane: int = 0) -> None:
        self.parameters, self._records, self._lane = parameters, records, lane
        self.mesh, self.probes = records.mesh, records.probes
        self.interval, self.samples, self.risen = records.interval, records.samples, records.kick
        self._sensed = records.sensing.matrix.shape[0]

    @property
    def momentary(self) -> np.ndarray | None:
        """Last samples that `Momentary` has kept, (sample, quantity, N)."""
        return self._records.momentary.of(self._lane)

    @property
    def displacement(self) -> np.ndarray:
        """Displacement at the probes, (done, probe) [m]."""
        return self.rows[:, : len(self.probes)]

    @property
    def modes(self) -> np.ndarray:
        """Sine amplitudes of both strands, (done, 2, MODES) [m]."""
        return self.rows[:, len(self.probes) : self._sensed].reshape(self.done, 2, -1)

    def channel(self, name: str) -> np.ndarray:
        """History of one of CHANNELS, (done,)."""
        return self.rows[:, self._sensed + sampling.CHANNELS.index(name)]

    def mean_driving_speed(self, samples: slice) -> float:
        """Mean speed of the driving pulley in some samples [rad/s]."""
        is_held = not (self.parameters.get("driving_speed_profile") or are_free(self.parameters))
        if is_held and ramped(self.parameters) != "speed":
            return self.parameters["driving_speed"]
        return float(self.channel("driving_speed")[samples].mean())

    def powers(self) -> dict[str, float]:
        """Mean powers over the judged part, named as in the record [W]."""
        found = {name: float(self.channel(name)[self.judged].mean()) for name in POWERS[:-1]}
        stored = self.channel("stored_energy")[self.judged]
        storing = (stored[-1] - stored[0]) / ((stored.size - 1) * self.interval)
        return found | {"storing_power": storing, "loss": sum(found[name] for name in LOSSES)}

    @property
    def path(self) -> Variator:
        """The reference path."""
        return self.mesh.path

    @property
    def judged(self) -> slice:
        """Samples of the judged part."""
        return slice(self._records.first_judged, self.samples)

    @property
    def means(self) -> dict[str, np.ndarray]:
        """PROFILES around the belt, (N,) each: mean over the judged part.

        Not a number before that part, and where the run has failed.
        """
        sums = self._records.profiles.data[:, :, self._lane]
        return dict(zip(sampling.PROFILES, sums.T / self._judged_count, strict=True))

    @property
    def layer_means(self) -> np.ndarray | None:
        """Return the means of what `layer_sums` has."""
        return None if self.layer_sums is None else self.layer_sums / self._judged_count

    @property
    def _judged_count(self) -> float:
        """Samples of the judged part so far; not a number before it, and where the run has failed."""
        count = self.done - self._records.first_judged if self.failure is None else 0
        return count if count > 0 else np.nan

    @property
    def fluctuation(self) -> Fluctuation:
        """Energy that enters and leaves the fluctuations of the judged part."""
        return fluctuation(self.means, self.mesh, self.parameters)

    @property
    def regions(self) -> np.ndarray:
        """Name of the region behind each station, (N,)."""
        return np.array(REGIONS)[self.mesh.region]

    def numerical_doubt(self, record: Values) -> Failure | None:
        """Whether a run that reached its end is not to be trusted; the reason, if so.

        By `power_residual`, `step_ripple` and `least_strand_force` of its record.
        """
        found = doubt(record, self.parameters, self.mesh)
        grooves = (self.mesh.zone(region).stations for region in (0, 2))
        return found or reach_doubt(self.means["contact_force"], grooves)


class OneLaneRun(RecordedRun):
    """A run by a step that knows nothing of lanes: sampled as a single lane; attributes of `RecordedRun`."""

    done: int

    def prolong(self, parameters: Parameters) -> None:
        """Make room for the samples of a longer duration, whose judged part has yet to come.

        The parameters differ from those of the run by `duration` and `judged_fraction` alone.
        """
        RecordedRun.__init__(self, parameters, Records([parameters], 1, np.float64))
        rows = LaneArray(self.samples, self._records.channels, 1)
        if self.done:
            rows.data[: self.done, :, 0] = self.rows
        self._rows = rows
        # of the part that is not judged, and of the judged one
        self._layer_sums = [LaneArray(layer_count(parameters) + 1, len(lane_rings.SUMS), 1) for _ in range(2)]

    def _make_lane(self, belt: Belt, first: State) -> None:
        """Return the run as a single lane, which can be sampled."""
        count = layer_count(self.parameters)
        if count > 1:
            self._rings = lane_rings.lane_rings([belt], [ring_constants(self.parameters, belt)], np.float64)
            self._layers = LaneArray(self.mesh.cell.size, count, 1)
            belt = without_saddle_friction(belt)
        self._lane_belt = lane_belt([belt], np.float64)
        self._state = lane_state([belt], [first], np.float64)
        self._stations = LaneArray(self.mesh.cell.size, lf.FIELDS_OF_FORCES, 1)
        self._take_sample = called_alike(sampling.sample_state)
        self._audit_layers = called_alike(lane_rings.audit_layers)

    @property
    def layer_sums(self) -> np.ndarray | None:
        """Return the sums over layers of `RecordedRun`."""
        return self._layer_sums[1].data[:, :, 0] if layer_count(self.parameters) > 1 else None

    @property
    def rows(self) -> np.ndarray:
        """The sensors' displacement [m], the strands' modes [m], and CHANNELS, (done, S + C)."""
        return self._rows.data[: self.done, :, 0]

    def _go_on_from(self, run: Any) -> None:
        """Take over the history of a run by another stepper, except for means that began before."""
        self.done, self._disturbed = run.done, run.done > self._records.kick
        self._rows.data[: self.done, :, 0] = run.rows
        if self.done > self._records.first_judged:
            self._records.without_means()
            self._layer_sums[1].data[:] = np.nan

    def _sample_lane(self) -> sampling.Outcome:
        """Record the values in the lane; `done` is left to the caller."""
        layer_sums = self._layer_sums[int(self.done >= self._records.first_judged)]
        with self._records.profiles_of(self.done) as profiles:
            samples = sampling.Samples(self._records.sensing, self._rows, profiles, self._records.ended)
            self._take_sample(self._lane_belt, self._state, self._stations, samples, self.done)
            if layer_count(self.parameters) > 1:
                of_layers = self._lane_belt, self._rings, self._state, self._layers
                self._audit_layers(*of_layers, samples, self.done, layer_sums)
        return sampling.Outcome(int(self._records.ended.data[0, sampling.OUTCOME, 0]))
