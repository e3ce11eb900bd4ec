"""Whether a run vibrates: yes, no, or undecided because the run was too short to tell.

Judged are the amplitudes of each strand within a frequency band, in successive windows of the last part of
the run, and the growth rate fitted to them; `assessment.py` takes both from the displacement.

A strand vibrates if it is above the threshold in every window and not decaying. It is quiet if it is
below the threshold at the end and not on its way there. Everything else is undecided: a start transient
that has not died out yet, a vibration that is still growing, one that comes and goes. A run vibrates if a
strand does, and is quiet only if all strands are.

The defaults, and why:

- `band_low` 100 Hz: above the pulleys' revolutions (20-50 Hz) and every settling, below the strands'
  first modes (from 200 Hz). `band_high` 1500 Hz: twice the measured 500-700 Hz, so that third modes and
  second harmonics are in; models of this belt are not meant to be dynamic much above 1 kHz.
- `amplitude_threshold` 1 um: a tenth of the simulated 10 um and a twentieth of the measured 20 um
  (Lebrecht et al. 2004, figs. 3.3 and 3.9), yet decades above what rounding leaves, even in single
  precision (1e-4 m times 1e-7).
- `judged_fraction` 1/2: the first half belongs to the start transient; belt damping alone (d_b/(2 m) = 77
  1/s in the reference belt) takes five decades off it within 0.15 s.
- `window_length` 40 ms: four periods of `band_low` keep drift and 50 Hz revolutions out, and beats
  between neighbouring modes (50 Hz apart and more) average out. Shortened where the judged part would
  hold fewer than four windows; for the shortest part that is accepted, to two periods.
- `decay_tolerance` 0.25 e-folds over the judged part: settled amplitudes scatter by 2-7 % from one 50 ms
  window to the next; three times that may pass for scatter. A smaller loss still counts as decay where
  the fit leaves no doubt, that is where it exceeds STEADY_LOSS and the fit's scatter.
- `growth_tolerance` 1 e-fold, gained since the quietest window or, beyond doubt, within one more record of
  the same length: noise in the band scatters by 10-15 % per window, and a factor of e is far outside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from cvt_hpc.parameters import Parameter
from cvt_hpc.variables import Vibrates

CONFIDENCE = 0.975  # one-sided, by Student's t: few windows know their own scatter badly
STEADY_LOSS = 0.05  # e-folds over the judged part that a settled vibration may lose, scatter apart
LONGEST_REASON = 240  # bytes that a record keeps of the reason

PARAMETERS: dict[str, dict[str, Parameter]] = {
    "vibration": {
        "band_low": Parameter(100.0, "Hz", "lowest frequency of a vibration", minimum=0.0, exclusive=True),
        "band_high": Parameter(1500.0, "Hz", "highest frequency of a vibration", minimum=0.0, exclusive=True),
        "amplitude_threshold": Parameter(
            1e-6, "m", "peak amplitude from which a strand vibrates", minimum=0.0, exclusive=True
        ),
        "judged_fraction": Parameter(
            0.5,
            "",
            "last part of the run that is judged, the rest being start transient",
            minimum=0.05,
            maximum=1.0,
        ),
        "window_length": Parameter(
            0.04, "s", "length of the windows in which the amplitude is taken", minimum=0.0, exclusive=True
        ),
        "decay_tolerance": Parameter(
            0.25,
            "",
            "largest loss of amplitude over the judged part, in e-folds, of a settled vibration",
            minimum=0.0,
        ),
        "growth_tolerance": Parameter(
            1.0,
            "",
            "gain of amplitude, in e-folds, from which a strand is growing",
            minimum=0.0,
            exclusive=True,
        ),
    }
}


def check(parameters: Mapping[str, Any]) -> list[tuple[str, str, str]]:
    """Problems between parameters: (key, expected, found), in the form of a model's check.

    Parameters
    ----------
    parameters : mapping
        Flat parameters with those of [vibration] and, if the job has one, the `duration` of a run [s].
    """
    low, high, window = parameters["band_low"], parameters["band_high"], parameters["window_length"]
    problems = []
    if high <= low:
        problems.append(("band_high", f"a frequency above band_low = {low:g} Hz", f"{high:g} Hz"))
    if window < 2 / low:
        problems.append(
            ("window_length", f"two periods of band_low ({2 / low:g} s) or more", f"{window:g} s")
        )
    judged = parameters["judged_fraction"] * parameters.get("duration", np.inf)
    if judged < 5 / low * (1 - 1e-9):
        expected = f"a judged part of five periods of band_low ({5 / low:g} s) or more"
        problems.append(("duration", expected, f"judged_fraction times duration = {judged:g} s"))
    return problems


def classify(
    amplitudes: ArrayLike,
    growth_rate: ArrayLike,
    growth_error: ArrayLike,
    *,
    judged_time: float,
    record_time: float,
    parameters: Mapping[str, Any],
    strands: Sequence[str] = ("t1", "t2"),
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
    strands : sequence of str, length strand
        Their names, for the reason.

    Returns
    -------
    Vibrates
        YES if a strand vibrates, NO if all are quiet, UNDECIDED otherwise.
    str
        The reason, in one line.

    Raises
    ------
    ValueError
        There is no window, or an amplitude is not finite: such a run has failed and has no class.
    """
    windows = np.asarray(amplitudes, dtype=float)
    if windows.ndim != 2 or len(windows) == 0 or not np.all(np.isfinite(windows)):
        raise ValueError("expected finite amplitudes of one window or more, shape (window, strand)")
    judged = {
        name: _judge_strand(strand, rate, error, judged_time, record_time, parameters)
        for name, strand, rate, error in zip(strands, windows.T, growth_rate, growth_error, strict=True)
    }
    for outcome in (Vibrates.YES, Vibrates.UNDECIDED, Vibrates.NO):
        told = [f"{name} {text}" for name, (vibrates, text) in judged.items() if vibrates is outcome]
        if told:
            return outcome, "; ".join(told)[:LONGEST_REASON]
    raise ValueError("expected one strand or more")


