"""A run of a belt of rigid elements, whichever equations march it.

It starts from geometry, is clamped and loaded, and recorded.

Start-ups that runs of this process have marched, from which runs with the same beginning continue.

A start-up is known by a key of all values that determine it. It stays in the memory of its process: on a disk
it would have to be trusted, to save each process a march of its own.
"""

from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from hashlib import sha256
from typing import Any

import numpy as np

from cvt_hpc.models.pushbelt import fields as f
from cvt_hpc.models.pushbelt.readings import PROFILES, SCALARS, OnPath, Readings
from cvt_hpc.models.sampled import MOST_UNSOLVED, SampledRun
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.geometry import driven_radius
from cvt_hpc.variables import Status
from cvt_hpc.variator import LEAST_SPEED, MOST_SPEED, PULLEYS, STRANDS
from cvt_hpc.variator.course import load_course
from cvt_hpc.variator.history import points_at, regions
from cvt_hpc.variator.profiles import extremes, multiple
from cvt_hpc.variator.slip import GAINED, LOST
from cvt_hpc.vibration.ramped import ramped

_MOST_BYTES = 2**24  # of a process: some 80 start-ups of 432 elements and 15 ms at 20 kHz


class StartUps:
    """Start-ups as copies of arrays, of `most_bytes` in all; the least recently used goes first."""

    def __init__(self, most_bytes: int = _MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._kept: OrderedDict[str, tuple[np.ndarray, ...]] = OrderedDict()

    def find(self, key: str) -> tuple[np.ndarray, ...] | None:
        """The start-up that is kept under a key, to be copied; None where there is none."""
        if key in self._kept:
            self._kept.move_to_end(key)
        return self._kept.get(key)

    def keep(self, key: str, arrays: Sequence[np.ndarray]) -> None:
        """Keep copies of arrays under a key."""
        self._kept[key] = tuple(array.copy() for array in arrays)
        while sum(array.nbytes for kept in self._kept.values() for array in kept) > self._most_bytes:
            self._kept.popitem(last=False)

    def forget(self) -> None:
        """Drop all of them."""
        self._kept.clear()


def fingerprint(*values: object) -> str:
    """Return a key of values that differs where any of them does, by a bit of a number or by its type.

    Values are numbers, texts, arrays, and sequences, mappings and objects of such.
    """
    digest = sha256()

    def take(value: object) -> None:
        if isinstance(value, int | float | str | np.generic | np.ndarray):
            array = np.asarray(value)
            digest.update(f"{array.dtype.str}{array.shape}".encode() + array.tobytes())
        elif isinstance(value, tuple | list):
            digest.update(f"({len(value)}".encode())
            for part in value:
                take(part)
        elif isinstance(value, Mapping):
            take(tuple(value.items()))
        elif parts := vars(value):
            take(parts)
        else:
            raise TypeError(f"a {type(value).__name__} has no values to tell it by")

    take(values)
    return digest.hexdigest()


COURSES = ("load", "driving_speed")
_FIRST_THRUST = 500.0  # [N]: with which the run begins, so that the belt settles in the grooves
_KICK_PEAK = 32.0 / 27.0  # of sin^2 x (1 + cos x), at cos x = 1/3
CLAMPED = 0.5  # of the rise time: until then the thrust rises, from then on the load, lest the belt slips
# Limit of the open power balance beside the equations' tolerance: elastic sheaves lean along the arc,
# which has no part in the elements' forces. Sound runs leave up to 0.5 % of the losses.
_OF_LOSS = 0.02  # [1]
# Limit of numerical damping beside that share of the losses: one of the energy of rotation of elements
# that meet and leave an arc, and of thrust times belt speed, by step. Without vibration sound runs damp by up
# to 85 % of these two.
_OF_ROTATION, _OF_THRUST = 1.5, 10.0  # [1], [1/s]

_start_ups = StartUps()
forget = _start_ups.forget


class ElementRun(SampledRun):
    """One run of a belt of rigid elements by the model's own stepper, advanced sample by sample.

    It begins at the end of its start-up where another run of this process has marched the same one. Resolved
    parameters [SI] include those of the stepper.

    Attributes
    ----------
    path : Variator
        The reference path.
    places : (place,) array
        Path coordinates of the profiles [m].
    """

    _contacts: tuple[str, ...] = f.CONTACTS  # by number, as the counters have them
    _channels: tuple[str, ...] = (*COURSES, *SCALARS)
    _profiles: Sequence[str] = tuple(PROFILES)
    _directions: tuple[str, ...] = STRANDS  # of the displacement at the probes of the strands
    _saddle: tuple[int, ...] = (f.Y, f.Z)  # fields of the saddle point, and of its speed with the turning
    _speeds: tuple[int, ...] = (f.U_Y, f.U_Z, f.OMEGA)
    _belt: Any
    _method: object  # how steps are solved, state and work space, as `_advance` takes them
    _state: Any
    _work: object
    _advance: Callable[..., int]

    def __init__(self, parameters: Parameters, stepper: str) -> None:
        p = parameters
        super().__init__(p)
        self._begin(p)
        self._readings = Readings(p, self._belt)
        self.path, self.places = self._readings.path, self._readings.places
        sums = len(self._profiles) + 1, self._readings.places.size
        probes = np.tile(self._readings.probes, (len(self._directions) // len(STRANDS), 1))
        self._record(self._channels, self._directions, probes, f.TOTALS + 1, sums)
        clamped = int(CLAMPED * p["rise_time"] / self.interval + 1e-9)
        self._start_up = min(clamped, self.first_judged)
        self._kick_at = self.first_judged if p["kick"] > 0.0 else -1  # also of a run that is prolonged
        self._start_up_key = self._key_of_start_up()
        self._go_on_from(_start_ups.find(self._start_up_key))

    def _begin(self, p: Parameters) -> None:
        """Set how steps are solved, constants, state and work space."""
        raise NotImplementedError

    def _read(self) -> Any:
        """Readings of the sample that is reached."""
        raise NotImplementedError

    def _stored_energy(self, found: Any) -> float:
        """Kinetic and elastic energy of belt and pulleys [J]."""
        raise NotImplementedError

    def _tilting_inertia(self) -> float:
        """Moment of inertia of an element about its axial direction [kg m^2]."""
        return self._belt.inertia

    def advance(self, samples: int) -> tuple[Status, str] | None:
        """March on by so many samples at most, 0 compiles only; the reason, if the run ends here."""
        if samples == 0:
            self._compile()
        for _ in range(min(samples, self.samples - self.done)):
            if self.done == self._kick_at:
                self._kick()
            inputs = self._inputs_along(self.done)
            outcome = self._march(inputs, self._steps_per_sample)
            if outcome:
                self.failure = Status.FAILED_NUMERICS, self._why(outcome)
                break
            self._take_sample(inputs[1])
            if (slipped := self._slipped()) is not None:
                self.failure = self._early_end(slipped)
                break
            if (gone := self._out_of_place()) is not None:
                self.failure = Status.FAILED_NUMERICS, gone
                break
            if self.done == self._start_up:
                _start_ups.keep(self._start_up_key, self._reached())
        return self.failure

    def _key_of_start_up(self) -> str:
        """All values that determine the samples before the load acts."""
        course = [self._inputs_along(sample) for sample in range(self._start_up)]
        marched = self._belt, self._method, self._state, self.interval, self._steps_per_sample, course
        return fingerprint(type(self).__module__, marched, self._readings, self.parameters["ratio"])

    def _go_on_from(self, start_up: tuple[np.ndarray, ...] | None) -> None:
        """Be at the end of the start-up, where another run has marched it."""
        if start_up is None:
            return
        self.done = self._start_up
        for own, kept in zip(self._reached(), start_up, strict=True):
            own[...] = kept

    def _reached(self) -> tuple[np.ndarray, ...]:
        """Views of all arrays that marching has changed so far, where nothing is judged yet."""
        return self._state.elements.data, *self._state[1:], *self._recorded()

    def _by_field(self) -> np.ndarray:
        """Fields of the elements in the order of the belt, a view (fields, ...)."""
        return self._state.elements.data.transpose(1, 2, 0)

    def _kick(self) -> None:
        """Give both strands a speed outwards, and their elements the turning that goes with it.

        The shape begins and ends without a kink, and has parts in odd and in even half waves.
        """
        elements, path = self._by_field(), self.path
        saddles = elements[list(self._saddle)].reshape(2, -1).T
        position = OnPath(self._readings, saddles).position
        region = regions(path, position)
        starts, length = np.concatenate([[0.0], np.cumsum(path.lengths)]), path.strand_length
        phase = np.pi * np.where(region % 2 == 1, (position - starts[region]) / length, 0.0)
        c, s = np.cos(phase), np.sin(phase)
        size = self.parameters["kick"] / _KICK_PEAK
        speed, slope = size * s**2 * (1.0 + c), size * np.pi / length * s * (1.0 + c) * (3.0 * c - 1.0)
        _, angle, _ = points_at(path, self.parameters["centre_distance"], position)
        changes = speed * np.sin(angle), -speed * np.cos(angle), -slope
        for field, change in zip(self._speeds, changes, strict=True):
            elements[field] += change.reshape(elements[field].shape)

    def _march(self, inputs: np.ndarray, steps: int) -> int:
        return self._advance(self._belt, self._method, self._state, self._work, inputs, steps, self.step)

    def _compile(self) -> None:
        self._march(self._inputs_along(0), 0)

    def _inputs_along(self, sample: int) -> np.ndarray:
        """Inputs at the start and at the end of a sample, (2, INPUTS)."""
        ends = [(sample + end) * self.interval for end in (0, 1)]
        shift = 0.0
        if self._belt.driving_rate == 0.0 and self.parameters["ratio_profile"]:
            before, after = map(self._prescribed_radius, ends)
            shift = (after - before) / self.interval
        return np.array([[*self._inputs(time), shift] for time in ends])

    def _prescribed_radius(self, time: float) -> float:
        """Radius to which the position of the driving sheave brings the belt at a time [m]."""
        p = self.parameters
        ratio = p["ratio"] * multiple(p, "ratio", time)
        return driven_radius(ratio, self.path.path_length, p["centre_distance"]) / ratio

    def _inputs(self, time: float) -> tuple[float, float, float, float]:
        """Speed [rad/s], thrusts on both pulleys [N] and torque on the driven one [N m] at a time."""
        p = self.parameters
        rise, end = p["rise_time"], p["duration"]
        load = self.load(time)
        share = 1.0
        if ramped(p) == "speed":
            begun = p["speed_start"] / p["driving_speed"]
            share = begun + (1.0 - begun) * min(max((time - rise) / (end - rise), 0.0), 1.0)
        clamped = load_course.py_func(time, CLAMPED * rise, rise, 1.0, 1.0)
        driving, driven = (
            _FIRST_THRUST + clamped * (p[name] * multiple(p, name, time) - _FIRST_THRUST)
            for name in ("driving_thrust", "thrust")
        )
        speed = share * p["driving_speed"] * multiple(p, "driving_speed", time)
        return speed, driving, driven, p["ratio"] * load

    def load(self, time: float) -> float:
        """Torque at the driving pulley without losses [N m]."""
        p = self.parameters
        begun = p["load_start"] if ramped(p) == "load" else p["load"]
        clamped = CLAMPED * p["rise_time"]
        rise, end = p["rise_time"] - clamped, p["duration"] - clamped
        course = load_course.py_func(max(time - clamped, 0.0), rise, end, begun, p["load"])
        return course * multiple(p, "load", time)

    def _take_sample(self, inputs: np.ndarray) -> None:
        found = self._read()
        speed, torque = inputs[f.IN_SPEED], inputs[f.IN_LOAD]
        load = torque / self.parameters["ratio"]
        stored = np.nan
        if self.done >= self.first_judged:
            stored = self._stored_energy(found)
            self._sums += found.profiles()
        row = [*found.displacement(), load, speed, *found.scalars()]
        self._keep(row, [*self._state.totals, stored])

    def _why(self, outcome: int) -> str:
        if outcome == f.NOT_CONVERGED:
            return f"the equations of a step were not solved, {self._fault()}"
        return "the state is not a number, or the equations of a step are singular"

    def _fault(self) -> str:
        """Contact at fault in the last step that was not solved."""
        counters = self._state.counters
        contact = self._contacts[counters[f.FAILED_CONTACT]]
        return f"at the {contact} contact of element {counters[f.FAILED_ELEMENT]}"

    def _slipped(self) -> str | None:
        """Whether the driven pulley runs far from the speed that the present radii give without slip."""
        driving_speed, driven_speed, driving_radius, driven_radius = self._state.pulleys[:4]
        driving, driven = driving_speed * driving_radius, driven_speed * driven_radius
        if driven < LEAST_SPEED * driving:
            return LOST
        return GAINED if driven > MOST_SPEED * driving else None

    def _out_of_place(self) -> str | None:
        """Reason why a sheave has run to its stop, if the job gives the reach of the sheaves; or None."""
        least, most = self.parameters["inner_radius"], self.parameters["outer_radius"]
        radii = self._state.pulleys[[f.DRIVING_RADIUS, f.DRIVEN_RADIUS]]
        for pulley, radius in zip(PULLEYS, radii, strict=True):
            if not least <= radius <= most:
                at, reach = f"a pitch radius of {radius:.5g} m", f"{least:g} to {most:g} m"
                return f"the {pulley} sheave has run to its stop: {at}, of {reach}"
        return None

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return float(self._state.totals[f.TIME])

    def mean_rate(self, total: int) -> float:
        """Mean rate over the judged part of one of the totals, by its index; TOTALS: of the stored energy."""
        part, time = self._totals[self.judged], f.TIME
        return float((part[-1, total] - part[0, total]) / (part[-1, time] - part[0, time]))

    def powers(self) -> dict[str, float | np.ndarray]:
        """Mean powers over the judged part, named as in the record [W]."""
        found = {name: self.mean_rate(f.WORK_IN + k) for k, name in enumerate(f.POWERS)}
        loss = found["flank_loss"] + found["ring_loss"] + found["belt_loss"]
        loss += found["tilt_loss"] + found["element_loss"] + found["stretch_loss"] + found["lag_loss"]
        damped = np.array([self.mean_rate(total) for total in f.DAMPED.values()])
        storing = self.mean_rate(f.TOTALS) - self.mean_rate(f.GRAVITY_WORK)
        return {**found, "loss": loss, "storing_power": storing, "numerical_damping": damped}

    @property
    def profiles(self) -> dict[str, np.ndarray]:
        """Profiles at places along the path, (place,), means of the judged part; nan without elements."""
        with np.errstate(invalid="ignore", divide="ignore"):
            means = self._sums[:-1] / self._sums[-1]
        return dict(zip(self._profiles, means, strict=True))

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """Reason why a run that reached its end is not to be trusted, by its values; None where it is.

        These are `power_residual`, `numerical_damping`, `driving_power`, `loss` and `unsolved_share`.
        """
        unsolved, open_power = record["unsolved_share"], abs(record["power_residual"])
        flow, small = max(abs(record["driving_power"]), record["loss"]), _OF_LOSS * record["loss"]
        damped, most_damped = record["numerical_damping"].sum(), self._most_damped() + small
        most_open = (small + self._most_open()) / flow
        if not unsolved <= MOST_UNSOLVED:
            why = f"{unsolved:.1%} of the steps were not solved, the last {self._fault()}"
        elif not open_power <= most_open:
            why = f"the power balance is open by {open_power:.3g}, not by {most_open:.3g} or less"
        elif not damped <= most_damped:
            why = f"the time step itself damps {damped:.4g} W, not {most_damped:.4g} W or less"
        else:
            return None
        return Status.FAILED_NUMERICS, why

    def _most_open(self) -> float:
        """Power that the equations may leave open, beside a share of the losses [W]."""
        return float(self.parameters["power_tolerance"])

    def _most_damped(self) -> float:
        """Most that the steps of a sound run without vibration damp by themselves [W]."""
        p, path = self.parameters, self.path
        speed = self.mean_driving_speed(self.judged) * path.driving_radius
        passing = speed / self._readings.pitch
        turning = path.driving_radius**-2 + path.driven_radius**-2
        rotation = 0.5 * self._tilting_inertia() * passing * speed**2 * turning
        thrust = extremes(p, "thrust")[1]
        return _OF_ROTATION * rotation + _OF_THRUST * self.step * thrust * speed
