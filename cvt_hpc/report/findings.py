"""What came out of a study, in sentences with numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis.arrangement import Arrangement, infinity_in_words, value_text
from cvt_hpc.analysis.classes import (
    OccurrenceClass,
    at_strongest_strand,
    count_classes,
    map_classes,
    occurrence_classes,
)
from cvt_hpc.analysis.figures import coordinate_unit, in_words
from cvt_hpc.variables import Status
from cvt_hpc.vibration.onsets import levels, onsets

MOST_LINES = 12  # lines of the map that are told apart
_STATUS = {int(status): status.name.lower() for status in Status}


def summary(dataset: xr.Dataset) -> str:
    """Return how many runs there are, of which classes."""
    classes = occurrence_classes(dataset).values
    return f"{counted(classes.size, 'run')}: {count_classes(classes)}."


def counted(count: int, noun: str) -> str:
    """Return a number with its noun: "1 run", "2 runs"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def window_sentences(arrangement: Arrangement) -> Iterator[str]:
    """Yield for each line of a map along x, which windows of it vibrate, how far and at which frequency.

    A line is called quiet only if all of its cells are.
    """
    dataset, x = arrangement.dataset, arrangement.x
    if dataset[x].dtype.kind not in "iuf":
        return
    decided = np.isfinite(levels(map_classes(dataset).values))
    if not decided.any():
        yield "No run is known to be quiet or to vibrate."
        return
    others = [name for name in (arrangement.panel, arrangement.y) if name]
    stacked = dataset.stack(line=others) if others else dataset.expand_dims("line")
    lines = [stacked.isel(line=k) for k in range(stacked.sizes["line"])]
    told = [_line(line, x, _place(dataset, others, k)) for k, line in enumerate(lines)]
    vibrating = [text for text in told if text]
    yield from islice(vibrating, MOST_LINES)
    if (more := len(vibrating) - MOST_LINES) > 0:
        yield f"{counted(more, 'more line')} of the map {'vibrates' if more == 1 else 'vibrate'}."
    rest = [line for line, text in zip(lines, told, strict=True) if not text]
    quiet = sum(bool(np.all(map_classes(line) == OccurrenceClass.QUIET)) for line in rest)
    along = f"of {len(lines)} lines along {in_words(dataset[x])}" if len(lines) > 1 else ""
    if quiet:
        yield f"Nothing vibrates in {quiet} {along}." if along else "Nothing vibrates here."
    if open_ones := len(rest) - quiet:
        start = f"In {open_ones} {along} no" if along else "No"
        yield f"{start} run is known to vibrate, but not all are known to be quiet."


def _place(dataset: xr.Dataset, names: list[str], index: int) -> str:
    places = np.unravel_index(index, [dataset.sizes[name] for name in names]) if names else ()
    at = (
        f"{in_words(dataset[name])} {value_text(dataset[name], int(place))}"
        for name, place in zip(names, places, strict=True)
    )
    return " and ".join(at)


def _line(line: xr.Dataset, x: str, place: str) -> str:
    """What vibrates along a line; "" where nothing does."""
    classes = map_classes(line).values
    vibrating = classes == OccurrenceClass.VIBRATING
    if not vibrating.any():
        return ""
    level = levels(classes)
    windows = _windows(line[x], level)
    last = level[np.argmax(line[x].values)]
    windows += ", as far as is decided" if windows.endswith(" on") and np.isnan(last) else ""
    start = f"At {place} the belt" if place else "The belt"
    text = f"{start} vibrates {windows}"
    amplitude = np.where(vibrating, at_strongest_strand(line, "amplitude").values, np.nan)
    if np.isfinite(amplitude).any():
        largest = int(np.nanargmax(amplitude))
        frequency = at_strongest_strand(line, "frequency").values[largest]
        text += f", most at {value_text(line[x], largest)}: {1e6 * amplitude[largest]:.3g} µm"
        text += f" at {frequency:.0f} Hz" if np.isfinite(frequency) else ""
    return text + "."


def _windows(axis: xr.DataArray, level: NDArray[np.float64]) -> str:
    """Between which values, by the boundaries midway between neighbours of different class."""
    values = axis.values.astype(float)
    factor, unit = coordinate_unit(axis.attrs)
    behind = f" {unit}" if unit else ""
    last = np.max(values[np.isfinite(values) & np.isfinite(level)], initial=-np.inf)

    def at(value: float) -> str:
        if np.isfinite(value):
            return f"{factor * value:.4g}".replace("-", "−")
        return f"a value between {factor * last:.4g} and {infinity_in_words(str(axis.name))}"

    parts = []
    start = ""
    for one in onsets(values, level):
        if one.rising:
            start = at(one.load)
        else:
            parts.append(
                f"from {start} to {at(one.load)}{behind}" if start else f"up to {at(one.load)}{behind}"
            )
            start = ""
    if start:
        parts.append(f"from {start}{behind} on")
    everywhere = "in all runs" if np.isfinite(level).all() else "in all runs that are decided"
    return " and ".join(parts) or everywhere


def failures(dataset: xr.Dataset) -> list[tuple[str, str, int]]:
    """Return status, reason and number of the runs that failed, the most frequent first.

    Numbers within reasons are passed over, so that runs that failed alike count together.
    """
    status = dataset["status"].values.ravel()
    failed = np.flatnonzero((status != Status.DONE) & (status != Status.NOT_RUN) & np.isfinite(status))
    if not failed.size:
        return []
    reasons = dataset["reason"].values.ravel()[failed] if "reason" in dataset else [""] * failed.size
    alike: dict[tuple[str, str], str] = {}
    numbers: Counter[tuple[str, str]] = Counter()
    for index, reason in zip(failed, map(str, reasons), strict=True):
        kind = _STATUS.get(int(status[index]), "failed"), _without_numbers(reason)
        alike.setdefault(kind, reason)
        numbers[kind] += 1
    return [(kind[0], alike[kind], count) for kind, count in numbers.most_common()]


def _without_numbers(reason: str) -> str:
    return "".join(letter for letter in reason if not letter.isdigit())
