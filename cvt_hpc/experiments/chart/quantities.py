"""The results by which methods are judged: their keys in a job, and their values in runs.

A quantity of one run is an array of one row; runs from several starts are pooled before they are compared,
so that a chaotic scene is judged by repeatable quantities: the rms over the starts of an amplitude, the mean
of everything else. Errors are relative: the norm of the difference over the norm of the reference, or over a
stated scale.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from cvt_hpc.errors import mismatch, unknown
from cvt_hpc.experiments.chart.plan import Quantity
from cvt_hpc.job.document import read_table
from cvt_hpc.parameters import Parameter, not_negative, positive
from cvt_hpc.vibration import signals
from cvt_hpc.vibration.assessment import assess
from cvt_hpc.vibration.settings import band, fitting_window

Array = NDArray[np.float64]


@dataclass(frozen=True)
class History:
    """Recorded values of a run."""

    # shape (time, probe): of the probes on strands or masses [m]; the first sample is one interval after the
    # start
    displacement: Array
    strands: tuple[str, ...]  # the strand, or the mass, to which each probe belongs
    channel: Callable[[str], Array]  # history of a recorded channel by its name, shape (time,)
    parameters: Mapping[str, Any]  # flat parameters of the run [SI]

    @property
    def rate(self) -> float:
        """Return the sampling rate [Hz]."""
        return float(self.parameters["sampling_rate"])

    @property
    def band(self) -> tuple[float, float]:
        """Return the band in which vibrations are looked for [Hz]."""
        return band(self.parameters)

    @property
    def judged(self) -> slice:
        """Return the samples of the judged part of the run."""
        samples = len(self.displacement)
        return slice(samples - round(self.parameters["judged_fraction"] * samples), samples)

    def part(self, since: float, until: float) -> slice:
        """Return the samples after `since` and up to `until` [s]."""
        last = len(self.displacement) if math.isinf(until) else round(until * self.rate)
        return slice(round(since * self.rate), last)


@dataclass(frozen=True)
class Kind:
    """A sort of quantity."""

    unit: str  # of its values
    title: str  # the compared quantity, for people; the heading of a panel
    # (History, Quantity) -> the run's values, shape (n,) or, for a trajectory, (time, probe)
    values: Callable[[History, Quantity], Array]
    takes_part: bool = False  # whether a job may limit it to a part of the run
    needs_part: bool = False  # whether it must
    channels: tuple[str, ...] = ()  # recorded channels that it is made of


def _trajectory(history: History, quantity: Quantity) -> Array:
    return history.displacement[history.part(quantity.since, quantity.until)]


def _growth_rate(history: History, quantity: Quantity) -> Array:
    part = history.displacement[history.part(quantity.since, quantity.until)]
    return _at_strongest(history, signals.envelope_growth(part, history.rate, history.band).rate)


def _onset(history: History, quantity: Quantity) -> Array:
    """Load at which the amplitude of a window first exceeds the threshold, between the windows' middles."""
    p = history.parameters
    w = history.displacement
    length = fitting_window(len(w) / history.rate, p["window_length"])
    times, windows = signals.window_amplitudes(w, history.rate, history.band, length)
    first = round(quantity.since * history.rate) / history.rate
    strongest, times = windows.max(axis=1)[times >= first], times[times >= first]
    above = np.flatnonzero(strongest > p["amplitude_threshold"])
    if above.size == 0 or above[0] == 0:
        return np.array([np.nan])
    k = above[0]
    # amplitudes grow exponentially, so it is their logarithm that is interpolated
    levels = np.log(np.maximum(strongest[k - 1 : k + 1], np.finfo(float).tiny))
    crossing = np.interp(np.log(p["amplitude_threshold"]), levels, times[k - 1 : k + 1])
    sampled = (1 + np.arange(len(w))) / history.rate
    # the first sample is one interval after the start, and `times` counts from the first sample
    return np.array([np.interp(crossing + 1 / history.rate, sampled, history.channel(quantity.channel))])


def _means(unit: str, title: str, *channels: str) -> Kind:
    """Return the kind of quantity that is the mean of channels over the judged part."""

    def values(history: History, quantity: Quantity) -> Array:
        return np.array([history.channel(name)[history.judged].mean() for name in channels])

    return Kind(unit, title, values, channels=channels)


