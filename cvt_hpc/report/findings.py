"""What came out of a study, in sentences with numbers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from itertools import islice

import numpy as np
import xarray as xr

from cvt_hpc.analysis.arrangement import Arrangement, value_text
from cvt_hpc.analysis.classes import (
    OccurrenceClass,
    at_strongest_strand,
    count_classes,
    map_classes,
    occurrence_classes,
)
from cvt_hpc.analysis.figures import coordinate_unit, in_words
from cvt_hpc.variables import Status
from cvt_hpc.vibration.onsets import Onset, onsets

MOST_LINES = 12  # lines of the map that are told apart
_STATUS = {int(status): status.name.lower() for status in Status}
_LEVEL = {OccurrenceClass.QUIET: -1.0, OccurrenceClass.VIBRATING: 1.0}


def summary(dataset: xr.Dataset) -> str:
    """Return how many runs there are, of which classes."""
    classes = occurrence_classes(dataset).values
    return f"{classes.size} runs: {count_classes(classes)}."


def window_sentences(arrangement: Arrangement) -> Iterator[str]:
    """Yield for each line of a map along x, which windows of it vibrate, how far and at which frequency."""
    dataset, x = arrangement.dataset, arrangement.x
    if dataset[x].dtype.kind not in "iuf":
        return
    others = [name for name in (arrangement.panel, arrangement.y) if name]
    stacked = dataset.stack(line=others) if others else dataset.expand_dims("line")
    lines = stacked.sizes["line"]
    told = [_line(stacked.isel(line=k), x, _place(dataset, others, k)) for k in range(lines)]
    vibrating = [line for line in told if line]
    yield from islice(vibrating, MOST_LINES)
    if (more := len(vibrating) - MOST_LINES) > 0:
        yield f"{more} more lines of the map vibrate."
    if quiet := lines - len(vibrating):
        yield f"Nothing vibrates {'here' if lines == 1 else f'in {quiet} of {lines} lines along {x}'}."


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
    level = np.full(classes.shape, np.nan)
    for kind, value in _LEVEL.items():
        level[classes == kind] = value
    factor, unit = coordinate_unit(line[x].attrs)
    windows = _windows(onsets(line[x].values.astype(float), level), factor, unit)
    last = level[np.argmax(line[x].values)]
    windows += ", as far as is decided" if windows.endswith(" on") and np.isnan(last) else ""
    start = f"At {place} the belt" if place else "The belt"
    text = f"{start} vibrates{windows}"
    amplitude = np.where(vibrating, at_strongest_strand(line, "amplitude").values, np.nan)
    if np.isfinite(amplitude).any():
        largest = int(np.nanargmax(amplitude))
        frequency = at_strongest_strand(line, "frequency").values[largest]
        text += f", most at {value_text(line[x], largest)}: {1e6 * amplitude[largest]:.3g} µm"
        text += f" at {frequency:.0f} Hz" if np.isfinite(frequency) else ""
    return text + "."


def _windows(found: list[Onset], factor: float, unit: str) -> str:
    """Between which values, by the boundaries midway between neighbours of different class."""
    parts = []
    start = None
    for one in found:
        value = f"{factor * one.load:.4g}"
        if one.rising:
            start = value
        else:
            parts.append(f"from {start} to {value} {unit}" if start else f"up to {value} {unit}")
            start = None
    if start:
        parts.append(f"from {start} {unit} on")
    return f" {' and '.join(parts)}".replace("  ", " ") if parts else " wherever it is decided"


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
    counted: Counter[tuple[str, str]] = Counter()
    for index, reason in zip(failed, map(str, reasons), strict=True):
        kind = _STATUS.get(int(status[index]), "failed"), _without_numbers(reason)
        alike.setdefault(kind, reason)
        counted[kind] += 1
    return [(kind[0], alike[kind], count) for kind, count in counted.most_common()]


def _without_numbers(reason: str) -> str:
    return "".join(letter for letter in reason if not letter.isdigit())
