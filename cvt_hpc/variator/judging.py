"""Verdict and record of a run of a variator, as far as they are the same whichever model marched it.

A run is as `slip` takes it, and has `displacement`, `probes` with labels, `failure` and `time` as well, and
`risen`, the samples before its load has risen. Of its channels, those of both strands count here, too. All
samples are recorded, or those until it slipped through; `names` are those of its strands, and `pulleys` those
whose slip it records.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from cvt_hpc.variables import Values, Variable, Vibrates, shortened, values
from cvt_hpc.variator import PULLEYS, STRANDS
from cvt_hpc.variator.band import band, judder_frequency
from cvt_hpc.variator.slip import slide, with_slip
from cvt_hpc.variator.variables import Measured
from cvt_hpc.vibration import assessment, ramp
from cvt_hpc.vibration.ramped import ramped
from cvt_hpc.vibration.signals import band_amplitude

VIBRATION = tuple(
    replace(v, early=True, may_miss=v in ramp.VARIABLES) for v in (*assessment.VARIABLES, *ramp.VARIABLES)
)
_LOCKED = 0.1  # of the resolution 1/L: how far a line of judder's may lie from a multiple of its frequency
_REGULAR = 1e-8  # keeps the matrix of multiples regular where the last one lies at half the sampling rate
_COMB = 0.5  # of that line: least height of the multiple before it
_RAMPED_CHANNELS = {"load": "load", "speed": "driving_speed"}  # by the ramped quantity, if not the time


def assess(
    run: Any, names: Sequence[str] = STRANDS, pulleys: Sequence[str] = PULLEYS
) -> assessment.Occurrence:
    """Whether and how a run vibrates that has reached its end; its probes are columns of the displacement."""
    p = run.parameters
    if ramped(p):
        # None is of a run before its end
        return with_slip(run, _assess_ramp(run, names))  # type: ignore[arg-type]
    columns, strands = _on_strands(run, names)
    in_band = {**p, "band_low": band(run)[0]}
    found = assessment.assess(run.displacement[:, columns], p["sampling_rate"], strands, in_band)
    found = with_judder(run, replace(found, strongest_probe=columns[found.strongest_probe]))
    return with_slip(run, found, pulleys)


def with_judder(run: Any, found: assessment.Occurrence) -> assessment.Occurrence:
    """The verdict on a run whose driven pulley judders: harmonics of judder are no vibration of the belt.

    A run does not vibrate where the strongest line of each strand above the threshold is a multiple of the
    judder's frequency, twice it or more, within _LOCKED/L, L being the length of the judged part, and rises
    out of the multiple before it by no more than 1/_COMB, and where the strands are below the threshold
    without all multiples up to the band's end. A vibration of the belt that is locked to judder rises by
    three and more. Amplitudes stay as they are; nothing else is decided by them. Probes are columns of the
    displacement.
    """
    p = run.parameters
    rate, threshold = p["sampling_rate"], p["amplitude_threshold"]
    slow = judder_frequency(run) if found.vibrates is Vibrates.YES else np.nan
    if not slow > 0.0:
        return found
    moved = run.displacement[run.judged][:, found.strongest_probe]
    above = np.flatnonzero(found.amplitude >= threshold)
    orders, highest = found.strongest_frequency[above] / slow, np.floor(p["band_high"] / slow)
    off = np.abs(orders - np.round(orders)) * slow * len(moved) / rate
    if not np.all((off <= _LOCKED) & (np.round(orders) >= 2.0) & (np.round(orders) <= highest)):
        return found
    nearest = np.round(orders).astype(int)
    parts, fitted = multiples(moved, slow / rate, int(highest))
    left = band_amplitude(moved - fitted, rate, (found.lower_band_edge, p["band_high"]))
    if np.any(left >= threshold):
        return found
    heights = np.abs(parts[1:, above])  # (multiple, strand above the threshold)
    of_strand = np.arange(above.size)
    if np.any(heights[nearest - 2, of_strand] < _COMB * heights[nearest - 1, of_strand]):
        return found
    told = [
        f"{found.strands[k]} by {found.amplitude[k] * 1e6:.3g} um at its harmonic {order}"
        for k, order in zip(above, nearest, strict=True)
    ]
    reason = f"the driven pulley judders at {slow:.4g} Hz and moves {', '.join(told)}"
    return replace(found, vibrates=Vibrates.NO, reason=reason, margin=0.0)


def multiples(moved: np.ndarray, slow: float, highest: int) -> tuple[np.ndarray, np.ndarray]:
    """The sum of a constant and of sines of all multiples of a frequency that is nearest to motions.

    `moved` (time, strand) holds the motions, `slow` is the frequency in cycles a sample, `highest` the
    largest multiple, at least 1. Returns complex amplitudes of the constant and of each multiple (1 +
    highest, strand), and the sum itself (time, strand).

    With x_t = sum_k c_k exp(i k w t) over k = -highest .. highest, least squares have the matrix
    D_(l-k) = sum_t exp(i (l - k) w t), which is Toeplitz: n^2 operations for n unknowns. All sums are chirp
    transforms.
    """
    from scipy.linalg import solve_toeplitz
    from scipy.signal import czt  # scipy.signal takes long to load

    turn = np.exp(2j * np.pi * slow)
    sums = czt(moved, highest + 1, 1.0 / turn, axis=0)
    column = czt(np.ones(len(moved)), 2 * highest + 1, 1.0 / turn)
    column[0] *= 1.0 + _REGULAR
    both = np.concatenate([sums[:0:-1].conj(), sums])
    parts = solve_toeplitz(column, both)[highest:]
    parts[1:] *= 2.0
    return parts, czt(parts, len(moved), turn, axis=0).real


def _assess_ramp(run: Any, names: Sequence[str]) -> ramp.RampOccurrence | None:
    """Whether and how a run vibrates along a ramp; None if it ended too soon to tell."""
    p, first, quantity = run.parameters, run.risen, ramped(run.parameters)
    columns, strands = _on_strands(run, names)
    rate, moved = p["sampling_rate"], run.displacement[first:, columns]
    if quantity == "time":
        values = (np.arange(first, first + len(moved)) + 1.0) / rate
    else:
        values = run.channel(_RAMPED_CHANNELS[quantity])[first:]
    found = ramp.assess_ramp(moved, rate, strands, quantity, values, run.samples - first, p)
    return found and replace(found, strongest_probe=columns[found.strongest_probe])


def _on_strands(run: Any, names: Sequence[str]) -> tuple[np.ndarray, list[str]]:
    """Columns of the displacement whose probes lie on strands, and on which."""
    regions = [probe.label.split()[0] for probe in run.probes]
    columns = [k for k, region in enumerate(regions) if region in names]
    return np.array(columns), [regions[k] for k in columns]


def slipped_through(run: Any) -> Values:
    """The verdict on a run that has slipped through before its end."""
    status, why = run.failure
    return {"status": status, "vibrates": Vibrates.SLIPS, "reason": f"at {run.time * 1e3:.4g} ms: {why}"}


def judge(run: Any, variables: Sequence[Variable], names: Sequence[str] = STRANDS) -> Values:
    """The record of a run that has reached its end, or slipped through before, its cost apart."""
    if run.failure is None:
        return finished(run, variables, assess(run, names))
    record = slipped_through(run)
    before = _assess_ramp(run, names) if ramped(run.parameters) else None
    if before is not None:
        record["reason"] = shortened(f"{record['reason']}; before: {before.reason}")
    return record | values((v for v in variables if v.early), Measured(run, slide(run), before))


def finished(run: Any, variables: Sequence[Variable], found: assessment.Occurrence) -> Values:
    """The record of a run that has reached its end, and of which the verdict is found."""
    return found.verdict() | values(variables, Measured(run, run.judged, found))
