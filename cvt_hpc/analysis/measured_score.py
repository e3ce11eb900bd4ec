"""Agreement of a computed map with a measured file: hits, misses, false alarms and correct silences.

Cells of the measured range count where a run is known to vibrate or to be quiet. Within a window noise was
measured, elsewhere in the range silence. Peaks tell of the cells in which they lie alone, and of no silence.
Onsets tell of no cell: they are paired with the computed ones of the same direction, as many as there can be
and at the least distance in all; one without a partner is a miss or a false alarm. The ends of windows within
the range are paired alike, and give the error of the onset alone.

The distance of a pair has the standard error hypot(h, s): h is half the distance of the two cells between
which the computed onset lies, s the deviation that the file states. Farther than _FARTHEST of these apart,
two onsets are no pair.

Of a study with uncertain parameters each sample has lines of its own, and the probability of vibration has
the Brier score: the mean square of its distance from 1 where noise was measured, from 0 where silence was.
"""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.arrangement import value_text
from cvt_hpc.analysis.classes import at_strongest_strand, axes_in_words, check_results, map_classes
from cvt_hpc.analysis.figures import coordinate_unit
from cvt_hpc.analysis.measured import ONSET, PEAK, WINDOW, Measured, Row, Span, read_measured, within
from cvt_hpc.analysis.probability import PROBABILITY, over_samples
from cvt_hpc.errors import mismatch
from cvt_hpc.storage.files import write_rows
from cvt_hpc.tables import columns, number
from cvt_hpc.vibration.classes import levels, onsets

_FARTHEST = 3.0  # standard errors
MOST_LINES = 10  # that are printed
COUNTS = ("hits", "misses", "false_alarms", "correct_silences", "neither")
_READ = ("status", "vibrates", "occurrence_class", "inferred_class", "amplitude", "frequency")

Array = NDArray[np.float64]
Cells = NDArray[np.bool_]


class Line(NamedTuple):
    """Agreement along one line of a study, or along all: cells of the measured range, or onsets."""

    hits: int = 0
    misses: int = 0
    false_alarms: int = 0
    silences: int = 0
    neither: int = 0  # cells that are not known to vibrate or to be quiet
    frequency: tuple[float, ...] = ()  # distances of hits from measured frequencies, or their band [Hz]
    onset: tuple[float, ...] = ()  # distances of paired onsets, in the unit in which the axis is shown
    standard: tuple[float, ...] = ()  # their standard errors
    amplitude: tuple[float, ...] = ()  # ratios of hits to measured amplitudes


def joined(lines: Sequence[Line]) -> Line:
    """Agreement along several lines together."""
    return Line(*(sum(parts[1:], parts[0]) for parts in zip(*lines, strict=True)))


class Score(NamedTuple):
    """Agreement of a study with a measured file."""

    measured: Measured
    unit: str  # in which the axis of the file is shown
    names: list[str]  # of the other axes
    lines: list[tuple[list[str], Line]]  # their values in words, and the agreement, of each that was measured
    dataset: xr.Dataset  # the results of the study

    @property
    def total(self) -> Line:
        """Agreement along all lines."""
        return joined([line for _, line in self.lines])

    @property
    def contradicts(self) -> bool:
        """Whether anything is computed otherwise than it was measured."""
        return self.total.misses + self.total.false_alarms > 0

    def probabilities(self) -> tuple[Array, Array]:
        """Probabilities of vibration in cells of measured noise, and of silence; none without samples."""
        measured, cells = self.measured, over_samples(self.dataset)
        if PROBABILITY not in cells or measured.kind == ONSET:
            return np.empty(0), np.empty(0)
        shares = cells[PROBABILITY].transpose(..., measured.along)
        values, places = shares.values, shares[measured.along].values.astype(float)
        noise, known = np.zeros((2, *shares.shape), bool)
        for row in measured.rows:
            here = xr.ones_like(shares, bool)
            for name, value in row.at.items():
                here &= shares[name] == value
            noise |= here.values & row.covers(places)
            known |= here.values & within(places, row.swept) & np.isnan(row.cell)
        told = [values[one & np.isfinite(values)] for one in (noise, known & ~noise)]
        return told[0], told[1]