def _speed_loss(history: History, quantity: Quantity) -> Array:
    driven, driving = (history.channel(f"{name}_speed")[history.judged] for name in ("driven", "driving"))
    return np.array([1.0 - history.parameters["ratio"] * driven.mean() / driving.mean()])


def _net_axial_force(history: History, quantity: Quantity) -> Array:
    left, right = (history.channel(name)[history.judged].mean() for name in _DRIVING_SHEAVES)
    return np.array([right - left])


_DRIVING_SHEAVES = ("sheave_force driving left", "sheave_force driving right")
_TIMES = (1e-6, 1e3)  # [s]
KINDS: dict[str, Kind] = {
    "trajectory": Kind("m", "trajectory", _trajectory, takes_part=True, needs_part=True),
    "amplitude": Kind("m", "amplitude", lambda history, _: _assessed(history).amplitude),
    "frequency": Kind("Hz", "fundamental frequency", lambda history, _: _assessed(history).frequency),
    "growth_rate": Kind("s-1", "growth rate", _growth_rate, takes_part=True),
    "occurrence": Kind("1", "occurrence", lambda history, _: np.array([float(_assessed(history).vibrates)])),
    "onset": Kind("N m", "onset load", _onset, takes_part=True),
    "push_force": _means("N", "push force", "push_force t1", "push_force t2"),
    "ring_tension": _means("N", "ring tension", "ring_tension t1", "ring_tension t2"),
    "net_axial_force": Kind("N", "net axial force", _net_axial_force, channels=_DRIVING_SHEAVES),
    "strand_tension": _means("N", "strand tension", "tension t1", "tension t2"),
    "speed_loss": Kind("1", "speed loss", _speed_loss, channels=("driven_speed", "driving_speed")),
    "friction_loss": _means("W", "friction losses", "driving_flank_loss", "driven_flank_loss", "ring_loss"),
}


def read_quantity(name: str, raw: Any, where: str) -> Quantity:
    """Return a quantity as a chart job requests it.

    Raises
    ------
    InputError
        If there is no such quantity, or its table is not legal.
    """
    if name not in KINDS:
        raise unknown(where, "quantity", name, KINDS)
    kind = KINDS[name]
    declared = {
        "tolerance": not_negative(
            0.0 if name == "occurrence" else math.inf,
            "",
            "largest error allowed; of the occurrence the share of starts that are judged differently",
            allow_infinite=True,
        ),
        "scale": not_negative(0.0, kind.unit, "what errors are divided by; 0: the reference's size"),
    }
    if kind.takes_part:
        end = None if kind.needs_part else math.inf
        declared["since"] = not_negative(0.0, "s", "start of the part that is looked at", sensible=_TIMES)
        declared["until"] = positive(end, "s", "end of it", allow_infinite=end is not None, sensible=_TIMES)
    if name == "onset":
        declared["channel"] = Parameter("load", "", "recorded channel whose value is the onset")
    values = read_table(declared, raw, where)
    if kind.takes_part and values["since"] >= values["until"]:
        raise mismatch(
            f"{where} until", f"a time after since = {values['since']:g} s", f"{values['until']:g} s"
        )
    return Quantity(name, **values)


def channels_needed(quantities: Sequence[Quantity]) -> tuple[str, ...]:
    """Return the recorded channels that quantities are made of."""
    meant = (channel for q in quantities for channel in KINDS[q.name].channels)
    return (*meant, *(q.channel for q in quantities if q.channel))


def strand_of(label: str) -> str | None:
    """Return the strand, or the mass, on which a probe lies; None for one on an arc, as "driving arc 1/2"."""
    return None if " arc " in label else label.split()[0]


def observe(history: History, quantities: Sequence[Quantity], whole: bool) -> dict[str, Array]:
    """Return the values of a run by quantity; of one that is not `whole` only the trajectory counts."""
    asked = [quantity for quantity in quantities if whole or quantity.name == "trajectory"]
    values = {quantity.name: KINDS[quantity.name].values(history, quantity) for quantity in asked}
    # amplitudes determine the judged strand, whether they are requested or not
    return {"amplitude": _assessed(history).amplitude, **values} if whole else values


def _assessed(history: History) -> Any:
    return assess(history.displacement, history.rate, history.strands, history.parameters)


def _at_strongest(history: History, values: Array) -> Array:
    """Return the values (probe,) at the probe of each strand that moves most."""
    return values[_assessed(history).strongest_probe]
