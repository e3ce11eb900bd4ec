"""A transient run of the belt drive: it starts in motion from its static tension, is loaded, and recorded."""

from typing import Any

import numpy as np

from cvt_hpc.kernels import called_alike
from cvt_hpc.models.belt_drive import courses, readings
from cvt_hpc.models.belt_drive.drive import advance, drive_frequencies
from cvt_hpc.models.belt_drive.layout import Layout, layout
from cvt_hpc.models.belt_drive.pulleys import FRICTION_LOSS, POWERS, axes
from cvt_hpc.models.belt_drive.start import start
from cvt_hpc.models.belt_drive.theory import kick, mesh_amplitude
from cvt_hpc.models.marched import batches_of_one
from cvt_hpc.models.sampled import MOST_UNSOLVED, SampledRun
from cvt_hpc.parameters import Parameters
from cvt_hpc.physics.belt_path import belt_path
from cvt_hpc.solvers.generalised_alpha import generalised_alpha
from cvt_hpc.variables import Status, Vibrates
from cvt_hpc.variator import LEAST_SPEED, MOST_SPEED, PULLEYS, STRANDS
from cvt_hpc.variator.slip import GAINED, LOST

# of two pulleys; those of more are a run's own
CHANNELS = (
    *("load", "driving_speed", "driven_speed"),
    *(f"tension {strand}" for strand in STRANDS),
    *(f"slip {pulley}" for pulley in PULLEYS),
)
_MOST_LIFTED = 0.01  # [s] that a pulley may be without the belt
# Of the larger of drive and losses. Without load, where bending alone takes 4 W, steps of 0.1 ms leave up to
# 0.013 open, of 0.05 ms 0.0009 (22.6 rad/s, 96 elements); with load runs leave up to 0.004.
_MOST_OPEN = 0.02


