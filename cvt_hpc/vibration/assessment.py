"""From a run's displacement history to its amplitudes, frequencies, growth rates, and whether it vibrates.

A run vibrates, does not, or does so irregularly, or is undecided because it was too short. Judged are the
amplitudes of each strand within a frequency band, in successive windows of the last part of the run, and the
growth rate fitted to them.

A strand vibrates if it is above the threshold in every window and not decaying. It is irregular if it comes
and goes about the threshold over so many windows that a trend is ruled out: a longer run
would say no more. It is quiet if it is below the threshold at the end and not on its way there. Everything
else is undecided, and a longer run may decide: a start transient that has not died out yet, a vibration that
is still growing. A run vibrates if a strand does, and is quiet only if all strands are. It is irregular if a
strand is, unless another one is undecided that may have a trend. The thresholds are in `criterion.py`.

Whether an amplitude comes and goes about a threshold without a trend: a longer run would not decide.

The belt near 40 N m moves so: judder of the driven pulley rings a strand, now above the threshold and now
below. Called irregular is a record of windows in which

- the amplitude crosses the threshold _LEAST_CROSSINGS times or more: growth and decay cross it once, a single
  burst twice;
- it scatters by _LEAST_SCATTER of its mean or more: settled vibrations scatter by 2-7 %, noise in the band by
  10-15 %, judder by 30-100 %. A steady amplitude that happens to lie at the threshold is not irregular;
- a trend is ruled out: the 95 % confidence interval of the gain over the record, in e-folds, contains 0 and
  lies within +-`most_gain`. So an amplitude that grows or decays by that much is called irregular in at most
  one of 40 records. Large scatter requires more windows: some 15 if the logarithm scatters by 0.5.

Windows within one burst are alike, so the interval is that of fewer independent windows: n (1 - r)/(1 + r)
of n, r being the autocorrelation of neighbouring windows about the trend (Santer et al. 2000, J. Geophys.
Res. 105, 7337-7356), and of these there have to be _LEAST_WINDOWS. A beat of which the record holds a few
periods is undecided for that reason.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from cvt_hpc.variables import Status, Variable, Vibrates, shortened, values
from cvt_hpc.vibration import signals
from cvt_hpc.vibration.peaks import fundamentals
from cvt_hpc.vibration.settings import LEAST_PERIODS, fitting_window
from cvt_hpc.vibration.settings import band as given_band

_LEAST_WINDOWS = 12  # that are independent
_LEAST_CROSSINGS = 4
_LEAST_SCATTER = 0.2
_CONFIDENCE = 0.975  # one-sided

CONFIDENCE = 0.975  # one-sided, by Student's t: few windows know their own scatter badly
STEADY_LOSS = 0.05  # e-folds over the judged part that a settled vibration may lose, scatter apart
_CERTAIN_FACTOR = 2.0  # between amplitude and threshold, from which a shorter run decides
_UNSETTLED = 0.1  # change of a vibration, in e-folds, that the amplitude of a map may have
LEAST_RISES = 3  # windows in a row, none below the one before: irregular motion does that once in 24 times

VARIABLES = (
    Variable("amplitude", "m", "band-limited peak amplitude at the strongest probe", dims=("strand",)),
    Variable(
        "frequency",
        "Hz",
        "spacing of the harmonics in the band at the strongest probe; without any, of its strongest line",
        dims=("strand",),
        words="fundamental frequency",
    ),
    Variable(
        "strongest_frequency", "Hz", "of the strongest line in the band at that probe", dims=("strand",)
    ),
    Variable("lower_band_edge", "Hz", "lowest frequency of the motion by which the run is judged"),
    Variable("growth_rate", "s-1", "growth rate of the amplitude over the judged part", dims=("strand",)),
    Variable("growth_error", "s-1", "standard error of the growth rate", dims=("strand",)),
    Variable(
        "amplitude_scatter",
        "1",
        "standard deviation over mean of the amplitudes in successive windows",
        dims=("strand",),
    ),
)


def classify(
    amplitudes: ArrayLike,
    growth_rate: Sequence[float] | NDArray[np.float64],
    growth_error: Sequence[float] | NDArray[np.float64],
    *,
    judged_time: float,
    record_time: float,
    parameters: Mapping[str, Any],
    strands: Sequence[str] = ("t1", "t2"),
    overall: ArrayLike | None = None,
) -> tuple[Vibrates, str]:
    """Decide whether a run vibrates.

    Parameters
    ----------
    amplitudes : array, shape (window, strand)
        Band-limited amplitudes in successive windows of the judged part [m].
    growth_rate, growth_error : array, shape (strand,)
        Growth rate fitted to them and its standard error [1/s]; nan where there is none.
    judged_time, record_time : float
        Length of the judged part and of the whole run [s].
    parameters : mapping
        With `amplitude_threshold` [m], `decay_tolerance` and `growth_tolerance` [e-folds].
    overall : array, shape (strand,), optional
        Amplitudes over the whole judged part [m], for the reason; else the root mean square of the windows'.

    Returns
    -------
    Vibrates
        YES if a strand vibrates, UNDECIDED where a longer run may decide, IRREGULAR where it would not, NO if
        all strands are quiet.
    str
        The reason, in one line, the strongest of `strands` first.

    Raises
    ------
    ValueError
        There is no window, or an amplitude is not finite: such a run has failed and has no class.
    """
    windows = np.asarray(amplitudes, dtype=float)
    if windows.ndim != 2 or len(windows) == 0 or not np.all(np.isfinite(windows)):
        raise ValueError("expected finite amplitudes of one window or more, shape (window, strand)")
    sizes = np.sqrt(np.mean(windows**2, axis=0)) if overall is None else np.asarray(overall, dtype=float)
    each = list(zip(strands, windows.T, growth_rate, growth_error, sizes, strict=True))
    each.sort(key=lambda strand: -strand[1][-1])  # of a long reason the first ones stay
    judged = {
        name: _judge_strand(strand, rate, error, size, judged_time, record_time, parameters)
        for name, strand, rate, error, size in each
    }
    left_open = [
        strand
        for (_, strand, *_), (vibrates, _) in zip(each, judged.values(), strict=True)
        if vibrates is Vibrates.UNDECIDED
    ]
    order = [Vibrates.YES, Vibrates.UNDECIDED, Vibrates.IRREGULAR, Vibrates.NO]
    if all(is_stationary(strand, parameters["growth_tolerance"]) for strand in left_open):
        order[1:3] = order[2], order[1]
    for outcome in order:
        told = [f"{name} {text}" for name, (vibrates, text) in judged.items() if vibrates is outcome]
        if told:
            return outcome, shortened("; ".join(told))
    raise ValueError("expected one strand or more")


def margin(amplitudes: ArrayLike, vibrates: Vibrates, threshold: float) -> float:
    """Distance of the amplitudes that decided from the threshold [e-folds]; 0 where nothing is decided.

    Of a vibration by how much the smallest window of the strand that keeps highest is above it, of silence by
    how much the largest of the last half of the windows is below it; infinite at rest. Amplitudes, (window,
    strand), and threshold [m] are those of `classify`, `vibrates` its verdict.
    """
    windows = np.asarray(amplitudes, dtype=float)
    with np.errstate(divide="ignore"):
        if vibrates is Vibrates.YES:
            return float(np.log(windows.min(axis=0).max() / threshold))
        if vibrates is Vibrates.NO:
            return float(-np.log(windows[len(windows) // 2 :].max() / threshold))
    return 0.0


def _judge_strand(
    windows: NDArray[np.float64],
    rate: float,
    error: float,
    overall: float,
    judged_time: float,
    record_time: float,
    parameters: Mapping[str, Any],
) -> tuple[Vibrates, str]:
    """Verdict and reason for one strand from its amplitudes in successive windows, and over all [m]."""
    threshold = parameters["amplitude_threshold"]
    last = windows[-1]
    size = f"{last * 1e6:.3g} um in the last window"
    from scipy.special import stdtrit  # takes long, and quiet runs do without

    margin = error * stdtrit(max(len(windows) - 2, 1), CONFIDENCE)
    if np.all(windows >= threshold):
        loss = -rate * judged_time
        excused = min(parameters["decay_tolerance"], STEADY_LOSS + margin * judged_time)
        if loss <= excused:
            size = f"{overall * 1e6:.3g} um, growth {rate:.2g} 1/s"
            return Vibrates.YES, f"vibrates for the last {judged_time:.3g} s, {size}"
        why = "in too few windows to tell decay" if np.isnan(rate) else f"but decays at {-rate:.3g} 1/s"
        return Vibrates.UNDECIDED, f"is above the threshold, {size}, {why}"
    if is_irregular(windows, threshold, parameters["growth_tolerance"]):
        spread = f"{windows.min() * 1e6:.3g} to {windows.max() * 1e6:.3g} um"
        return Vibrates.IRREGULAR, f"is irregular, {spread} in {len(windows)} windows without a trend"
    if last == 0:
        return Vibrates.NO, "is at rest"
    late = windows[len(windows) // 2 :]
    if np.all(late < parameters["negligible_amplitude"]):
        return Vibrates.NO, f"is quiet, {size}"
    if last >= threshold or (np.any(late >= threshold) and not rate + margin < 0):
        return Vibrates.UNDECIDED, f"is above the threshold only at times, {size}"
    since = windows[np.argmin(windows) :]
    rising = len(since) > LEAST_RISES and bool(np.all(np.diff(since) >= 0.0))
    with np.errstate(divide="ignore"):
        gain = max(np.log(last / since[0]) if rising else 0.0, (rate - margin) * record_time)
    if gain >= parameters["growth_tolerance"]:
        return Vibrates.UNDECIDED, f"is below the threshold, {size}, but growing"
    if not (rate + error) * record_time < np.log(threshold / last):
        return Vibrates.UNDECIDED, f"is below the threshold, {size}, but may cross it in {record_time:.3g} s"
    return Vibrates.NO, f"is quiet, {size}"


def is_certain(record: Mapping[str, Any], parameters: Mapping[str, Any], left: float) -> bool:
    """Tell whether a run that goes on would keep its verdict, and its amplitude within a tenth.

    Its amplitude is _CERTAIN_FACTOR times above or below the threshold, and stays so as it grows or decays
    over the time that is left [s], by twice the error of its growth rate; of a vibration it changes by less
    than _UNSETTLED. Where the judged part is so short that it cuts the band off above the first modes, a
    slower motion may be left. The record has `vibrates` and VARIABLES, of each strand or of a single body; of
    the parameters those of [vibration], `duration` and `judged_fraction` count.
    """
    if record["vibrates"] not in (Vibrates.YES, Vibrates.NO) or "growth_rate" not in record:
        return False
    judged = parameters["judged_fraction"] * parameters["duration"]
    if not parameters["band_low"] and record["lower_band_edge"] <= LEAST_PERIODS / judged * (1.0 + 1e-9):
        return False
    threshold = parameters["amplitude_threshold"]
    names = "amplitude", "growth_rate", "growth_error", "amplitude_scatter"
    amplitude, rate, error, scatter = (np.atleast_1d(np.nan_to_num(record[name])) for name in names)
    with np.errstate(divide="ignore"):
        levels = np.log(amplitude / threshold)
    if record["vibrates"] == Vibrates.NO:
        return bool(np.all(levels + np.maximum(rate + 2.0 * error, 0.0) * left <= -np.log(_CERTAIN_FACTOR)))
    strongest = int(np.argmax(levels))
    most, spread = rate[strongest], 2.0 * error[strongest]
    is_settled = abs(most) * judged <= _UNSETTLED and scatter[strongest] <= _UNSETTLED
    lowest = levels[strongest] + min(most - spread, 0.0) * left
    return bool(is_settled and lowest >= np.log(_CERTAIN_FACTOR))


def relative_scatter(windows: ArrayLike, axis: int = 0) -> NDArray[np.float64]:
    """Standard deviation of amplitudes over their mean, along an axis; nan where nothing moves."""
    amplitudes = np.asarray(windows, dtype=float)
    with np.errstate(invalid="ignore"):
        return np.std(amplitudes, axis=axis) / np.mean(amplitudes, axis=axis)


def is_irregular(windows: ArrayLike, threshold: float, most_gain: float) -> bool:
    """Tell whether an amplitude comes and goes about a threshold, and a trend is ruled out.

    Of amplitudes in successive windows, (window,), equally spaced in time. The growth or decay over the
    record that has to be ruled out is `most_gain` [e-folds].
    """
    amplitudes = np.asarray(windows, dtype=float)
    crossings = np.count_nonzero(np.diff(amplitudes >= threshold))
    if crossings < _LEAST_CROSSINGS or relative_scatter(amplitudes) < _LEAST_SCATTER:
        return False
    return is_stationary(amplitudes, most_gain)


def is_stationary(windows: ArrayLike, most_gain: float) -> bool:
    """Whether a trend of an amplitude is ruled out; arguments as of `is_irregular`."""
    amplitudes = np.asarray(windows, dtype=float)
    if len(amplitudes) < _LEAST_WINDOWS or not np.all(amplitudes > 0.0):
        return False
    gain, error = _gain(np.log(amplitudes))
    return abs(gain) < error and abs(gain) + error < most_gain


def _gain(levels: NDArray[np.float64]) -> tuple[float, float]:
    """Gain of levels (window,) along their straight line, and how far it is uncertain; inf: not known."""
    n = len(levels)
    t = np.linspace(-0.5, 0.5, n)
    slope = t @ levels / (t @ t)
    scatter = levels - levels.mean() - slope * t
    # about a fitted line neighbours seem less alike than they are, by (2 + 4 r)/n
    found = (scatter[1:] @ scatter[:-1]) / (scatter @ scatter)
    alike = float(np.clip((n * found + 2.0) / (n - 4.0), 0.0, 1.0))
    freedom = n * (1.0 - alike) / (1.0 + alike) - 2.0
    if freedom < _LEAST_WINDOWS - 2:
        return float(slope), np.inf
    from scipy.special import stdtrit  # takes long, and quiet runs do without

    error = np.sqrt(scatter @ scatter / (freedom * (t @ t)))
    return float(slope), float(stdtrit(freedom, _CONFIDENCE) * error)


@dataclass(frozen=True)
class Occurrence:
    """Verdict on a run: whether and how it vibrates."""

    vibrates: Vibrates  # the verdict
    reason: str  # reason in one line, ASCII, at most 240 characters
    strands: tuple[str, ...]  # labels of the strands, the order of the arrays below
    # shape (strand,): band-limited peak amplitude over the judged part [m], at the strongest probe
    amplitude: NDArray[np.float64]
    # frequency, strongest_frequency, shape (strand,): fundamental of the periodic part at that probe, as of
    # `peaks.fundamental`, and its strongest line in the band [Hz]; nan without a peak in the band
    frequency: NDArray[np.float64]
    strongest_frequency: NDArray[np.float64]
    lower_band_edge: float  # lowest frequency of the band [Hz]
    # growth_rate, growth_error, shape (strand,): growth rate over the judged part and its standard error
    # [1/s]; nan where nothing moves
    growth_rate: NDArray[np.float64]
    growth_error: NDArray[np.float64]
    # shape (strand,): standard deviation of the amplitudes in successive windows over their mean; nan where
    # nothing moves
    amplitude_scatter: NDArray[np.float64]
    # shape (strand,): column of the displacement with the largest amplitude
    strongest_probe: NDArray[np.int64]
    # distance of the deciding quantity, as a rule the amplitudes, from the threshold [e-folds]; 0 where
    # nothing is decided
    margin: float

    def record(self) -> dict[str, Any]:
        """Return the entries of a record: the verdict, and VARIABLES."""
        return self.verdict() | values(VARIABLES, self)

    def verdict(self) -> dict[str, Any]:
        """Return the first entries of a record: that the run is done, and the verdict."""
        return {"status": Status.DONE, "vibrates": self.vibrates, "reason": self.reason}


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
        The strand on which each probe lies; those of the result are in the order in which they first appear.
    parameters : mapping
        Flat parameters with the keys of `settings.PARAMETERS["vibration"]`.

    Raises
    ------
    ValueError
        The displacement is not finite, or too short for the band.
    """
    return assess_runs(np.asarray(displacement, dtype=float)[np.newaxis], rate, strands, parameters)[0]


