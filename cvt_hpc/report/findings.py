"""Findings of a study, in sentences with numbers.

Quantities that a page shows are numbers, one for each run, that vary over the study.
"""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import islice
from typing import NamedTuple

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from cvt_hpc.analysis import courses
from cvt_hpc.analysis.arrangement import infinity_in_words, place_text, value_text
from cvt_hpc.analysis.classes import at_strongest_strand, count_classes, map_classes, occurrence_classes
from cvt_hpc.analysis.figures import coordinate_unit, in_words, number, value_unit
from cvt_hpc.analysis.probability import PROBABILITY
from cvt_hpc.analysis.scatter import is_sampled
from cvt_hpc.job import Job
from cvt_hpc.variables import Status
from cvt_hpc.vibration.classes import DECIDED, OccurrenceClass, levels, onsets
from cvt_hpc.vibration.ramped import ramped

_MOST_NUMBERS = 1_000_000  # of all quantities together: some 5 MB of the page
_MOST_PLACES = 4  # of a dimension that the runs have in common, such as both strands: a quantity for each
AMPLITUDE, FREQUENCY = "amplitude", "frequency"  # at the stronger strand; that of runs that vibrate
_OF_COMPUTATION = (  # come behind what is about the belt
    *("power_residual", "step_ripple", "fluctuation_remainder", "unsolved_share", "iterations"),
    *("core_seconds", "simulated_seconds", "time_step", "refinements", "steps", "contact_solves"),
)

MOST_LINES = 8  # lines of the map that are told apart, on the first page
_MOST_VALUE_MAPS = 2  # quantities in a picture, of a study that judges no vibration
_MOST_RANGES = 6  # quantities
NARROW = 1.05  # largest over least frequency of a line that are told apart
STATUS = {int(status): status.name.lower() for status in Status}


def summary(dataset: xr.Dataset) -> str:
    """Return how many runs there are, of which classes; of a trace also how many cells are inferred."""
    runs = occurrence_classes(dataset).values
    text = f"{counted(runs.size, 'run')}: {count_classes(runs)}."
    if not is_judged(dataset):
        return f"{text} No run is known to be quiet or to vibrate."
    if "inferred_class" not in dataset:
        return text
    inferred = map_classes(dataset).values[runs != map_classes(dataset).values]
    known = runs[runs != OccurrenceClass.NOT_RUN]
    text = f"{counted(known.size, 'run')}: {count_classes(known)}."
    beside = f" {counted(inferred.size, 'cell')} inferred: {count_classes(inferred)}."
    return text + beside if inferred.size else text


def course_sentence(job: Job) -> str:
    """Return what drives the runs over their time, and for which time verdicts hold; "" without a course."""
    changed, p = courses.of_job(job), job.parameters
    if not changed:
        return ""
    file = f"of `{job.files[courses.FILE]}` " if courses.FILE in job.files else ""
    held = "Verdicts hold over that time, window by window: `onset_time`, `end_time`."
    if "judged_fraction" in p and not ramped(p):
        held = "Verdicts hold for the constant values to which it leads."
    times = f"{p[courses.TIME][0]:g} to {p[courses.TIME][-1]:g} s"
    return f"The course {file}drives each run from {times}: {courses.in_words(changed)}. {held}"


def is_judged(dataset: xr.Dataset) -> bool:
    """Return whether any run was judged: is quiet, vibrates, slips or moves irregularly."""
    return bool(np.isin(map_classes(dataset).values, DECIDED).any())