class Transient(SampledRun):
    """One run of the belt drive by the stepper "cyclic_alpha", advanced sample by sample.

    `drawn` are pulleys and reference path, `pulleys` constants of pulleys and arms, `places` path coordinates
    of the profiles, (place,) [m], `kicked` the samples from a kick to the end that the run then had.
    """

    kicked: slice | None = None

    def __init__(self, parameters: Parameters, stepper: str) -> None:
        p = parameters
        super().__init__(p)
        self._scheme = generalised_alpha(p["spectral_radius"])
        self.drawn = layout(p)
        self.path = self.drawn.path
        self._readings = readings.Readings(p, self.drawn)
        self._drive, self._state, is_settled = start(p, self.drawn, self._readings.mean_tension)
        self.pulleys, self.places = self._drive.pulleys, self._readings.places
        channels = ("load", "driving_speed", *readings.scalars_of(self.drawn, len(self.pulleys.arms.pivot)))
        sums, totals = (len(readings.PROFILES) + 2, readings.PLACES), self._state.totals.size + 1
        self._record(channels, self.drawn.spans, self._readings.probes, totals, sums)
        self._advance = called_alike(advance)
        self._lifted = np.zeros(len(self.drawn.pulleys), int)
        if not is_settled:  # as it would be at any step
            self.parameters = {**p, "most_refinements": 0}
            self.failure = Status.FAILED_NUMERICS, "the belt finds no equilibrium on its pulleys"

    def advance(self, samples: int) -> tuple[Status, str] | None:
        """March on by so many samples at most, 0 compiles only; the reason, if the run ends here."""
        for _ in range(min(samples, self.samples - self.done)):
            if self.done == self.first_judged and self.parameters["kick"] > 0.0 and not self.kicked:
                chain = self._state.chain
                kick(self.path, self.parameters["line_mass"], self.parameters["kick"], chain.q, chain.v)
                self.kicked = self.judged  # a run that is prolonged is not kicked again
            inputs = np.array([self._inputs(self.time), self._inputs(self.time + self.interval)])
            if not self._march(inputs):
                self.failure = Status.FAILED_NUMERICS, "the equations of a step have no solution in numbers"
                break
            self._take_sample()
            if (ended := self._slipped() or self._left()) is not None:
                self._totals[self.done - 1, -1] = readings.stored_energy(self._drive, self._state)
                self.failure = self._early_end(ended)
                break
        return self.failure

    def _march(self, inputs: np.ndarray) -> bool:
        p = self.parameters
        settings = self.step, self._steps_per_sample, p["speed_tolerance"], p["most_iterations"]
        return self._advance(self._drive, self._state, self._scheme, inputs, *settings)

    def _inputs(self, time: float) -> np.ndarray:
        """Speed of the driving pulley [rad/s] and torques on the others [N m] at a time, (P,)."""
        turn = self.drawn.path.turn
        inputs = -turn * self.drawn.load * self.load(time)
        inputs[0] = turn[0] * self.driving_speed(time)
        return inputs

    def driving_speed(self, time: float) -> float:
        """Speed of the driving pulley [rad/s]."""
        return courses.driving_speed(self.parameters, time)

    def load(self, time: float) -> float:
        """Torque at the driving pulley without losses, or the unit of `pulley_load` [N m]."""
        return courses.load(self.parameters, time)

    def _take_sample(self) -> None:
        sums = self._sums if self.done >= self.first_judged else None
        found = readings.Reading(self._readings, self._drive, self._state, sums)
        time = self.time
        speed = self.driving_speed(time)
        row = [*found.displacement, self.load(time), speed, *found.scalars()]
        self._lifted = np.where(found.lifted, self._lifted + 1, 0)
        stored = np.nan
        if self.done in (0, self.whole_turns.start - 1, self.samples - 1):
            stored = readings.stored_energy(self._drive, self._state)
        self._keep(row, [*self._state.totals, stored])

    def _slipped(self) -> str | None:
        """Whether the driven pulley runs far from its speed without slip, where the drive is under way."""
        row = self.done - 1
        driving, driven = (self.channel(f"{name}_speed")[row] for name in PULLEYS)
        if driving < LEAST_SPEED * self.parameters["driving_speed"]:
            return None
        share = self.drawn.ratio * driven / driving
        if share < LEAST_SPEED:
            return LOST
        return GAINED if share > MOST_SPEED else None

    @property
    def lifted(self) -> np.ndarray:
        """Whether the belt has left a pulley, (P,)."""
        return self._lifted * self.interval > _MOST_LIFTED

    def _left(self) -> str | None:
        if not self.lifted.any():
            return None
        name = self.drawn.pulleys[int(np.argmax(self._lifted))]
        return f"the belt lifts off: it has not touched the {name} pulley for {_MOST_LIFTED:g} s"

    @property
    def time(self) -> float:
        """Simulated time [s]."""
        return self.steps * self.step

    def speed_loss(self, samples: slice) -> float:
        """Loss of driven speed by sliding and creep in some samples, over the speed without slip [1]."""
        driven = self.channel("driven_speed")[samples].mean()
        return float(1.0 - self.drawn.ratio * driven / self.mean_driving_speed(samples))

    def drive_frequencies(self, count: int) -> np.ndarray:
        """Lowest frequencies of the drive about where it is, (count,) [Hz]."""
        return drive_frequencies(self._drive, self._state, count)

    @property
    def turns(self) -> int:
        """Whole turns of the belt in the judged part."""
        return int((self.samples - self.first_judged) / self._turn)

    @property
    def whole_turns(self) -> slice:
        """Samples of the last of these turns; of the judged part where there is none.

        With a ripple of the speed they are whole periods of it, as near to whole turns as the judged part has
        room for.
        """
        judged, count = self.samples - self.first_judged, self.turns * self._turn
        if self.parameters["speed_ripple"] > 0.0:
            period = 1.0 / (self.parameters["ripple_frequency"] * self.interval)
            count = min(round((count or judged) / period), int(judged / period + 1e-9)) * period or count
        return slice(self.samples - round(count), self.samples) if round(count) else self.judged

    @property
    def _turn(self) -> float:
        """Samples of a turn of the belt."""
        return self.path.path_length / (self._readings.belt_speed * self.interval)

    def mean_rate(self, total: int) -> float:
        """Mean rate of one of the totals, by its index; -1: of the stored energy.

        Over whole revolutions; of a run that ended before, over all that it has recorded.
        """
        first, last = max(self.whole_turns.start - 1, 0), self.samples - 1
        if self.done < self.samples:
            first, last = 0, self.done - 1
        change = self._totals[last, total] - self._totals[first, total]
        return float(change / ((last - first) * self.interval)) if last > first else np.nan

    def powers(self) -> dict[str, float | np.ndarray]:
        """Mean powers, as of `mean_rate`, named as in the record [W]."""
        found = {name: self.mean_rate(total) for total, name in enumerate(POWERS)}
        friction = np.array([self.mean_rate(FRICTION_LOSS + k) for k in range(len(self.drawn.pulleys))])
        loss = found["contact_loss"] + found["belt_loss"] + found["arm_loss"] + friction.sum()
        return {**found, "friction_loss": friction, "loss": loss, "storing_power": self.mean_rate(-1)}

    @property
    def profiles(self) -> dict[str, np.ndarray]:
        """PROFILES at places along the path, (place,), means of the judged part; nan where none is."""
        length, tension, offset, normal, friction, samples = self._sums
        with np.errstate(invalid="ignore", divide="ignore"):
            means = tension / length, normal / samples, friction / samples, offset / length
        return dict(zip(readings.PROFILES, means, strict=True))

    @property
    def present(self) -> Layout:
        """Pulleys and path with the arms at their mean angles in the judged part."""
        path, arms = self.path, range(len(self.pulleys.arms.pivot))
        angles = [self.channel(f"arm T{a + 1}")[self.judged].mean() for a in arms]
        if not angles:
            return self.drawn
        moved = axes(self.pulleys, np.array(angles))
        return self.drawn._replace(path=belt_path(moved, path.radius, path.turn))

    def numerical_doubt(self, record: dict[str, Any]) -> tuple[Status, str] | None:
        """Reason why a run that reached its end is not to be trusted, by its values; None where it is.

        These are `unsolved_share`, `power_residual`, `vibrates`, `amplitude` and `strand_tension`.
        """
        p = self.parameters
        unsolved, open_power = record["unsolved_share"], record["power_residual"]
        if not unsolved <= MOST_UNSOLVED:
            why = f"{unsolved:.1%} of the steps were not solved"
        elif not abs(open_power) <= _MOST_OPEN:
            why = f"the power balance is open by {open_power:.3g}, not by at most {_MOST_OPEN:g}"
        elif record["vibrates"] in (Vibrates.YES, Vibrates.IRREGULAR) and (
            record["amplitude"].max() < (shaken := mesh_amplitude(p, self.path, record["strand_tension"]))
        ):
            needed = p["elements"] * (shaken / p["amplitude_threshold"]) ** 0.25
            why = (
                f"the mesh alone may shake the belt by {shaken * 1e6:.3g} um: {np.ceil(needed):.0f} elements"
            )
            why += " or more tell whether it vibrates"
            self.parameters = {**p, "most_refinements": 0}  # no shorter step would help
        else:
            return None
        return Status.FAILED_NUMERICS, why


batch = batches_of_one(Transient)