def assess_runs(
    displacements: NDArray[np.float64], rate: float, strands: Sequence[str], parameters: Mapping[str, Any]
) -> list[Occurrence]:
    """Judge runs of equal length and settings as `assess` does each; displacements (run, time, probe).

    The numbers of a run do not depend on the others, to the bit.
    """
    w = displacements
    total = w.shape[1]
    judged = w[:, total - round(parameters["judged_fraction"] * total) :]
    band = given_band(parameters)
    duration = judged.shape[1] / rate
    window = fitting_window(duration, parameters["window_length"])
    by_time = np.moveaxis(judged, 1, 0)
    centres, windows = signals.window_amplitudes(by_time, rate, band, window)
    amplitudes = signals.band_amplitude(by_time, rate, band)
    names = tuple(dict.fromkeys(strands))
    members = [np.flatnonzero(np.asarray(strands) == name) for name in names]
    strongest = np.stack([columns[np.argmax(amplitudes[:, columns], axis=1)] for columns in members], axis=1)
    sizes = np.take_along_axis(amplitudes, strongest, axis=1)
    strand_windows = np.stack([windows[:, :, columns].max(axis=2) for columns in members], axis=2)
    strand_windows = np.ascontiguousarray(np.moveaxis(strand_windows, 1, 0))
    growth = signals.growth_fits(centres, strand_windows)
    scatter = relative_scatter(strand_windows, axis=1)
    motions = np.take_along_axis(judged, strongest[:, np.newaxis], axis=2)
    motions = np.moveaxis(motions, 1, 2).reshape(-1, judged.shape[1])
    frequencies = fundamentals(motions, rate, band).reshape(*strongest.shape, 2)
    found = []
    for k, own in enumerate(strand_windows):
        vibrates, reason = classify(
            own,
            growth.rate[k],
            growth.standard_error[k],
            judged_time=duration,
            record_time=total / rate,
            parameters=parameters,
            strands=names,
            overall=sizes[k],
        )
        if vibrates is Vibrates.YES and sizes[k].max() < parameters["amplitude_threshold"]:
            # a short window sees a little beyond the band: motion there is not in it
            vibrates, reason = Vibrates.UNDECIDED, "moves at the edge of the band only"
        found.append(
            Occurrence(
                vibrates,
                reason,
                names,
                sizes[k],
                frequencies[k, :, 0],
                frequencies[k, :, 1],
                band[0],
                growth.rate[k],
                growth.standard_error[k],
                scatter[k],
                strongest[k],
                margin(own, vibrates, parameters["amplitude_threshold"]),
            )
        )
    return found