def score(dataset: xr.Dataset, path: str | Path, source: str = "results") -> Score:
    """Compare a study over a grid with a measured file; a row counts along each line that it admits.

    InputError as of `read_measured`; or if the axis of the file is no axis of the study.
    """
    check_results(dataset, source)
    measured = read_measured(path, dataset, source)
    along = measured.along
    if along not in dataset["status"].dims:
        expected = f"results over the axis {along}, as in {measured.name}"
        raise mismatch(source, expected, axes_in_words(dataset))
    dataset = dataset[[name for name in _READ if name in dataset]].sortby(along).transpose(..., along)
    strongest = (at_strongest_strand(dataset, name) for name in ("frequency", "amplitude"))
    arrays = map_classes(dataset), *strongest
    classes, frequency, amplitude = (array.transpose(..., along).values for array in arrays)
    names = [str(name) for name in dataset["status"].dims if name != along]
    factor, unit = coordinate_unit(dataset[along].attrs)
    loads, lines = dataset[along].values.astype(float), []
    cells = [(row, row.covers(loads), within(loads, row.swept) & np.isnan(row.cell)) for row in measured.rows]
    axes = {name: dataset[name].values for name in names}
    texts = [[value_text(dataset[name], k) for k in range(dataset.sizes[name])] for name in names]
    known = levels(classes)
    of_onsets: dict[tuple[tuple[int, ...], bytes], Line] = {}  # many samples vibrate in the same cells
    for index in np.ndindex(classes.shape[:-1]):
        at = {name: axes[name][k] for name, k in zip(names, index, strict=True)}
        told = [one for one in cells if all(at[name] == value for name, value in one[0].at.items())]
        if told:
            level, rows = known[index], [row for row, *_ in told]
            alike = tuple(map(id, rows)), level.tobytes()
            if alike not in of_onsets:
                of_onsets[alike] = _of_onsets(measured.kind, rows, loads, level, factor)
            line = of_onsets[alike]
            if measured.kind != ONSET:
                of_cells = _of_cells(told, level, frequency[index], amplitude[index])
                line = of_cells._replace(onset=line.onset, standard=line.standard)
            lines.append(([text[k] for text, k in zip(texts, index, strict=True)], line))
    return Score(measured, unit, names, lines, dataset)


def _of_cells(
    rows: Sequence[tuple[Row, Cells, Cells]], level: Array, frequency: Array, amplitude: Array
) -> Line:
    """Agreement of a line (n,) with windows or peaks, each with its cells of noise, and of its range."""
    noise, known = np.zeros((2, level.size), bool)
    errors, ratios = np.full((2, level.size), np.inf)
    for row, inside, swept in rows:
        nearest = inside & ~np.isfinite(ratios)  # the row whose frequency is nearest gives the amplitude, too
        noise |= inside
        known |= inside | swept
        if row.frequency:
            beyond = np.maximum(np.maximum(row.frequency[0] - frequency, frequency - row.frequency[1]), 0.0)
            nearest = inside & ~(beyond >= errors)
            errors[nearest] = beyond[nearest]
        ratios[nearest] = amplitude[nearest] / row.amplitude
    vibrates, quiet = known & (level > 0.0), known & (level < 0.0)
    counts = noise & vibrates, noise & quiet, vibrates & ~noise, quiet & ~noise, known & np.isnan(level)
    told = [tuple(values[counts[0] & np.isfinite(values)].tolist()) for values in (errors, ratios)]
    return Line._make([*(int(one.sum()) for one in counts), told[0], (), (), told[1]])


