"""From a run's displacement history to its amplitudes, frequencies, growth rates, and whether it vibrates."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvt_hpc.variables import Status, Variable, Vibrates
from cvt_hpc.vibration import signals
from cvt_hpc.vibration.occurrence import classify, margin, relative_scatter
from cvt_hpc.vibration.settings import fitting_window

VARIABLES = (
    Variable("amplitude", "m", "band-limited peak amplitude at the strongest probe", dims=("strand",)),
    Variable("frequency", "Hz", "at the strongest probe", dims=("strand",), words="dominant frequency"),
    Variable("growth_rate", "s-1", "growth rate of the amplitude over the judged part", dims=("strand",)),
    Variable("growth_error", "s-1", "standard error of the growth rate", dims=("strand",)),
    Variable(
        "amplitude_scatter",
        "1",
        "standard deviation over mean of the amplitudes in successive windows",
        dims=("strand",),
    ),
)


@dataclass(frozen=True)
class Occurrence:
    """Whether and how a run vibrates.

    Attributes
    ----------
    vibrates : Vibrates
        The verdict.
    reason : str
        Reason in one line, ASCII, at most 240 characters.
    strands : tuple of str
        Labels of the strands, the order of the arrays below.
    amplitude : array, shape (strand,)
        Band-limited peak amplitude over the judged part [m], at the strongest probe.
    frequency : array, shape (strand,)
        Dominant frequency at that probe [Hz]; nan without a peak in the band.
    growth_rate, growth_error : array, shape (strand,)
        Growth rate over the judged part and its standard error [1/s]; nan where nothing moves.
    amplitude_scatter : array, shape (strand,)
        Standard deviation of the amplitudes in successive windows over their mean; nan where nothing moves.
    strongest_probe : array of int, shape (strand,)
        Column of the displacement with the largest amplitude.
    margin : float
        Distance of the deciding quantity, as a rule the amplitudes, from the threshold [e-folds]; 0 where
        nothing is decided.
    """

    vibrates: Vibrates
    reason: str
    strands: tuple[str, ...]
    amplitude: NDArray[np.float64]
    frequency: NDArray[np.float64]
    growth_rate: NDArray[np.float64]
    growth_error: NDArray[np.float64]
    amplitude_scatter: NDArray[np.float64]
    strongest_probe: NDArray[np.int64]
    margin: float

    def record(self) -> dict[str, Any]:
        """Return the entries of a record: that the run is done, the verdict, and VARIABLES."""
        verdict = {"status": Status.DONE, "vibrates": self.vibrates, "reason": self.reason}
        return verdict | {variable.name: getattr(self, variable.name) for variable in VARIABLES}


def assess(
    displacement: ArrayLike, rate: float, strands: Sequence[str], parameters: Mapping[str, Any]
) -> Occurrence:
    """Judge a run by its displacement history.

    Parameters
    ----------
    displacement : array, shape (time, probe)
        Displacement of the probes over the whole run [m].
    rate : float
        Sampling rate [Hz].
    strands : sequence of str, length probe
        The strand on which each probe lies.
    parameters : mapping
        Flat parameters with the keys of `settings.PARAMETERS["vibration"]`.

    Returns
    -------
    Occurrence
        Strands in the order in which they first appear in `strands`.

    Raises
    ------
    ValueError
        The displacement is not finite, or too short for the band.
    """
    w = np.asarray(displacement, dtype=float)
    judged = w[len(w) - round(parameters["judged_fraction"] * len(w)) :]
    band = (parameters["band_low"], parameters["band_high"])
    duration = len(judged) / rate
    window = fitting_window(duration, parameters["window_length"])
    centres, windows = signals.window_amplitudes(judged, rate, band, window)
    amplitudes = signals.band_amplitude(judged, rate, band)
    names = tuple(dict.fromkeys(strands))
    members = [np.flatnonzero(np.asarray(strands) == name) for name in names]
    strongest = np.array([columns[np.argmax(amplitudes[columns])] for columns in members])
    strand_windows = np.stack([windows[:, columns].max(axis=1) for columns in members], axis=1)
    growth = signals.growth_fit(centres, strand_windows)
    vibrates, reason = classify(
        strand_windows,
        growth.rate,
        growth.standard_error,
        judged_time=duration,
        record_time=len(w) / rate,
        parameters=parameters,
        strands=names,
    )
    if vibrates is Vibrates.YES and amplitudes[strongest].max() < parameters["amplitude_threshold"]:
        # a short window sees a little beyond the band: motion there is not in it
        vibrates, reason = Vibrates.UNDECIDED, "moves at the edge of the band only"
    frequency = signals.dominant_frequency(judged[:, strongest], rate, band)
    return Occurrence(
        vibrates,
        reason,
        names,
        amplitudes[strongest],
        frequency,
        growth.rate,
        growth.standard_error,
        relative_scatter(strand_windows),
        strongest,
        margin(strand_windows, vibrates, parameters["amplitude_threshold"]),
    )
