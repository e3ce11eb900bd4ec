"""Whether a run vibrates anywhere along a ramp of load or speed, between which values, and how far at each.

Under a ramp no part of the run stands for the whole, so all windows after the start-up are judged. The run
vibrates if a strand stays above the threshold for SUSTAINED windows in a row, wherever that is. It is quiet
only if no window is above, and the amplitude is not growing at the end. Vibration above the threshold for a
shorter time is undecided: a slower ramp may decide. A vibration takes time to grow, so a fast ramp shows the
onset late, by the change of the ramped quantity meanwhile.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvt_hpc.variables import Coordinate, Variable, Vibrates, shortened, together, values
from cvt_hpc.vibration import signals
from cvt_hpc.vibration.assessment import LEAST_RISES, Occurrence
from cvt_hpc.vibration.peaks import fundamental
from cvt_hpc.vibration.ramped import QUANTITIES, Quantity
from cvt_hpc.vibration.settings import SHORTEST_SEGMENT, fitting_window
from cvt_hpc.vibration.settings import band as given_band

Array = NDArray[np.float64]

SUSTAINED = 4  # windows in a row: as many as the shortest judged part of a run at constant load has
LEAST_PERIODS = 1.9  # of the lowest frequency in a window; of four windows in five periods one has 1.95
BINS = 20  # parts of a ramp whose amplitudes are recorded


def _variables(name: str, quantity: Quantity) -> tuple[Variable, ...]:
    units, what = quantity.cf_units, quantity.long_name
    return together(
        lambda found: (found.onset, found.end, found.ramp_mean) if found.quantity == name else None,
        Variable(
            f"onset_{name}",
            units,
            f"{what} at which vibration sets in along a ramp; not a number where it is there from the start",
        ),
        Variable(
            f"end_{name}",
            units,
            f"{what} at which vibration ends along a ramp; not a number where it lasts to the end",
        ),
        Variable(f"ramp_{name}", units, f"mean {what} in parts of a ramp", dims=("ramp_share",)),
    )


VARIABLES = (
    *(variable for name, quantity in QUANTITIES.items() for variable in _variables(name, quantity)),
    Variable(
        "ramp_amplitude", "m", "mean band-limited amplitude in parts of a ramp", dims=("strand", "ramp_share")
    ),
)


def coordinate() -> Coordinate:
    """The dimension `ramp_share`: middles of the parts of a ramp, as shares of it."""
    return Coordinate((np.arange(BINS) + 0.5) / BINS, "1", "share of the ramp", "after rise_time")


@dataclass(frozen=True)
class RampOccurrence(Occurrence):
    """Occurrence along a ramp: amplitude and frequencies are those of the window that moves most."""

    quantity: str  # the ramped one of QUANTITIES: a load [N m] or a speed [rad/s]
    # onset, end: its values between which the run vibrates; nan where it does not, and where vibration is
    # there from the ramp's start, or lasts to its end
    onset: float
    end: float
    ramp_mean: Array  # shape (BINS,): its mean in equal parts of the ramp; nan where no window lies
    ramp_amplitude: Array  # shape (strand, BINS): mean amplitude in them [m]

    def record(self) -> dict[str, Any]:
        """Return the entries of a record: as of `Occurrence`, and VARIABLES of its quantity."""
        return super().record() | values(VARIABLES, self)


def assess_ramp(
    displacement: ArrayLike,
    rate: float,
    strands: Sequence[str],
    quantity: str,
    values: Array,
    samples: int,
    parameters: Mapping[str, Any],
) -> RampOccurrence | None:
    """Judge a run along a ramp; None where it ended before it could be judged.

    Parameters
    ----------
    displacement : array, shape (time, probe)
        Displacement of the probes along the ramp, without the start-up before it [m].
    quantity, values : str and array, shape (time,)
        The ramped one of QUANTITIES, and its values at the same instants.
    samples : int
        Samples of the whole ramp; a run that ended early has fewer.
    rate, strands, parameters
        As of `assessment.assess`.
    """
    w, band = np.asarray(displacement, dtype=float), given_band(parameters)
    length = fitting_window(len(w) / rate, parameters["window_length"])
    width = round(length * rate)
    if width < SHORTEST_SEGMENT or length * band[0] < LEAST_PERIODS:
        return None
    centres, windows = signals.window_amplitudes(w, rate, band, length)
    names = tuple(dict.fromkeys(strands))
    members = [np.flatnonzero(np.asarray(strands) == name) for name in names]
    strongest = np.array([columns[np.argmax(windows[:, columns].max(axis=0))] for columns in members])
    levels = np.stack([windows[:, columns].max(axis=1) for columns in members], axis=1)
    at = np.interp(centres, np.arange(len(w)) / rate, values)
    bins = np.minimum((centres * rate / samples * BINS).astype(int), BINS - 1)
    verdict = Passages(levels, at, QUANTITIES[quantity], parameters)
    vibrates, reason = verdict.classify(names)
    unknown, each = np.full(len(names), np.nan), []
    for probe in strongest:  # in the window that moves most
        first = round(centres[np.argmax(windows[:, probe])] * rate - (width - 1) / 2)
        each.append(fundamental(w[first : first + width, probe], rate, band))
    frequencies = np.array(each)
    return RampOccurrence(
        vibrates,
        reason,
        names,
        levels.max(axis=0),
        frequencies[:, 0],
        frequencies[:, 1],
        band[0],
        unknown,
        unknown,
        unknown,
        strongest,
        verdict.margin(vibrates),
        quantity,
        *verdict.ends(),
        _means(at[:, np.newaxis], bins)[0],
        _means(levels, bins),
    )


class Passages:
    """Stretches in which amplitudes, (window, strand) [m], stay above the threshold.

    `values`, (window,), are those of the ramped quantity in the middles of the windows.
    """

    def __init__(
        self, levels: Array, values: Array, quantity: Quantity, parameters: Mapping[str, Any]
    ) -> None:
        self.levels, self.at, self.quantity = levels, values, quantity
        self.threshold, self.negligible = (
            parameters[key] for key in ("amplitude_threshold", "negligible_amplitude")
        )
        self.tolerance = parameters["growth_tolerance"]
        self.kept = np.stack([_sustained(strand >= self.threshold) for strand in levels.T], axis=1)
        self.low = np.log(np.maximum(levels, np.finfo(float).tiny))

    def classify(self, names: Sequence[str]) -> tuple[Vibrates, str]:
        """Verdict and reason; `names` are those of the strands."""
        top = f"at most {self.levels.max() * 1e6:.3g} um"
        if self.kept.any():
            which = [name for name, kept in zip(names, self.kept.T, strict=True) if kept.any()]
            who = " and ".join(which) + (" vibrates" if len(which) == 1 else " vibrate")
            onset, end = self.ends()
            since = "the ramp's start" if np.isnan(onset) else self._in_words(onset)
            until = "its end" if np.isnan(end) else self._in_words(end)
            return Vibrates.YES, shortened(f"{who} from {since} to {until}, {top}")
        place = f"between {self.quantity.factor * self.at[0]:.4g} and {self._in_words(self.at[-1])}"
        above = int((self.levels >= self.threshold).any(axis=1).sum())
        if above:
            return Vibrates.UNDECIDED, f"above the threshold in {above} windows only {place}, {top}"
        last = self.low[-LEAST_RISES - 1 :]
        rising = np.all(np.diff(last, axis=0) >= 0.0, axis=0) & (self.levels[-1] >= self.negligible)
        if np.any(rising & (last[-1] - last[0] >= self.tolerance)):
            return Vibrates.UNDECIDED, f"below the threshold {place}, {top}, but growing at the end"
        return Vibrates.NO, f"quiet {place}, {top}"

    def _in_words(self, value: float) -> str:
        return f"{self.quantity.factor * value:.4g} {self.quantity.units}"

    def ends(self) -> tuple[float, float]:
        """Values at the onset and at the end."""
        vibrating = np.flatnonzero(self.kept.any(axis=1))
        if not vibrating.size:
            return np.nan, np.nan
        return self._crossing(vibrating[0], -1), self._crossing(vibrating[-1], 1)

    def margin(self, vibrates: Vibrates) -> float:
        """Margin of the best SUSTAINED windows in a row, or of the largest window."""
        over = self.low - np.log(self.threshold)
        if vibrates is Vibrates.YES:
            rows = np.lib.stride_tricks.sliding_window_view(over, SUSTAINED, axis=0)
            return float(rows.min(axis=-1).max())
        return float(-over.max()) if vibrates is Vibrates.NO else 0.0

    def _crossing(self, k: int, step: int) -> float:
        """Value between window k, in which a strand vibrates, and its neighbour on one side."""
        if not 0 <= k + step < len(self.at):
            return np.nan
        strand = int(np.argmax(np.where(self.kept[k], self.levels[k], -1.0)))
        inside, outside = self.low[[k, k + step], strand]
        share = (inside - np.log(self.threshold)) / (inside - outside)
        return float(self.at[k] + share * (self.at[k + step] - self.at[k]))


def _sustained(above: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which windows belong to SUSTAINED or more in a row that are above."""
    kept = np.zeros(len(above), bool)
    borders = np.flatnonzero(np.diff(np.concatenate([[False], above, [False]])))
    for first, last in borders.reshape(-1, 2):
        kept[first:last] = last - first >= SUSTAINED
    return kept


def _means(values: Array, bins: NDArray[np.int64]) -> Array:
    """Means of values (window, n) in BINS, (n, BINS); nan where no window lies."""
    counts = np.bincount(bins, minlength=BINS)
    with np.errstate(invalid="ignore"):
        return np.stack([np.bincount(bins, column, BINS) / counts for column in values.T])