def _of_onsets(kind: str, rows: Sequence[Row], loads: Array, level: Array, factor: float) -> Line:
    """Agreement of the onsets along a line (n,), or of the ends of windows; `factor` is from SI."""
    from scipy.optimize import linear_sum_assignment  # long to load

    loads, level = loads[np.isfinite(loads)], level[np.isfinite(loads)]
    low = max(loads[0], min(row.swept[0] for row in rows))
    high = min(loads[-1], max(row.swept[1] for row in rows))
    ends: list[Span] = []  # of windows, each with its deviation
    for row in sorted((row for row in rows if row.span[0] < row.span[1]), key=lambda row: row.span):
        start, end = ((load, row.deviation) for load in row.span)
        if ends and start[0] <= ends[-1][0]:  # windows that touch are one
            end, start = max(end, ends.pop()), ends.pop()
        ends += [start, end]
    true = [(*one, k % 2 == 0) for k, one in enumerate(ends) if low < one[0] < high]
    if kind == ONSET:
        true = [(row.span[0], row.deviation, row.rising) for row in rows]
    ways = {WINDOW: {True, False}, ONSET: {row.rising for row in rows}, PEAK: set()}[kind]
    decided, computed, errors, alone = loads[np.isfinite(level)], onsets(loads, level), [], 0
    for rising in ways:
        places = np.array([one.load for one in computed if one.rising == rising])
        others = np.array([one[:2] for one in true if one[2] == rising]).reshape(-1, 2)
        above = np.searchsorted(decided, places)
        distance = np.abs(np.subtract.outer(places, others[:, 0]))
        standard = np.hypot.outer(0.5 * (decided[above] - decided[above - 1]), others[:, 1])
        near = distance <= _FARTHEST * standard
        pairs = linear_sum_assignment(np.where(near, distance, distance.size * distance.max(initial=0.0)))
        errors += [(factor * distance[k], factor * standard[k]) for k in zip(*pairs, strict=True) if near[k]]
        left = np.delete(places, pairs[0][near[pairs]])
        swept = [row.swept for row in rows if kind != ONSET or row.rising == rising]
        alone += sum(any(max(low, a) < one < min(high, b) for a, b in swept) for one in left.tolist())
    onset, known = zip(*errors, strict=True) if errors else ((), ())
    return Line(len(errors), len(true) - len(errors), alone, onset=tuple(onset), standard=tuple(known))


def _told(values: Sequence[float]) -> tuple[float, float]:
    """Median and largest of errors; not numbers of none."""
    return (float(np.median(values)), max(values)) if values else (math.nan, math.nan)


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
            middle, most = (f"{number(one, 3)} {unit}" for one in _told(values))
            yield f"Error of the {what}: {middle} (median), {most} (largest)."
    noise, silence = found.probabilities()
    if noise.size + silence.size:
        told = [
            f"{number(values.mean(), 2)} in {values.size} cells of measured {what}"
            for what, values in (("noise", noise), ("silence", silence))
            if values.size
        ]
        brier = number(np.mean(np.concatenate([1.0 - noise, silence]) ** 2), 2)
        yield (
            f"Probability of vibration: on average {', '.join(told)}; Brier score {brier} "
            "(0: certain and right, 1: certain and wrong)."
        )
    if total.amplitude:
        ratio = number(_told(total.amplitude)[0], 3)
        yield f"Amplitude of hits: computed {ratio} times the measured one (median)."


def _rows(found: Score) -> list[list[str]]:
    """Rows of the agreement along each line, those first that agree most."""

    def disagreement(one: tuple[list[str], Line]) -> int:
        return one[1].misses + one[1].false_alarms - one[1].hits - one[1].silences

    return [
        [*place, *map(str, line[:5])]
        + [number(one, 4) for one in (*_told(line.frequency), *_told(line.onset), _told(line.amplitude)[0])]
        for place, line in sorted(found.lines, key=disagreement)
    ]


def score_lines(found: Score, source: str, path: str) -> Iterator[str]:
    """Yield the lines that say how far a study agrees with a measured file."""
    yield f"computed: {source}; measured: {path}"
    yield from score_sentences(found)
    head = ["hits", "misses", "false alarms", "silences", "neither", "frequency [Hz]", "largest"]
    head = [*found.names, *head, f"onset [{found.unit}]", "largest", "amplitude"]
    yield from columns([head, *_rows(found)[:MOST_LINES]])
    if len(found.lines) > MOST_LINES:
        yield f"  {len(found.lines) - MOST_LINES} lines that agree less, in the table"


def write_score(found: Score, table: Path) -> Path:
    """Write the agreement along each line as a CSV table, and return its path."""
    units = {"frequency_error": "Hz", "onset_error": found.unit}
    errors = [f"{what}_{how} [{unit}]" for what, unit in units.items() for how in ("median", "largest")]
    return write_rows(table, [*found.names, *COUNTS, *errors, "amplitude_ratio_median"], _rows(found))
