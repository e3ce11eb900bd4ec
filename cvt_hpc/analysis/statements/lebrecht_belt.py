"""Statements of Lebrecht, Pfeiffer and Ulbrich 2004 about figs 3.2 to 3.4, 3.7, 3.10, 3.11, 4.1 and 4.2."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from cvt_hpc.analysis.followed_drawing import one_passage
from cvt_hpc.analysis.statements.kept import Kept, over_arc
from cvt_hpc.analysis.statements.verdicts import Measured, Statement

BAND = (500.0, 700.0)  # [Hz] of the noise


def _peaks(kept: Kept, strand: str) -> list[tuple[float, int, float]]:
    """Frequency [Hz], mode and amplitude [um] of the peaks of a strand, largest first."""
    run = kept.run().sel(strand=strand)
    values = (run[f"peak_{name}"].values for name in ("frequency", "mode", "amplitude"))
    return [(float(f), int(m), 1e6 * float(a)) for f, m, a in zip(*values, strict=True) if m]


def _in_words(peaks: Sequence[tuple[float, int, float]]) -> str:
    return ", ".join(f"{f:.0f} Hz (mode {m}, {a:.2g} um)" for f, m, a in peaks)


def _frequencies_in_band(kept: Kept) -> Measured:
    peaks = [_peaks(kept, strand) for strand in ("t1", "t2")]
    holds = [BAND[0] <= own[0][0] <= BAND[1] for own in peaks if own]
    return Measured(holds, f"t1 {_in_words(peaks[0])}; t2 {_in_words(peaks[1])}")


def _higher_peak_of_unloaded(kept: Kept) -> Measured:
    first, second = (_peaks(kept, strand) for strand in ("t1", "t2"))
    above = max((f for f, _, _ in second), default=0.0) > 1.1 * max((f for f, _, _ in first), default=0.0)
    larger = False
    for frequency, _, amplitude in second:
        beside = [a for f, _, a in first if abs(f - frequency) < 0.05 * frequency]
        larger |= frequency > 1.1 * second[0][0] and amplitude > max(beside, default=0.0)
    return Measured([above or larger], f"t1 {_in_words(first)}; t2 {_in_words(second)}")


def _modes(kept: Kept) -> Measured:
    first, second = (_peaks(kept, strand)[0] for strand in ("t1", "t2"))
    return Measured(
        [first[1] == 2, second[1] == 3], f"largest peak of t1 in mode {first[1]}, of t2 in mode {second[1]}"
    )


def _speed_has_the_peaks(kept: Kept) -> Measured:
    history = kept.histories[0]
    speed = history["momentary_sliding_speed"].values
    inner = np.flatnonzero(history["region"].values.astype(str) == "driven arc")[5:-5]
    motion = speed[:, inner] - speed[:, inner].mean(axis=0)
    interval = float(np.diff(history["profile_time"].values).mean())
    power = (
        np.abs(np.fft.rfft(motion * np.hanning(len(motion))[:, None], 8 * len(motion), axis=0)) ** 2
    ).sum(1)
    lines = np.fft.rfftfreq(8 * len(motion), interval)
    found = float(lines[lines > 200.0][np.argmax(power[lines > 200.0])])
    peaks = [f for strand in ("t1", "t2") for f, _, _ in _peaks(kept, strand)]
    # a window of 60 ms tells lines 2 / 60 ms = 33 Hz apart
    return Measured(
        [any(abs(found - f) < 33.0 for f in peaks)],
        f"sliding on the driven arc {found:.0f} Hz, strands {', '.join(f'{f:.0f}' for f in peaks)} Hz",
    )


def _spiral(kept: Kept) -> Measured:
    arc = over_arc(kept.histories[0], "mean_displacement", "driven")
    depth = 1e3 * (arc.values[0] - arc.values.min())
    place = float(arc.share[np.argmin(arc.values)])
    return Measured(
        [depth > 0.0, 0.0 < place < 1.0, arc.values[-1] > arc.values.min()],
        f"{depth:.2g} mm into the groove, innermost at {100 * place:.0f} % of the wrap",
    )


def _radial_through_zero(kept: Kept) -> Measured:
    element = one_passage(kept.histories[0], "driven")
    radial = 1e3 * element["radial_sliding"].values
    n = radial.size // 4
    return Measured(
        [radial[1:n].mean() < 0.0 < radial[-n:].mean()],
        f"{radial[1:n].mean():.3g} mm/s in the first, {radial[-n:].mean():.3g} mm/s in the last quarter",
    )


def _jagged(kept: Kept) -> Measured:
    history = kept.histories[0]
    element = one_passage(history, "driven")
    mean = np.interp(element["position"], history["position"], history["radial_sliding"].fillna(0.0))
    off = 1e3 * (element["radial_sliding"].values - mean)[5:-5]
    turns = int((np.diff(np.sign(off)) != 0).sum())
    return Measured(
        [turns >= 6], f"it swings {off.std():.2g} mm/s (rms) about its mean, with {turns} changes of sign"
    )


FIGURE_3_10 = (
    Statement("The dominant frequencies are 500-700 Hz (figs 3.2, 3.11)", _frequencies_in_band),
    Statement("The peak at the higher frequency belongs to the strand under no load (fig. 3.11)",
              _higher_peak_of_unloaded),
    Statement("The strand under load moves in its second shape, the other in its third (figs 3.3, 3.4)",
              _modes,
              "both strands move at one frequency, and then the one with less tension has more half waves"),
    Statement("The relative velocity of elements and pulley has the dominant frequencies (fig. 3.10)",
              _speed_has_the_peaks),
    Statement("Elements move into the sheave till the innermost point is reached (fig. 4.1)", _spiral),
    Statement("Their radial relative velocity passes from inwards to outwards (fig. 4.2)",
              _radial_through_zero),
    Statement("and small movements make it a jagged curve (fig. 4.2)", _jagged),
)  # fmt: skip


def _eigenfrequencies(kept: Kept, strand: str, waves: int) -> np.ndarray:
    return kept.results["eigenfrequency"].sel(strand=strand, half_waves=waves).values


def _loaded_falls_unloaded_rises(kept: Kept) -> Measured:
    moves = {
        (strand, waves): _eigenfrequencies(kept, strand, waves)[[0, -1]]
        for strand in ("t1", "t2")
        for waves in (2, 3)
    }
    holds = [(b < a) if strand == "t1" else (b > a) for (strand, _), (a, b) in moves.items()]
    said = [f"{s} {w}. {a:.0f} to {b:.0f} Hz" for (s, w), (a, b) in moves.items()]
    return Measured(holds, ", ".join(said))


def _second_and_third_in_band(kept: Kept) -> Measured:
    load = kept.results["load"].values
    noisy = (load >= 130.0) & (load <= 200.0)
    second, third = _eigenfrequencies(kept, "t1", 2)[noisy], _eigenfrequencies(kept, "t2", 3)[noisy]
    holds = [bool(((f >= BAND[0]) & (f <= BAND[1])).all()) for f in (second, third)]
    return Measured(
        holds,
        f"at 130-200 N m the second of t1 {second.min():.0f}-{second.max():.0f} Hz, "
        f"the third of t2 {third.min():.0f}-{third.max():.0f} Hz",
    )


FIGURE_3_7 = (
    Statement("The frequencies of the strand under load fall with the load, the others rise",
              _loaded_falls_unloaded_rises),
    Statement("The second and third eigenfrequency are in the range of 500-700 Hz", _second_and_third_in_band,
              "the torque balance forbids both under load, whatever mass, tension and bending stiffness"),
)  # fmt: skip
