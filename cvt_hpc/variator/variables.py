"""Variables that records of all models of a variator have in common, and what they are functions of."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from cvt_hpc.parameters import Parameters
from cvt_hpc.variables import Coordinate, Variable
from cvt_hpc.variator import PULLEYS, STRANDS
from cvt_hpc.vibration import assessment, ramp
from cvt_hpc.vibration.signals import amplitude_spectrum

COORDINATES = {
    "strand": Coordinate(np.array(STRANDS), "", "strand", "t1 leaves the driving pulley, t2 enters it"),
    "pulley": Coordinate(np.array(PULLEYS), "", "pulley"),
}


class Means:
    """Quantities that follow from mean values of a belt between pulleys."""

    mean: Callable[[str], float]  # mean of a channel, by its name
    powers: Any  # mean powers by their names in the record [W]; a part of the balance that is not there is 0

    def each(self, name: str, labels: Sequence[str] = PULLEYS) -> np.ndarray:
        """Means of a channel for each pulley, or other label, that fills a gap {} in its name."""
        return np.array([self.mean(name.format(label)) for label in labels])

    @property
    def thrust_ratio(self) -> float:
        """Axial force of the driving over that of the driven pulley [1]."""
        return np.divide(*self.each("axial_force {}"))

    @property
    def efficiency(self) -> float:
        """Share of the power put in that is not lost [1]: 0 without load; nan where none is put in."""
        put_in = max(self.powers["driving_power"], 0.0) + max(-self.powers["load_power"], 0.0)
        return 1.0 - self.powers["loss"] / put_in if put_in > 0.0 else np.nan

    @property
    def power_residual(self) -> float:
        """Power that the balance leaves open, over the larger of drive and losses [1]."""
        driving, loss = self.powers["driving_power"], self.powers["loss"]
        open_power = driving
        for name in ("load_power", "thrust_power", "loss", "storing_power", "numerical_damping"):
            open_power -= np.sum(self.powers.get(name, 0.0))
        return open_power / max(abs(driving), loss)


@dataclass(frozen=True)
class Measured(Means):
    """The part of a run by which its record is made, with the attributes of the run and of what is found.

    The run has `channel(name)`, `parameters`, `displacement`, `mean_driving_speed(samples)`, and `powers()`,
    means over the judged part. All other attributes are those of the verdict of a ramp, and of the run. One
    that a property lacks is sought there as well, so an error may name the run for it.
    """

    run: Any
    samples: slice  # the judged part; of a run that has slipped through, its slide
    found: assessment.Occurrence | None  # how it vibrates

    def __getattr__(self, name: str) -> Any:
        if name in ramp.RampOccurrence.__dataclass_fields__:
            return getattr(self.found, name, None)
        return getattr(self.run, name)

    @cached_property
    def powers(self) -> dict[str, Any]:
        """Mean powers by their names in the record [W]."""
        return self.run.powers()

    def part(self, name: str) -> np.ndarray:
        """History of a channel in the part."""
        return self.run.channel(name)[self.samples]

    def mean(self, name: str) -> float:
        """Mean of a channel."""
        return float(self.part(name).mean())

    @property
    def spectrum(self) -> np.ndarray:
        """Amplitude spectra at the probes that vibrate most, (strand, frequency) [m]."""
        p, moved = self.parameters, self.displacement[self.samples][:, self.strongest_probe]
        return amplitude_spectrum(moved, p["sampling_rate"], frequency_bins(p).values).T

    @property
    def speed_loss(self) -> float:
        """Loss of driven speed by sliding and creep over the speed without slip [1]."""
        driven_speed = self.part("driven_speed").mean()
        return 1.0 - self.parameters["ratio"] * driven_speed / self.mean_driving_speed(self.samples)


def power(name: str, comment: str, **others: Any) -> Variable:
    """One of `powers`, declared by its name there."""
    return Variable(name, "W", comment, of=lambda m: m.powers[name], **others)


def means(
    dim: str, labels: Sequence[str], name: str, units: str, comment: str, channel: str = "", **others: Any
) -> Variable:
    """Means along a dimension, declared: of a channel for each label, with the variable's name or its own."""
    template = channel or f"{name} {{}}"
    return Variable(name, units, comment, dims=(dim,), of=lambda m: m.each(template, labels), **others)


def shift_speed(radii: Callable[[Any], Sequence[np.ndarray]]) -> Variable:
    """Rate of the speed ratio, declared: radii(measured) are both pulleys' over the judged part [m]."""

    def rate(measured: Any) -> float:
        driving, driven = radii(measured)
        # the slope of a line of least squares; sums have the same bits on any number of threads
        time = np.arange(len(driving)) - 0.5 * (len(driving) - 1)
        per_sample = (time * (driven / driving)).sum() / (time * time).sum()
        return float(per_sample * measured.parameters["sampling_rate"])

    return Variable(
        "shift_speed",
        "s-1",
        "mean rate of the ratio of the driven to the driving radius, as the sheaves' positions give both",
        of=rate,
    )


each_pulley, each_strand = partial(means, "pulley", PULLEYS), partial(means, "strand", STRANDS)
_SHARED = (
    Variable(
        "spectrum",
        "m",
        "at the strongest probe",
        dims=("strand", "frequency_bin"),
        words="amplitude spectrum",
    ),
    each_strand("mean_ring_tension", "N", "mean ring tension in the middle of the strand", "ring_tension {}"),
    each_strand("mean_push_force", "N", "mean push force in the middle of the strand", "push_force {}"),
    each_pulley("axial_force", "N", "mean axial force of the belt on a sheave", early=True),
    each_pulley(
        "slip", "1", "mean tangential sliding over belt speed, weighted by contact force", early=True
    ),
    each_pulley("flank_loss", "W", "mean friction power of the flanks", "{}_flank_loss"),
    Variable(
        "thrust_ratio", "1", "mean axial force of the driving over that of the driven pulley", early=True
    ),
    Variable("speed_loss", "1", "1 - ratio x driven speed / driving speed, mean", early=True),
    Variable(
        "driven_speed_ripple",
        "rad s-1",
        "standard deviation of the driven pulley's speed",
        of=lambda m: m.part("driven_speed").std(),
    ),
    power("driving_power", "mean power of the driving pulley"),
    power("load_power", "mean power of the load"),
    power("thrust_power", "mean power that the thrust takes up"),
    power("storing_power", "mean rate of the stored energy"),
    power("ring_loss", "mean friction power between rings and elements"),
    power("belt_loss", "mean power of the belt's transverse damping"),
    power("layer_loss", "mean power of the layers' longitudinal dampers"),
    power("tilt_loss", "mean power of the dampers of the elements' tilt"),
    power("seating_loss", "mean elastic power lost by the mesh where contact ends"),
    power("loss", "mean of all losses", words="total loss"),
    Variable(
        "efficiency",
        "1",
        "share of the power put in that is not lost, by the driving pulley or by a load that drives",
    ),
    Variable(
        "power_residual", "1", "power that the balance leaves open, over the larger of drive and losses"
    ),
)


def frequency_bins(parameters: Parameters) -> Coordinate:
    """Frequencies of the spectra of a transient [Hz], by flat parameters of the job or of a run [SI]."""
    step = parameters["spectrum_step"]
    return Coordinate(np.arange(0.0, parameters["band_high"] + step / 2, step), "Hz", "frequency")


def shared(*names: str, **changes: Any) -> tuple[Variable, ...]:
    """Variables of the records of all variators, by name; with changes, as of their comment."""
    by_name = {variable.name: variable for variable in _SHARED}
    return tuple(replace(by_name[name], **changes) for name in names)