def range_sentences(dataset: xr.Dataset) -> Iterator[str]:
    """Yield for the first quantities of a study that judges no vibration, how far they range."""
    dims = list(map(str, dataset["status"].dims))
    told = (one for one in quantities(dataset) if one.key not in _OF_COMPUTATION)
    for one in islice(told, _MOST_RANGES):
        known = np.where(np.isfinite(one.values) & (dataset["status"] == Status.DONE), one.values, np.nan)
        if np.isnan(known).all():
            continue
        ends = [number(value, ".4g") for value in (np.nanmin(known), np.nanmax(known))]
        unit = f" {one.unit}" if one.unit else ""
        place = ""
        if not is_sampled(dataset):
            place = f", largest at {place_of(dataset, dims, int(np.nanargmax(known)))}"
        yield f"{one.name[:1].upper()}{one.name[1:]}: from {ends[0]} to {ends[1]}{unit}{place}."


def slip_sentence(dataset: xr.Dataset, x: str) -> str:
    """Return how many runs slip, and from where on x on; "" where none does."""
    slipping = map_classes(dataset) == OccurrenceClass.SLIPPING
    count = int(slipping.sum())
    if not count:
        return ""
    other = [dim for dim in slipping.dims if dim != x]
    lowest = int(np.argmax(slipping.any(other).values))
    least = f", the first at {place_text(dataset[x], lowest)}"
    return f"The belt slips or lifts off in {counted(count, 'run')}{least if is_number(dataset[x]) else ''}."


