"""Time signals of a kept run in files: WAV to listen to, CSV and UFF58 as input of a model of the casing.

What is written is the motion of the belt and forces, no radiated sound: casing and air are not modelled.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.histories import settings_of
from cvt_hpc.analysis.ramps import changing_of, start_up
from cvt_hpc.analysis.time_signals import Signal, known_signals, read_signal, shown_in
from cvt_hpc.errors import InputError, mismatch
from cvt_hpc.storage.files import naming_refusals, read_regular, write_rows, written_aside
from cvt_hpc.storage.provenance import origin_lines
from cvt_hpc.vibration.peaks import fundamental

Array = NDArray[np.float64]

FORMATS = (".wav", ".csv", ".uff")
AUDIO_RATE, FULL_SCALE = 48000, 32767  # [Hz], and the largest number of 16 bits
PEAK = 10.0 ** (-3.0 / 20.0)  # of full scale: -3 dBFS
_LEAST_SOUND = 5.0  # [s]: a loop is repeated until it lasts so long
ROUNDING = 1e-13  # of a signal, which moves no more than that by rounding alone
_FADE = 0.01  # [s]: over this time, in whole periods, the end of a loop goes over into its beginning
KINDS = {"m": 8, "N": 13}  # specific data types of UFF58: displacement, excitation force; else unknown
_NOT_MODELLED = "not modelled: the casing, and the sound that it radiates"


class Loop(NamedTuple):
    """Signal of a loop: (n,) values, of which the first follows the last, in a length [s].

    `periods` are those within it; 0 of a signal that has none.
    """

    values: Array
    length: float
    periods: int


def export(
    history: xr.Dataset, of: Sequence[str], out: Path, source: str = "history", *, velocity: bool = False
) -> list[str]:
    """Write signals of a run in the format that the suffix names; return lines about what was written.

    Parameters
    ----------
    history, source
        As of `read_signal`.
    of : sequence of str
        Signals, as of `read_signal`. By default t1 as WAV, all of them otherwise.
    out : Path
        FILE.wav: one signal, its judged part as a loop of whole periods, or all of a ramp, at AUDIO_RATE with
        its peak at -3 dBFS; FILE.txt beside it has the scale. FILE.csv: a column for each. FILE.uff: a
        data set 58 for each, in SI units.
    velocity : bool
        As WAV the velocity of a displacement.

    Raises
    ------
    InputError
        As of `read_signal`; another suffix; more than one signal as WAV; signals at unlike times; `pyuff` is
        missing; FILE.txt is of somebody else; or the system refuses.
    """
    out, suffix = Path(out), Path(out).suffix.lower()
    if suffix not in FORMATS:
        raise mismatch(str(out), f"a file of signals: {', '.join(FORMATS)}", suffix or "no suffix")
    if suffix == ".wav":
        if len(of) > 1:
            raise mismatch(str(out), "one signal, which a sound has", str(len(of)))
        signal = read_signal(history, (*of, "t1")[0], source, velocity=velocity)
        return _write_sound(history, signal, out, source, velocity)
    if velocity:
        raise mismatch(str(out), "velocities as .wav alone", suffix)
    signals: list[Signal] = []
    left_out = []
    for name in of or known_signals(history):
        try:
            signal = read_signal(history, name, source)
            if signals and not np.array_equal(signal.times, signals[0].times):
                expected = f"samples at the times of {signals[0].name}"
                raise mismatch(f"{source}: {signal.name}", expected, "others")
        except InputError:
            if of:
                raise
            left_out.append(name)  # of all that there are, such as a course that the model does not compute
        else:
            signals.append(signal)
    if not signals:
        raise mismatch(source, "signals over time", "none that is a number throughout")
    times = signals[0].times
    if suffix == ".csv":
        head = ["time [s]", *(f"{signal.name} [{signal.unit}]" for signal in signals)]
        rows = np.stack([times, *(signal.values for signal in signals)], 1)
        write_rows(out, head, rows.tolist(), origin_lines(history.attrs))
    else:
        _write_uff(signals, out)
    lines = [f"left out, as not all of their samples are there: {', '.join(left_out)}"] if left_out else []
    return [*lines, f"signals: {out}: {len(signals)} of {times.size} samples, {signals[0].rate:g} Hz"]


def loop_of(signal: Signal, band: tuple[float, float]) -> Loop:
    """Make a loop of the end of a run: whole periods of the fundamental that `band` [Hz] holds.

    In its last periods it goes over, by a raised cosine, into what came before its beginning, so that value
    and slope are continuous at the seam whatever else the signal has. The periods before are needed for it;
    InputError if the judged part is shorter than that.
    """
    from scipy.interpolate import CubicSpline

    part, rate = signal.vibration, signal.rate
    frequency, _ = fundamental(part, rate, band)
    has_period = bool(np.isfinite(frequency))
    frequency = frequency if has_period else rate
    fade = int(np.ceil(_FADE * frequency))
    periods = int((part.size - 1) / rate * frequency) - fade
    if periods < fade:
        expected = f"a judged part of {2.0 * fade / frequency:.3g} s or more"
        raise mismatch(signal.name, expected, "a shorter one")
    length, over = periods / frequency, fade / frequency
    course = CubicSpline(np.arange(part.size) / rate, part)
    begin = (part.size - 1) / rate - length
    at = length * np.arange(round(length * rate)) / round(length * rate)
    share = np.clip((at - (length - over)) / over, 0.0, 1.0)
    weight = 0.5 - 0.5 * np.cos(np.pi * share)
    before = course(begin + np.where(share > 0.0, at - length, 0.0))
    return Loop((1.0 - weight) * course(begin + at) + weight * before, length, periods if has_period else 0)


def _write_sound(history: xr.Dataset, signal: Signal, out: Path, source: str, velocity: bool) -> list[str]:
    """Write a WAV of 16 bits, and a text beside it with the lines that are returned."""
    from scipy.io import wavfile
    from scipy.signal import resample, windows

    text = out.with_suffix(".txt")
    _check_own(text)
    if changing_of(history) is None:
        low, high = settings_of(history)[1]
        loop = loop_of(signal, (low, min(high, 0.5 * signal.rate)))
        times = int(np.ceil(_LEAST_SOUND / loop.length))
        what = f"{times} times {loop.length:.6g} s"
        what += f", {loop.periods} periods each" if loop.periods else ""
    else:
        moved = signal._replace(judged=int(np.searchsorted(signal.times, start_up(history)))).vibration
        faded = moved * windows.tukey(moved.size, 2.0 * _FADE * signal.rate / (moved.size - 1))
        loop = Loop(faded, moved.size / signal.rate, 0)
        times, what = 1, f"the whole ramp, {loop.length:.6g} s"
    if np.ptp(loop.values) <= ROUNDING * np.abs(signal.values).max():
        raise mismatch(f"{source}: {signal.name}", "a signal that changes", "a constant one")
    # periodic, so that transforms give the derivative and samples at another rate without effects of ends
    values, unit = loop.values, signal.unit
    if velocity:
        rates = 2j * np.pi * np.fft.rfftfreq(values.size, loop.length / values.size)
        values, unit = np.fft.irfft(rates * np.fft.rfft(values), values.size), "m s-1"
    values = resample(values, round(loop.length * AUDIO_RATE))
    highest = float(np.abs(values).max())
    samples = np.round(values * (PEAK * FULL_SCALE / highest)).astype(np.int16)
    with written_aside(out, parents=True) as aside:
        wavfile.write(aside, AUDIO_RATE, np.tile(samples, times))
    reference, name = shown_in(unit)
    full = highest / PEAK / reference
    lines = [
        f"sound: {out}: {'velocity of ' * velocity}{signal.words}, {what}, {AUDIO_RATE} Hz",
        f"full scale: {full:.6g} {name}; peak {PEAK * full:.6g} {name}, at -3 dBFS",
        _NOT_MODELLED,
    ]
    with written_aside(text) as aside:
        written = "".join([*origin_lines(history.attrs), *(f"{line}\n" for line in lines)])
        aside.write_text(written, encoding="utf-8")
    return [*lines, f"text: {text}"]


def _check_own(text: Path) -> None:
    """Raise InputError if another file stands where the text of a sound goes."""
    expected = "a new file, or the text of a sound written by cvt_hpc"
    if text.exists():
        with naming_refusals(text, expected):
            if _NOT_MODELLED.encode() not in read_regular(text, 1 << 20):
                raise mismatch(str(text), expected, "another file")


def _write_uff(signals: Sequence[Signal], out: Path) -> None:
    """Write a data set 58 for each signal, a time response, behind a data set 164 of SI units."""
    try:
        import pyuff
    except ImportError:
        then = '`pip install "cvt_hpc[uff]"`, or write a .csv'
        raise mismatch(str(out), "the library pyuff", "none", then) from None
    units = {"type": 164, "units_code": 1, "units_description": "SI: Meter (newton)", "temp_mode": 1}
    sets = [units | {"length": 1.0, "force": 1.0, "temp": 1.0, "temp_offset": 273.15}]
    for node, signal in enumerate(signals, 1):
        kind = {"ordinate_spec_data_type": KINDS.get(signal.unit, 0), "ordinate_axis_units_lab": signal.unit}
        time = {"abscissa_spacing": 1, "abscissa_spec_data_type": 17, "abscissa_axis_units_lab": "s"}
        at = {"rsp_node": node, "rsp_dir": 0, "ref_node": 0, "ref_dir": 0, "orddenom_spec_data_type": 0}
        of = {"id1": signal.name, "func_type": 1, "x": signal.times, "data": signal.values}
        sets.append({"type": 58} | of | at | time | kind)
    with written_aside(out, parents=True) as aside:
        pyuff.UFF(str(aside)).write_sets(sets, "overwrite")
