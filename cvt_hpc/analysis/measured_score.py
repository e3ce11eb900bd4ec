"""How far a computed map agrees with a measured file: hits, misses, false alarms and correct silences.

Cells of the measured range count where a run is known to vibrate or to be quiet. Within a window noise was
measured, elsewhere in the range silence. Peaks tell of the cells in which they lie alone, and of no silence.
Onsets tell of no cell: they are paired with the computed ones of the same direction at the least distance in
all; one without a partner is a miss or a false alarm. The ends of windows within the range are paired alike,
and give the error of the onset alone.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.arrangement import value_text
from cvt_hpc.analysis.classes import at_strongest_strand, check_results, map_classes
from cvt_hpc.analysis.figures import coordinate_unit
from cvt_hpc.analysis.measured import ONSET, PEAK, WINDOW, Measured, Row, Span, read_measured
from cvt_hpc.errors import mismatch
from cvt_hpc.storage.files import write_rows
from cvt_hpc.tables import columns, number
from cvt_hpc.vibration.classes import Onset, levels, onsets, paired_errors

MOST_LINES = 10  # that are printed
_READ = ("status", "vibrates", "occurrence_class", "inferred_class", "amplitude", "frequency")

Array = NDArray[np.float64]


class Line(NamedTuple):
    """Agreement along one line of a study, or along all.

    Attributes
    ----------
    hits, misses, false_alarms, silences, neither : int
        Cells of the measured range, `neither` those not known to vibrate or to be quiet; or onsets.
    frequency : tuple of float
        Distances of the frequencies of hits from the measured ones, or from their band [Hz].
    onset : tuple of float
        Distances of paired onsets, in the unit in which the axis is shown.
    amplitude : tuple of float
        Amplitudes of hits over the measured ones [1].
    """

    hits: int = 0
    misses: int = 0
    false_alarms: int = 0
    silences: int = 0
    neither: int = 0
    frequency: tuple[float, ...] = ()
    onset: tuple[float, ...] = ()
    amplitude: tuple[float, ...] = ()


def joined(lines: Sequence[Line]) -> Line:
    """Agreement along several lines together."""
    return Line(*(sum(parts[1:], parts[0]) for parts in zip(*lines, strict=True)))


class Score(NamedTuple):
    """Agreement of a study with a measured file.

    Attributes
    ----------
    measured : Measured
    unit : str
        In which the axis of the windows, onsets or peaks is shown.
    names : list of str
        The other axes of the study.
    lines : list of (list of str, Line)
        Values on these axes in words, and the agreement, of each line of which anything was measured.
    """

    measured: Measured
    unit: str
    names: list[str]
    lines: list[tuple[list[str], Line]]

    @property
    def total(self) -> Line:
        """Agreement along all lines."""
        return joined([line for _, line in self.lines])

    @property
    def contradicts(self) -> bool:
        """Whether anything is computed otherwise than it was measured."""
        return self.total.misses + self.total.false_alarms > 0


def score(dataset: xr.Dataset, path: str | Path, source: str = "results") -> Score:
    """Compare a study with a measured file.

    Parameters
    ----------
    dataset : Dataset
        Results of a study over a grid. A row counts along each line that it does not exclude.
    path : str or Path
        The file, as `read_measured` takes it.
    source : str
        Where the results are from, for the errors.

    Raises
    ------
    InputError
        As of `read_measured`; or the axis of the file is no axis of the study.
    """
    check_results(dataset, source)
    measured = read_measured(path, dataset, source)
    along = measured.along
    if along not in dataset["status"].dims:
        found = ", ".join(map(str, dataset["status"].dims)) or "a single run"
        raise mismatch(source, f"results over the axis {along}, as in {measured.name}", found)
    dataset = dataset[[name for name in _READ if name in dataset]].sortby(along).transpose(..., along)
    arrays = (
        map_classes(dataset),
        *(at_strongest_strand(dataset, name) for name in ("frequency", "amplitude")),
    )
    classes, frequency, amplitude = (array.transpose(..., along).values for array in arrays)
    names = [str(name) for name in dataset["status"].dims if name != along]
    factor, unit = coordinate_unit(dataset[along].attrs)
    lines = []
    for index in np.ndindex(classes.shape[:-1]):
        at = {name: dataset[name].values[k] for name, k in zip(names, index, strict=True)}
        rows = [row for row in measured.rows if all(at[name] == value for name, value in row.at.items())]
        if rows:
            loads, level = dataset[along].values.astype(float), levels(classes[index])
            errors, missed, additional = _onset_errors(measured.kind, rows, loads, level)
            line = Line(len(errors), missed, additional)
            if measured.kind != ONSET:
                line = _of_cells(rows, loads, level, frequency[index], amplitude[index])
            place = [value_text(dataset[name], k) for name, k in zip(names, index, strict=True)]
            lines.append((place, line._replace(onset=tuple(factor * error for error in errors))))
    return Score(measured, unit, names, lines)


def _of_cells(rows: Sequence[Row], loads: Array, level: Array, frequency: Array, amplitude: Array) -> Line:
    """Agreement of the cells of a line (n,) with windows or peaks."""
    noise, known = np.zeros((2, loads.size), bool)
    errors, ratios = np.full((2, loads.size), np.inf)
    for row in rows:
        inside = loads == row.cell
        if np.isnan(row.cell):  # a window
            inside = _within(loads, row.span) & (row.span[0] < row.span[1])
            known |= _within(loads, row.swept)
        noise |= inside
        if row.frequency:
            beyond = np.maximum(np.maximum(row.frequency[0] - frequency, frequency - row.frequency[1]), 0.0)
            errors[inside] = np.fmin(errors, beyond)[inside]
        ratios[inside] = amplitude[inside] / row.amplitude
    known |= noise
    vibrates, quiet = known & (level > 0.0), known & (level < 0.0)
    counts = noise & vibrates, noise & quiet, vibrates & ~noise, quiet & ~noise, known & np.isnan(level)
    told = [tuple(values[counts[0] & np.isfinite(values)].tolist()) for values in (errors, ratios)]
    return Line(*(int(one.sum()) for one in counts), told[0], (), told[1])  # type: ignore[call-arg, arg-type]


def _within(loads: Array, span: Span) -> NDArray[np.bool_]:
    """Whether values lie between two others, or on them within rounding."""
    on_ends = np.isclose(loads[:, None], span, 1e-9, 0.0).any(axis=1)
    return ((span[0] <= loads) & (loads <= span[1])) | on_ends


def _onset_errors(kind: str, rows: Sequence[Row], loads: Array, level: Array) -> tuple[list[float], int, int]:
    """Errors of onsets along a line (n,) [SI], and how many are missed and additional."""
    loads, level = loads[np.isfinite(loads)], level[np.isfinite(loads)]
    low = max(loads[0], min(row.swept[0] for row in rows))
    high = min(loads[-1], max(row.swept[1] for row in rows))
    true = [Onset(row.span[0], row.rising) for row in rows if kind == ONSET]
    if kind == WINDOW:
        joined: list[Span] = []
        for start, end in sorted(row.span for row in rows if row.span[0] < row.span[1]):
            if joined and start <= joined[-1][1]:
                start, end = joined[-1][0], max(end, joined.pop()[1])
            joined.append((start, end))
        ends = [Onset(end, k == 0) for span in joined for k, end in enumerate(span)]
        true = [one for one in ends if low < one.load < high]
    ways = {row.rising for row in rows} if kind == ONSET else {True, False} if kind == WINDOW else set()
    return paired_errors([one for one in onsets(loads, level) if one.rising in ways], true, (low, high))


def score_sentences(found: Score) -> Iterator[str]:
    """Yield sentences about how far a study agrees with a measured file."""
    total, (name, kind, along, rows) = found.total, found.measured
    counts = f"{total.misses} misses, {total.false_alarms} false alarms"
    if kind == ONSET:
        yield f"Of onsets measured in {name}, along all lines: {total.hits} hits, {counts}."
    else:
        agreeing = total.hits + total.silences
        decided = agreeing + total.misses + total.false_alarms
        yield (
            f"Of {decided} decided cells in the measured range of {name} {agreeing} agree: "
            f"{total.hits} hits, {total.silences} correct silences; {counts}. "
            f"{total.neither} more count on neither side: undecided, failed, slipping, irregular or not run."
        )
    if kind == PEAK:
        yield "Peaks tell of no silence: there are no false alarms nor correct silences."
    if kind == WINDOW and not np.isfinite([row.swept for row in rows]).any():
        yield f"The file states no measured range: all values of {along.replace('_', ' ')} count as measured."
    for what, values, unit in (("frequency", total.frequency, "Hz"), ("onset", total.onset, found.unit)):
        if values:
            middle, most = number(float(np.median(values)), 3), number(max(values), 3)
            yield f"Error of the {what}: {middle} {unit} (median), {most} {unit} (largest)."
    if total.amplitude:
        ratio = number(float(np.median(total.amplitude)), 3)
        yield f"Amplitude of hits: computed {ratio} times the measured one (median)."


def _disagreement(one: tuple[list[str], Line]) -> int:
    line = one[1]
    return line.misses + line.false_alarms - line.hits - line.silences


def score_table(found: Score) -> tuple[list[str], list[list[str]]]:
    """Return head and rows of the agreement along each line, those first that agree most."""
    head = [*found.names, "hits", "misses", "false_alarms", "correct_silences", "neither"]
    units = {"frequency_error": "Hz", "onset_error": found.unit}
    head += [f"{what}_{how} [{unit}]" for what, unit in units.items() for how in ("median", "largest")]
    rows = []
    for place, line in sorted(found.lines, key=_disagreement):
        errors = [
            how(values) if values else math.nan
            for values in (line.frequency, line.onset)
            for how in (np.median, max)
        ]
        ratio = float(np.median(line.amplitude)) if line.amplitude else math.nan
        rows.append([*place, *map(str, line[:5]), *(number(float(one), 4) for one in (*errors, ratio))])
    return [*head, "amplitude_ratio_median"], rows


def score_lines(found: Score, source: str, path: str) -> Iterator[str]:
    """Yield the lines that say how far a study agrees with a measured file."""
    yield f"computed: {source}; measured: {path}"
    yield from score_sentences(found)
    head = ["hits", "misses", "false alarms", "silences", "neither", "frequency [Hz]", "largest"]
    head = [*found.names, *head, f"onset [{found.unit}]", "largest", "amplitude"]
    _, rows = score_table(found)
    yield from columns([head, *rows[:MOST_LINES]])
    if len(rows) > MOST_LINES:
        yield f"  {len(rows) - MOST_LINES} lines that agree less, in the table"


def write_score(found: Score, table: Path) -> Path:
    """Write the agreement along each line as a CSV table, and return its path."""
    return write_rows(table, *score_table(found))