def counted(count: int, noun: str) -> str:
    """Return a number with its noun: "1 run", "2 runs"."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def window_sentences(dataset: xr.Dataset, x: str, others: Sequence[str]) -> Iterator[str]:
    """Yield for each line of a study along x, which windows of it vibrate, how far and at which frequency.

    A line is called quiet only if all of its cells are. `others` are all other axes of the study.
    """
    if not is_number(dataset[x]):
        return
    decided = np.isfinite(levels(map_classes(dataset).values))
    if not decided.any():
        return
    dataset = dataset.sortby([name for name in (x, *others) if is_number(dataset[name])])
    places, lines = lines_along(dataset, others)
    told = [_line(line, x, place) for line, place in zip(lines, places, strict=True)]
    vibrating = [text for text in told if text]
    shown = np.unique(np.linspace(0, len(vibrating) - 1, min(len(vibrating), MOST_LINES)).round().astype(int))
    yield from (vibrating[k] for k in shown)
    if (more := len(vibrating) - MOST_LINES) > 0:
        verb = "vibrates" if more == 1 else "vibrate"
        yield f"{counted(more, 'more line')} along {in_words(dataset[x])} {verb}."
    rest = [line for line, text in zip(lines, told, strict=True) if not text]
    quiet = sum(bool(np.all(map_classes(line) == OccurrenceClass.QUIET)) for line in rest)
    along = f"of {len(lines)} lines along {in_words(dataset[x])}" if len(lines) > 1 else ""
    if quiet:
        yield f"Nothing vibrates in {quiet} {along}." if along else "Nothing vibrates here."
    known = [OccurrenceClass.QUIET, OccurrenceClass.SLIPPING]
    if slipping := sum(bool(map_classes(line).isin(known).all()) for line in rest) - quiet:
        start = f"In {slipping} {along} no" if along else "No"
        yield f"{start} run vibrates, but some slip through."
    if open_ones := len(rest) - quiet - slipping:
        start = f"In {open_ones} {along} no" if along else "No"
        yield f"{start} run is known to vibrate, but not all are known to be quiet."


def lines_along(dataset: xr.Dataset, others: Sequence[str]) -> tuple[list[str], list[xr.Dataset]]:
    """Return places of the lines of a study along an axis, and these lines, by the values of all others."""
    stacked = dataset.stack(line=others) if others else dataset.expand_dims("line")
    numbers = range(stacked.sizes["line"])
    return [place_of(dataset, others, k) for k in numbers], [stacked.isel(line=k) for k in numbers]


def place_of(dataset: xr.Dataset, names: Sequence[str], index: int) -> str:
    """Return in words where a flat index along dimensions lies."""
    places = np.unravel_index(index, [dataset.sizes[name] for name in names]) if names else ()
    at = [place_text(dataset[name], int(k)) for name, k in zip(names, places, strict=True)]
    return " and ".join(filter(None, (", ".join(at[:-1]), *at[-1:])))


def _line(line: xr.Dataset, x: str, place: str) -> str:
    """State what vibrates along a line; "" where nothing does."""
    classes = map_classes(line).values
    vibrating = classes == OccurrenceClass.VIBRATING
    if not vibrating.any():
        return ""
    level = levels(classes)
    windows = _windows(line[x], level)
    last = level[np.argmax(line[x].values)]
    windows += ", as far as is decided" if windows.endswith(" on") and np.isnan(last) else ""
    start = f"At {place} there is" if place else "There is"
    text = f"{start} vibration {windows}"
    amplitude = np.where(vibrating, at_strongest_strand(line, "amplitude").values, np.nan)
    if np.isfinite(amplitude).any():
        largest = int(np.nanargmax(amplitude))
        factor, unit = length_unit(amplitude[largest])
        frequencies = np.where(vibrating, at_strongest_strand(line, "frequency").values, np.nan)
        text += f", most at {value_text(line[x], largest)}: {factor * amplitude[largest]:.3g} {unit}"
        if np.isfinite(frequencies[largest]):
            text += f" at {frequencies[largest]:.0f} Hz"
        if np.nanmax(frequencies, initial=0.0) > NARROW * np.nanmin(frequencies, initial=np.inf):
            text += f"; frequencies from {np.nanmin(frequencies):.0f} to {np.nanmax(frequencies):.0f} Hz"
    return text + "."


def _windows(axis: xr.DataArray, level: NDArray[np.float64]) -> str:
    """Between which values, by the boundaries midway between neighbours of different class."""
    values = axis.values.astype(float)
    factor, unit = coordinate_unit(axis.attrs)
    behind = f" {unit}" if unit else ""
    last = np.max(values[np.isfinite(values) & np.isfinite(level)], initial=-np.inf)

    def at(value: float) -> str:
        if np.isfinite(value):
            return number(factor * value, ".4g")
        return f"a value between {factor * last:.4g} and {infinity_in_words(str(axis.name))}"

    parts = []
    start = ""
    for one in onsets(values, level):
        if one.rising:
            start = at(one.load)
        else:
            end = f"{at(one.load)}{behind}"
            parts.append(f"from {start} to {end}" if start else f"up to {end}")
            start = ""
    if start:
        parts.append(f"from {start}{behind} on")
    if len(parts) > 1 and np.isfinite(level).all():
        return f"{' and '.join(parts)}, quiet between"
    everywhere = "in all runs" if np.isfinite(level).all() else "in all runs that are decided"
    return " and ".join(parts) or everywhere


class Failure(NamedTuple):
    """Runs that failed alike: status, how many, reason and place of the first."""

    status: str
    runs: int
    reason: str
    place: str


def failures(dataset: xr.Dataset) -> list[Failure]:
    """Return how the runs failed, the most frequent first.

    Numbers within reasons are passed over, so that runs that failed alike count together.
    """
    dims = list(map(str, dataset["status"].dims))
    status = dataset["status"].values.ravel()
    failed = np.flatnonzero((status != Status.DONE) & (status != Status.NOT_RUN) & np.isfinite(status))
    if not failed.size:
        return []
    reasons = dataset["reason"].values.ravel()[failed] if "reason" in dataset else [""] * failed.size
    alike: dict[tuple[str, str], tuple[str, int]] = {}
    numbers: Counter[tuple[str, str]] = Counter()
    for index, reason in zip(failed, map(str, reasons), strict=True):
        kind = STATUS.get(int(status[index]), "failed"), re.sub(r"\d", "", reason)
        alike.setdefault(kind, (reason, int(index)))
        numbers[kind] += 1
    found = []
    for kind, count in numbers.most_common():
        reason, first = alike[kind]
        place = f"run {first}" if is_sampled(dataset) else place_of(dataset, dims, first)
        found.append(Failure(kind[0], count, reason, place))
    return found


def is_number(axis: xr.DataArray) -> bool:
    """Return whether the values of an axis are numbers."""
    return axis.dtype.kind in "iuf"


class Quantity(NamedTuple):
    """A number of each run."""

    key: str  # the variable of the dataset
    name: str  # in words
    unit: str  # for people
    values: NDArray[np.float64]  # in that unit, over the dimensions of `status`; nan where it is not known

    @property
    def label(self) -> str:
        """Name and unit."""
        return f"{self.name} [{self.unit}]" if self.unit else self.name


def quantities(dataset: xr.Dataset) -> list[Quantity]:
    """Return amplitude and frequency, then all that vary, as in the dataset, up to _MOST_NUMBERS."""
    dims = dataset["status"].dims
    room = max(_MOST_NUMBERS // max(dataset["status"].size, 1), 2)
    found = []
    for key, array in _candidates(dataset):
        values = array.transpose(*dims).values.astype(float)
        known = values[np.isfinite(values)]
        if not known.size or (key not in (AMPLITUDE, FREQUENCY) and known.min() == known.max()):
            continue
        factor, unit = length_unit(known) if key == AMPLITUDE else value_unit(array)
        found.append(Quantity(key, in_words(array), unit, factor * values))
        if len(found) == room:
            break
    return found


def shown_quantities(dataset: xr.Dataset) -> list[str]:
    """Return the quantities that a map shows where no run was judged; none elsewhere."""
    if is_judged(dataset) or PROBABILITY in dataset or is_sampled(dataset):
        return []
    names = dict.fromkeys(one.key for one in quantities(dataset))
    return [name for name in names if dataset[name].dtype.kind in "iuf"][:_MOST_VALUE_MAPS]


def length_unit(lengths: NDArray[np.float64]) -> tuple[float, str]:
    """Factor and unit in which lengths of vibrations [m] are shown."""
    return (1e3, "mm") if np.abs(lengths).max(initial=0.0) >= 1e-3 else (1e6, "µm")


def _candidates(dataset: xr.Dataset) -> Iterator[tuple[str, xr.DataArray]]:
    moves = occurrence_classes(dataset).isin([OccurrenceClass.VIBRATING, OccurrenceClass.IRREGULAR])
    yield AMPLITUDE, at_strongest_strand(dataset, AMPLITUDE).assign_attrs(units="m", long_name=AMPLITUDE)
    # what is quiet has none
    frequency = at_strongest_strand(dataset, FREQUENCY).where(moves)
    yield FREQUENCY, frequency.assign_attrs(units="Hz", long_name=FREQUENCY)
    dims = dataset["status"].dims
    names = [str(name) for name, array in dataset.data_vars.items() if _is_quantity(array, dims)]
    for name in sorted(names, key=_OF_COMPUTATION.__contains__):
        array = dataset[name]
        extra = next((dim for dim in array.dims if dim not in dims), None)
        if extra is None:
            yield name, array
            continue
        for place in range(array.sizes[extra]):
            label = f"{in_words(dataset[extra])} {place + 1}"
            if not is_number(dataset[extra]):
                label = str(dataset[extra].values[place])
            part = array.isel({extra: place}, drop=True)
            # the name of a variable may be long; what stands there is never taken for a sentence
            yield name, part.rename(f"{in_words(array)}, {label}").assign_attrs(long_name="")


def _is_quantity(array: xr.DataArray, dims: tuple[object, ...]) -> bool:
    extra = [dim for dim in array.dims if dim not in dims]
    is_split = len(extra) == 1 and array.sizes[extra[0]] <= _MOST_PLACES and extra[0] in array.coords
    return (
        set(dims) <= set(array.dims)
        and array.dtype.kind in "iuf"
        and "flag_values" not in array.attrs
        and str(array.name) not in ("status", "vibrates", "inferred_class", AMPLITUDE, FREQUENCY)
        and (not extra or is_split)
    )