def _judge_strand(
    windows: NDArray[np.float64],
    rate: float,
    error: float,
    judged_time: float,
    record_time: float,
    parameters: Mapping[str, Any],
) -> tuple[Vibrates, str]:
    """Verdict and reason for one strand from its amplitudes in successive windows [m]."""
    threshold = parameters["amplitude_threshold"]
    last = windows[-1]
    size = f"{last * 1e6:.3g} um at the end"
    margin = error * stdtrit(max(len(windows) - 2, 1), CONFIDENCE)
    if np.all(windows >= threshold):
        loss = -rate * judged_time
        excused = min(parameters["decay_tolerance"], STEADY_LOSS + margin * judged_time)
        if loss <= excused:
            return Vibrates.YES, f"vibrates for the last {judged_time:.3g} s, {size}, growth {rate:.2g} 1/s"
        why = "in too few windows to tell decay" if np.isnan(rate) else f"but decays at {-rate:.3g} 1/s"
        return Vibrates.UNDECIDED, f"is above the threshold, {size}, {why}"
    if last == 0:
        return Vibrates.NO, "is at rest"
    late = windows[len(windows) // 2 :]
    if last >= threshold or (np.any(late >= threshold) and not rate + margin < 0):
        return Vibrates.UNDECIDED, f"is above the threshold only at times, {size}"
    with np.errstate(divide="ignore"):
        gain = max(np.log(last) - np.log(windows.min()), (rate - margin) * record_time)
    if gain >= parameters["growth_tolerance"]:
        return Vibrates.UNDECIDED, f"is below the threshold, {size}, but growing"
    if not (rate + error) * record_time < np.log(threshold / last):
        return Vibrates.UNDECIDED, f"is below the threshold, {size}, but may cross it in {record_time:.3g} s"
    return Vibrates.NO, f"is quiet, {size}"
